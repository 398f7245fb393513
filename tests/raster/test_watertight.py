"""Triangles that share edges cover every pixel exactly once.

Plan
- Fans, and grids with either diagonal, under random rotation, scale, sub-pixel shift and w: once inside, never twice.
- A fan about the screen whose other corners lie from a thousand pixels away to the end of float32: once everywhere, as
  neighbours cut a shared edge at the same point.
- A floor in perspective that runs behind the eye and beyond the far plane, so that most triangles are clipped: once
  where it is seen for certain, never twice.
- 100,000 triangles below pixel size: once, in both loops.
- A closed mesh shows as many fronts as backs at every pixel, seen from near and from far (where triangles are below a
  pixel and snapping turns some over): the torus knot, and the closed bunny where present; its row reads missing where
  not. A convex one shows one front and one back.
- A stencil that fronts count up and backs down ends where it began behind a closed mesh, and elsewhere counts.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.pipeline.state import CompareFunction, StencilFaceState, StencilOperation
from refsim.reference import raster
from refsim.scene import load_scene
from tests.raster.certainty import certain_coverage
from tests.raster.drawing import BACKS, FRONTS, LIST, Screen, assert_same_bits, clip_positions, rasterise, with_depth
from tests.raster.triangles import grid_faces, grid_points, perspective_positions, random_triangles, rotation, turned
from tests.scenes_present import real_scene

SCREEN = Screen(48, 40)
seeds = st.integers(0, 2**31)
EVERYWHERE = (0, 0, SCREEN.width, SCREEN.height)


@settings(max_examples=80)
@given(seeds)
def test_a_fan_covers_its_inside_once(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 20))
    angle = np.sort((np.arange(n) + rng.uniform(-0.3, 0.3, n)) * (2 * np.pi / n))
    ring = turned(rng, np.stack([np.cos(angle), np.sin(angle)], 1) * rng.uniform(2, 40, 2), SCREEN)
    hub = rng.dirichlet(np.ones(n)) @ ring
    points = clip_positions(SCREEN, *np.vstack([ring, hub]).T, 0.5, rng.uniform(0.5, 2, n + 1))
    faces = np.stack([np.arange(n), (np.arange(n) + 1) % n, np.full(n, n)], 1)
    drawn = rasterise(SCREEN, points[faces], tap=False)
    inside, doubtful = certain_coverage(points[:n], SCREEN.viewport, EVERYWHERE)
    assert (drawn.coverage == inside)[~doubtful].all() and drawn.coverage.max() <= 1


@settings(max_examples=80)
@given(seeds)
def test_a_grid_covers_the_screen_once(seed):
    rng = np.random.default_rng(seed)
    cell = rng.choice([0.7, 2.0, 5.0, 17.0])
    cells = int(72 / cell) + 4
    points = grid_points(cells, cells)
    points = turned(rng, (points + rng.uniform(-0.25, 0.25, points.shape)) * cell, SCREEN)
    position = clip_positions(SCREEN, *points.T, 0.5, rng.uniform(0.5, 2, len(points)))
    drawn = rasterise(SCREEN, position[grid_faces(rng, cells, cells)], tap=False)
    assert (drawn.coverage == 1).all()


@settings(max_examples=80)
@given(seeds, st.sampled_from([3.0, 5.0, 9.0, 20.0, 36.0]))
def test_a_fan_with_corners_far_beyond_the_guard_band_covers_the_screen_once(seed, farthest):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 20))
    angle = np.sort((np.arange(n) + rng.uniform(-0.3, 0.3, n)) * (2 * np.pi / n))
    ring = np.stack([np.cos(angle), np.sin(angle)], 1) * 10 ** rng.uniform(3, farthest, (n, 1))
    points = clip_positions(SCREEN, *np.vstack([ring, rng.uniform(0, 40, 2)]).T, 0.5, rng.uniform(0.5, 2, n + 1))
    faces = np.stack([np.arange(n), (np.arange(n) + 1) % n, np.full(n, n)], 1)
    faces = np.take_along_axis(faces, (np.arange(3) + rng.integers(0, 3, (n, 1))) % 3, axis=1)
    drawn = rasterise(SCREEN, points[faces], tap=False)
    assert (drawn.coverage == 1).all()


def seen_for_certain(origin, across, along, screen: Screen, slack=0.05) -> np.ndarray:
    """bool [h, w]: pixels that a floor origin + u · across + v · along (clip space), |u|, |v| <= 1, covers though moved
    by `slack` pixels."""
    seen = np.ones((screen.height, screen.width), bool)
    row, column = np.mgrid[0 : screen.height, 0 : screen.width] + 0.5
    for dx, dy in [(-slack, -slack), (slack, -slack), (-slack, slack), (slack, slack)]:
        x, y = 2 * (column + dx) / screen.width - 1, 1 - 2 * (row + dy) / screen.height
        # (u, v) of the floor's point under the pixel: two linear equations, x − X w = 0 and y − Y w = 0
        a, b, c = ((part[0] - x * part[3], part[1] - y * part[3]) for part in (across, along, origin))
        determinant = a[0] * b[1] - a[1] * b[0]
        u, v = (b[0] * c[1] - b[1] * c[0]) / determinant, (a[1] * c[0] - a[0] * c[1]) / determinant
        z, w = (origin[k] + u * across[k] + v * along[k] for k in (2, 3))
        seen &= (abs(u) < 1) & (abs(v) < 1) & (w > 0) & (z > 0) & (z < w)
    return seen


@settings(max_examples=80)
@given(seeds)
def test_a_clipped_floor_covers_what_is_seen_once(seed):
    rng = np.random.default_rng(seed)
    tilt, size = rng.uniform(0.15, 1.2), rng.uniform(4, 12)
    # Eye space: below the eye, tilted about x, turned about its normal; then a projection with near 0.5 and far 6
    turn = rng.uniform(0, 2 * np.pi)
    flat = np.array([[np.cos(turn), 0, -np.sin(turn)], [np.sin(turn), 0, np.cos(turn)]]) * size
    lean = np.array([[1, 0, 0], [0, np.cos(tilt), np.sin(tilt)], [0, -np.sin(tilt), np.cos(tilt)]])
    across, along = flat @ lean
    origin = np.array([rng.uniform(-1, 1), rng.uniform(-1.5, -0.4), rng.uniform(-3, -1)])
    near, far = 0.5, 6.0
    projection = np.array([[1.2, 0, 0, 0], [0, 1.5, 0, 0], [0, 0, far / (near - far), near * far / (near - far)],
                           [0, 0, -1, 0]])  # fmt: skip
    across, along = projection[:, :3] @ across, projection[:, :3] @ along
    origin = projection @ [*origin, 1]
    cells = int(rng.integers(3, 16))
    u, v = (grid_points(cells, cells) * (2 / cells)).T[:, :, None]
    position = (origin + u * across + v * along).astype(np.float32)
    drawn = rasterise(SCREEN, position[grid_faces(rng, cells, cells)], tap=False)
    assert (drawn.coverage[seen_for_certain(origin, across, along, SCREEN)] == 1).all()
    assert drawn.coverage.max() <= 1
    assert drawn.counters["raster.clipped"] > 0 or drawn.counters["raster.clipped_pieces"] > 0


def test_a_hundred_thousand_triangles_below_a_pixel():
    rng = np.random.default_rng(3)
    screen, cells = Screen(128, 96), 224
    points = turned(rng, grid_points(cells, cells) * 0.75, screen)
    faces = grid_faces(rng, cells, cells)
    position = clip_positions(screen, *points.T)[faces]
    assert len(faces) == 100_352
    dense = rasterise(screen, position, tap=False, loop="dense")
    assert (dense.coverage == 1).all() and dense.counters["raster.primitives"] == 100_352
    for options in ({"loop": "list"}, {"loop": "auto", "threads": 2}):
        assert_same_bits(rasterise(screen, position, tap=False, **options), dense)


def fronts_and_backs(points: np.ndarray, distance: float, extent: float) -> tuple[np.ndarray, np.ndarray]:
    """Coverage of the triangles [n, 3, 3] that show the front, and of those that show the back."""
    position = perspective_positions(points, distance, extent, SCREEN)
    return tuple(rasterise(SCREEN, position, pipe=pipe, tap=False).coverage for pipe in (FRONTS, BACKS))


def is_closed(triangles: np.ndarray) -> bool:
    """Whether every directed edge has as many opposite ones."""
    _, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    a = number.reshape(-1, 3)
    edges = np.concatenate([a[:, [0, 1]], a[:, [1, 2]], a[:, [2, 0]]])
    there, here = (np.sort(pair[:, 0] * len(number) + pair[:, 1]) for pair in (edges, edges[:, ::-1]))
    return np.array_equal(there, here)


@pytest.mark.parametrize("name", ["torus_knot_1024", "bunny_closed"])
@pytest.mark.parametrize("extent", [18.0, 3.0])
def test_a_closed_mesh_shows_as_many_fronts_as_backs(name, extent, record_property):
    scene = real_scene(name) if name == "bunny_closed" else load_scene(name)
    record_property(name, "missing" if scene is None else "present")
    if scene is None:
        return
    assert is_closed(scene.triangles)
    rng = np.random.default_rng(8)
    points = (scene.triangles.astype(np.float64) - scene.center) / (scene.diagonal / 2)
    fronts, backs = fronts_and_backs(points @ rotation(rng), 4.0, extent)
    np.testing.assert_array_equal(fronts, backs)
    assert (fronts > 0).sum() > extent**2 / 4
    assert (fronts > 1).any()


def test_a_convex_mesh_shows_one_front_and_one_back():
    points = load_scene("sphere").triangles.astype(np.float64)
    points = points / np.linalg.norm(points, axis=-1).max()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        fronts, backs = fronts_and_backs(points @ rotation(rng), 3.0, rng.uniform(8, 40))
        np.testing.assert_array_equal(fronts, backs)
        assert fronts.max() == 1 and fronts.sum() > 150


KEEP, UP, DOWN = StencilOperation.KEEP, StencilOperation.INCREMENT_WRAP, StencilOperation.DECREMENT_WRAP
COUNTING = replace(
    LIST,
    depth_stencil=with_depth(
        stencil_front=StencilFaceState(CompareFunction.ALWAYS, KEEP, KEEP, UP),
        stencil_back=StencilFaceState(CompareFunction.ALWAYS, KEEP, KEEP, DOWN),
    ),
    label="counting",
)


@pytest.mark.parametrize("options", [{"loop": "dense"}, {"loop": "list"}], ids=["dense", "list"])
def test_a_stencil_counts_fronts_up_and_backs_down(options):
    rng = np.random.default_rng(9)
    scene = load_scene("torus_knot_1024")
    points = (scene.triangles.astype(np.float64) - scene.center) / (scene.diagonal / 2)
    position = perspective_positions(points @ rotation(rng), 4.0, 18.0, SCREEN)
    closed = rasterise(SCREEN, position, pipe=COUNTING, tap=False, **options)
    assert not closed.framebuffer.stencil.any() and closed.coverage.max() > 2
    corners = random_triangles(rng, 84, SCREEN)
    position = clip_positions(SCREEN, corners[..., 0], corners[..., 1])
    drawn = rasterise(SCREEN, position, pipe=COUNTING, tap=False, **options)
    expected = np.zeros((SCREEN.height, SCREEN.width), int)
    for snapped in raster.corners_of(position, SCREEN.viewport):
        expected += np.where(raster.faces_front(snapped, "ccw"), 1, -1) * raster.coverage(snapped, EVERYWHERE)
    assert expected.max() > 1 and expected.min() < -1
    np.testing.assert_array_equal(drawn.framebuffer.stencil, expected.astype(np.uint8))
