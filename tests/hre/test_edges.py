"""Small, odd and degenerate input, and images that are no multiple of the tile.

Plan
- One ray, one pixel, one triangle, only dead rays, only degenerate triangles, more pixels than rays.
- Zero-area triangles are counted and never hit; leaving them out changes no hit but the numbers of the triangles.
- A width of 242 with tiles of 16 (the last centre lies past the edge): no column is lost, nor for any other remainder.
- Depth is t times a power of two below 1, so that different t stay different; scenes far away and tiny ones too.
- 24-bit depth makes ties that float32 does not have: the triangle drawn first wins them.
- Results are plain: shapes, dtypes, contiguous, and the input untouched.
- A scene whose triangles were written to is traced as it stands, not as it was.
"""

from __future__ import annotations

import numpy as np
import pytest

import refsim
from refsim import Rays, Scene, camera_rays
from refsim.papers.hierarchical_ray_engine.tracer import depth_scale
from tests.hre.bits import differences
from tests.hre.scenes import rays_of, scene_of

HRE, RE, BRUTE = "hierarchical_ray_engine", "ray_engine", "brute_force"
METHODS = (BRUTE, RE, HRE)
BACKENDS = ("numba", "numpy")
ONE_TRIANGLE = np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], np.float32)


def straight(n: int = 1) -> Rays:
    """Rays along −z; the first meets the triangle's middle, the others pass beside it."""
    origin = np.array([[100.0 * k, 0, 5] for k in range(n)], np.float32)
    return Rays(origin, np.tile(np.array([0, 0, -1], np.float32), (n, 1)))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", METHODS)
def test_one_ray_one_triangle(method: str, backend: str) -> None:
    trace = refsim.trace(method, Scene(ONE_TRIANGLE), straight(), backend=backend, generations=2)
    assert trace.hits.triangle.tolist() == [0] and trace.hits.t.tolist() == [5.0]
    assert trace.generations[1].rays.direction.tolist() == [[0, 0, -1]]
    assert trace.generations[1].hits.triangle.tolist() == [-1]
    epsilon = Scene(ONE_TRIANGLE).epsilon
    assert trace.exit_rays.origin[0].tolist() == [0, 0, -epsilon]


@pytest.mark.parametrize("method", METHODS)
def test_hits_need_t_below_t_max(method: str) -> None:
    for t_max, hits in ((5.0, -1), (np.nextafter(np.float32(5), np.float32(6)), 0), (0.0, -1)):
        one = straight()
        rays = Rays(one.origin, one.direction, np.array([t_max], np.float32))
        assert refsim.trace(method, Scene(ONE_TRIANGLE), rays).hits.triangle.tolist() == [hits], t_max


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", METHODS)
def test_one_pixel(method: str, backend: str) -> None:
    scene = scene_of("blob_100")
    assert scene is not None
    rays = camera_rays(scene, 1, 1)
    trace = refsim.trace(method, scene, rays, backend=backend)
    assert trace.hits.triangle.shape == (1,) and trace.hits.triangle[0] >= 0


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", METHODS)
def test_only_dead_rays(method: str, backend: str) -> None:
    dead = Rays(np.ones((35, 3), np.float32), np.zeros((35, 3), np.float32), 0.0, 7, 5)  # type: ignore[arg-type]
    scene = scene_of("blob_100")
    assert scene is not None
    trace = refsim.trace(method, scene, dead, backend=backend, generations=3)
    for generation in trace.generations:
        assert not generation.alive.any() and (generation.hits.triangle == -1).all()
        assert np.isinf(generation.hits.t).all()
    assert (trace.exit_rays.direction == 0).all()
    assert all(trace.counters[f"rays.{kind}"] == 0 for kind in ("eye", "reflected", "refracted"))
    if method == HRE:
        assert trace.counters["cone.pairs_kept"] == 0 == trace.counters["intersection.triangle_tests"]
        assert trace.counters["cone.tiles_empty"] == 3


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", METHODS)
def test_more_pixels_than_rays(method: str, backend: str) -> None:
    """Rays without an image fill the squarest one; its spare pixels are dead and belong to no row."""
    scene = scene_of("blob_100")
    assert scene is not None
    rays = rays_of("blob_100", 40, 30)[200:207]
    trace = refsim.trace(method, scene, rays, backend=backend)
    one_by_one = [refsim.trace(BRUTE, scene, rays[[k]]).hits.triangle[0] for k in range(7)]
    assert trace.hits.triangle.tolist() == one_by_one
    if method == RE:
        assert trace.counters["raster.fragments"] == 5 * 9 * len(scene)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", METHODS)
