"""Clipping of a triangle in homogeneous clip space, before the perspective divide.

The planes are near (z ≥ 0), far (z ≤ w), w > 0 and, far beyond the viewport, the guard band; what lies between the
clip volume's sides and the guard band is left to the rasteriser, which bounds it by the viewport. A corner that
clipping makes is the same from either end of its edge, in float64: triangles that share an edge cut it at the same
point, to the bit. Every corner carries its weights in the triangle's own corners, so that varyings are
interpolated as if nothing had been clipped.
Source: Sutherland and Hodgman 1974; Blinn and Newell 1978 (homogeneous clipping); OpenGL 4.6 section 13.7.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.pipeline.viewport import LEAST_W

D = np.float64
U = np.uintp
D0 = np.float64(0)
PLANES = 7
MOST_CORNERS = 3 + PLANES
CORNER = 7  # x, y, z, w and the three weights


@func
def turn(corners, a, b, c):
    """Twice the signed area of three corners on the sub-pixel grid, int64."""
    dx1, dy1 = np.int64(corners[b, 0]) - np.int64(corners[a, 0]), np.int64(corners[b, 1]) - np.int64(corners[a, 1])
    dx2, dy2 = np.int64(corners[c, 0]) - np.int64(corners[a, 0]), np.int64(corners[c, 1]) - np.int64(corners[a, 1])
    return dx1 * dy2 - dx2 * dy1


@func
def convex_ring(corners, count, ring):
    """Numbers of the polygon's corners that make it convex on the sub-pixel grid, in `ring`; returns how many.

    The polygon was convex before its corners were rounded; a needle may fold. Corners that turn the wrong way, or not
    at all, are left out one after the other, so that the fan that is drawn faces one way and covers no pixel twice.
    """
    area = np.int64(0)
    for k in range(count):
        ring[k] = k
        if k >= 2:
            area += turn(corners, U(0), U(k - 1), U(k))
    sign = np.int64(1) if area > 0 else np.int64(-1)
    k = 0
    while count > 2 and k < count:
        before, after = ring[k - 1 if k > 0 else count - 1], ring[k + 1 if k + 1 < count else 0]
        if turn(corners, U(before), U(ring[k]), U(after)) * sign > 0:
            k += 1
            continue
        for j in range(k, count - 1):
            ring[j] = ring[j + 1]
        count -= 1
        k = 0
    return count if area != 0 else 0


@func
def whole_ring(ring):
    """The ring of a triangle that was not clipped."""
    ring[0], ring[1], ring[2] = 0, 1, 2
    return 3


@func
def distance(k, x, y, z, w, guard_x, guard_y):
    """How far inside plane k a corner lies (any positive unit)."""
    result = z
    result = w - z if k == 1 else result
    result = w - D(LEAST_W) if k == 2 else result
    result = guard_x * w - x if k == 3 else result
    result = guard_x * w + x if k == 4 else result
    result = guard_y * w - y if k == 5 else result
    result = guard_y * w + y if k == 6 else result
    return result


@func
def clip_polygon(polygon, spare, guard_x, guard_y):
    """Clips the triangle in polygon[:3]; f64[MOST_CORNERS, CORNER] both. Returns how many corners are left.

    The result stands in `polygon`, in the triangle's order.
    """
    count = 3
    for k in range(PLANES):
        left = 0
        for j in range(count):
            a, b = U(j), U(j + 1 if j + 1 < count else 0)
            da = distance(k, polygon[a, 0], polygon[a, 1], polygon[a, 2], polygon[a, 3], guard_x, guard_y)
            db = distance(k, polygon[b, 0], polygon[b, 1], polygon[b, 2], polygon[b, 3], guard_x, guard_y)
            if da >= D0:
                for c in range(CORNER):
                    spare[U(left), U(c)] = polygon[a, U(c)]
                left += 1
            if (da >= D0) != (db >= D0):
                # Weighted, not stepped from one end: right to rounding however unequal the ends, and the same for a
                # neighbour, who comes from the other end
                here, there = db / (db - da), da / (da - db)
                for c in range(CORNER):
                    spare[U(left), U(c)] = here * polygon[a, U(c)] + there * polygon[b, U(c)]
                if k >= 2:  # inside the plane of w by now, but for rounding
                    spare[U(left), 3] = max(spare[U(left), 3], D(LEAST_W))
                left += 1
        count = left
        for j in range(count):
            for c in range(CORNER):
                polygon[U(j), U(c)] = spare[U(j), U(c)]
    return count
