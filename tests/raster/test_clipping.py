"""Clipping: what is left of a triangle covers what it should and holds what the whole triangle would have held there.

Plan
- Every combination of three vertices inside, before the near plane, beyond the far plane, behind the eye, in the eye's
  plane (w = 0), beyond the guard band left, right, above, below, and two of these at once: coverage is that of the
  polygon clipped in float64, but for pixels so near to its border that rounding may decide them; each such pixel is
  shown to be so near (1/256 pixel and float32's roundings).
- There, varyings and depth are the exact homogeneous formula's of the original triangle, within what moving the
  corners by as much can change and so many float32 roundings of the largest vertex value: those of interpolation (26,
  8, 5; see test_interpolation) between corners that were themselves interpolated (8 more; 2 for z and w of depth).
  Linear values of a triangle that reaches behind the eye grow beyond its vertex values at the cut; there the largest is
  taken at the corners that are left. Flat values are the first vertex's even where that is clipped away.
- Counters: clipped exactly where nothing is left or all lies beyond one side of the clip volume; every combination is
  culled or not as what is left of it faces.
- A position that is no number or infinite, in any component of any vertex: clipped, nothing drawn, its neighbours
  untouched.
- Triangles that all leave several pieces need more room than was set aside for them: nothing changes.
- A table of single triangles with their counters: pieces made, culled after clipping, w all negative, control cases.
- The float64 clipper itself: all that is left is inside every plane, and all of the triangle that is inside is left.
"""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.reference import clip, raster
from tests.raster import exact_values
from tests.raster.certainty import UNIT, certain_coverage, movement, to_screen
from tests.raster.drawing import BACKS, FRONTS, Screen, assert_same_bits, clip_positions, rasterise

SCREEN = Screen(40, 28, (2.5, 1.25, 36.0, 25.5, 0.125, 0.875))
BOUNDS = raster.pixels_of(SCREEN.viewport, SCREEN.scissor)
REGIONS = ("inside", "near", "far", "behind", "eye plane", "left", "right", "above", "below", "near left", "far above")
COMBINATIONS = list(product(REGIONS, repeat=3))
SEED = 77


def vertex_in(rng: np.random.Generator, region: str) -> np.ndarray:
    """A clip position in a region of clip space."""
    w = rng.uniform(0.5, 3)
    x, y, z = rng.uniform(-1.3, 1.3) * w, rng.uniform(-1.3, 1.3) * w, rng.uniform(0.05, 0.95) * w
    if "near" in region:
        z = -rng.uniform(0.01, 2) * w
    if "far" in region:
        z = rng.uniform(1.01, 3) * w
    if "left" in region or "right" in region:  # to a million pixels away
        x = 10 ** rng.uniform(3.3, 4.8) * w * (-1 if "left" in region else 1)
    if "above" in region or "below" in region:
        y = 10 ** rng.uniform(3.5, 4.9) * w * (1 if "above" in region else -1)
    if region == "behind":
        w = -w
        z = rng.uniform(-4, 2)
    if region == "eye plane":
        w, z = 0.0, rng.uniform(-1, 1)
    return np.array([x, y, z, w])


