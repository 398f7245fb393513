"""Point sprites: which pixels a square of any size covers, and which points are never drawn.

Plan
- A pixel is covered exactly when its centre lies in [cx − s/2, cx + s/2) × [cy − s/2, cy + s/2), centre and size on
  the grid of 1/256 pixel: sizes 1 to 64, all
  centres on a grid of 1/8 pixel and off the screen, in exact arithmetic; random sizes and centres where no edge is in
  doubt. So neighbouring tiles share no pixel and leave none out.
- Drawn, a point's fragments are those of the rule within the scissor, row by row.
- first_pixel is the least index whose centre is not before the edge, within its bounds, whatever the edge.
- A point is kept or clipped by its centre alone: rows on each face of the clip volume, inside and a step outside.
- Width 242 with sprites of 16: the last tile's centre is off the screen, two columns vanish; padded target and scissor
  bring them back.
- Viewport: offset, size and depth range.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.pipeline.raster import CLIPPED, DRAWN
from refsim.pipeline.state import DynamicState, ScissorRect, Viewport
from refsim.pipeline.taps import Taps
from refsim.pipeline.viewport import screen_map
from tests.pipeline import device_loops
from tests.pipeline.pipelines import POOL
from tests.pipeline.scenes import away_from_centres, full_screen, run, to_clip

SIDE = 64
F = np.float32


def rectangles(x, y, size, *, width=SIDE, height=SIDE):
    """Rectangles [n, 4] and fates of points at pixel coordinates, from the rasteriser's own function."""
    n = len(x)
    position = np.ascontiguousarray(to_clip(x, y, np.full(n, 0.5), 1.0, width, height).T)
    return rasterised(position, size, width, height)


def rasterised(position, size, width=SIDE, height=SIDE):
    """Rectangles and fates of clip positions f32[4, n]."""
    n = position.shape[1]
    rect, depth, fate = np.empty((4, n), np.int32), np.empty(n, F), np.empty(n, np.int32)
    view = tuple(screen_map(0, 0, width, height, 0, 1))
    bounds = tuple(F(v) for v in (0, 0, width, height))
    device_loops.points(position, np.asarray(size, F), view, bounds, rect, depth, fate)
    return rect.T, fate


def centres_within(low, high, count):
    """[n, count]: whether each pixel's centre lies in [low, high)."""
    centre = np.arange(count) + 0.5
    return (centre >= np.asarray(low)[:, None]) & (centre < np.asarray(high)[:, None])


def assert_covered(rect, fate, x, y, size, width=SIDE, height=SIDE):
    """Rectangles are those of the rule, for points inside the clip volume."""
    half = np.asarray(size) / 2
    for low, high, center, count in ((rect[:, 0], rect[:, 2], x, width), (rect[:, 1], rect[:, 3], y, height)):
        pixel = np.arange(count)
        drawn = (pixel >= low[:, None]) & (pixel < high[:, None])
        expected = centres_within(center - half, center + half, count)
        np.testing.assert_array_equal(drawn, expected)
    covers = centres_within(x - half, x + half, width).any(axis=1)
    covers &= centres_within(y - half, y + half, height).any(axis=1)
    np.testing.assert_array_equal(fate == DRAWN, covers)


@pytest.mark.parametrize("size", range(1, 65))
def test_coverage_of_every_size_at_every_eighth_of_a_pixel(size):
    x = np.concatenate([np.arange(0, 2 * 8 + 1), np.arange(30 * 8, 32 * 8), np.arange(62 * 8, 64 * 8 + 1)]) / 8
    y = np.roll(x, 7)
    rect, fate = rectangles(x, y, np.full(len(x), size))
    assert_covered(rect, fate, x, y, np.full(len(x), float(size)))


@settings(deadline=None)
@given(st.integers(0, 2**31))
def test_coverage_of_random_points(seed):
    rng = np.random.default_rng(seed)
    width, height = (int(v) for v in rng.integers(1, 200, 2))
    x, y = rng.uniform(0, width, 50), rng.uniform(0, height, 50)
    size = np.exp(rng.uniform(np.log(0.1), np.log(300), 50)).astype(F).astype(float)
    clear = away_from_centres(x - size / 2, x + size / 2, y - size / 2, y + size / 2)
    x, y, size = x[clear], y[clear], size[clear]
    rect, fate = rectangles(x, y, size, width=width, height=height)
    assert_covered(rect, fate, x, y, size, width, height)


@settings(deadline=None)
@given(st.integers(1, 40), st.integers(0, 15))
def test_neighbouring_tiles_share_no_pixel_and_leave_none_out(size, sixteenths):
    # Square tiles from an odd origin over the screen, each a sprite at its centre
    first = np.arange(-sixteenths / 16, SIDE, size)
    center = first + size / 2
    center = center[center < SIDE]
    rect, _ = rectangles(center, np.full(len(center), SIDE / 2), np.full(len(center), size))
    assert (rect[1:, 0] == rect[:-1, 2]).all() and rect[0, 0] == 0


