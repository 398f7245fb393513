"""What the dense loop asks of a whole tile before it asks a pixel: whether a triangle covers none, some or all of it.

Plan
- All means that every pixel's centre is covered, and is said whenever that is so: fully covered tiles skip coverage.
  None means that no pixel is; what remains is said to be some.
- The int32 edges of a bin say of every pixel what the exact float64 edges say, for triangles of any size, as far away
  as the guard band reaches.
- Both against whole numbers in plain Python (`refsim.reference.raster` judges coverage elsewhere).
"""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from numba import njit

from refsim.pipeline.surface import ALL_COVERED, NONE_COVERED, SOME_COVERED
from refsim.pipeline.triangle import (
    inside_edges,
    locate_in_triangle,
    shape_of_triangle,
    triangle_in_bin,
    triangle_over,
)

FAR = 2**23


@njit(error_model="numpy")
def tile(corner, x0, y0, size, exact, quick):
    """Classification of a tile; `exact`, `quick` [size, size] get what the two tests say of every pixel."""
    shape = shape_of_triangle(corner, 0)
    edges = triangle_in_bin(shape, x0, y0)
    for y in range(size):
        for x in range(size):
            exact[y, x], _, _ = locate_in_triangle(shape, x0 + np.int32(x), y0 + np.int32(y))
            quick[y, x] = inside_edges(edges, np.int32(x), np.int32(y))
    return triangle_over(shape, x0, y0, x0 + np.int32(size), y0 + np.int32(size))


def covered(corners, x0, y0, size) -> np.ndarray:
    """The rule in whole numbers: inside, or on a top or left edge."""
    found = np.ones((size, size), bool)
    for k in range(3):
        (ax, ay), (bx, by) = corners[k], corners[(k + 1) % 3]
        dx, dy = bx - ax, by - ay
        owns = dy < 0 or (dy == 0 and dx > 0)
        for y in range(size):
            for x in range(size):
                px, py = 256 * (x0 + x) + 128, 256 * (y0 + y) + 128
                found[y, x] &= dx * (py - ay) - dy * (px - ax) >= (0 if owns else 1)
    return found


near, far = st.integers(-2000, 10000), st.integers(-FAR, FAR)
points = st.tuples(near, near) | st.tuples(far, far) | st.tuples(near.map(lambda v: v // 128 * 128), near)
AROUND = ((-FAR, -FAR), (FAR, -FAR), (0, FAR))


@given(st.tuples(points, points, points), st.integers(0, 3), st.integers(0, 3), st.sampled_from([8, 16, 32]))
@example(AROUND, 0, 0, 32)
@example(((128, 128), (128 + 8 * 256, 128), (128, 128 + 8 * 256)), 0, 0, 8)
@example(((0, 0), (0, 2048), (-1, 0)), 0, 0, 8)
def test_tiles_and_their_pixels(corners, column, row, size):
    (ax, ay), (bx, by), (cx, cy) = corners
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if area < 0:
        corners = (corners[0], corners[2], corners[1])
    if area == 0:
        corners = AROUND
    x0, y0 = np.int32(column * size), np.int32(row * size)
    exact, quick = np.empty((size, size), bool), np.empty((size, size), bool)
    corner = np.array([[*np.ravel(corners), 1]], np.int32)
    said = tile(corner, x0, y0, np.int32(size), exact, quick)
    expected = covered([tuple(int(v) for v in point) for point in corners], int(x0), int(y0), size)
    np.testing.assert_array_equal(exact, expected)
    np.testing.assert_array_equal(quick, expected)
    assert (said == ALL_COVERED) == expected.all()
    assert said != NONE_COVERED or not expected.any()


def test_every_answer_is_given():
    answers = set()
    for corners in (AROUND, ((0, 0), (2048, 0), (0, 2048)), ((-9000, 0), (-8000, 0), (-9000, 5))):
        corner = np.array([[*np.ravel(corners), 1]], np.int32)
        empty = np.empty((8, 8), bool)
        answers.add(int(tile(corner, np.int32(0), np.int32(0), np.int32(8), empty, empty.copy())))
    assert answers == {NONE_COVERED, SOME_COVERED, ALL_COVERED}
