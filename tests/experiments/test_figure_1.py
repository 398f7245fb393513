"""Plan: the block diagram's numbers are those of the draws, and its verdicts can fail.

- A small run: draws alternate, cones first; each cone pass writes a texel a tile; vertices are triangles times tiles;
  what is handed on is what the next generation shoots; both orders of submission find the same hits.
- Verdicts follow from the draws: draws out of order, another buffer in a later generation, a cone pass that leaves a
  texel out each fail their line, and no other.
- Claims on the structure fail when a count is off by one; growth and emptied tiles fail when they fall.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from refsim.experiments import figure_1, figure_7, hre_claims_structure
from refsim.experiments.files import read_csv
from refsim.experiments.registry import Rows, Tables

FIGURES = Path(__file__).resolve().parents[2] / "figures"


@cache
def small() -> Tables:
    rows = figure_1.measure("torus_knot_100", size_px=16, tile_px=8, generations=3)
    return figure_1.tables(rows, {})


def test_draws_are_those_of_the_diagram() -> None:
    draws = small()["figure-1"]
    assert [row["pass"] for row in draws] == list(figure_1.PARTS) * 3
    for cones, hits in zip(draws[::2], draws[1::2], strict=True):
        assert cones["fragments"] == cones["pixels_drawn_to"] == 4 and cones["vertices"] == 4
        assert hits["vertices"] == 4 * 100 and hits["buffer_rows"] == 100
        assert hits["fragments"] == 64 * hits["sprites_or_quads_drawn"] > 0
    live = [row["live_rays"] for row in draws[1::2]]
    assert [row["rays_handed_on"] for row in draws[1::2]] == [*live[1:], 0] and live[0] == 256 > live[1] > 0


def test_both_orders_find_the_same() -> None:
    orders = small()["figure-1-orders"]
    assert [(row["submission"], row["rays_with_other_hits"], row["verdict"]) for row in orders] == [
        ("tile", 0, "holds"), ("primitive", 0, "holds"),
    ]  # fmt: skip
    assert [row["cone_texels_read_back"] for row in orders] == [12, 0]


@pytest.mark.parametrize(
    ("row", "change", "failing"),
    [
        (0, {}, None),
        (2, {"pass": "intersection"}, 0),
        (3, {"same_buffer_as_in_generation_0": False}, 1),
        (4, {"pixels_drawn_to": 3}, 2),
    ],
)
def test_verdicts_can_fail(row: int, change: dict, failing: int | None) -> None:
    draws: Rows = [dict(line) for line in small()["figure-1"]]
    draws[row] |= change
    expected = ["fails" if k == failing else "holds" for k in range(3)]
    assert [line["verdict"] for line in figure_1.verdicts(draws)] == expected


def runs_of(body: str) -> Rows:
    rows = read_csv(FIGURES / "figure-7.csv")
    return [row for row in rows if (row["body"], row["shading"]) == (body, "geometric")]


@pytest.mark.parametrize(
    ("engine", "column", "claims"),
    [
        (figure_7.RAY_ENGINE, "triangle_tests", ("the ray engine tests", "both calculate")),
        (figure_7.HIERARCHICAL, "cone_tests", ("a vertex is tested",)),
        (figure_7.HIERARCHICAL, "fragments", ("pixel shaders are invoked",)),
    ],
)
def test_count_off_by_one_fails_its_claim(engine: str, column: str, claims: tuple[str, ...]) -> None:
    rows = runs_of("blob")
    assert {row["verdict"] for row in hre_claims_structure.structure_claims(rows)} == {"holds"}
    stencil = "off" if engine == figure_7.RAY_ENGINE else "on"
    next(row for row in rows if (row["engine"], row["stencil"]) == (engine, stencil))[column] += 1
    fails = [line["claim"] for line in hre_claims_structure.structure_claims(rows) if line["verdict"] == "fails"]
    assert len(fails) == len(claims) and all(text.startswith(name) for text, name in zip(fails, claims, strict=True))


def test_growth_and_emptied_tiles_can_fail() -> None:
    rows = runs_of("sphere")
    first = hre_claims_structure.growth_claims(rows)
    assert {line["verdict"] for line in first} <= {"holds", "depends"}
    turned = rows[::-1]
    assert {line["verdict"] for line in hre_claims_structure.growth_claims(turned)} == {"fails"}
    tiles = [row for row in read_csv(FIGURES / "figure-4.csv") if row["scene"] == "sphere_896"]
    assert [line["verdict"] for line in hre_claims_structure.later_claims(tiles)] == ["holds"]
    last = max(row["iteration"] for row in tiles)
    full = [{**row, "state": "bounded", "half_angle_deg": 9.0} if row["iteration"] == last else row for row in tiles]
    assert [line["verdict"] for line in hre_claims_structure.later_claims(full)] == ["fails"]
