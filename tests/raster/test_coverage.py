"""Which pixels a triangle covers, against one triangle restated in whole numbers.

Plan
- The restatement's top-left rule is the one of a sample that stands an infinitesimal right of the centre and a much
  smaller one below; its snapping goes to the nearest 1/256.
- Random triangles (plain, slivers, corners and edges on centres, degenerate, huge, off the screen, below a pixel) cover
  exactly the pixels of the restatement, whichever way round they go; counters tell drawn from empty.
- Both loops, one and two threads, tap on and off: the same bits. Viewports off the origin, fractional, with a scissor.
- Boundary table: corners and edges through centres on each side, half a sub-pixel step, zero area, a single pixel; each
  wound both ways, with control cases.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.reference import clip, raster
from tests.raster.drawing import Screen, assert_same_bits, clip_positions, rasterise
from tests.raster.triangles import KINDS, random_triangles

SCREEN = Screen(61, 47)
SCREENS = [
    SCREEN,
    Screen(64, 32, None, (3, 5, 40, 20)),
    Screen(40, 30, (3.25, -7.5, 21.4, 40.125, 0.25, 0.75)),
    Screen(33, 29, (-11.0, 4.0, 60.0, 17.0), (0, 2, 33, 14)),
    Screen(16, 16, (15.25, 2.5, 0.5, 9.0)),
]
seeds = st.integers(0, 2**31)
LOOPS = [{"loop": "dense"}, {"loop": "list"}, {"loop": "dense", "threads": 2}, {"loop": "list", "threads": 2}]


def expected_counts(position: np.ndarray, screen: Screen) -> np.ndarray:
    """bool [n, h, w]: what each of the triangles [n, 3, 4] covers, restated."""
    count = np.zeros((len(position), screen.height, screen.width), bool)
    x0, y0, x1, y1 = bounds = raster.pixels_of(screen.viewport, screen.scissor)
    for k, corners in enumerate(raster.corners_of(position, screen.viewport)):
        count[k, y0:y1, x0:x1] = raster.coverage(corners, bounds)
    return count


def tapped_counts(drawn, triangles: int) -> np.ndarray:
    """int32 [n, h, w]: how often each triangle covers each pixel, from the fragment tap."""
    count = np.zeros((triangles, *drawn.coverage.shape), np.int32)
    tap = drawn.fragments
    np.add.at(count, (tap.primitive, tap.y, tap.x), 1)
    return count


@given(seeds)
def test_top_left_rule_is_a_sample_right_of_and_below_the_centre(seed):
    rng = np.random.default_rng(seed)
    corners = rng.integers(-2, 7, (3, 2)) * 128
    if raster.doubled_area(corners) < 0:
        corners = corners[::-1]
    x, y = raster.centres((0, 0, 4, 4)).transpose(2, 0, 1)
    inside = np.full((4, 4), raster.doubled_area(corners) != 0)
    for k in range(3):
        (ax, ay), (bx, by) = corners[k], corners[(k + 1) % 3]
        # Twice the area that the edge spans with the sample, and how it grows as the sample goes right, then down
        here = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        inside &= np.where(here != 0, here > 0, -(by - ay) > 0 if by != ay else bx - ax > 0)
    np.testing.assert_array_equal(raster.coverage(corners, (0, 0, 4, 4)), inside)


@given(st.floats(-30000, 30000, width=32))
def test_snapping_goes_to_the_nearest_step(place):
    step = int(raster.snap(np.array([place], np.float32))[0])
    assert abs(step / 256 - float(place)) <= 1 / 512


@settings(max_examples=80)
@given(seeds, st.sampled_from(SCREENS))
def test_random_triangles_cover_what_the_restatement_covers(seed, screen):
    rng = np.random.default_rng(seed)
    corners = random_triangles(rng, 56, screen)
    position = clip_positions(screen, corners[..., 0], corners[..., 1], 0.5, rng.uniform(0.3, 3, (56, 3)))
    assert not any(clip.needs_clipping(one, screen.viewport) for one in position)
    expected = expected_counts(position, screen)
    drawn = rasterise(screen, position)
    found = tapped_counts(drawn, 56)
    wrong = [k for k in range(56) if (found[k] != expected[k]).any()]
    assert not wrong, [(k, KINDS[k % len(KINDS)], raster.corners_of(position[k], screen.viewport)) for k in wrong[:3]]
    bounds = raster.pixels_of(screen.viewport, screen.scissor)
    visible = [one for one in position if not clip.is_outside(one)]
    snapped = [raster.corners_of(one, screen.viewport) for one in visible]
    reached = sum(raster.holds_centre(one, bounds) and raster.doubled_area(one) != 0 for one in snapped)
    fates = [drawn.counters[f"raster.{fate}"] for fate in ("clipped", "empty", "drawn", "culled")]
    assert fates == [56 - len(visible), len(visible) - reached, reached, 0]
    np.testing.assert_array_equal(drawn.coverage, expected.sum(axis=0))


def test_winding_and_first_corner_do_not_matter():
    rng = np.random.default_rng(5)
    corners = random_triangles(rng, 140, SCREEN)
    position = clip_positions(SCREEN, corners[..., 0], corners[..., 1])
    once = tapped_counts(rasterise(SCREEN, position), 140)
    assert (once.sum(axis=(1, 2)) > 0).sum() > 40
    for order in [(1, 2, 0), (2, 1, 0), (0, 2, 1)]:
        np.testing.assert_array_equal(tapped_counts(rasterise(SCREEN, position[:, order]), 140), once)


@pytest.mark.parametrize("screen", SCREENS, ids=range(len(SCREENS)))
def test_loops_threads_and_taps_give_the_same_bits(screen):
    rng = np.random.default_rng(11)
    corners = random_triangles(rng, 700, screen)
    columns = {name: rng.normal(size=2100) for name in ("smooth", "straight", "first")}
    w, z = rng.uniform(0.3, 3, (700, 3)), rng.uniform(0, 1, (700, 3))
    position = clip_positions(screen, corners[..., 0], corners[..., 1], z, w)
    tapped = rasterise(screen, position, **columns)
    assert len(tapped.fragments.primitive) == tapped.coverage.sum() > 0
    for options in LOOPS:
        assert_same_bits(rasterise(screen, position, tap=False, **options, **columns), tapped)


def pixels(picture: str) -> set[tuple[int, int]]:
    """(x, y) of the # in rows divided by blanks, from the pixel (1, 1) on."""
    return {(x, y) for y, row in enumerate(picture.split(), 1) for x, sign in enumerate(row, 1) if sign == "#"}