def test_zero_area_triangles_are_counted_and_never_hit(method: str, backend: str) -> None:
    scene = scene_of("slivers")
    assert scene is not None
    degenerate = scene.degenerate
    assert degenerate.sum() == 4
    whole = refsim.trace(method, scene, rays_of("slivers"), backend=backend)
    assert whole.counters["intersection.degenerate_triangles"] == 4
    sound = Scene(scene.triangles[~degenerate])
    # The same box, so the same epsilon
    assert sound.epsilon == scene.epsilon
    part = refsim.trace(method, sound, rays_of("slivers"), backend=backend)
    number = np.append(np.flatnonzero(~degenerate), -1)
    for a, b in zip(whole.generations, part.generations, strict=True):
        hit = a.hits.triangle >= 0
        assert not degenerate[a.hits.triangle[hit]].any()
        assert (a.hits.triangle == number[b.hits.triangle]).all()
        assert (a.hits.t == b.hits.t).all() and (a.hits.u == b.hits.u).all()
    tests = [trace.counters["intersection.triangle_tests"] for trace in (whole, part)]
    assert tests[0] >= tests[1] if method == HRE else tests[0] > tests[1]


@pytest.mark.parametrize("method", METHODS)
def test_a_scene_of_nothing_but_flat_triangles(method: str) -> None:
    flat = Scene(np.array([[[0, 0, 0], [1, 1, 0], [2, 2, 0]], [[0, 1, 0]] * 3], np.float32))
    trace = refsim.trace(method, flat, camera_rays(flat, 6, 5))
    assert (trace.hits.triangle == -1).all() and trace.counters["intersection.degenerate_triangles"] == 2


