"""Plan: what the table of sensitivities says follows from its rows, and the rows from runs.

- Every sweep holds its baseline exactly once, full and quick; the cases hold every run that a setting needs, once.
- Whatever the values: the baseline is one line in all sweeps, counted once; `holds` is the claim's limits and nothing
  else; the summary counts the lines; a claim that holds, or fails, at one setting is said to.
- Limits: at the limit a claim holds, unless it is strict.
- A setting whose mesh is not at hand reads `missing`, is not counted and does not spoil the rest.
- The Ray Engine's tests are foretold rightly, with and without stencil; a body of plaster costs what `bsh_runs` counts;
  a grid of one cell saves nothing; the ledger asks for claims that are here, and counts settings as the summary does.
- A headline's picture, and that of all, is drawn from made-up rows; it says what is missing.
"""

from __future__ import annotations

import inspect
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.experiments import (
    bsh_runs,
    sensitivity,
    sensitivity_grid,
    sensitivity_hierarchy,
    sensitivity_list_runs,
    sensitivity_nodes,
    style,
)
from refsim.experiments import sensitivity_frame as frame
from refsim.experiments.ledger import _sensitivity
from refsim.experiments.ledger_file import Claim as LedgerClaim
from refsim.experiments.ledger_file import papers
from refsim.experiments.outcome import Outcome
from refsim.experiments.runs import eye_rays, scene_named
from refsim.methods import trace

PARTS = {part.EXPERIMENT.id: part for part in sensitivity.PARTS}
BASE = {"body": "blob", "triangles": 100, "camera": "front", "x": 0, "y": 0}
SWEEPS = (
    frame.Sweep("x", {"0": {}, "1": {"x": 1}, "2": {"x": 2}}),
    frame.Sweep("y", {"0": {}, "1": {"y": 1}}),
    frame.Sweep("x again", {"0": {}, "one": {"x": 1}}),
    frame.camera_sweep(),
)
CLAIM = frame.Claim(
    "headline", "claim", "said", "rule", "unit", BASE, SWEEPS, lambda config: [dict(config)],
    lambda config, rows: float(rows[0]["v"]), low=10.0, high=20.0,
)  # fmt: skip
CROSSED = ("right",)
CONFIGS = [(0, 0), (1, 0), (2, 0), (0, 1)]  # x, y of the four different settings besides those of the camera
VALUES = st.lists(st.integers(1, 40), min_size=len(CONFIGS), max_size=len(CONFIGS))


def made_up_lines(values: list[int], claim: frame.Claim = CLAIM, camera: int = 15) -> list[dict]:
    """Lines of the made-up claim: a value a setting seen from the front, one for what other cameras see."""
    rows = [
        {**BASE, "camera": name, "x": x, "y": y, "mesh": "made", "v": value if name == "front" else camera}
        for (x, y), value in zip(CONFIGS, values, strict=True) for name in frame.CAMERAS
    ]  # fmt: skip
    return frame.lines(rows, (claim,), CROSSED)


@pytest.mark.parametrize("quick", [False, True], ids=["full", "quick"])
@pytest.mark.parametrize("name", PARTS)
def test_every_sweep_holds_its_baseline_once(name: str, quick: bool) -> None:
    for claim in PARTS[name].CLAIMS:
        base = claim.baseline(quick)
        assert len({sweep.parameter for sweep in claim.sweeps}) == len(claim.sweeps)
        for sweep in claim.sweeps:
            chosen = sweep.chosen(quick)
            assert set(sweep.quick) <= set(sweep.settings)
            assert all(set(over) <= set(claim.base) for over in chosen.values())
            same = [label for label, over in chosen.items() if {**base, **over} == base]
            assert len(same) == bool(chosen), (claim.claim, sweep.parameter)