STEP = 1 / 256
ROWS = [
    # corners in pixels, what is covered, what becomes of it
    ("control: corners between centres", [(1.2, 1.2), (5.2, 1.2), (1.2, 5.2)], "####. ###.. ##... #....", "drawn"),
    ("corners on centres, right at the top left", [(1.5, 1.5), (4.5, 1.5), (1.5, 4.5)], "###. ##.. #...", "drawn"),
    ("corners on centres, right at the bottom right", [(4.5, 4.5), (1.5, 4.5), (4.5, 1.5)], "... ..# .##", "drawn"),
    ("corners on centres, right at the top right", [(4.5, 1.5), (4.5, 4.5), (1.5, 1.5)], "### .## ..#", "drawn"),
    ("corners on centres, right at the bottom left", [(1.5, 4.5), (1.5, 1.5), (4.5, 4.5)], "... #.. ##.", "drawn"),
    ("level top edge through centres", [(1, 2.5), (5, 2.5), (3, 4.2)], "..... #### .##.", "drawn"),
    ("level bottom edge through centres", [(1, 2.5), (5, 2.5), (3, 0.8)], ".##.", "drawn"),
    ("upright left edge through centres", [(2.5, 1), (2.5, 5), (4.2, 3)], ".#. .## .## .#.", "drawn"),
    ("upright right edge through centres", [(2.5, 1), (2.5, 5), (0.8, 3)], "... #.. #.. ...", "drawn"),
    ("its lowest corner on a centre", [(2, 1), (3, 1), (2.5, 2.5)], ".#. ...", "drawn"),
    ("its highest corner on a centre", [(2, 4), (3, 4), (2.5, 2.5)], "... ... .#.", "drawn"),
    ("its left corner on a centre", [(2.5, 2.5), (4, 2), (4, 3)], "... .##", "drawn"),
    ("its right corner on a centre", [(2.5, 2.5), (1, 2), (1, 3)], "... #..", "drawn"),
    ("control: a left edge a step before the centres", [(2.5 - STEP, 1), (2.5 - STEP, 5), (4.2, 3)], ".#. .## .## .#.",
     "drawn"),
    ("a left edge a step behind the centres", [(2.5 + STEP, 1), (2.5 + STEP, 5), (4.2, 3)], "... ..# ..# ...", "drawn"),
    ("a left edge less than half a step behind", [(2.5 + STEP / 3, 1), (2.5 + STEP / 3, 5), (4.2, 3)],
     ".#. .## .## .#.", "drawn"),
    ("a left edge more than half a step behind", [(2.5 + STEP * 0.7, 1), (2.5 + STEP * 0.7, 5), (4.2, 3)],
     "... ..# ..# ...", "drawn"),
    ("a right edge more than half a step behind", [(2.5 + STEP * 0.7, 1), (2.5 + STEP * 0.7, 5), (0.8, 3)],
     ".#. ##. ##. .#.", "drawn"),
    ("a right edge less than half a step behind", [(2.5 + STEP / 3, 1), (2.5 + STEP / 3, 5), (0.8, 3)],
     "... #.. #.. ...", "drawn"),
    ("one pixel", [(2.25, 2.25), (3, 2.25), (2.25, 3)], "... .#.", "drawn"),
    ("below a pixel, between centres", [(2.6, 2.6), (3.4, 2.6), (2.6, 3.4)], "", "empty"),
    ("between columns of centres", [(2.6, 1), (3.4, 1), (3, 6)], "", "empty"),
    ("a box around a centre that it misses", [(2.25, 2.25), (3.25, 2.25), (2.75, 2.375)], "", "empty"),
    ("a box that holds a centre that it misses", [(2.25, 2.25), (3.25, 2.25), (3.25, 2.75)], "", "drawn"),
    ("no area: a line through centres", [(1.5, 1.5), (4.5, 4.5), (3, 3)], "", "empty"),
    ("no area: a level line", [(1, 2.5), (5, 2.5), (3, 2.5)], "", "empty"),
    ("no area: two corners alike", [(1.5, 1.5), (1.5, 1.5), (4.5, 3.5)], "", "empty"),
    ("no area: a point", [(2.5, 2.5)] * 3, "", "empty"),
    ("no area after snapping", [(1, 1), (5, 1), (3, 1 + STEP / 3)], "", "empty"),
    ("control: a step of area", [(1, 2.5), (5, 2.5), (3, 2.5 + STEP)], "..... ####", "drawn"),
    ("off the screen", [(-9, 1), (-1, 1), (-3, 5)], "", "clipped"),
    ("off the screen, but for an edge on its border", [(-9, 1), (0, 1), (0, 5)], "", "empty"),
    ("the whole screen", [(-1, -1), (19, -1), (-1, 19)], "all", "drawn"),
]  # fmt: skip


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1)], ids=["", "other way round"])
@pytest.mark.parametrize(("corners", "picture", "fate"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_boundary_row(corners, picture, fate, order):
    screen = Screen(8, 8)
    position = clip_positions(screen, *np.array(corners)[list(order)].T)
    drawn = rasterise(screen, position)
    found = {(int(x), int(y)) for y, x in np.argwhere(drawn.coverage)}
    assert found == ({(x, y) for x in range(8) for y in range(8)} if picture == "all" else pixels(picture))
    assert drawn.coverage.max() <= 1
    assert drawn.counters[f"raster.{fate}"] == drawn.counters["raster.primitives"] == 1