@pytest.mark.parametrize("submission", ["tile", "primitive"])
@pytest.mark.parametrize(
    ("width", "height", "tile_size"), [(242, 9, 16), (17, 33, 16), (33, 15, 16), (9, 10, 8), (65, 63, 64)]
)
def test_no_column_is_lost(width: int, height: int, tile_size: int, submission: str) -> None:
    """A wall of two triangles that fills the view: every pixel hits."""
    corner = np.array([[-50, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], np.float32)
    wall = Scene(corner[[[0, 1, 2], [0, 2, 3]]])
    x, y = np.meshgrid(np.linspace(-9, 9.3, width), np.linspace(9, -9.3, height))
    origin = np.stack([x, y, np.full_like(x, 3)], axis=-1).reshape(-1, 3)
    rays = Rays(origin, np.tile([0.0, 0.0, -1.0], (width * height, 1)), np.inf, width, height)  # type: ignore[arg-type]
    trace = refsim.trace(HRE, wall, rays, tile_size=tile_size, submission=submission, generations=2)
    missed = (trace.hits.triangle < 0).reshape(height, width)
    assert not missed.any(), f"columns {np.flatnonzero(missed.any(axis=0))}, rows {np.flatnonzero(missed.any(axis=1))}"
    cones = trace.generations[0].cones
    assert cones is not None
    assert (cones.width, cones.height) == (-(-width // tile_size), -(-height // tile_size))
    assert trace.counters["raster.empty"] == 0


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("shift", [0.0, 30.0])
def test_depth_scale(factor: float, shift: float) -> None:
    body = scene_of("blob_100")
    assert body is not None
    scene = Scene(((body.triangles + np.float32(shift)) * np.float32(factor)).astype(np.float32))
    rays = camera_rays(scene, 40, 30)
    scale = depth_scale(scene, rays)
    assert scale == 2.0 ** np.round(np.log2(float(scale)))
    trace = refsim.trace(RE, scene, rays)
    assert differences(refsim.trace(BRUTE, scene, rays), trace, counters=False) == []
    for generation in trace.generations:
        hit = generation.hits.triangle >= 0
        depth = generation.hits.t[hit] * scale
        assert (depth > 0).all() and (depth < 1).all()
        assert len(np.unique(depth)) == len(np.unique(generation.hits.t[hit]))
    assert (trace.generations[1].hits.triangle >= 0).any()


def test_fixed_point_depth_makes_ties() -> None:
    """Two sheets closer together than 2^-24 of the range: float32 tells them apart, the first drawn wins in 24 bits."""
    gap = np.float32(2.0**-24)
    behind, before = ONE_TRIANGLE.copy(), ONE_TRIANGLE.copy()
    before[..., 2] = gap
    scene = Scene(np.concatenate([behind, before]))
    rays = Rays(np.tile([0, 0, 0.25], (25, 1)), np.tile([0, 0, -1], (25, 1)), np.inf, 5, 5)  # type: ignore[arg-type]
    state = {"early_tests": "none", "shading": "smooth", "facing": "front", "stencil": True, "generations": 1}
    for backend in BACKENDS:
        exact = refsim.trace(RE, scene, rays, backend=backend, generations=1)
        fixed = refsim.trace(RE, scene, rays, backend=backend, depth_format="depth24unorm-stencil8", **state)
        assert (exact.hits.triangle == 1).all() and (fixed.hits.triangle == 0).all()


@pytest.mark.parametrize("method", METHODS)
def test_results_are_plain_columns(method: str) -> None:
    scene, rays = scene_of("blob_100"), rays_of("blob_100")
    assert scene is not None
    before = [column.copy() for column in (rays.origin, rays.direction, rays.t_max)]
    for backend in BACKENDS:
        trace = refsim.trace(method, scene, rays, backend=backend)
        assert trace.method == method and trace.options["backend"] == backend and trace.scene is scene
        assert trace.hits is trace.generations[0].hits and len(trace.generations) == 5
        n = len(rays)
        for generation in trace.generations:
            columns = [
                (generation.rays.origin, (n, 3), np.float32), (generation.rays.direction, (n, 3), np.float32),
                (generation.rays.t_max, (n,), np.float32), (generation.hits.triangle, (n,), np.int32),
                (generation.hits.t, (n,), np.float32), (generation.hits.u, (n,), np.float32),
                (generation.hits.v, (n,), np.float32), (generation.alive, (n,), np.bool_),
                (generation.kind, (n,), np.int32), (generation.parent, (n,), np.int32),
                (generation.per_ray["triangle_tests"], (n,), np.int32),
            ]  # fmt: skip
            for column, shape, dtype in columns:
                assert column.shape == shape and column.dtype == dtype and column.flags.c_contiguous
        assert trace.exit_rays.width == rays.width and trace.exit_rays.origin.shape == (n, 3)
    for column, copy in zip((rays.origin, rays.direction, rays.t_max), before, strict=True):
        assert (column == copy).all()


def test_a_scene_that_is_written_to_is_traced_as_it_stands() -> None:
    scene = refsim.load_scene("sphere_192")
    scene = scene.replace(triangles=scene.triangles.copy())
    rays = refsim.camera_rays(scene, 16, 16)
    before = refsim.trace("ray_engine", scene, rays, generations=1)
    scene.triangles[:] *= np.float32(0.5)
    after = refsim.trace("ray_engine", scene, rays, generations=1)
    fresh = refsim.trace("ray_engine", scene.replace(triangles=scene.triangles.copy()), rays, generations=1)
    assert 0 < after.hits.hit.sum() < before.hits.hit.sum()
    assert np.array_equal(after.hits.triangle, fresh.hits.triangle)