@pytest.mark.parametrize("quick", [False, True], ids=["full", "quick"])
@pytest.mark.parametrize("name", PARTS)
def test_cases_are_the_runs_of_all_settings(name: str, quick: bool) -> None:
    part = PARTS[name]
    cases = part.cases(quick)
    assert cases
    assert len({json.dumps(case, sort_keys=True) for case in cases}) == len(cases)
    assert all(json.loads(json.dumps(case)) == case for case in cases)
    bare = []
    for case in cases:
        inspect.signature(part.measure).bind(**case)
        config = {key: value for key, value in case.items() if key not in ("cameras", "mesh")}
        bare += [json.dumps({**config, "camera": camera}, sort_keys=True) for camera in case["cameras"]]
    assert len(set(bare)) == len(bare)
    for claim in part.CLAIMS:
        for sweep in claim.sweeps:
            for over in sweep.chosen(quick).values():
                for run in claim.runs({**claim.baseline(quick), **over}):
                    assert json.dumps(run, sort_keys=True) in bare


@given(VALUES)
def test_the_baseline_is_one_line_in_all_sweeps(values: list[int]) -> None:
    lines = made_up_lines(values)
    base = [line for line in lines if line["baseline"] == "yes"]
    assert [line["parameter"] for line in base] == [sweep.parameter for sweep in SWEEPS]
    same = [{k: v for k, v in line.items() if k not in ("parameter", "setting", "counted")} for line in base]
    assert all(line == same[0] for line in same)
    assert [line["counted"] for line in base] == ["yes", "no", "no", "no"]
    # x = 1 stands in two sweeps: it too is counted once
    assert [line["counted"] for line in lines if line["setting"] in ("1", "one")] == ["yes", "yes", "no"]


@given(VALUES)
def test_holds_follows_from_the_value_and_the_summary_from_the_lines(values: list[int]) -> None:
    lines = made_up_lines(values)
    for line in lines:
        assert line["holds"] == ("yes" if 10 <= line["value"] <= 20 else "no")
        seen = [line["value"]] if line["parameter"] == "camera" and line["setting"] != "front" else [line["value"], 15]
        assert line["cameras"] == len(seen)
        assert line["cameras_that_hold"] == sum(10 <= value <= 20 for value in seen)
        assert (line["least_of_cameras"], line["most_of_cameras"]) == (min(seen), max(seen))
    (found,) = frame.summary(lines, (CLAIM,))
    all_values = [*values, *([15] * (len(frame.CAMERAS) - 1))]
    good = [10 <= value <= 20 for value in all_values]
    assert (found["settings"], found["holds"]) == (len(all_values), sum(good))
    assert (found["least"], found["most"]) == (min(all_values), max(all_values))
    assert found["baseline_holds"] == ("yes" if good[0] else "no")
    spreads = {
        "x": max(values[:3]) / min(values[:3]),
        "y": max(values[0], values[3]) / min(values[0], values[3]),
        "camera": max(values[0], 15) / min(values[0], 15),
    }
    assert found["moves"] == round(max(spreads.values()), 3)
    assert spreads.get(found["moved_most_by"], found["moves"]) == max(spreads.values())


def test_a_claim_that_holds_or_fails_at_one_setting_is_said_to() -> None:
    alone = {"values": [5, 12, 5, 5], "camera": 5}
    (found,) = frame.summary(made_up_lines(**alone), (CLAIM,))
    assert (found["holds"], found["only_at"], found["fails_only_at"]) == (1, "x: 1", "")
    (found,) = frame.summary(made_up_lines([12, 5, 5, 5], camera=5), (CLAIM,))
    assert found["only_at"] == "the baseline"
    (found,) = frame.summary(made_up_lines([12, 12, 12, 21]), (CLAIM,))
    assert (found["only_at"], found["fails_only_at"]) == ("", "y: 1")
    (found,) = frame.summary(made_up_lines([12, 12, 12, 12]), (CLAIM,))
    assert (found["only_at"], found["fails_only_at"]) == ("", "")


