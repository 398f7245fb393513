"""Which passes the method "fragment_grid" draws, and what its rows and pixels are.

Plan
- Tables: how many passes there are under which options, and in which order, whether or not a ray reaches them.
- Rows are pixels; rays that are no image; dead rays.
- What is refused: options of the geometry shader's method, trees too large, and what both refuse.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from refsim import Rays, camera_rays, trace
from refsim.errors import InputError
from refsim.pipeline.taps import Taps
from refsim.results import RayKind
from refsim.scene import PointLight
from tests.gsr.pixel_rays import assert_same, by_pixels
from tests.gsr.scenes import BACKGROUND, cornell, cornell_rays

# passes, options, then surface passes, shadow passes and shading passes with two lights
PASSES: list[tuple[int, dict[str, Any], int, int, int]] = [
    (1, {}, 1, 0, 3),
    (2, {"reflections": False, "refractions": False}, 1, 2, 3),
    (2, {"shadows": False}, 3, 0, 9),
    (2, {}, 3, 2, 9),
    (3, {}, 7, 6, 21),
    (3, {"refractions": False}, 3, 4, 9),
    (3, {"reflections": False}, 3, 4, 9),
    (3, {"lights": 0}, 7, 0, 7),
    (3, {"lights": 1}, 7, 3, 14),
]


@pytest.mark.parametrize(("passes", "options", "surfaces", "shadows", "shadings"), PASSES)
def test_passes_depend_on_options_alone(
    passes: int, options: dict[str, Any], surfaces: int, shadows: int, shadings: int
) -> None:
    """The same draws for rays that meet everything, and for rays that meet nothing."""
    seen = cornell_rays()
    away = Rays(seen.origin, -seen.direction, seen.t_max, seen.width, seen.height)
    draws = []
    for rays in (seen, away):
        taps = Taps("vertex")
        trace = by_pixels(cornell(), rays, passes=passes, taps=taps, **options)
        draws.append([tap.label for tap in taps.vertex])
        assert len(trace.generations) == surfaces + shadows
        assert trace.counters["draw.calls"] == len(taps.vertex) == surfaces + shadows + shadings
        assert trace.counters["fragment.invocations"] == len(taps.vertex) * len(rays)
        assert sum(g.counters["draw.calls"] for g in trace.generations) == surfaces + shadows
        assert sum(int(g.kind[0] == RayKind.SHADOW) for g in trace.generations) == shadows
    assert draws[0] == draws[1] and trace.counters["rays.shadow"] == 0
    assert trace.counters["traversal.cells"] == 0 and "geometry.invocations" not in list(trace.counters)


def test_order_of_passes() -> None:
    """Node by node: surface rays, their ambient light, then each light's shadow rays and its light."""
    taps = Taps("vertex")
    trace = by_pixels(cornell(), cornell_rays(), passes=3, refractions=False, taps=taps)
    order = [(RayKind(g.kind[0]).name, int(g.node[0]), int(g.light[0]), g.parent_generation) for g in trace.generations]  # type: ignore[index]
    assert order == [
        ("EYE", 0, -1, -1),
        ("SHADOW", 0, 0, 0),
        ("SHADOW", 0, 1, 0),
        ("REFLECTED", 1, -1, 0),
        ("SHADOW", 1, 0, 3),
        ("SHADOW", 1, 1, 3),
        ("REFLECTED", 2, -1, 3),
    ]
    shot, light = "rays in the fragment shader", "lighting"
    node = [shot, light, shot, light, shot, light]
    assert [tap.label for tap in taps.vertex] == [*node, *node, shot, light, light, light]
    both = by_pixels(cornell(), cornell_rays(), passes=3, shadows=False)
    assert [int(g.node[0]) for g in both.generations] == list(range(7))  # type: ignore[index]
    assert [g.parent_generation for g in both.generations] == [-1, 0, 0, 1, 1, 2, 2]


def test_rows_are_pixels() -> None:
    trace = by_pixels(cornell(), cornell_rays(23, 17), passes=3)
    for generation in trace.generations:
        assert (generation.pixel == np.arange(23 * 17)).all()
        assert (generation.alive == (generation.rays.t_max > 0)).all()
        dead = ~generation.alive
        assert (generation.rays.direction[dead] == 0).all() and (generation.hits.triangle[dead] == -1).all()
        assert np.isinf(generation.hits.t[generation.hits.triangle < 0]).all()
        assert (generation.parent == np.where(dead | (generation.kind == RayKind.EYE), -1, generation.pixel)).all()
        assert all((counts[dead] == 0).all() for counts in generation.per_ray.values())
    assert trace.per_ray["triangle_tests"].sum() == trace.counters["intersection.triangle_tests"]


