"""Grid and hierarchy find what the search through all triangles finds, bit for bit, whatever the scene and the ray.

Plan
- Property: nearest hit (triangle, t, u, v) of a bare loop, naive, grid and hierarchy are the same bits, ties
  included, on scenes with and without thickness, of copies, slivers, lattices and spanning triangles, at scales 1e-6
  to 1e6, moved far from the world's origin, at any resolution; rays start inside, outside, on faces, edges, corners
  and vertices, run along axes with both zeros, are short, long, ended by t_max. One-sided too, and beyond `reach`.
- Property: an any-hit search answers hit or miss as the nearest search does, and what it found is a hit.
- Boundary: a hit beyond its cell is not accepted early; t_max; NaN, infinite and zero directions and origins end.
- Counters: rejected means that nothing was visited; a scene's box is missed by the rays that point away.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Scene, camera_rays, load_scene
from refsim.papers.geometry_shader_rays.bvh import bvh
from refsim.papers.geometry_shader_rays.grid import grid
from tests.gsr.grid_cases import INF, KINDS, Shot, assert_same, everything, rays_of, scene_of, shoot, structures

seeds = st.integers(0, 2**32 - 1)
resolutions = st.one_of(st.none(), st.integers(1, 40), st.tuples(*[st.integers(1, 12)] * 3))


@given(
    seed=seeds, kind=st.sampled_from(KINDS), exponent=st.integers(-6, 6), resolution=resolutions,
    reach=st.sampled_from([None, 0.0, 1.0, 100.0]), moved=st.booleans(), front_only=st.booleans(),
)  # fmt: skip
@settings(max_examples=250)
def test_the_same_bits(seed, kind, exponent, resolution, reach, moved, front_only) -> None:
    rng = np.random.default_rng(seed)
    scene = scene_of(kind, rng, 10.0**exponent)
    if moved:
        scene = Scene(scene.triangles + np.float32(1000 * scene.diagonal))
    rays = rays_of(scene, rng)
    distance = None if reach is None else reach * scene.diagonal
    first, *others = structures(scene, resolution, distance)
    expected = shoot(first, scene, rays, front_only=front_only)
    for other in others:
        found = shoot(other, scene, rays, front_only=front_only)
        assert_same(expected, found, other.name)
        assert ((found.rejected == 0) | ((found.cells == 0) & (found.tests == 0))).all()


@given(seed=seeds, kind=st.sampled_from(KINDS), resolution=resolutions, front_only=st.booleans())
@settings(max_examples=60)
def test_any_hit_answers_hit_or_miss(seed, kind, resolution, front_only) -> None:
    rng = np.random.default_rng(seed)
    scene = scene_of(kind, rng)
    rays = rays_of(scene, rng)
    for accelerator in structures(scene, resolution):
        nearest = shoot(accelerator, scene, rays, front_only=front_only)
        found = shoot(accelerator, scene, rays, any_hit=True, front_only=front_only)
        hit = nearest.triangle >= 0
        assert ((found.triangle >= 0) == hit).all(), accelerator.name
        assert (found.t[hit] >= nearest.t[hit]).all() and (found.t[hit] < rays[2][hit]).all()
        assert (found.tests <= nearest.tests).all() and (found.cells <= nearest.cells).all()


def test_the_rays_above_hit_something() -> None:
    """What the properties rest on: every kind of scene is hit, and by rays that are walked."""
    for kind in KINDS:
        rng = np.random.default_rng(1)
        scene = scene_of(kind, rng)
        shot = shoot(grid(scene, 8), scene, rays_of(scene, rng, 2000))
        least = {"point": 0, "line": 1}.get(kind, 200)
        assert (shot.triangle >= 0).sum() >= least, kind
        if kind not in ("point", "needles"):
            assert (shot.cells > 1).sum() > 200, kind


def one_ray(accelerator, scene: Scene, o, d, t_max=INF, **flags) -> Shot:
    return Shot(*(x[0] for x in shoot(accelerator, scene, ([o], [d], [t_max]), **flags)))


def sheets(*at: float, half: float = 0.4) -> Scene:
    """Triangles across the x axis at the given places."""
    corners = np.array([[-half, -half], [2 * half, -half], [-half, 2 * half]])
    return Scene(np.array([[(x, y, z) for y, z in corners] for x in at], np.float32))


def test_a_hit_beyond_the_cell_is_kept_but_not_accepted() -> None:
    """A large slanting triangle shares the first cell; the ray meets it in the last, behind a small one."""
    slanting = [(-4.0, -0.05, -1.0), (4.0, 0.05, -1.0), (0.0, 0.0, 9.0)]
    small = [(2.0, -0.5, -0.5), (2.0, 0.5, -0.5), (2.0, 0.0, 0.5)]
    ends = [[(-4.0, y, 3), (-4.0, y + 0.01, 3), (-4.0, y, 3.01)] for y in (-4.0, 4.0)]
    scene = Scene(np.array([slanting, small, *ends], np.float32))
    o, d = (-4.2, 0.04, 0.0), (1.0, 0.0, 0.0)
    assert one_ray(everything(scene), scene, o, d).triangle == 1
    for resolution in (1, 2, 3, 5, 8, 20, 50):
        found = one_ray(grid(scene, (resolution, 1, 1)), scene, o, d)
        assert found.triangle == 1 and found.t == np.float32(6.2), resolution
        assert found.cells <= resolution


@pytest.mark.parametrize("order", [(0.0, 1.0, 2.0), (2.0, 1.0, 0.0)])
def test_t_max_ends_the_search(order: tuple[float, ...]) -> None:
    scene = sheets(*order)
    for accelerator in structures(scene, 30):
        after = np.nextafter(np.float32(5), INF)
        for t_max, hit in ((5.0, False), (after, True), (5.5, True), (0.0, False), (-1.0, False)):
            shot = one_ray(accelerator, scene, (-5, 0, 0), (1, 0, 0), t_max)
            assert (shot.triangle >= 0) == hit
            assert shot.t == (np.float32(5) if hit else np.float32(t_max)) and (hit or (shot.u == 0 and shot.v == 0))
        assert np.isnan(one_ray(accelerator, scene, (-5, 0, 0), (1, 0, 0), np.nan).t)


def test_equal_t_goes_to_the_lower_number() -> None:
    """Copies in one cell, and a large and a small triangle of one plane listed in different cells."""
    large, small = [(0, -3, -3), (0, 9, -3), (0, -3, 9)], [(0, -0.1, -0.1), (0, 0.2, -0.1), (0, -0.1, 0.2)]
    for triangles in ([small, large, small], [large, small, large]):
        scene = Scene(np.array(triangles, np.float32))
        for accelerator in structures(scene, 16):
            assert one_ray(accelerator, scene, (5, 0, 0), (-1, 0, 0)).triangle == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_rays_that_are_no_rays_end_and_hit_nothing(bad: float) -> None:
    scene = scene_of("soup", np.random.default_rng(3))
    for accelerator in structures(scene, 8):
        for axis in range(3):
            numbers = np.array([0.3, 0.5, -0.2], np.float32)
            numbers[axis] = bad
            for ray in (((0, 0, 0), numbers), (numbers, (0, 0, 1)), (numbers, numbers)):
                assert one_ray(accelerator, scene, *ray).triangle == -1
        shot = one_ray(accelerator, scene, (0, 0, 0), (0.0, -0.0, 0.0))
        assert shot.triangle == -1
        assert accelerator.name not in ("grid", "bvh") or (shot.rejected == 1 and shot.tests == 0)


@pytest.mark.parametrize("power", [-140, -60, -21, -20, 0, 20, 21, 60, 110])
def test_directions_of_any_length(power: int) -> None:
    rng = np.random.default_rng(9)
    scene = scene_of("soup", rng)
    origin, direction, t_max = rays_of(scene, rng)
    rays = origin, np.ldexp(direction, power).astype(np.float32), t_max
    expected = shoot(everything(scene), scene, rays)
    for accelerator in (grid(scene), bvh(scene)):
        assert_same(expected, shoot(accelerator, scene, rays), accelerator.name)


@pytest.mark.parametrize("power", [-100, -70, -40, 40, 60, 90])
def test_scenes_of_sizes_beyond_all_measure(power: int) -> None:
    rng = np.random.default_rng(10)
    scene = scene_of("soup", rng)
    origin, direction, t_max = rays_of(scene, rng)
    rays = np.ldexp(origin, power).astype(np.float32), direction, np.ldexp(t_max, power).astype(np.float32)
    scene = Scene(np.ldexp(scene.triangles, power).astype(np.float32))
    expected = shoot(everything(scene), scene, rays)
    for accelerator in (grid(scene), bvh(scene)):
        assert_same(expected, shoot(accelerator, scene, rays), accelerator.name)


def test_rays_that_point_away_are_rejected() -> None:
    scene = load_scene("torus_knot_1024")
    rays = camera_rays(scene, 24, 24)
    for accelerator in (grid(scene), bvh(scene)):
        away = shoot(accelerator, scene, (rays.origin, -rays.direction, rays.t_max))
        assert away.rejected.all() and not away.cells.any() and not away.tests.any()
        towards = shoot(accelerator, scene, (rays.origin, rays.direction, rays.t_max))
        assert not towards.rejected[towards.triangle >= 0].any()
        assert 0 < towards.rejected.sum() < 24 * 24
        # A search that ends before the box is reached, and one from inside the box
        assert shoot(accelerator, scene, (rays.origin, rays.direction, np.full(576, 1e-3))).rejected.all()
        inside = np.tile(scene.center.astype(np.float32), (576, 1))
        assert not shoot(accelerator, scene, (inside, rays.direction, rays.t_max)).rejected.any()


def test_a_mesh() -> None:
    """Golden numbers, and that structures pay: fewer tests for each ray than a hundredth of the triangles."""
    scene = load_scene("torus_knot_1024")
    rays = camera_rays(scene, 32, 32)
    given_rays = rays.origin, rays.direction, rays.t_max
    first, *others = structures(scene)
    expected = shoot(first, scene, given_rays)
    assert (expected.tests == 1024).all()
    for other in others:
        found = shoot(other, scene, given_rays)
        assert_same(expected, found, other.name)
        assert other.name == "naive" or found.tests.mean() < 10