def combinations(seed: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A triangle of every combination, f32 [n, 3, 4], and columns [n, 3] to spread over it."""
    rng = np.random.default_rng(seed)
    position = np.array([[vertex_in(rng, region) for region in regions] for regions in COMBINATIONS], np.float32)
    shape = position.shape[:2]
    columns = {name: rng.uniform(-5, 5, shape).astype(np.float32) for name in ("smooth", "straight")}
    columns["first"] = np.arange(len(position) * 3, dtype=np.float32).reshape(shape)
    return position, columns


@pytest.fixture(scope="module", params=[SEED, SEED + 1])
def drawn_combinations(request):
    """All combinations drawn once, and what is left of each: weights [m, 3]."""
    position, columns = combinations(request.param)
    return position, columns, rasterise(SCREEN, position, **columns), [clip.clip(p, SCREEN.viewport) for p in position]


def left_of(position: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Clip positions float64 [m, 4] of what is left of a triangle."""
    return weights @ position.astype(np.float64)


def test_coverage_is_that_of_the_clipped_polygon(drawn_combinations):
    position, _, drawn, left = drawn_combinations
    x0, y0, x1, y1 = BOUNDS
    certain = open_pixels = 0
    for k, regions in enumerate(COMBINATIONS):
        found = drawn.covered_by(k)
        inside, doubtful = certain_coverage(left_of(position[k], left[k]), SCREEN.viewport, BOUNDS)
        wrong = (found[y0:y1, x0:x1] != inside) & ~doubtful
        assert not wrong.any(), (k, regions, np.argwhere(wrong)[:3])
        assert found.max() <= 1, (k, regions)
        certain, open_pixels = certain + (inside & ~doubtful).sum(), open_pixels + doubtful.sum()
    assert drawn.coverage.sum() == sum(drawn.covered_by(k)[y0:y1, x0:x1].sum() for k in range(len(COMBINATIONS)))
    assert certain > 60_000 and open_pixels < certain / 50


def test_values_are_those_of_the_original_triangle(drawn_combinations):
    position, columns, drawn, left = drawn_combinations
    tap, tested = drawn.fragments, 0
    for k, regions in enumerate(COMBINATIONS):
        mine = tap.primitive == k
        if not mine.any():
            continue
        x, y, values, depth = tap.x[mine], tap.y[mine], tap.outputs["values"][mine].astype(np.float64), tap.depth[mine]
        slack = movement(to_screen(left_of(position[k], left[k]), SCREEN.viewport), SCREEN.viewport).max()
        weights = exact_values.weights_around(position[k], SCREEN.viewport, x, y, slack)
        largest = {name: np.abs(columns[name][k]).max() for name in ("smooth", "straight")}
        smooth = exact_values.smooth_values(weights, columns["smooth"][k])
        assert smooth.excess(values[:, 0]).max() <= 34 * UNIT * largest["smooth"], (k, regions)
        straight = exact_values.straight_values(weights, position[k], columns["straight"][k])
        on_screen = left[k] * position[k, :, 3].astype(np.float64)
        growth = np.abs(on_screen / on_screen.sum(axis=1, keepdims=True)).sum(axis=1).max()
        assert straight.excess(values[:, 1]).max() <= 16 * UNIT * largest["straight"] * growth, (k, regions)
        exact = exact_values.depths(weights, position[k], SCREEN.viewport)
        assert exact.excess(depth.astype(np.float64)).max() <= 7 * UNIT, (k, regions)
        assert (values[:, 2] == columns["first"][k, 0]).all() and (tap.outputs["id"][mine] == k).all()
        tested += int(smooth.exists.sum())
    assert tested > 0.99 * len(tap.x) > 50_000


def test_a_constant_stays_that_constant(drawn_combinations):
    position, _, drawn, _ = drawn_combinations
    constant = rasterise(SCREEN, position, **dict.fromkeys(("smooth", "straight"), np.full(position.shape[:2], 0.1)))
    np.testing.assert_array_equal(constant.coverage, drawn.coverage)
    assert (constant.fragments.outputs["values"][:, :2] == np.float32(0.1)).all()


def test_clipped_is_where_nothing_is_left_or_all_beyond_one_side(drawn_combinations):
    position, _, drawn, left = drawn_combinations
    gone = sum(len(weights) < 3 or clip.is_outside(p) for p, weights in zip(position, left, strict=True))
    assert drawn.counters["raster.clipped"] == gone > 100


def test_pieces_face_as_the_triangle_does_on_the_screen(drawn_combinations):
    position, _, drawn, left = drawn_combinations
    fronts, backs = (rasterise(SCREEN, position, pipe=pipe) for pipe in (FRONTS, BACKS))
    np.testing.assert_array_equal(fronts.coverage + backs.coverage, drawn.coverage)
    for k, weights in enumerate(left):
        if len(weights) > 2:
            x, y = to_screen(left_of(position[k], weights), SCREEN.viewport).T
            clockwise = x @ np.roll(y, -1) - y @ np.roll(x, -1) > 0  # rows go down
            assert not ((backs if not clockwise else fronts).fragments.primitive == k).any(), COMBINATIONS[k]
    for culled in (fronts, backs):
        assert culled.counters["raster.clipped"] == drawn.counters["raster.clipped"]
        assert culled.counters["raster.culled"] > 200


def test_loops_and_threads_give_the_same_bits(drawn_combinations):
    position, columns, drawn, _ = drawn_combinations
    for options in ({"loop": "dense"}, {"loop": "list", "threads": 2}, {"loop": "dense", "threads": 2}):
        assert_same_bits(rasterise(SCREEN, position, tap=False, **options, **columns), drawn)


@pytest.mark.parametrize("threads", [1, 2])
def test_more_pieces_than_triangles(drawn_combinations, threads):
    position, columns, drawn, left = drawn_combinations
    many = [k for k in range(len(left)) if len(left[k]) >= 5 and drawn.covered_by(k).any()]
    some = {name: column[many] for name, column in columns.items()}
    alone = rasterise(SCREEN, position[many], threads=threads, **some)
    assert alone.counters["raster.clipped_pieces"] > 1.5 * len(many) > 50
    mine = np.isin(drawn.fragments.primitive, many)
    np.testing.assert_array_equal(np.array(many)[alone.fragments.primitive], drawn.fragments.primitive[mine])
    for name in ("x", "y", "depth"):
        np.testing.assert_array_equal(getattr(alone.fragments, name), getattr(drawn.fragments, name)[mine])
    values = alone.fragments.outputs["values"]
    np.testing.assert_array_equal(values[:, :2], drawn.fragments.outputs["values"][mine, :2])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf], ids=str)