def test_rays_that_are_no_image() -> None:
    """Ten rays make four columns and three rows; no ray looks through the last two pixels: background."""
    seen = cornell_rays(5, 2)
    trace = by_pixels(cornell(), Rays(seen.origin, seen.direction, seen.t_max), passes=2)
    assert trace.image is not None and trace.image.shape == (3, 4, 3)
    assert all(len(g.alive) == len(g.rays) == 10 for g in trace.generations)
    assert (trace.image.reshape(-1, 3)[10:] == np.float32(BACKGROUND)).all()
    whole = by_pixels(cornell(), seen, passes=2)
    assert whole.image is not None
    assert (trace.image.reshape(-1, 3)[:10] == whole.image.reshape(-1, 3)).all()
    assert_same(replace(trace, image=whole.image), whole)


def test_dead_eye_rays() -> None:
    """Behind a dead ray lies the background; it sends nothing, and its neighbours are as they were."""
    seen = cornell_rays()
    t_max, direction = seen.t_max.copy(), seen.direction.copy()
    dead = np.arange(len(seen)) % 3 == 1
    t_max[dead], direction[dead] = 0.0, 0.0
    found = by_pixels(cornell(), Rays(seen.origin, direction, t_max, seen.width, seen.height), passes=3)
    whole = by_pixels(cornell(), seen, passes=3)
    assert found.image is not None and whole.image is not None
    image, expected = found.image.reshape(-1, 3), whole.image.reshape(-1, 3)
    assert (image[dead] == np.float32(BACKGROUND)).all() and (image[~dead] == expected[~dead]).all()
    assert (expected[dead] != np.float32(BACKGROUND)).any()
    for generation in found.generations:
        assert not generation.alive[dead].any()
    assert all(found.per_ray[name][dead].sum() == 0 for name in found.per_ray)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"errata": "as_printed"}, "errata"),
        ({"capacity": 10}, "capacity"),
        ({"emission_order": "listed"}, "emission_order"),
        ({"stages": "vertex"}, "stages"),
        ({"primary": "raster"}, "primary"),
        ({"passes": 0}, "passes"),
        ({"passes": 2, "generations": 3}, "generations"),
        ({"passes": 40}, "fragment_grid: 40 passes make a tree of"),
        ({"acceleration": "kd"}, "acceleration"),
        ({"acceleration": "naive", "resolution": 8}, "resolution"),
        ({"lights": 3}, "lights"),
        ({"background": (0.1, -1.0, 0.0)}, "background"),
        ({"color_format": "rgba16float"}, "color_format"),
    ],
)
def test_refused(options: dict[str, Any], word: str) -> None:
    with pytest.raises(InputError, match=word):
        by_pixels(cornell(), cornell_rays(), **options)
    assert by_pixels(cornell(), cornell_rays(), generations=2).image is not None


def test_a_picture_of_one_pixel_keeps_its_rays() -> None:
    """Each generation's rays are copies, not views of targets that later passes draw again."""
    scene = cornell()
    rays = camera_rays(scene, 1, 1, view=(0, 0, 1), fill=0.9)
    options: dict[str, Any] = {"passes": 3, "acceleration": "naive", "background": BACKGROUND}
    pixels, points = (trace(method, scene, rays, **options) for method in ("fragment_grid", "geometry_shader"))
    assert_same(pixels, points)


def test_a_shadow_ray_without_length_is_dead_and_has_no_direction() -> None:
    """The light stands where the shadow ray starts."""
    scene = cornell()
    rays = cornell_rays()
    before = trace("geometry_shader", scene, rays, passes=2, acceleration="naive").generations[1]
    row = int(np.flatnonzero(before.kind == RayKind.SHADOW)[0])
    light = PointLight(tuple(before.rays.origin[row].tolist()))
    found = trace("fragment_grid", scene, rays, passes=2, acceleration="naive", lights=light)
    shadows = next(g for g in found.generations if (g.kind == RayKind.SHADOW).all())
    pixel = int(before.pixel[row])
    assert not shadows.alive[pixel]
    np.testing.assert_array_equal(shadows.rays.direction[pixel], 0)
    assert np.isfinite(shadows.rays.direction).all()
