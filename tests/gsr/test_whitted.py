"""The composed image is Whitted's: the recursive tracer in plain NumPy and the pipeline agree in every bit.

Plan
- Depths 1 to 4, one to three lights, a box with mirror and glass and a room of glossy walls and glass spheres, normals
  geometric and smooth, both sides hit and front sides alone, background black and coloured: image, rays, hits, rows,
  weights, costs, counters and buffers of "geometry_shader" and "fragment_grid" are the reference's.
- The same through the grid, whose cells, lists and walks the reference has too: default and chosen resolutions.
- Each of shadows, reflections, refractions off; emission in another order; pictures of 8 bits after the same rounding.
- Hypothesis: soups of triangles, degenerate and doubled ones among them, of any materials, lit from on a surface and
  from nowhere, by rays from without and within, dead and short ones too, with and without an image size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import refsim
from refsim import Rays, Scene
from refsim.papers.geometry_shader_rays import grid
from refsim.reference import grid_search
from refsim.results import RayKind
from refsim.scene import PointLight, shapes
from tests.gsr.tree_bits import tree_differences
from tests.gsr.whitted_scenes import (
    BLACK,
    MATERIALS,
    PIXELS,
    POINTS,
    TINTED,
    both,
    rays_of,
    rays_of_kind,
    scene_of,
    traced,
)
from tests.hre.bits import same_bits

# Each value of each option with every other option's
LOOKS = [
    {"shading": "geometric", "facing": "both", "background": TINTED},
    {"shading": "smooth", "facing": "both", "background": BLACK},
    {"shading": "smooth", "facing": "front", "background": TINTED},
    {"shading": "geometric", "facing": "front", "background": BLACK},
]


@pytest.mark.parametrize("lights", [1, 2, 3])
@pytest.mark.parametrize("passes", [1, 2, 3, 4])
@pytest.mark.parametrize("name", ["cornell_box", "glossy room"])
def test_image_and_rows(name: str, passes: int, lights: int) -> None:
    scene, rays = scene_of(name), rays_of(name)
    for look in LOOKS:
        ours, reference = both(POINTS, scene, rays, passes=passes, lights=lights, **look)
        assert tree_differences(ours, reference) == [], look
        quads = refsim.trace(PIXELS, scene, rays, acceleration="naive", passes=passes, lights=lights, **look)
        assert same_bits(quads.image, reference.image), look
        if look["facing"] == "front":
            continue
        wanted = [RayKind.EYE, *([RayKind.SHADOW, RayKind.REFLECTED, RayKind.REFRACTED] if passes > 1 else [])]
        assert all(rays_of_kind(ours, kind) >= 15 for kind in wanted), "the case shows too little"


@pytest.mark.parametrize("name", ["cornell_box", "glossy room"])
@pytest.mark.parametrize("lights", [1, 3])
def test_rows_of_pixels(name: str, lights: int) -> None:
    for look in LOOKS:
        ours, reference = both(PIXELS, scene_of(name), rays_of(name), passes=3, lights=lights, **look)
        assert tree_differences(ours, reference) == [], look


@pytest.mark.parametrize("method", [POINTS, PIXELS])
def test_kinds_of_rays_left_out(method: str) -> None:
    scene, rays = scene_of("glossy room"), rays_of("glossy room")
    seen = set()
    for off in range(8):
        flags = {name: not off >> k & 1 for k, name in enumerate(("shadows", "reflections", "refractions"))}
        ours, reference = both(method, scene, rays, passes=3, lights=2, **flags)
        assert tree_differences(ours, reference) == [], flags
        assert ours.image is not None
        seen.add(ours.image.tobytes())
    assert len(seen) == 8, "a kind of ray that shows nowhere"


def test_rows_follow_the_emission_order() -> None:
    """Sorted into targets, the order of emission moves rows and changes no bit of the image."""
    listed = both(POINTS, scene_of("glossy room"), rays_of("glossy room"), passes=3, lights=2)[1]
    other = both(POINTS, scene_of("glossy room"), rays_of("glossy room"), passes=3, lights=2, emission_order="reversed")
    assert tree_differences(*other) == []
    assert same_bits(other[1].image, listed.image)
    assert not np.array_equal(other[1].generations[1].node, listed.generations[1].node)


@pytest.mark.parametrize("name", ["cornell_box", "glossy room"])
def test_eight_bits(name: str) -> None:
    """After the same rounding: a target's at every write, the image's at every sum."""
    scene, rays = scene_of(name), rays_of(name)
    fine, coarse = (
        traced(scene, rays, passes=4, lights=2, color_format=form).image for form in ("rgba32float", "rgba8unorm")
    )
    assert fine is not None and coarse is not None
    for look in LOOKS:
        options = {"passes": 4, "lights": 2, "color_format": "rgba8unorm", **look}
        ours, reference = both(POINTS, scene, rays, **options)
        assert tree_differences(ours, reference) == [], look
        quads = both(PIXELS, scene, rays, **options)
        assert tree_differences(*quads) == [] and same_bits(quads[0].image, ours.image), look
        levels = reference.image * np.float32(255)
        assert np.array_equal(np.rint(levels) / np.float32(255), reference.image) and len(np.unique(levels)) > 50
    # Rounded once at the end it would be another picture
    rounded = np.rint(np.clip(fine, 0, 1) * np.float32(255)) / np.float32(255)
    assert not np.array_equal(rounded, coarse)


def test_through_the_grid() -> None:
    scene, rays = scene_of("glossy room"), rays_of("glossy room", 9, 7)
    assert grid_search.DENSITY == grid.DENSITY, "the default resolution's rule, which both state"
    naive = traced(scene, rays, passes=3, lights=1)
    for resolution, facing in ((None, "both"), (7, "front"), ((3, 9, 2), "both")):
        options = {"passes": 3, "lights": 1, "resolution": resolution, "facing": facing, "acceleration": "grid"}
        ours, reference = both(POINTS, scene, rays, **options)
        assert tree_differences(ours, reference) == [], resolution
        assert ours.counters["traversal.cells"] > 500
        assert same_bits(reference.image, naive.image) == (facing == "both")


@st.composite
def cases(draw: st.DrawFn) -> tuple[str, Scene, Rays, dict[str, Any]]:
    """A method, a soup, rays, options."""
    method = draw(st.sampled_from([POINTS, PIXELS]))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(1, 14))
    triangles = random.normal(0, 1, (count, 1, 3)) + random.normal(0, 0.9, (count, 3, 3))
    triangles[random.random(count) < 0.3] *= 2.0
    if draw(st.booleans()):  # points and segments, and every triangle twice: equal t
        triangles[random.random(count) < 0.2, 1] = triangles[0, 0]
        triangles[random.random(count) < 0.1, :] = triangles[0, 0]
        triangles = np.concatenate([triangles, triangles[::-1]])
    triangles = triangles.astype(np.float32)
    ids = random.integers(0, len(MATERIALS), len(triangles)).astype(np.int32)
    places = {
        "around": random.normal(0, 2, 3),
        "on a surface": triangles[0].astype(np.float64).mean(axis=0),
        "at a vertex": triangles[-1, 0].astype(np.float64),
    }
    lamps = tuple(
        PointLight(tuple(places[draw(st.sampled_from(sorted(places)))].tolist()), tuple(random.random(3)), 2.0)
        for _ in range(draw(st.integers(1, 3)))
    )
    scene = Scene(triangles, "soup", MATERIALS, ids, lights=lamps)
    width, height = draw(st.integers(1, 12)), draw(st.integers(1, 9))
    n = width * height
    origin = random.normal(0, 1.5, (n, 3))
    origin[random.random(n) < 0.2] = triangles[0, 0]
    direction = random.normal(size=(n, 3))
    towards = random.random(n) < 0.7
    direction[towards] = (triangles.mean(axis=1)[random.integers(0, len(triangles), n)] - origin)[towards] + 1e-3
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    t_max = np.where(random.random(n) < 0.2, random.random(n) * 3, np.inf)
    dead = random.random(n) < 0.15
    direction[dead], t_max[dead] = 0.0, 0.0
    rays = Rays(origin, direction, t_max, width, height)
    rays = rays if draw(st.booleans()) else rays[:]  # without an image size
    # Few pipelines: through the grid with points and one lamp alone
    in_grid = method == POINTS and len(lamps) == 1 and draw(st.booleans())
    options = {
        "passes": draw(st.integers(1, 4)),
        "shading": draw(st.sampled_from(["geometric", "smooth"])),
        "facing": draw(st.sampled_from(["both", "front"])),
        "background": draw(st.sampled_from([TINTED, BLACK, (0.0, 0.0, 3.0)])),
        "ior": draw(st.sampled_from([1.5, 0.7])),
        **({"acceleration": "grid", "resolution": draw(st.integers(1, 6))} if in_grid else {}),
        **{name: draw(st.sampled_from([True, True, False])) for name in ("shadows", "reflections", "refractions")},
    }
    return method, scene, rays, options


@settings(max_examples=100)
@given(cases())
def test_soups(case: tuple[str, Scene, Rays, dict[str, Any]]) -> None:
    method, scene, rays, options = case
    assert tree_differences(*both(method, scene, rays, **options)) == []


@pytest.mark.parametrize(
    ("method", "shot", "acceleration"), [(POINTS, 1, "naive"), (POINTS, 1, "grid"), (PIXELS, 0, "naive")]
)
def test_a_light_where_the_shadow_ray_starts(method: str, shot: int, acceleration: str) -> None:
    """That ray has no length: NaN for a direction, and no hit. As a pixel it is dead, since its search ends at 0."""
    corners, faces = shapes.quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2))
    floor = Scene(corners[faces], materials=MATERIALS[:1])
    floor = floor.replace(lights=(PointLight((0.5, float(floor.epsilon), 0.25)),))
    rays = Rays([[0.5, 1.0, 0.25]], [[0.0, -1.0, 0.0]], np.inf, 1, 1)
    ours, reference = both(method, floor, rays, passes=2, acceleration=acceleration)
    assert tree_differences(ours, reference) == []
    assert rays_of_kind(reference, RayKind.SHADOW) == shot and reference.generations[1].rays.t_max.tolist()[0] == 0


def test_no_live_ray() -> None:
    dead = Rays(np.zeros((6, 3)), np.zeros((6, 3)), 0.0, 3, 2)
    for method in (POINTS, PIXELS):
        ours, reference = both(method, scene_of("cornell_box"), dead, passes=3, lights=1)
        assert tree_differences(ours, reference) == []
        assert np.array_equal(reference.image, np.full((2, 3, 3), TINTED, np.float32))