def test_limits() -> None:
    strict = replace(CLAIM, strict=True)
    for value, wide, narrow in ((9.99, False, False), (10.0, True, False), (15.0, True, True), (20.0, True, False)):
        assert (CLAIM.holds(value), strict.holds(value)) == (wide, narrow)
    assert replace(CLAIM, high=math.inf).holds(1e9)
    assert replace(CLAIM, low=-math.inf).holds(-1e9)


def test_a_sweep_of_which_nothing_but_the_baseline_was_run_is_left_out() -> None:
    rows = [{**BASE, "x": x, "mesh": "made", "v": 12} for x in (0, 1, 2)]
    assert {line["parameter"] for line in frame.lines(rows, (CLAIM,), ())} == {"x", "x again"}


def test_a_mesh_that_is_not_at_hand() -> None:
    rows = [{**BASE, "x": x, "mesh": "made" if x < 2 else "missing", "v": 12 + x} for x in (0, 1, 2)]
    lines = frame.lines(rows, (CLAIM,), ())
    (absent,) = [line for line in lines if line["holds"] == "missing"]
    assert (absent["setting"], absent["value"], absent["least_of_cameras"]) == ("2", "missing", "")
    (found,) = frame.summary(lines, (CLAIM,))
    assert (found["settings"], found["missing"], found["most"]) == (2, 1, 13)


def test_scenes_are_named() -> None:
    assert frame.scenes_of([BASE, BASE]) == "blob_100"
    assert frame.scenes_of([BASE, {**BASE, "triangles": 400}]) == "blob_100 to 400"
    meshes = [{**BASE, "body": name, "triangles": 0} for name in ("suzanne", "bunny")]
    assert frame.scenes_of(meshes) == "suzanne, bunny"


@pytest.mark.parametrize("generations", [1, 3])
@pytest.mark.parametrize("stencil", ["off", "on"])
def test_the_ray_engine_need_not_be_run(generations: int, stencil: str) -> None:
    config = {**sensitivity_hierarchy.BASE, **sensitivity_hierarchy.QUICK, "body": "torus_knot", "triangles": 100,
              "size_px": 20, "generations": generations}  # fmt: skip
    del config["camera"]
    (row,) = sensitivity_hierarchy.measure(cameras=["front"], mesh="made", backend="numpy", **config)
    found = trace("ray_engine", scene_named("torus_knot_100"), eye_rays("torus_knot_100", 20, 0.55),
                  generations=generations, stencil=stencil == "on", backend="numpy")  # fmt: skip
    assert row[f"ray_engine_tests_stencil_{stencil}"] == found.counters["intersection.triangle_tests"]
    assert 0 < row["triangle_tests"] < row["ray_engine_tests_stencil_on"]


def test_lists_cost_what_they_cost_elsewhere() -> None:
    config = {**sensitivity_list_runs.BASE, **sensitivity_list_runs.ALL_ON, "triangles": 400, "size_px": 24}
    del config["camera"]
    front, right = sensitivity_nodes.measure(cameras=["front", "right"], mesh="made", **config)
    assert right["nodes"] != front["nodes"]
    name = "torus_knot_400"
    for row, camera in ((front, "front"), (right, "right")):
        rays = bsh_runs.rays_of(name, 24, *bsh_runs.CAMERAS[camera])
        wanted = bsh_runs.ray_counts(bsh_runs.run(name, 24, rays=rays, **bsh_runs.ENABLED))
        assert row["nodes"] == wanted["nodes"]
        assert row["rays"] == wanted["eye_rays"] + wanted["shadow_rays"]
    (glass,) = sensitivity_nodes.measure(
        cameras=["front"], mesh="made", **{**config, "material": "glass", "generations": 4}
    )
    assert glass["rays"] > front["rays"] + glass["shadow_rays"] - front["shadow_rays"]
    assert sensitivity_nodes.measure(cameras=["front"], mesh="missing", **config)[0]["nodes"] == "missing"


