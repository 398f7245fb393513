"""Plan: what 24 bits must show is known before, and the engines show it.

- `weigh_hits` finds what NumPy finds of all pairs, at every range; a hit is never wrong by more than a step.
- At ranges at which hits are wrong, every engine and either submission shows the predicted hit; drawn backwards, the
  last one. A float32 depth has none wrong.
- Rows: nothing is wrong at the scene's own range, counts grow with the range, columns fit together.
- Two sheets: wrong for a share 1 − gap when the far one is drawn first, never when the near one is.
- Pictures are drawn from rows.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.experiments import depth_24, depth_24_sheets, style
from refsim.experiments.depth_24 import FACTORS, FIXED, FLOAT, STEPS, weigh
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE
from refsim.methods import trace
from refsim.reference import engines, triangle
from refsim.scene import Rays, Scene, camera_rays, load_scene

TINY: dict[str, Any] = {
    "scene": "torus_knot_100", "ground_half": 0.0, "fill": 0.8, "size_px": 16, "tile_px": 8, "generations": 3,
    "backend": "numpy",
}  # fmt: skip


def soup(seed: int) -> Scene:
    """Triangles in layers that are some 2^-20 apart."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.5, 1.5, (20, 3, 3))
    corners[..., 2] = 1.0 + rng.integers(0, 4, (20, 1)) * 2.0**-20
    return Scene(corners.astype(np.float32))


def upright(n: int, t_max: float = np.inf) -> Rays:
    """n rays along z, every fourth of them dead."""
    rng = np.random.default_rng(3)
    origin = np.column_stack([rng.uniform(-1, 1, (n, 2)), np.zeros(n)]).astype(np.float32)
    direction = np.tile(np.array([0, 0, 1], np.float32), (n, 1))
    reach = np.where(np.arange(n) % 4 == 3, 0.0, t_max).astype(np.float32)
    return Rays(origin, direction, reach)


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.sampled_from([2.0**-1, 2.0**-3, 2.0**-8]))
def test_all_hits_are_weighed_as_numpy_weighs_them(seed: int, scale: float) -> None:
    scene, rays = soup(seed), upright(40)
    alive = rays.t_max > 0
    found = weigh(scene, SimpleNamespace(rays=rays, alive=alive), np.float32(scale))  # type: ignore[arg-type]
    v0, n, _, m1, m2, _ = triangle.pack(scene.triangles)
    hit, t, *_ = triangle.intersect(
        rays.origin[:, None], rays.direction[:, None], rays.t_max[:, None], v0[None], n[None], m1[None], m2[None]
    )
    t = np.where(hit, t, np.float32(np.inf))
    some = hit.any(axis=1)
    assert some.sum() > 5 and not some[~alive].any()
    np.testing.assert_array_equal(found.nearest, np.where(some, t.argmin(axis=1), -1))
    np.testing.assert_array_equal(found.tied, np.where(some, (t == t.min(axis=1)[:, None]).sum(axis=1), 0) * some)
    for k, factor in enumerate(FACTORS):
        stored = np.floor(np.where(hit, t, 0.0).astype(np.float64) * scale / factor * STEPS + 0.5)
        stored = np.where(hit, stored, np.inf)
        least = stored == stored.min(axis=1)[:, None]
        np.testing.assert_array_equal(found.shown[k], np.where(some, least.argmax(axis=1), -1))
        np.testing.assert_array_equal(found.last[k], np.where(some, 19 - least[:, ::-1].argmax(axis=1), -1))
        np.testing.assert_array_equal(found.alike[k], least.sum(axis=1) * some)
        behind = found.shown_t[k, some].astype(np.float64) - found.t[some]
        assert (behind >= 0).all() and (behind * scale / factor * STEPS < 1.0 + 1e-6).all()
        np.testing.assert_array_equal(found.wrong(k)[some], behind > 0)


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> float:
    """The largest range of `FACTORS`, in the engines of the reference."""
    own = engines.depth_scale
    monkeypatch.setattr(engines, "depth_scale", lambda scene, rays: own(scene, rays) / np.float32(FACTORS[-1]))
    return FACTORS[-1]


