"""Which pixels points cover: squares of 1 to 64 pixels, on screen and over its edge.

Plan
- Whole sizes, centres on the sub-pixel grid where no edge of the square meets a pixel's centre: the same pixels, for
  every size from 1 to 64.
- Any size and centre: centre and size are snapped to the sub-pixel grid, so an edge may be off by half a step for
  each: every pixel is as in the exact square, but for centres within one step of an edge.
- Centres on edges: OpenGL 4.6 section 14.4.1 leaves them open. refsim takes those on the left and top edges (as
  Direct3D does), Mesa those on the left and bottom ones: only whole rows at these edges differ.
- A point whose centre lies outside the view is not drawn; sizes and colours beyond the edge of the screen are.
"""

from __future__ import annotations

import numpy as np

from refsim.pipeline.enums import PrimitiveTopology
from tests.opengl import case as cases
from tests.opengl import shapes
from tests.opengl.margins import point_margins
from tests.opengl.streams import clip
from tests.opengl.verdicts import note, same

SEED = 32001
SIZE = (64, 48)
COUNT = shapes.MOST
PIPELINE = shapes.pipeline(PrimitiveTopology.POINT_LIST)


def both(witness, place, size):
    """Coverage bool [n, h, w] of points at window places, of refsim and of OpenGL; the clip positions."""
    position = clip(place, np.full(COUNT, 0.5), SIZE)
    vertices = {"position": position, "size": size.astype(np.float32), "bits": shapes.marks(COUNT, 1)}
    given = cases.case(PIPELINE, shapes.GLSL, vertices, shapes.TARGETS, SIZE)
    ours, theirs = cases.ours(given), witness.draw(given)
    note("points", draws=1, fragments=ours.counts["fragment.written"])
    assert ours.counts["fragment.written"] == shapes.covered(ours.planes.color["bits"], COUNT).sum()
    return *(shapes.covered(outcome.planes.color["bits"], COUNT) for outcome in (ours, theirs)), position


def test_whole_sizes_cover_the_same_pixels(witness):
    for k in range(4):
        rng = np.random.default_rng([SEED, k])
        # Edges lie at the centre ± a multiple of 1/2: an odd sixteenth keeps them off pixel centres
        place = rng.integers(0, 8 * np.array(SIZE), (COUNT, 2)) / 8 + 1 / 16
        size = rng.permutation(np.arange(COUNT) % 64 + 1)
        ours, theirs, _ = both(witness, place, size)
        same("points", f"seed {SEED}, {k}", ours, theirs)


def test_any_size_and_place_is_right_within_the_precision(witness):
    step = 2.0**-witness.subpixel_bits
    for k in range(6):
        rng = np.random.default_rng([SEED, 10 + k])
        place, size = rng.uniform(0, 1, (COUNT, 2)) * SIZE, rng.uniform(1, 64, COUNT)
        ours, theirs, position = both(witness, place, size)
        margin = point_margins(position, size.astype(np.float32), SIZE)
        for cover, precision in ((ours, 2.0**-8), (theirs, step)):
            assert cover[margin > precision].all() and not cover[margin < -precision].any()
        note("points", values=ours.size, same=(ours == theirs).sum(), within_bound=(ours != theirs).sum())


def test_only_rows_on_edges_of_squares_differ(witness):
    rng = np.random.default_rng([SEED, 20])
    place, size = rng.integers(8, 40, (COUNT, 2)) + 0.5, 2 * rng.integers(1, 5, COUNT)
    ours, theirs, position = both(witness, place, size)
    margin = point_margins(position, size, SIZE)
    row = np.arange(SIZE[1])[:, None] + 0.5
    level = np.abs(row - place[:, 1, None, None]) == size[:, None, None] / 2
    differ = ours != theirs
    assert (np.abs(margin[differ]) < 2.0**-16).all() and np.broadcast_to(level, ours.shape)[differ].all()
    np.testing.assert_array_equal(ours.sum(axis=(1, 2)), size**2)
    np.testing.assert_array_equal(theirs.sum(axis=(1, 2)), size**2)
    note("points", values=ours.size, same=(ours == theirs).sum(), within_bound=(ours != theirs).sum())


def test_points_are_clipped_by_their_centres(witness):
    rng = np.random.default_rng([SEED, 30])
    place = (rng.integers(0, 8 * 2 * np.array(SIZE), (COUNT, 2)) / 8 + 1 / 16) - np.array(SIZE) / 2
    ours, theirs, position = both(witness, place, np.full(COUNT, 24))
    same("points", "over the edge", ours, theirs)
    inside = (np.abs(position[:, :2]) <= 1).all(axis=1)
    np.testing.assert_array_equal(ours.any(axis=(1, 2)), inside)
    assert 10 < inside.sum() < COUNT - 10
