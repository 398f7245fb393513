"""Plan: the shoot-out's rays are one set for all, its winners and crossings follow from the rows.

- Rays (hypothesis over spreads): unit, live, the same for the same spread; spread 0 is the camera's to float32
  rounding; the angle in a tile grows with the spread.
- Winners: nobody has fewer steps; methods over the cap are never among them. Crossings: on two power laws the crossing
  lies where they meet; a method that is always ahead always wins, one that never is never does.
- The committed rows: all methods that ran found the same bits, both grids took the same steps, brute force tests
  every triangle, and capped rows are those above the cap.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.experiments import shoot_out, shoot_out_runs, shoot_out_speed
from refsim.experiments.files import read_csv
from refsim.experiments.runs import MISSING
from refsim.scene import camera_rays, load_scene

FIGURES = Path(__file__).resolve().parents[2] / "figures"
SCENE = "blob_100"


@settings(max_examples=12, deadline=None)
@given(st.floats(0.0, 1.0))
def test_rays_are_unit_live_and_the_same_again(spread: float) -> None:
    shoot_out_runs.rays_of.cache_clear()
    rays = shoot_out_runs.rays_of(SCENE, 16, spread)
    shoot_out_runs.rays_of.cache_clear()
    again = shoot_out_runs.rays_of(SCENE, 16, spread)
    assert rays.direction.tobytes() == again.direction.tobytes() and rays.origin.tobytes() == again.origin.tobytes()
    assert (rays.t_max == np.inf).all() and (rays.width, rays.height) == (16, 16)
    assert np.allclose(np.linalg.norm(rays.direction.astype(np.float64), axis=1), 1.0, atol=2e-7)


def test_spread_zero_is_the_camera_and_one_is_anywhere() -> None:
    scene = load_scene(SCENE)
    camera = camera_rays(scene, 32, 32, fill=shoot_out_runs.FILL)
    rays = shoot_out_runs.rays_of(SCENE, 32, 0.0)
    # A sum and a difference of numbers as far apart as the eye is from the scene, in float64, rounded once
    assert np.abs(rays.direction - camera.direction).max() <= 2e-7
    assert (rays.origin == camera.origin).all()
    angles = [shoot_out_runs.tile_angle(shoot_out_runs.rays_of(SCENE, 32, s), 8) for s in shoot_out_runs.SPREADS]
    assert angles == sorted(angles) and angles[0] < 15 and angles[-1] > 90


def rows_of(table: dict[str, dict[int, float]], spread: float = 0.0) -> list[dict]:
    return [
        {"scene": f"s{n}", "triangles": n, "spread": spread, "method": name, "steps_per_ray": steps,
         "rebuilt_steps_per_ray": 2 * steps, "capped": ""}
        for name, own in table.items() for n, steps in own.items()
    ]  # fmt: skip


@given(st.floats(1.0, 100.0), st.floats(0.2, 1.0), st.floats(2.5, 4.5))
def test_power_laws_cross_where_they_meet(height: float, slope: float, meet: float) -> None:
    sizes = (100, 1000, 10_000, 100_000)
    flat = {n: height for n in sizes}
    steep = {n: height * (n / 10**meet) ** slope for n in sizes}
    rows = rows_of({"six lists": flat, "Hierarchical Ray Engine": steep})
    lines = [row for row in shoot_out.crossings(rows)
             if (row["method"], row["against"]) == ("six lists", "Hierarchical Ray Engine")]  # fmt: skip
    assert [line["structure"] for line in lines] == list(shoot_out.COSTS)
    for line in lines:
        assert line["wins"] == "beyond"
        assert line["from_triangles"] == pytest.approx(10**meet, rel=1e-9, abs=0.51)


@pytest.mark.parametrize(("ours", "wins"), [(1.0, "always"), (5.0, "never"), (9.0, "never")])
def test_always_and_never(ours: float, wins: str) -> None:
    rows = rows_of({"six lists": {100: ours, 1000: ours}, "one list": {100: 5.0, 1000: 5.0}})
    line = next(row for row in shoot_out.crossings(rows) if row["against"] == "one list")
    assert (line["wins"], line["from_triangles"]) == (wins, "")


@given(st.lists(st.floats(1.0, 1e4), min_size=2, max_size=8))
def test_nobody_beats_the_winner(steps: list[float]) -> None:
    names = list(shoot_out_runs.CONTENDERS)[: len(steps)]
    rows = rows_of({name: {100: value} for name, value in zip(names, steps, strict=True)})
    capped = {"scene": "s100", "triangles": 100, "spread": 0.0, "method": "Ray Engine", "capped": "above"}
    own = [steps[k] for k, name in enumerate(names) if name != shoot_out.SAME]
    kept, rebuilt = shoot_out.winners([*rows, capped])
    assert (kept["steps_per_ray"], rebuilt["steps_per_ray"]) == (min(own), 2 * min(own))
    assert kept["second_times_as_many"] == round(sorted(own)[1] / min(own), 3) >= 1


def test_committed_rows_obey_the_laws() -> None:
    rows = [row for row in read_csv(FIGURES / "shoot-out.csv") if row["triangles"] != MISSING]
    ran = [row for row in rows if row["capped"] == ""]
    assert {row["method"] for row in ran} == set(shoot_out_runs.CONTENDERS)
    assert all(row["same_hits"] == 1 for row in ran)
    for row in ran:
        if row["method"] in ("brute force", "Ray Engine"):
            assert row["triangle_tests_per_ray"] == row["triangles"] and row["other_tests_per_ray"] == 0
        if row["method"] == "Hierarchical Ray Engine":
            assert row["other_tests_per_ray"] == pytest.approx(row["triangles"] / shoot_out.TILE**2, abs=0.0006)
    steps = {(row["scene"], row["spread"], row["method"]): row["steps_per_ray"] for row in ran}
    for (scene, spread, method), value in steps.items():
        if method == "geometry shader, grid":
            assert value == steps[scene, spread, "fragment shader, grid"]
    for row in rows:
        unbounded = shoot_out_runs.CONTENDERS[row["method"]][2] and row["triangles"] > shoot_out_runs.CAP
        assert (row["capped"] != "") is unbounded
    assert shoot_out.winners(rows) == read_csv(FIGURES / "shoot-out-winners.csv")
    assert shoot_out.crossings(rows) == read_csv(FIGURES / "shoot-out-crossings.csv")


def test_times_are_apart() -> None:
    assert shoot_out_speed.EXPERIMENT.timed and not shoot_out.EXPERIMENT.timed
