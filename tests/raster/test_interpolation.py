"""What the pixels of a triangle hold: varyings, depth, depth bias; against float64.

Plan
- Random triangles, slivers too, with w from 1e-3 to 1e3 within one triangle: perspective and linear values are the
  float64 formula's at the snapped corners, within so many float32 roundings of the largest vertex value V:
  linear 8 (two differences of up to 2 V, their weights, their products: 6; two sums), perspective 26 (its weights take
  ten roundings instead of one: weight, 1 / w and product above and below, two sums, inverse, product). Depth is within
  5 roundings of 1 (1 / w, z / w, range, near end, result).
- Both differ where w does: a perspective value is not the linear one.
- Neither leaves the range of the vertex values by more than the rounding; equal values come out as they went in.
- Depth of a plane is the plane's on both sides of shared edges; both formats, any depth range.
- Depth bias: table of constant, slope and clamp for both formats, with control rows without bias, and the depth range
  it cannot leave. The step of float32 is a unit in the last place of the triangle's largest depth.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.reference import clip, interpolation, raster
from tests.raster.certainty import UNIT
from tests.raster.drawing import D24, D32, LIST, Screen, clip_positions, rasterise, with_depth
from tests.raster.triangles import grid_faces, grid_points, random_triangle, turned

SCREENS = [Screen(48, 40), Screen(50, 33, (3.5, -2.25, 41.3, 40.0, 0.25, 0.625))]
KINDS = ("plain", "plain", "sliver", "huge", "on the grid")
PERSPECTIVE, LINEAR, DEPTH = 26, 8, 5  # roundings, derived above
LARGEST24 = 2.0**24 - 1
seeds = st.integers(0, 2**31)


def random_draw(seed: int, screen: Screen, count=40):
    """Clip positions f32 [count, 3, 4] with strong perspective, and columns [count, 3] of very different sizes."""
    rng = np.random.default_rng(seed)
    corners = np.array([random_triangle(rng, KINDS[k % len(KINDS)], screen) for k in range(count)])
    w = 10 ** (rng.uniform(-3, 3, (count, 3)) * rng.choice([0, 0.2, 1], (count, 1)))
    position = clip_positions(screen, corners[..., 0], corners[..., 1], rng.uniform(0, 1, (count, 3)), w)
    scale = 10 ** rng.uniform(-6, 6, (count, 1))
    values = {name: (rng.uniform(-1, 1, (count, 3)) * scale).astype(np.float32) for name in ("smooth", "straight")}
    return position, values


@settings(max_examples=80)
@given(seeds, st.sampled_from(SCREENS))
def test_values_and_depth_are_the_float64_formula_s(seed, screen):
    position, values = random_draw(seed, screen)
    drawn = rasterise(screen, position, **values)
    tap, viewport = drawn.fragments, screen.viewport
    for k in set(tap.primitive):
        if clip.needs_clipping(position[k], viewport):
            continue
        mine = tap.primitive == k
        corners = raster.corners_of(position[k], viewport)
        on_screen = interpolation.barycentrics(corners, tap.x[mine], tap.y[mine])
        in_space = interpolation.perspective(on_screen, position[k, :, 3])
        kinds = [("smooth", in_space, PERSPECTIVE), ("straight", on_screen, LINEAR)]
        for place, (name, weights, roundings) in enumerate(kinds):
            vertex = values[name][k].astype(np.float64)
            found, exact = tap.outputs["values"][mine, place], interpolation.spread(weights, vertex)
            bound = roundings * UNIT * np.abs(vertex).max()
            assert np.abs(found - exact).max() <= bound, (k, name)
            assert vertex.min() - bound <= found.min() and found.max() <= vertex.max() + bound
        ndc, _ = raster.divide(position[k].astype(np.float64))
        exact = interpolation.depth(on_screen, raster.window_depth(ndc, viewport), 0.0, viewport)
        assert np.abs(tap.depth[mine] - exact.astype(np.float64)).max() <= DEPTH * UNIT, k


def test_perspective_is_not_linear():
    screen = SCREENS[0]
    position = clip_positions(screen, [2, 46, 2], [2, 2, 38], 0.5, [1, 10, 1])
    values = np.array([0, 1, 0], np.float32)
    tap = rasterise(screen, position, smooth=values, straight=values).fragments
    smooth, straight, _ = tap.outputs["values"].T
    assert (smooth < straight).all()
    # Halfway along the edge from w = 1 to w = 10 the linear value is a half, the other 0.1 / (1 + 0.1)
    middle = (tap.x == 23) & (tap.y == 2)
    np.testing.assert_allclose(straight[middle], 0.5 - 0.5 / 44, atol=1e-6)
    t = straight[middle][0]
    np.testing.assert_allclose(smooth[middle], t / 10 / (t / 10 + 1 - t), rtol=1e-5)


@given(seeds, st.floats(-(2.0**100), 2.0**100, width=32))
@settings(max_examples=10)
def test_equal_values_come_out_as_they_went_in(seed, value):
    position, _ = random_draw(seed, SCREENS[0])
    columns = dict.fromkeys(("smooth", "straight", "first"), np.full(position.shape[:2], value, np.float32))
    tap = rasterise(SCREENS[0], position, **columns).fragments
    assert len(tap.x) > 0 and (tap.outputs["values"] == np.float32(value)).all()


@pytest.mark.parametrize("form", [D32, D24])
@pytest.mark.parametrize("depths", [(0, 1), (0.25, 0.625)])
def test_depth_of_a_plane_is_the_plane_s(form, depths):
    rng = np.random.default_rng(6)
    screen = Screen(64, 32, (0, 0, 64, 32, *depths))
    points = np.rint(turned(rng, grid_points(9, 9) * 9, screen) * 256) / 256
    slope = np.array([1 / 256, -1 / 512])
    z = 0.4 + points @ slope
    position = clip_positions(screen, *points.T, z, 2.0)[grid_faces(rng, 9, 9)]
    pipe = replace(LIST, depth_stencil=with_depth(form=form))
    drawn = rasterise(screen, position, pipe=pipe, tap=False)
    assert (drawn.coverage == 1).all()
    x, y = raster.centres((0, 0, 64, 32)).transpose(2, 0, 1) / 256
    exact = depths[0] + (0.4 + x * slope[0] + y * slope[1]) * (depths[1] - depths[0])
    if form == D24:
        assert np.abs(drawn.framebuffer.depth - exact * LARGEST24).max() <= 0.5 + DEPTH
    else:
        assert np.abs(drawn.framebuffer.depth - exact).max() <= DEPTH * UNIT


STEP32, STEP24 = 2.0**-24, 1 / LARGEST24  # of depths from 0.5 to 1 in float32; of all in 24 bits
ROWS = [
    # depth at the origin, its growth a pixel along x and y, bias, slope scale, clamp, depth added (24 bits, float32)
    ("control: no bias", (0.5, 0, 0), 0, 0.0, 0.0, 0, 0),
    ("control: no bias on a slope", (0.25, 1 / 128, 1 / 256), 0, 0.0, 0.0, 0, 0),
    ("three steps", (0.5, 0, 0), 3, 0.0, 0.0, 3 * STEP24, 3 * STEP32),
    ("back a thousand", (0.75, 0, 0), -1000, 0.0, 0.0, -1000 * STEP24, -1000 * STEP32),
    ("steps of a smaller depth", (0.25, 0, 0), 64, 0.0, 0.0, 64 * STEP24, 64 * 2.0**-25),
    ("steps of the largest depth of the triangle", (0.0, 1 / 64, 0), 64, 0.0, 0.0, 64 * STEP24, 64 * STEP32),
    ("once the slope along x", (0.25, 1 / 128, 1 / 256), 0, 1.0, 0.0, 1 / 128, 1 / 128),
    ("twice the slope along y", (0.25, 1 / 256, -1 / 128), 0, 2.0, 0.0, 1 / 64, 1 / 64),
    ("back half the slope", (0.75, -1 / 128, 1 / 256), 0, -0.5, 0.0, -1 / 256, -1 / 256),
    ("both", (0.5, 1 / 256, 0), 4096, 1.0, 0.0, 1 / 256 + 4096 * STEP24, 1 / 256 + 4096 * STEP32),
    ("control: below the clamp", (0.25, 1 / 128, 0), 0, 1.0, 0.5, 1 / 128, 1 / 128),
    ("clamped", (0.25, 1 / 128, 0), 0, 1.0, 1 / 1024, 1 / 1024, 1 / 1024),
    ("clamped from below", (0.25, 1 / 128, 0), 0, -1.0, -1 / 1024, -1 / 1024, -1 / 1024),
    ("a clamp on the other side", (0.25, 1 / 128, 0), 0, 1.0, -1 / 1024, 1 / 128, 1 / 128),
    ("no slope to scale", (0.5, 0, 0), 0, 1000.0, 0.0, 0, 0),
    ("out of the range", (0.75, 0, 0), 2**30, 0.0, 0.0, 1, 1),
    ("out of the range in front", (0.25, 0, 0), -(2**30), 0.0, 0.0, -1, -1),
]


@pytest.mark.parametrize("form", [D32, D24])
@pytest.mark.parametrize(("plane", "constant", "scale", "clamp", "added24", "added32"), [row[1:] for row in ROWS],
                         ids=[row[0] for row in ROWS])  # fmt: skip
def test_depth_bias_row(form, plane, constant, scale, clamp, added24, added32):
    screen = Screen(64, 32)
    corners = np.array([(4, 2), (4, 30), (60, 2)])
    z = plane[0] + corners @ np.array(plane[1:])
    state = with_depth(
        form=form, depth_bias=constant, depth_bias_slope_scale=scale, depth_bias_clamp=clamp
    )
    pipe = replace(LIST, depth_stencil=state)
    drawn = rasterise(screen, clip_positions(screen, *corners.T, z), pipe=pipe, loop="list", tap=False)
    y, x = np.nonzero(drawn.coverage)
    assert len(x) > 500
    added = added24 if form == D24 else added32
    exact = np.clip(plane[0] + (x + 0.5) * plane[1] + (y + 0.5) * plane[2] + added, 0, 1)
    found = drawn.framebuffer.depth[y, x].astype(np.float64)
    if form == D24:
        assert np.abs(found - exact * LARGEST24).max() <= 0.5 + 1
    else:
        assert np.abs(found - exact).max() <= UNIT
    # The twin's parts
    snapped = raster.corners_of(clip_positions(screen, *corners.T, z), screen.viewport)
    name = "depth24unorm-stencil8" if form == D24 else "depth32float-stencil8"
    step, slope = interpolation.smallest_step(name, z), interpolation.steepest(snapped, z)
    assert slope == pytest.approx(max(map(abs, plane[1:])), abs=1e-15)
    bias = interpolation.depth_bias(constant, scale, clamp, step, slope)
    assert np.clip(bias, -1, 1) == pytest.approx(added, rel=1e-12)