def test_a_position_that_is_no_number_clips_the_triangle(value):
    whole = clip_positions(SCREEN, [5, 30, 10], [3, 8, 22], 0.5, [1, 2, 3])
    position = np.tile(whole, (13, 1, 1))
    for k in range(12):
        position[k, k // 4, k % 4] = value
    drawn = rasterise(SCREEN, position)
    assert drawn.counters["raster.clipped"] == 12 and drawn.counters["raster.drawn"] == 1
    assert set(drawn.fragments.primitive) == {12} and drawn.coverage.max() == 1
    assert np.isfinite(drawn.framebuffer.floats).all() and np.isfinite(drawn.framebuffer.depth).all()


IN = [(-0.5, -0.5, 0.5, 1), (0.5, -0.5, 0.5, 1), (0, 0.5, 0.5, 1)]  # counter-clockwise on the screen
FAR_OUT = 3000
TABLE = [
    # vertices in clip space, fate, pieces
    ("control: inside", IN, "drawn", 0),
    ("control: over the sides of the view, within the guard band", [(-9, -9, 0.5, 1), (9, -9, 0.5, 1), (0, 9, 0.5, 1)],
     "drawn", 0),
    ("one vertex before the near plane", [IN[0], IN[1], (0, 0.5, -0.5, 1)], "drawn", 2),
    ("two vertices before the near plane", [IN[0], (0.5, -0.5, -0.5, 1), (0, 0.5, -0.5, 1)], "drawn", 1),
    ("all before the near plane", [(x, y, -0.1, w) for x, y, _, w in IN], "clipped", 0),
    ("one vertex beyond the far plane", [IN[0], IN[1], (0, 0.5, 1.5, 1)], "drawn", 2),
    ("all beyond the far plane", [(x, y, 1.1, w) for x, y, _, w in IN], "clipped", 0),
    ("control: on the near plane", [(x, y, 0, w) for x, y, _, w in IN], "drawn", 0),
    ("control: on the far plane", [(x, y, 1, w) for x, y, _, w in IN], "drawn", 0),
    ("all behind the eye, where it would project inside", [(-x, -y, -z, -w) for x, y, z, w in IN], "clipped", 0),
    ("all in the eye's plane", [(x, y, 0, 0) for x, y, _, _ in IN], "clipped", 0),
    ("the eye itself three times", [(0, 0, 0, 0)] * 3, "clipped", 0),
    ("left of the view, within the guard band", [(x - 5, y, z, w) for x, y, z, w in IN], "clipped", 0),
    ("left of the guard band", [(x - FAR_OUT, y, z, w) for x, y, z, w in IN], "clipped", 0),
    ("a corner cut off by the guard band", [IN[0], (FAR_OUT, 0, 0.5, 1), IN[2]], "drawn", 2),
    ("a corner at the end of float32", [IN[0], (3e38, 0, 0.5, 1), IN[2]], "drawn", 2),
    ("three corners there", [(-3e38, -3e38, 0.5, 1), (3e38, -3e38, 0.5, 1), (0, 3e38, 0.5, 1)], "drawn", 2),
    ("w at the end of float32", [(x * 3e38, y * 3e38, z * 3e38, 3e38) for x, y, z, _ in IN], "drawn", 0),
    ("no area", [IN[0], IN[1], IN[1]], "empty", 0),
]  # fmt: skip


@pytest.mark.parametrize(("vertices", "fate", "pieces"), [row[1:] for row in TABLE], ids=[row[0] for row in TABLE])
def test_table(vertices, fate, pieces):
    drawn = rasterise(SCREEN, np.array([vertices], np.float32))
    assert drawn.counters[f"raster.{fate}"] == drawn.counters["raster.primitives"] == 1
    assert drawn.counters["raster.clipped_pieces"] == pieces
    assert (drawn.coverage.sum() > 0) == (fate == "drawn")
    # The other way round, with fronts alone left: culled, unless it was clipped or has no area
    turned = rasterise(SCREEN, np.array([vertices[::-1]], np.float32), pipe=FRONTS)
    assert turned.counters["raster.clipped"] == (fate == "clipped")
    assert turned.counters["raster.drawn"] == turned.coverage.sum() == 0


@given(st.sampled_from(COMBINATIONS), st.integers(0, 2**31))
def test_the_float64_clipper_leaves_what_is_inside_all_planes(regions, seed):
    rng = np.random.default_rng(seed)
    position = np.array([vertex_in(rng, region) for region in regions])
    planes = clip.planes(SCREEN.viewport)
    weights = clip.clip(position, SCREEN.viewport)
    assert (weights >= -1e-12).all() and np.allclose(weights.sum(axis=1), 1)
    assert (weights @ position @ planes.T >= -1e-9).all()
    # A point of the triangle that all planes leave lies in the polygon of the weights, and no other does
    points = rng.dirichlet(np.ones(3), 40)
    kept = (points @ position @ planes.T >= 0).all(axis=1)
    flat = points[:, :2]
    polygon = weights[:, :2] if len(weights) > 2 else np.zeros((0, 2))
    sides = [raster.edge_function(polygon[k - 1], polygon[k], flat) for k in range(len(polygon))]
    within = np.logical_and.reduce([side >= -1e-9 for side in sides]) if sides else np.zeros(40, bool)
    assert not (kept & ~within).any()
    strictly = np.logical_and.reduce([side > 1e-9 for side in sides]) if sides else np.zeros(40, bool)
    assert not (strictly & ~kept).any()
