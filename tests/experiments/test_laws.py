"""Plan: rows obey what must be true of them whatever the scene.

- Every experiment's full and quick cases are what `measure` takes, JSON can hold, and differ from each other.
- The hierarchical engine never runs more ray–triangle tests than the Ray Engine; what the stencil rejects early is what
  separates the policies; without a stencil the Ray Engine tests every ray against every triangle.
- The corrected equations lose no hit, and as printed they lose some; the second pass, switched off alone, loses none.
- Without a ray the shader runs under `mesa` alone, by what it runs more in all.
- Smaller tiles: four times the cone tests each time, never more ray–triangle tests than one tile over all.
- Cone maps: one row a tile and iteration; shares add up to 100 %; an empty tile has no ray and only that one.
- The text's own numbers are products of each other; every claim has a verdict and what was measured.
- Verdicts change where their limits are; the prototype's statements hold on the prototype's own numbers.
"""

from __future__ import annotations

import inspect
import json

import pytest

from refsim.experiments import errata, experiments_of, figure_4, figure_7, hre_claims, prototype, published, tile_size
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE
from refsim.reference import cone
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
    assert cases


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


def test_second_pass_alone_is_not_what_the_errata_lose(monkeypatch: pytest.MonkeyPatch) -> None:
    (case,) = [
        case for case in errata.cases(True) if (case["scene"], case["errata"]) == ("torus_knot_256", "corrected")
    ]
    with_pass = errata.measure(**case)
    asked = []
    monkeypatch.setattr(cone, "repairs", lambda printed: asked.append(printed))
    # The corrected run is kept; the runs that are compared with it go without the pass
    without = errata.measure(**case)
    assert asked
    for row, other in zip(with_pass, without, strict=True):
        assert other["lost_on_its_own_hits"] == other["wrong_on_its_own_hits"] == 0
        assert other["pairs_kept_on_its_own"] == pytest.approx(row["pairs_kept_corrected"], rel=1e-3)


def test_shader_without_a_ray_is_what_late_tests_add() -> None:
    ideal, mesa = rows_of("claims-hre")
    assert ideal["shader_runs_without_ray"] == 0 < mesa["shader_runs_without_ray"]
    assert mesa["shader_runs"] - mesa["shader_runs_without_ray"] == ideal["shader_runs"]
    assert 0 < mesa["pixels_without_ray"] == ideal["pixels_without_ray"] <= 2 * 24 * 24


@pytest.mark.parametrize(
    ("ideal", "mesa", "verdict"), [(0, 0, "holds"), (0, 5, "depends"), (1, 5, "fails"), (1, 0, "fails")]
)
def test_one_shader_run_too_many_is_seen(ideal: int, mesa: int, verdict: str) -> None:
    rows = [
        {**row, "shader_runs_without_ray": runs} for row, runs in zip(rows_of("claims-hre"), (ideal, mesa), strict=True)
    ]
    assert [row["verdict"] for row in hre_claims.dead_ray_claims(rows)] == [verdict]


@pytest.mark.parametrize("limits", [hre_claims.ACCURATE, hre_claims.LINEAR, hre_claims.GRAZING])
def test_verdicts_change_at_the_limits(limits: tuple[float, float]) -> None:
    low, high = limits
    assert 0 < low < high
    assert [hre_claims.within(value, limits) for value in (0.0, low, low * 1.01, high, high * 1.01)] == [
        True, True, None, None, False,
    ]  # fmt: skip


@pytest.mark.parametrize(("scale", "verdict"), [(1.0, "holds"), (1.14, "holds"), (1.16, "fails"), (0.84, "fails")])
def test_prototype_agrees_with_itself_within_15_percent(scale: float, verdict: str) -> None:
    ratios = [
        {"body": body, "fill": 0.55, "shading": "geometric", "triangles": number,
         "ratio_to_ray_engine_without_stencil": scale * (said[0] if scale < 1 else said[1])}
        for body, number, said in prototype.RATIOS
    ]  # fmt: skip
    table = prototype.claims(ratios, [])
    assert [row["verdict"] for row in table] == [verdict] * len(prototype.RATIOS)
    # Another view that disagrees leaves it open; another triangle count is another matter
    other = [{**row, "fill": 0.4, "ratio_to_ray_engine_without_stencil": 99.0} for row in ratios]
    assert {row["verdict"] for row in prototype.claims(ratios + other, [])} == {
        "depends" if verdict == "holds" else "fails"
    }
    assert prototype.claims([{**row, "triangles": 7} for row in ratios], []) == []


def test_prototype_angles_are_of_their_iteration() -> None:
    means = {"torus_knot_1024": (2.1, 9.0, 40.0), "sphere_896": (2.1, 3.5, 15.0)}
    cones = [
        {"scene": scene, "iteration": k, "mean_half_angle_deg": angle, "unbounded_tiles_percent": unbounded}
        for scene, angles in means.items()
        for k, (angle, unbounded) in enumerate(zip(angles, (0.0, 0.0, 14.0), strict=True), 1)
    ]
    verdicts = [(row["body"], row["verdict"]) for row in prototype.claims([], cones)]
    knot, sphere = [("torus knot", "holds")] * 2, [("sphere", "depends"), ("sphere", "holds")]
    assert verdicts == [*knot, *sphere, ("torus knot", "holds"), ("sphere", "fails")]


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
    assert made["rays_with_other_hits"] == 0
    assert made["tests_ratio"] == round(24 * 24 * 100 * 3 / made["triangle_tests"], 2) > 1
    assert missing["triangles"] == "missing" and "triangle_tests" not in missing


def test_published_numbers_follow_from_each_other() -> None:
    table = {row["quantity"]: row for row in published.published_rows()}
    for engine, fps in published.FPS.items():
        assert table[f"tests per second, {engine}"]["value"] == round(256 * 256 * 5000 * 2 * fps)
    assert table["speed-up, from the frame rates"]["value"] == round(3 / 0.23, 2)
    allowed = [table[f"speed-up, {side} that rates rounding to these have"]["value"] for side in ("least", "most")]
    assert allowed == [round(2.5 / 0.235, 2), round(3.5 / 0.225, 2)]
    said = [table[f"tests per second, {engine}, to the digits said"]["value"] for engine in published.FPS]
    assert said == [150e6, 2e9] == list(published.SAID_TESTS.values())
    assert not any("figure" in row["origin"] for row in table.values())


def test_every_claim_has_a_verdict() -> None:
    needed = {name: rows_of(name) for name in TINY["claims-hre"].needs}
    (table,) = hre_claims.tables([], needed).values()
    assert {row["verdict"] for row in table} <= {"holds", "fails", "depends"}
    assert all(row["measured"] and row["rule"] for row in table)
    verdicts = {(row["claim"], row["body"]): row["verdict"] for row in table}
    assert verdicts[f"it is conservative ({errata.ABOUT['corrected']})", "blob_100"] == "holds"
    assert verdicts[f"it is conservative ({errata.ABOUT['as_printed']})", "blob_100"] == "fails"
    assert verdicts["a relative speedup of 15", "text"] == "holds"
