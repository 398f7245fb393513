"""Plan: rows obey what must be true of them whatever the scene.

- Every experiment's full and quick cases are what `measure` takes, JSON can hold, and differ from each other.
- The hierarchical engine never runs more ray–triangle tests than the Ray Engine; what the stencil rejects early is what
  separates the policies; without a stencil the Ray Engine tests every ray against every triangle.
- The corrected equations lose no hit, and as printed they lose some.
- Smaller tiles: four times the cone tests each time, never more ray–triangle tests than one tile over all.
- Cone maps: one row a tile and iteration; shares add up to 100 %; an empty tile has no ray and only that one.
- The text's own numbers are products of each other; every claim has a verdict and what was measured.
"""

from __future__ import annotations

import inspect
import json

import pytest

from refsim.experiments import claims, errata, experiments_of, figure_4, figure_7, published, tile_size
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE
from tests.experiments.tiny import TINY, rows_of

NAMES = list(experiments_of("hre"))


@pytest.mark.parametrize("quick", [False, True], ids=["full", "quick"])
@pytest.mark.parametrize("name", NAMES)
def test_cases_fit_the_measurement(name: str, quick: bool) -> None:
    experiment = experiments_of("hre")[name]
    cases = experiment.cases(quick)
    assert len({json.dumps(case, sort_keys=True) for case in cases}) == len(cases)
    assert all(json.loads(json.dumps(case)) == case for case in cases)
    for case in cases:
        inspect.signature(experiment.measure).bind(**case)
    assert bool(cases) is (not experiment.needs)


@pytest.fixture(scope="module")
def engines() -> list[dict]:
    return rows_of("figure-7")


def test_hierarchy_never_adds_tests(engines) -> None:
    for row in figure_7.select(engines, engine=HIERARCHICAL):
        same = {name: row[name] for name in ("body", "fill", "triangles", "early_tests")}
        (other,) = figure_7.select(engines, engine=RAY_ENGINE, stencil="on", **same)
        assert 0 < row["triangle_tests"] <= other["triangle_tests"]
        assert row["pairs_kept"] <= row["cone_tests"]


def test_policies_differ_by_what_is_rejected_early(engines) -> None:
    for row in figure_7.select(engines, early_tests="mesa"):
        same = {name: row[name] for name in ("body", "fill", "triangles", "engine", "stencil")}
        (ideal,) = figure_7.select(engines, early_tests="ideal", **same)
        assert row["stencil_rejected_early_fragments"] == 0 <= ideal["stencil_rejected_early_fragments"]
        assert row["triangle_tests"] == ideal["triangle_tests"] + ideal["stencil_rejected_early_fragments"]
        assert row["fragments_written"] == ideal["fragments_written"]
    rejected = [row["stencil_rejected_early_fragments"] for row in figure_7.select(engines, body="torus_knot")]
    assert max(rejected) > 0


def test_ray_engine_without_stencil_tests_everything(engines) -> None:
    for row in figure_7.select(engines, engine=RAY_ENGINE, stencil="off"):
        assert row["triangle_tests"] == row["size_px"] ** 2 * row["triangles"] * 3


def test_ratios_are_quotients_of_the_rows(engines) -> None:
    table = figure_7.ratios(engines)
    assert len(table) == 2 * len(figure_7.views(engines))
    for row in table:
        own = figure_7.of_view(engines, (row["body"], row["fill"], row["shading"]), triangles=row["triangles"])
        (ideal,) = figure_7.select(own, engine=HIERARCHICAL, early_tests="ideal")
        full = ideal["size_px"] ** 2 * row["triangles"] * 3
        assert row["ratio_to_ray_engine_without_stencil"] == round(full / ideal["triangle_tests"], 2)
        assert row["ratio_to_ray_engine_with_stencil"] <= row["ratio_to_ray_engine_without_stencil"]


def test_corrected_loses_nothing_and_printed_does() -> None:
    rows = rows_of("errata")
    faults = ("lost_on_its_own_hits", "wrong_on_its_own_hits", "added_on_its_own_hits")
    faults += tuple(name.replace("on_its_own", "along_the_path") for name in faults)
    for row in rows:
        if row["errata"] == "corrected":
            assert all(row[name] == 0 for name in faults)
            assert row["pairs_kept_on_its_own"] == row["pairs_kept_corrected"]
        assert row["lost_on_its_own_hits"] + row["wrong_on_its_own_hits"] <= row["hits"] <= row["rays"]
    for variant in ("as_printed", "HRE-E1", "HRE-E4"):
        assert sum(row["lost_on_its_own_hits"] for row in rows if row["errata"] == variant) > 0


def test_smaller_tiles_trade_one_test_for_another() -> None:
    rows = rows_of("tile-size")
    by_tile = {row["tile_px"]: row for row in rows}
    # 24 × 24 pixels are 3 × 3 tiles of 8 and 2 × 2 of 16, the outer ones padded
    assert 4 * by_tile[8]["cone_tests"] == 9 * by_tile[16]["cone_tests"] == 36 * by_tile[32]["cone_tests"]
    assert all(row["triangle_tests"] <= by_tile[32]["triangle_tests"] for row in rows)
    assert len({row["rays_visited"] for row in rows}) == 1
    price = tile_size.break_even(by_tile[16], by_tile[8])
    assert tile_size.priced(by_tile[16], price) == pytest.approx(tile_size.priced(by_tile[8], price))


def test_cone_map_accounts_for_every_tile() -> None:
    rows = rows_of("figure-4")
    assert len(rows) == 4 * 9
    for row in rows:
        assert (row["state"] == "empty") is (row["live_rays"] == 0)
        assert (row["state"] == "bounded") is (row["half_angle_deg"] != "")
        assert row["half_angle_deg"] == "" or 0 <= row["half_angle_deg"] <= figure_4.LARGEST
    table = figure_4.summary(rows)
    for line in table:
        shares = [line[f"{state}_tiles_percent"] for state in ("bounded", "unbounded", "empty")]
        assert sum(shares) == pytest.approx(100.0, abs=0.02)
    assert table[0]["live_rays"] == 24 * 24


def test_pictures_count_what_they_saved() -> None:
    made, missing = rows_of("figure-5")
    assert made["tests_ratio"] == round(24 * 24 * 100 * 3 / made["triangle_tests"], 2) > 1
    assert missing["triangles"] == "missing" and "triangle_tests" not in missing


def test_published_numbers_follow_from_each_other() -> None:
    table = {row["quantity"]: row for row in published.published_rows()}
    for engine, fps in published.FPS.items():
        assert table[f"tests per second, {engine}"]["value"] == round(256 * 256 * 5000 * 2 * fps)
    assert table["speed-up, from the frame rates"]["value"] == round(3 / 0.23, 2)
    assert not any("figure" in row["origin"] for row in table.values())


def test_every_claim_has_a_verdict() -> None:
    needed = {name: rows_of(name) for name in TINY["claims-hre"].needs}
    (table,) = claims.tables([], needed).values()
    assert {row["verdict"] for row in table} <= {"holds", "fails", "depends"}
    assert all(row["measured"] and row["rule"] for row in table)
    verdicts = {(row["claim"], row["body"]): row["verdict"] for row in table}
    assert verdicts[f"it is conservative ({errata.ABOUT['corrected']})", "blob_100"] == "holds"
    assert verdicts[f"it is conservative ({errata.ABOUT['as_printed']})", "blob_100"] == "fails"
    assert verdicts["a relative speedup of 15", "text"] == "fails"