def test_engines_show_what_is_predicted(wide: float) -> None:
    scene = load_scene("torus_knot_256")
    rays = camera_rays(scene, 32, 32, fill=0.8)
    options: dict[str, Any] = {"generations": 1, "backend": "numpy"}
    right = trace("brute_force", scene, rays, **options).generations[0]
    found = weigh(scene, right, depth_24.depth_scale(scene, rays))
    assert found.wrong(-1).sum() >= 3
    np.testing.assert_array_equal(found.nearest, right.hits.triangle)
    tiles = {**options, "tile_size": 8}
    for depth_format, expected in ((FIXED, found.shown[-1]), (FLOAT, found.nearest)):
        for submission in ("tile", "primitive"):
            shown = trace(HIERARCHICAL, scene, rays, depth_format=depth_format, submission=submission, **tiles)
            np.testing.assert_array_equal(shown.hits.triangle, expected)
        shown = trace(RAY_ENGINE, scene, rays, depth_format=depth_format, **options)
        np.testing.assert_array_equal(shown.hits.triangle, expected)
    backwards = scene.replace(triangles=scene.triangles[::-1].copy(), material_ids=scene.material_ids[::-1].copy())
    shown = trace(HIERARCHICAL, backwards, rays, depth_format=FIXED, **tiles)
    hit = shown.hits.triangle >= 0
    np.testing.assert_array_equal(len(scene) - 1 - shown.hits.triangle[hit], found.last[-1][hit])


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    return depth_24.measure(**TINY) + depth_24.measure(**{**TINY, "ground_half": 0.75})


def test_rows_fit_together(rows) -> None:
    tables = depth_24.EXPERIMENT.tables_of(rows, {})
    assert [len(tables[name]) for name in ("depth-24", "depth-24-ranges", "depth-24-pictures")] == [6, 30, 2]
    for row in tables["depth-24"]:
        assert row["float32_wrong_hits"] == row["not_as_predicted"] == row["other_submission_differs"] == 0
        assert row["ray_engine_differs"] == 0
        assert row["wrong_hits"] == row["predicted_wrong_hits"] <= row["alike_rays"]
        assert row["same_rays"] <= row["rays"] and row["hits"] <= row["rays"]
        assert row["worst_gap_steps"] < 1.0
    for before, after in zip(tables["depth-24-ranges"], tables["depth-24-ranges"][1:], strict=False):
        if after["range_factor"] > before["range_factor"]:
            # A coarser step joins what a finer one joined, but for where its borders lie
            assert after["alike_rays"] + 1 >= before["alike_rays"]
        assert after["wrong_hits"] <= after["alike_rays"] and after["worst_gap_steps"] < 1.0
    assert all(row["pixels_changed"] == 0 for row in tables["depth-24-pictures"])


def test_a_ray_that_strayed_is_not_counted_again() -> None:
    scene = load_scene("torus_knot_100")
    found = trace("brute_force", scene, camera_rays(scene, 8, 8, fill=0.8), generations=2, backend="numpy")
    one = found.generations[1]
    assert depth_24.same_rays(one, one).sum() == one.alive.sum() > 0
    other = one.rays.direction.copy()
    first = int(np.flatnonzero(one.alive)[0])
    other[first, 0] = np.nextafter(other[first, 0], np.float32(2))
    bent = SimpleNamespace(rays=Rays.unchecked(one.rays.origin, other, one.rays.t_max), alive=one.alive)
    assert np.flatnonzero(one.alive & ~depth_24.same_rays(one, bent)).tolist() == [first]  # type: ignore[arg-type]


@pytest.mark.parametrize("gap", [0.125, 0.5, 1.25])
def test_the_far_sheet_shows_by_the_gap(gap: float) -> None:
    rows = {
        order: depth_24_sheets.measure(order, gap, 32, "numpy")[0] for order in depth_24_sheets.ORDERS
    }
    first, second = (rows[order] for order in depth_24_sheets.ORDERS)
    for row in rows.values():
        assert row["unorm24_hits"] == row["float32_hits"] == 32 * 32
        assert row["float32_wrong_hits"] == 0
    assert second["unorm24_wrong_hits"] == second["predicted_wrong_percent"] == 0
    share = first["predicted_wrong_percent"] / 100.0
    # t near 7 is float32 to 1/128 of a step; the rest is 4 standard deviations of so many rays
    off = 100.0 * (1 / 128 + 4 * np.sqrt(share * (1 - share) / first["rays"]))
    assert abs(first["unorm24_wrong_percent"] - 100.0 * share) <= off
    assert share == pytest.approx(max(0.0, 1.0 - first["mean_gap_of_rays_steps"]), abs=1e-3)


def test_pictures_are_drawn_from_the_rows(rows) -> None:
    sheets = [row for case in ((0.5, "far sheet first"), (0.5, "near sheet first"))
              for row in depth_24_sheets.measure(case[1], case[0], 16, "numpy")]  # fmt: skip
    with style.styled():
        for experiment, own, panels in ((depth_24.EXPERIMENT, rows, 2), (depth_24_sheets.EXPERIMENT, sheets, 1)):
            assert experiment.plot is not None and experiment.alt
            assert len(experiment.plot(own).axes) == panels
