"""Plan: the figures that are committed are those that the code makes.

- Each full case has its rows in the committed table: same case, same columns, nothing left over.
- A part is computed again by the pipeline and equals the committed rows.
- Tables that follow from others are, byte for byte, what the code makes of the committed ones.
- Every picture has its table, and the README shows one that is there.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from refsim.experiments import dead_rays, errata, experiments_of, figure_4, figure_7, hre_claims, published, tile_size
from refsim.experiments.files import csv_text, read_csv
from refsim.experiments.runs import MISSING
from refsim.experiments.topics import TOPICS

FIGURES = Path(__file__).resolve().parents[2] / "figures"


def committed(stem: str) -> list[dict]:
    return read_csv(FIGURES / f"{stem}.csv")


def committed_text(stem: str) -> str:
    return (FIGURES / f"{stem}.csv").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def dead_ray_rows() -> list[dict]:
    return [row for case in dead_rays.cases(False) for row in dead_rays.measure(**case)]


# The verdicts' own runs are in no table; they are made again below
@pytest.mark.parametrize("name", [name for name, e in experiments_of("hre").items() if not e.needs])
def test_every_full_case_is_in_the_table(name: str) -> None:
    rows = committed(name)
    for case in experiments_of("hre")[name].cases(False):
        given = {key: value for key, value in case.items() if key in rows[0] and key not in ("stencil", "tile_px")}
        if case.get("mesh") == MISSING:
            given = {key: case[key] for key in ("scene", "size_px")}
        if name == "hre-equations":
            given = {"id": case["item"]}
        assert any(all(row[key] == value for key, value in given.items()) for row in rows), case


def test_engine_rows_are_computed_again() -> None:
    rows = committed("figure-7")
    cases = [case for case in figure_7.cases(False) if case["triangles"] == 100 and case["shading"] == "geometric"]
    runs = [case for case in cases if case["early_tests"] == "ideal" and case["stencil"]]
    for case in runs:
        (again,) = figure_7.measure(**case)
        assert again in rows


def test_tile_rows_are_computed_again() -> None:
    rows = committed("tile-size")
    for case in tile_size.cases(False):
        if case["scene"] == "torus_knot_1024" and case["tile_px"] in (8, 32):
            assert tile_size.measure(**case)[0] in rows


def test_cone_rows_are_computed_again() -> None:
    rows = committed("figure-4")
    (case,) = [case for case in figure_4.cases(False) if case["scene"] == "blob_1000"]
    again = figure_4.measure(**case)
    assert [row for row in rows if row["scene"] == "blob_1000"] == again
    assert figure_4.summary(again) == [r for r in committed("figure-4-summary") if r["scene"] == "blob_1000"]


@pytest.mark.parametrize("variant", ["corrected", "HRE-E1"])
def test_errata_rows_are_computed_again(variant: str) -> None:
    (case,) = [c for c in errata.cases(False) if (c["scene"], c["errata"]) == ("blob_1000", variant)]
    rows = [row for row in committed("errata") if (row["scene"], row["errata"]) == ("blob_1000", variant)]
    assert errata.measure(**case) == rows


def test_verdicts_follow_from_the_committed_tables(dead_ray_rows) -> None:
    needed = {name: committed(name) for name in hre_claims.EXPERIMENT.needs}
    assert csv_text(hre_claims.tables(dead_ray_rows, needed)["claims-hre"]) == committed_text("claims-hre")


def test_shader_runs_without_a_ray_are_the_policys(dead_ray_rows) -> None:
    for row in dead_ray_rows:
        assert row["pixels_without_ray"] > 0
        assert (row["shader_runs_without_ray"] > 0) is (row["early_tests"] == "mesa")


def test_text_numbers_follow_from_the_text() -> None:
    assert csv_text(published.published_rows()) == committed_text("figure-7-published")


def test_derived_tables_follow_from_their_rows() -> None:
    assert committed("figure-7-ratios") == [
        {**row, **{n: "" for n in ("ratio_without_early_tests_mesa",) if n not in row}}
        for row in figure_7.ratios(committed("figure-7"))
    ]
    assert committed("tile-size-costs") == tile_size.costs(committed("tile-size"))


def test_every_picture_has_its_table() -> None:
    pictures = {path.stem for path in FIGURES.glob("*.png")}
    every = [e for topic in TOPICS for e in experiments_of(topic).values() if e.plot is not None]
    assert pictures == {e.id for e in every if not e.timed}
    assert pictures <= {path.stem for path in FIGURES.glob("*.csv")}
    timed = FIGURES / "timings"
    assert {path.stem for path in timed.glob("*.png")} == {e.id for e in every if e.timed}
    assert {e.id for e in every if e.timed} <= {path.stem for path in timed.glob("*.csv")}