@settings(deadline=None)
@given(st.lists(st.floats(width=32), min_size=1), st.integers(0, 10), st.integers(0, 50))
def test_first_pixel_is_the_least_at_or_beyond_the_edge(edges, low, more):
    edges, out = np.array(edges, F), np.empty(len(edges), np.int32)
    device_loops.first_pixels(edges, F(low), F(low + more), out)
    pixels = np.arange(low, low + more)
    for edge, got in zip(edges.astype(float), out, strict=True):
        beyond = pixels[pixels + 0.5 >= edge]
        assert got == (low if np.isnan(edge) else beyond[0] if len(beyond) else low + more)


def test_drawn_fragments_are_those_of_the_rule_within_the_scissor():
    rng = np.random.default_rng(11)
    n, scissor = 300, ScissorRect(3, 5, 50, 41)
    x, y = rng.integers(0, SIDE * 8, (2, n)) / 8
    size = rng.integers(1, 65, n).astype(float)
    scene = full_screen(SIDE, SIDE, base=[0.5] * n)
    scene.columns["position"], scene.columns["size"] = to_clip(x, y, [0.5] * n, 1.0, SIDE, SIDE), size
    taps = Taps("fragment")
    run(POOL["nearest"], scene._replace(dynamic=DynamicState(scissor=scissor)), taps=taps)
    columns = centres_within(np.maximum(x - size / 2, 3), np.minimum(x + size / 2, 53), SIDE)
    rows = centres_within(np.maximum(y - size / 2, 5), np.minimum(y + size / 2, 46), SIDE)
    expected = np.argwhere(rows[:, :, None] & columns[:, None, :])
    tap = taps.fragment[0]
    np.testing.assert_array_equal(np.stack([tap.primitive, tap.y, tap.x], axis=1), expected)


STEP = np.nextafter(F(1), F(2))
CLIP = [
    # name, clip position, drawn
    ("control: centre", (0, 0, 0.5, 1), True),
    ("right face", (1, 0, 0.5, 1), True),
    ("a step beyond the right face", (STEP, 0, 0.5, 1), False),
    ("left face", (-1, 0, 0.5, 1), True),
    ("a step beyond the left face", (-STEP, 0, 0.5, 1), False),
    ("top face", (0, 1, 0.5, 1), True),
    ("a step beyond the top face", (0, STEP, 0.5, 1), False),
    ("bottom face", (0, -1, 0.5, 1), True),
    ("a step beyond the bottom face", (0, -STEP, 0.5, 1), False),
    ("near face", (0, 0, 0, 1), True),
    ("a step before the near face", (0, 0, -1e-45, 1), False),
    ("far face", (0, 0, 1, 1), True),
    ("a step beyond the far face", (0, 0, STEP, 1), False),
    ("w scales the volume", (3, 0, 1, 4), True),
    ("w of 0", (0, 0, 0, 0), False),
    ("behind the eye", (0, 0, -0.5, -1), False),
    ("x is no number", (np.nan, 0, 0.5, 1), False),
    ("z is no number", (0, 0, np.nan, 1), False),
    ("w is no number", (0, 0, 0.5, np.nan), False),
    ("infinitely far right", (np.inf, 0, 0.5, 1), False),
]


@pytest.mark.parametrize(("position", "drawn"), [row[1:] for row in CLIP], ids=[row[0] for row in CLIP])
def test_a_point_is_clipped_by_its_centre(position, drawn):
    _, fate = rasterised(np.array([position], F).T.copy(), [500.0])
    assert fate[0] == (DRAWN if drawn else CLIPPED)


def tiles_242():
    """Centres of tiles of 16 pixels over 242 × 16 pixels."""
    return np.arange(8.0, 256, 16)


@pytest.mark.parametrize(("width", "scissor", "vanished"), [
    (242, None, 2),
    (256, ScissorRect(0, 0, 242, 16), 0),
], ids=["not padded: two columns vanish", "padded target and scissor"])  # fmt: skip
def test_a_width_that_is_no_multiple_of_the_tile(width, scissor, vanished):
    x = tiles_242()
    scene = full_screen(width, 16, base=[0.5] * 16)
    scene.columns["position"] = to_clip(x, np.full(16, 8.0), [0.5] * 16, 1.0, width, 16)
    scene.columns["size"] = np.full(16, 16.0)
    framebuffer, counters = run(POOL["nearest"], scene._replace(dynamic=DynamicState(scissor=scissor)), loop="dense")
    runs = framebuffer.invocations
    assert (runs[:, : 242 - vanished] == 1).all() and (runs[:, 242 - vanished :] == 0).all()
    assert counters["raster.clipped"] == (1 if vanished else 0)


def test_viewport_moves_scales_and_maps_depth():
    scene = full_screen(32, 24, base=(0.25,), z=(0.5,), size=2.0)
    scene = scene._replace(dynamic=DynamicState(viewport=Viewport(4, 6, 16, 8, 0.25, 0.75)))
    framebuffer, _ = run(POOL["counted"], scene, loop="dense")
    drawn = np.argwhere(framebuffer.invocations)
    assert drawn.tolist() == [[9, 11], [9, 12], [10, 11], [10, 12]]  # around (4 + 8, 6 + 4)
    assert set(framebuffer.depth[9:11, 11:13].ravel()) == {np.floor(0.5 * (2**24 - 1) + 0.5)}
