"""The recursive reference by itself: pictures by hand, laws of light and weight, refusals.

Plan
- By hand: a floor under a blocker; a pane and a window of glass before a white background, exact.
- Laws: two lamps give what each gives; where glass reflects all, the reflected ray carries all weight; a shadow ray
  ends at the first blocker in file order.
- A buffer too small is reported as the pipeline reports it; what only the pipeline can do is named in one sentence.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import refsim
from refsim import Material, Rays, Scene, load_scene
from refsim.errors import InputError
from refsim.pipeline.taps import Taps
from refsim.results import RayKind
from refsim.scene import PointLight, shapes
from tests.gsr.whitted_scenes import DULL, LAMPS, POINTS, TINTED, rays_of, scene_of, seen, traced


def test_a_floor_by_hand() -> None:
    """A floor, a blocker over x < 0, a light at (0, 3, 0), three rays down: shadowed, lit, past the floor."""
    floor, _ = shapes.quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2))
    blocker, faces = shapes.quad((-2, 1, 2), (0, 1, 2), (0, 1, -2), (-2, 1, -2))
    triangles = np.concatenate([floor[faces], blocker[faces]])
    white = Material("white", "diffuse", (1.0, 0.5, 0.25))
    scene = Scene(triangles, materials=(white,), lights=(PointLight((0, 3, 0)),))
    origin = np.array([(-1, 0.5, 0), (1, 0.5, 0), (5, 0.5, 0)])
    rays = Rays(origin, np.tile([[0.0, -1.0, 0.0]], (3, 1)), np.inf, 3, 1)
    color, cosine = np.array([1.0, 0.5, 0.25]), 3 / 10**0.5
    shadowed = seen(traced(scene, rays, passes=2))
    # 2e-7: a few float32 roundings of numbers up to 1
    assert np.abs(shadowed - [0.2 * color, (0.2 + cosine) * color, TINTED]).max() < 2e-7
    # The last pass shoots no shadow rays: what one pass sees is unshadowed
    assert np.abs(seen(traced(scene, rays, passes=1))[0] - (0.2 + cosine) * color).max() < 2e-7


def test_a_mirror_and_a_window_by_hand() -> None:
    """Straight at a wall of glass before a background: ρ of it comes back, τ goes through, both sides weigh."""
    wall, faces = shapes.quad((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))
    rays = Rays([[0.5, 0.25, 1.0]], [[0.0, 0.0, -1.0]], np.inf, 1, 1)
    pane = Scene(wall[faces], materials=(Material("pane", "glass", reflectivity=0.25),))
    window = Scene(np.concatenate([wall[faces], (wall - (0, 0, 0.5))[faces][:, ::-1]]), materials=pane.materials)
    white = {"background": (1.0, 1.0, 1.0), "lights": 0}
    twice = 0.25 + 0.75 * 0.75
    for passes, single, double in ((1, 0, 0), (2, 1, 0.25), (3, 1, twice), (4, 1, twice + 0.75 * 0.25 * 0.75)):
        # All weights are sums of powers of two: no rounding
        assert (seen(traced(pane, rays, passes=passes, **white)) == single).all()
        assert (seen(traced(window, rays, passes=passes, **white)) == double).all(), passes


def test_lights_add_up() -> None:
    """With two lamps a picture is what each gives, and ambient light once."""
    scene, rays = scene_of("glossy room"), rays_of("glossy room")
    dark = PointLight((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    one, two, none, all_of_them = (
        seen(traced(scene, rays, passes=3, lights=lights)) for lights in (LAMPS[:1], LAMPS[1:2], (dark,), LAMPS[:2])
    )
    # 1e-6: some tens of float32 roundings of numbers up to 2
    assert np.abs(all_of_them - (one + two - none)).max() < 1e-6 and np.abs(one - none).max() > 0.1


def test_total_internal_reflection_keeps_the_weight() -> None:
    """In the room there are hits inside dense glass that refract nothing; their reflected ray weighs what they do."""
    trace = traced(scene_of("glossy room"), rays_of("glossy room", 32, 24), passes=4, lights=1)
    total = partial = 0
    for before, after in zip(trace.generations, trace.generations[1:], strict=False):
        for parent in np.flatnonzero(before.hits.triangle >= len(load_scene("room"))):
            rows = after.parent == parent
            children = {RayKind(after.kind[row]): float(after.weight[row]) for row in np.flatnonzero(rows)}
            if before.kind[parent] == RayKind.SHADOW:
                assert not rows.any()
                continue
            weight = float(before.weight[parent])
            whole = children[RayKind.REFLECTED] + children.get(RayKind.REFRACTED, 0.0)
            assert abs(whole - weight) < 1e-6 * weight
            total, partial = (total, partial + 1) if RayKind.REFRACTED in children else (total + 1, partial)
    assert total > 10 and partial > 100


def test_shadow_rays_are_any_hit() -> None:
    """They end at the first blocker in file order, though others lie nearer to the surface."""
    floor, faces = shapes.quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2))
    parts = [floor + np.array([0, up, 0]) for up in (0, 2, 1)]
    scene = Scene(np.concatenate([p[faces] for p in parts]), materials=(DULL,), lights=(PointLight((0, 3, 0)),))
    trace = traced(scene, Rays([[0.5, 0.5, 0.25]], [[0.0, -1.0, 0.0]], np.inf, 1, 1), passes=2)
    shadow = trace.generations[1]
    assert shadow.kind.tolist() == [RayKind.SHADOW] and shadow.hits.triangle[0] in (2, 3)
    assert shadow.per_ray["triangle_tests"][0] == shadow.hits.triangle[0] + 1


def test_the_buffer_that_is_too_small() -> None:
    scene, rays = scene_of("cornell_box"), rays_of("cornell_box")
    for backend in ("numba", "numpy"):
        with pytest.raises(InputError, match=r"pass 0 had \d+ rays more .* 300 records hold; S_VB needs 2106 records"):
            refsim.trace(POINTS, scene, rays, acceleration="naive", backend=backend, passes=3, lights=1, capacity=300)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"errata": "GSR-E8"}, "corrected tracer; errata need backend='numba'"),
        ({"primary": "raster"}, "rasterises nothing; primary='raster' needs backend='numba'"),
        ({"acceleration": "bvh"}, "'naive' and 'grid'; other structures need backend='numba'"),
        ({"resolution": 5}, "resolution is the grid's"),
        ({"taps": Taps("vertex")}, "no stages to tap"),
        ({"lights": 4}, "has 3 lights"),
        ({"lights": [1.0]}, "PointLight"),
        ({"lights": LAMPS * 22}, "more than the 64"),
        ({"passes": 2, "generations": 3}, "two names of one number"),
        ({"passes": 25}, "tree of 33554431 rays"),
        ({"stages": "vertex_only"}, "needs passes=1"),
    ],
)
def test_refusals(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        traced(scene_of("cornell_box"), rays_of("cornell_box", 2, 2), **options)