def test_a_grid_of_one_cell_saves_nothing() -> None:
    claim = sensitivity_grid.CLAIMS[0]
    config = {**claim.base, "triangles": 256, "size_px": 16, "mode": "RC", "passes": 1, "resolution": 1}
    rows = []
    for run in claim.runs(config):
        bare = {name: value for name, value in run.items() if name != "camera"}
        rows += sensitivity_grid.measure(cameras=["front"], mesh="made", **bare)
    assert rows[0]["triangle_tests"] == rows[1]["triangle_tests"] > 0
    assert claim.value({**config, "cell_price": 0.0}, rows) == 1.0
    assert claim.value(config, rows) < 1.0  # every ray visits the one cell


def test_the_ledger_asks_for_claims_that_are_here() -> None:
    here = {(claim.headline, claim.claim) for claim in sensitivity.CLAIMS}
    asked = {(c.headline, c.sensitivity) for paper in papers().values() for c in paper.claims if c.headline}
    assert asked
    assert asked <= here
    assert {headline for headline, _ in here} == {headline for headline, _ in asked}


def test_the_ledger_counts_as_the_summary_does(tmp_path: Path) -> None:
    lines = made_up_lines([5, 12, 5, 5], camera=5)
    outcome = Outcome(True, tmp_path)
    outcome.tables["sensitivity"] = {"sensitivity": lines}
    asked = LedgerClaim("id", "hre", "place", "number", "says", "equals", headline="headline", sensitivity="claim")
    found, (wanted,) = _sensitivity(asked, outcome), frame.summary(lines, (CLAIM,))
    assert found is not None
    assert (found["of"], found["holds"]) == (wanted["settings"], wanted["holds"]) == (11, 1)
    assert (found["least"], found["most"], found["only_at"]) == (wanted["least"], wanted["most"], "x = 1")


def made_up_rows(part, missing: str = "") -> list[dict]:  # type: ignore[no-untyped-def]
    """A row a quick case and camera, with counters of chance; scenes of the body `missing` are not at hand."""
    random = np.random.default_rng(7)
    names = ("triangle_tests", "cells", "nodes", "ray_bytes", "ray_engine_tests_stencil_off",
             "ray_engine_tests_stencil_on", "dearest_picture", "cheapest_picture", "dearest_shadow",
             "cheapest_shadow")  # fmt: skip
    rows = []
    for case in part.cases(True):
        config = {key: value for key, value in case.items() if key != "cameras"}
        if case["body"] == missing:
            config["mesh"] = "missing"
        for camera in case["cameras"]:
            counters = {name: int(random.integers(100, 1000)) for name in names}
            rows.append({**config, "camera": camera, **counters, "rays": 10, "scene_triangles": case["triangles"]})
    return rows


def test_pictures_are_drawn_and_say_what_is_missing() -> None:
    others = {name: made_up_rows(part) for name, part in PARTS.items()}
    others["sensitivity-lists"] = made_up_rows(PARTS["sensitivity-lists"], missing="blob")
    for name, part in PARTS.items():
        ((stem, lines),) = part.tables(others[name], {}).items()
        assert stem == part.EXPERIMENT.drawn == name
        assert {(line["headline"], line["claim"]) for line in lines} == {(c.headline, c.claim) for c in part.CLAIMS}
    part = PARTS["sensitivity-lists"]
    with style.styled():
        figure = part.plot(part.tables(others["sensitivity-lists"], {})["sensitivity-lists"])
        assert [axes.get_title("left") for axes in figure.axes] == [f"Said: {c.said}" for c in part.CLAIMS]
        said = [text.get_text() for axes in figure.axes for text in axes.texts]
        assert "missing: blob" in said
        assert {"latest last", "48²"} <= set(said)
        tables = sensitivity.tables([], others)
        assert list(tables) == ["sensitivity", "sensitivity-summary"]
        summary = tables["sensitivity-summary"]
        assert [(row["headline"], row["claim"]) for row in summary] == [
            (claim.headline, claim.claim) for claim in sensitivity.CLAIMS
        ]
        bars = sensitivity.plot(summary).axes[0]
        assert all(any(f"{row['holds']} of {row['settings']}" in t.get_text() for t in bars.texts) for row in summary)
