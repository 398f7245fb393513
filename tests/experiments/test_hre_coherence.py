"""Plan: what the tables of coherence, few triangles and the shoot-out say of section 7.1 and 8 follows from their rows.

- A small run: every tile with a ray is tight or wide, contours lie among both, pairs are kept or saved by one of two
  causes, hits are the Ray Engine's; past the stencil's bits shaders run without a ray, before them none does.
- Contours: an outline and a jump are found, at the pixel behind them; a flat field has none.
- Verdicts can fail: a share at the half, one wide tile without a contour, cones that spare as much as empty tiles, a
  hit that differs, nothing that runs beyond the eighth iteration.
- Few triangles: costs are counts times prices; break-even is the first number from which on no price is lost.
- Figure 7: rays visited are those that live; ratios with cone tests at a price are smaller; a test more is seen.
- The shoot-out: fewer steps than all others, and no growth, are told apart; a saving lost at random rays is seen.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from refsim.experiments import (
    figure_7,
    hre_claims,
    hre_claims_shoot_out,
    hre_claims_structure,
    hre_coherence,
    hre_few,
    sensitivity_frame,
    sensitivity_hierarchy,
    tile_size,
    tiles_16,
)
from refsim.experiments.files import read_csv
from refsim.experiments.registry import Rows
from refsim.experiments.runs import HIERARCHICAL, run
from refsim.results import Generation

FIGURES = Path(__file__).resolve().parents[2] / "figures"
HEAD: dict[str, Any] = {"scene": "torus_knot_100", "size_px": 24, "fill": 0.55, "backend": "numpy"}


@cache
def coherence() -> tuple[dict, ...]:
    return tuple(hre_coherence.measure(**HEAD, shading="geometric", tile_px=4, iterations=10))


def test_tiles_and_pairs_are_accounted_for() -> None:
    rows = coherence()
    assert [row["iteration"] for row in rows] == list(range(1, 11))
    for row in rows:
        assert row["tight_tiles"] + row["wide_tiles"] == row["live_tiles"] <= row["tiles"] == 36
        assert row["wide_tiles_with_contour"] <= min(row["wide_tiles"], row["live_tiles_with_contour"])
        assert row["unbounded_tiles"] <= row["wide_tiles"]
        assert row["pairs"] == 36 * 100 >= row["pairs_saved_by_empty_tiles"] + row["pairs_saved_by_cones"]
        assert row["pairs_saved_by_empty_tiles"] == (36 - row["live_tiles"]) * 100
        assert row["pairs_saved_by_cones"] >= 0 == row["rays_with_other_hits"]
        idle = row["shader_runs_without_ray"]
        assert (idle > 0) if row["iteration"] > hre_coherence.STENCIL_BITS else idle == 0
    assert rows[0]["live_tiles"] == rows[0]["tight_tiles"] == 36 and rows[0]["live_tiles_with_contour"] == 0
    assert rows[1]["live_tiles_with_contour"] > 0


def generation(t: np.ndarray) -> Generation:
    hits = SimpleNamespace(triangle=np.where(np.isfinite(t), 0, -1).ravel(), t=t.astype(np.float32).ravel())
    return SimpleNamespace(hits=hits)  # type: ignore[return-value]


def test_contours_are_where_neighbours_part() -> None:
    t = np.full((4, 4), 1.0)
    assert not hre_coherence.contours(generation(t), 4).any()
    t[:, 2:] = 2.0
    assert hre_coherence.contours(generation(t), 4).nonzero()[1].tolist() == [2] * 4
    t[3] = np.inf
    assert hre_coherence.contours(generation(t), 4)[3].all()
    assert not hre_coherence.contours(generation(np.full((4, 4), np.inf)), 4).any()
    edge = np.zeros((4, 4), np.bool_)
    edge[3, 0] = True
    assert hre_coherence.by_tile(edge, 4, 2).tolist() == [False, False, True, False]


MADE = {"scene": "blob_10", "shading": "smooth", "live_tiles": 10, "tight_tiles": 6, "tight_percent_of_live": 60.0,
        "wide_tiles": 4, "wide_tiles_with_contour": 4, "live_tiles_with_contour": 5, "pairs": 100,
        "pairs_saved_by_empty_tiles": 50, "pairs_saved_by_cones": 20, "rays": 9, "rays_with_other_hits": 0,
        "shader_runs_without_ray": 1}  # fmt: skip


def lines(changes: dict, claim: str) -> list[str]:
    rows: Rows = [{**MADE, "iteration": k, **changes} for k in range(1, 11)]
    return [line["verdict"] for line in hre_coherence.verdicts(rows) if line["claim"].startswith(claim)]


@pytest.mark.parametrize(
    ("claim", "changes", "verdict"),
    [
        ("in most cases", {"tight_tiles": 5}, "fails"),
        ("rays are coherent", {"tight_percent_of_live": 50.0}, "fails"),
        ("larger openings", {"wide_tiles_with_contour": 3}, "depends"),
        ("larger openings", {"wide_tiles_with_contour": 2}, "fails"),
        ("later on", {"pairs_saved_by_cones": 50}, "fails"),
        ("iterations beyond", {"rays_with_other_hits": 1}, "fails"),
        ("iterations beyond", {"shader_runs_without_ray": 0}, "fails"),
        ("iterations beyond", {"rays": 0}, "fails"),
    ],
)
def test_verdicts_on_coherence_can_fail(claim: str, changes: dict, verdict: str) -> None:
    assert set(lines({}, claim)) == {"holds"}
    assert set(lines(changes, claim)) == {verdict}


def test_few_triangles_cost_what_they_count() -> None:
    rows = [
        row for number in (6, 20)
        for row in hre_few.measure(f"blob_{number}", 16, 4, 0.55, generations=3, backend="numpy")
    ]  # fmt: skip
    for row in rows:
        assert row["vertices_of_points"] == row["cone_tests"] == 3 * 16 * row["triangles"] == row["points_drawn"]
        assert row["vertices_of_quads"] == 4 * row["quads_drawn"] == 4 * 3 * row["triangles"]
        assert row["ray_engine_tests_stencil_off"] == 3 * 256 * row["triangles"] > row["ray_engine_tests_stencil_on"]
    points = [line["verdict"] for line in hre_few.verdicts(rows) if line["claim"].startswith("points")]
    assert points == ["holds", "holds"]
    spoilt = [{**row, "vertices_of_points": row["vertices_of_points"] + 1} for row in rows]
    assert {x["verdict"] for x in hre_few.verdicts(spoilt) if x["claim"].startswith("points")} == {"fails"}
    for line in hre_few.costs(rows):
        (row,) = [row for row in rows if row["scene"] == line["scene"]]
        cost = row["triangle_tests"] + line["price_tests"] * (row["cone_tests"] + row["rays_visited"])
        assert line["cost_tests"] == cost
        assert (line["pays_off"] == "yes") is (cost < row[f"ray_engine_tests_stencil_{line['ray_engine_stencil']}"])


@pytest.mark.parametrize(
    ("costs", "pays_from", "verdicts"),
    [
        ((90, 190, 290), 6, {"with few": "fails", "with more": "holds"}),
        ((110, 190, 290), 8, {"with few": "holds", "with more": "holds"}),
        ((110, 190, 310), "", {"with few": "holds", "with more": "fails"}),
        ((90, 210, 290), 12, {"with few": "fails", "with more": "holds"}),
    ],
)
def test_break_even_is_from_where_on_no_price_is_lost(costs, pays_from, verdicts) -> None:  # type: ignore[no-untyped-def]
    tests = {"ray_engine_tests_stencil_off": 0, "ray_engine_tests_stencil_on": 0}
    rows: Rows = [
        {"scene": f"blob_{n}", "triangles": n, "triangle_tests": cost, "cone_tests": 0, "rays_visited": 0,
         **dict.fromkeys(tests, 100 * k), "vertices_of_points": 1, "vertices_of_quads": 4, "quads_drawn": 1,
         "size_px": 4, "tile_px": 4, "generations": 1}
        for k, (n, cost) in enumerate(zip((6, 8, 12), costs, strict=True), 1)
    ]  # fmt: skip
    assert {row["pays_off_from_triangles"] for row in hre_few.break_even(rows)} == {pays_from}
    for claim, verdict in verdicts.items():
        assert {x["verdict"] for x in hre_few.verdicts(rows) if x["claim"].startswith(claim)} == {verdict}


def runs_of_figure_7() -> Rows:
    rows = read_csv(FIGURES / "figure-7.csv")
    return [row for row in rows if (row["body"], row["shading"]) == ("blob", "geometric")]


def test_rays_visited_are_those_that_live() -> None:
    found = run(HIERARCHICAL, "torus_knot_100", 24, 0.55, generations=3, tile_size=8, backend="numpy")
    case = {"body": "torus_knot", "fill": 0.55, "shading": "geometric", "triangles": 100, "size_px": 24, "tile_px": 8,
            "generations": 3, "engine": HIERARCHICAL, "stencil": True, "early_tests": "ideal"}  # fmt: skip
    (row,) = figure_7.measure(**case, backend="numpy")
    assert figure_7.rays_visited(row) == sum(int(passed.alive.sum()) for passed in found.generations)


def test_a_price_lowers_ratios_and_iterations_are_of_all_pixels() -> None:
    price = figure_7.PRICE
    for row in figure_7.ratios(runs_of_figure_7()):
        for stencil in ("with", "without"):
            assert 0 < row[f"ratio_at_price_{price}_{stencil}_stencil"] < row[f"ratio_to_ray_engine_{stencil}_stencil"]
        share = row["ratio_to_ray_engine_with_stencil"] / row["ratio_to_ray_engine_without_stencil"]
        assert row["ray_engine_iterations_with_stencil"] == pytest.approx(5 * share, rel=2e-3)


@pytest.mark.parametrize("engine", [figure_7.RAY_ENGINE, HIERARCHICAL])
def test_a_shader_run_without_a_direction_is_seen(engine: str) -> None:
    rows = runs_of_figure_7()

    def verdict() -> list[str]:
        found = hre_claims_structure.structure_claims(rows)
        return [line["verdict"] for line in found if line["claim"].startswith("both calculate")]

    assert verdict() == ["holds"]
    next(row for row in rows if row["engine"] == engine)["fragment_shader_runs"] += 1
    assert verdict() == ["fails"]


def test_cone_tests_that_are_not_linear_are_seen() -> None:
    rows = runs_of_figure_7()

    def verdicts() -> list[str]:
        return [line["verdict"] for line in hre_claims.count_claims(rows) if "cone-sphere tests" in line["claim"]]

    assert verdicts() == ["holds"]
    next(row for row in rows if row["engine"] == HIERARCHICAL)["cone_tests"] += 1
    assert verdicts() == ["fails"]


def shot(steps: dict[str, float], scene: str = "blob_100", spread: float = 0.0) -> Rows:
    return [
        {"scene": scene, "triangles": 100, "spread": spread, "method": method, "steps_per_ray": value,
         "rebuilt_steps_per_ray": value}
        for method, value in steps.items()
    ]  # fmt: skip


def test_verdicts_on_the_shoot_out_can_fail() -> None:
    names = hre_claims_shoot_out.SPATIAL
    others = dict.fromkeys(names, 10.0)

    def verdicts(rows: Rows, claim: str) -> list[str]:
        return [line["verdict"] for line in hre_claims_shoot_out.claims(rows) if claim in line["claim"]]

    ours = hre_claims_shoot_out.OURS
    for steps, verdict in ((9.0, "holds"), (10.0, "fails")):
        assert verdicts(shot({ours: steps, **others}), "outperforms") == [verdict] * 2
    for last, verdict in ((21.0, "holds"), (20.0, "fails")):
        rows = shot({ours: 20.0, **others}) + shot({ours: last, **others}, "blob_1000")
        assert verdicts(rows, "several thousand") == [verdict] * 2
    for random, coherent, any_rays in ((100.0, "holds", "holds"), (99.0, "fails", "holds")):
        rows = shot({ours: 50.0, **others}) + shot({ours: random, **others}, spread=1.0)
        assert verdicts(rows, "assumes") == [coherent]
        assert verdicts(rows, "no constraint") == [any_rays] * len(names)
    rows = shot({ours: 50.0, **others}) + shot({ours: 100.0, **dict.fromkeys(names, 100.0)}, spread=1.0)
    assert verdicts(rows, "no constraint") == ["fails"] * len(names)


def test_optimum_and_read_back_can_fail() -> None:
    rows: Rows = [
        {"scene": scene, "tile_px": tile, "triangle_tests": tests, "cone_tests": 0, "rays_visited": 0}
        for scene, cheap in (("blob_1", 8), ("sphere_1", 16)) for tile in (8, 16)
        for tests in [1 if tile == cheap else 2]
    ]  # fmt: skip
    assert {line["verdict"] for line in tile_size.verdicts(rows)} == {"holds"}
    assert {line["verdict"] for line in tile_size.verdicts(rows[:2])} == {"fails"}
    row = {"scene": "blob_1", "reading": "count", "sixteen": 16, "cones_built": 512, "tiles": 256, "size_px": 256}
    for times, verdict in ((1, "holds"), (2, "depends"), (20, "fails")):
        (line,) = tiles_16.verdicts([{**row, "read_back_bytes": times * 4 * tiles_16.CONE_FLOATS * 512}])
        assert line["verdict"] == verdict


def test_settings_that_the_paper_rules_out_are_not_counted() -> None:
    (few, many) = sensitivity_hierarchy.CLAIMS
    excluded = {
        (claim.claim, sweep.parameter, label): sensitivity_hierarchy.ruled_out(
            {"claim": claim.claim, "parameter": sweep.parameter, "setting": label}
        )
        for claim in (few, many) for sweep in claim.sweeps for label in sweep.settings
    }  # fmt: skip
    out = [key for key, value in excluded.items() if value]
    assert {key[1:] for key in out if key[0] == many.claim} == sensitivity_hierarchy.EXCLUDED
    counts = {("triangles", label) for label in ("20", "50", "200", "500")}
    assert {key[1:] for key in out if key[0] == few.claim} == sensitivity_hierarchy.EXCLUDED | counts
    line = {"parameter": "x", "counted": "yes", "holds": "yes", "value": 2.0}
    lone = [line, {**line, "value": 3.0}, {**line, "value": 90.0, "counted": sensitivity_frame.RULED_OUT}]
    assert sensitivity_frame._strongest(lone, sensitivity_frame.RATIO) == ("x", 1.5)
    assert len(sensitivity_frame.apart(lone)) == 2
