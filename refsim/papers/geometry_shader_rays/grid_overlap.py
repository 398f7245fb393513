"""Triangle against the boxes of a grid by separating axes: device functions of the build, in float64.

An axis a is stored as (a, least, most): the centre c of a box, relative to the grid's lower corner, is not separated
by it if least ≤ a · c ≤ most. The box's own three axes are the range of cells of the triangle's bounding box.
"""

from __future__ import annotations

import math

import numpy as np

from refsim.jit import func

EMPTY = (np.int64(0), np.int64(0))


@func
def separating_axes(triangle, growth, lower, size, shape, axes, ranges):
    """Of one triangle: `axes` f64[10, 5] and `ranges` i64[3, 2], first and last cell on x, y, z.

    `growth` is added to the box on every side. The outermost cells have no outer wall.
    """
    for a in range(3):
        v0, v1, v2 = triangle[0, a] - lower[a], triangle[1, a] - lower[a], triangle[2, a] - lower[a]
        end = float(shape[2 - a] - 1)
        low = math.floor((min(v0, v1, v2) - growth) / size[a])
        high = math.floor((max(v0, v1, v2) + growth) / size[a])
        ranges[a, 0] = np.int64(min(max(low, 0.0), end))
        ranges[a, 1] = np.int64(min(max(high, 0.0), end))
    x0, y0, z0 = triangle[0, 0] - lower[0], triangle[0, 1] - lower[1], triangle[0, 2] - lower[2]
    x1, y1, z1 = triangle[1, 0] - lower[0], triangle[1, 1] - lower[1], triangle[1, 2] - lower[2]
    x2, y2, z2 = triangle[2, 0] - lower[0], triangle[2, 1] - lower[1], triangle[2, 2] - lower[2]
    half = 0.5 * size[0] + growth, 0.5 * size[1] + growth, 0.5 * size[2] + growth
    edges = (x1 - x0, y1 - y0, z1 - z0), (x2 - x1, y2 - y1, z2 - z1), (x0 - x2, y0 - y2, z0 - z2)
    corners = (x0, y0, z0), (x1, y1, z1), (x2, y2, z2)
    e, f = edges[0], edges[1]
    axis(axes, 0, e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0], corners, half)
    for k in range(3):
        ex, ey, ez = edges[k]
        axis(axes, 3 * k + 1, 0.0, -ez, ey, corners, half)
        axis(axes, 3 * k + 2, ez, 0.0, -ex, corners, half)
        axis(axes, 3 * k + 3, -ey, ex, 0.0, corners, half)


@func
def axis(axes, k, x, y, z, corners, half):
    """Writes axis k: the triangle's interval on it, grown by that of the box."""
    p0 = x * corners[0][0] + y * corners[0][1] + z * corners[0][2]
    p1 = x * corners[1][0] + y * corners[1][1] + z * corners[1][2]
    p2 = x * corners[2][0] + y * corners[2][1] + z * corners[2][2]
    radius = abs(x) * half[0] + abs(y) * half[1] + abs(z) * half[2]
    axes[k, 0], axes[k, 1], axes[k, 2] = x, y, z
    axes[k, 3] = min(p0, p1, p2) - radius
    axes[k, 4] = max(p0, p1, p2) + radius


@func
def row(axes, ranges, size, y, z):
    """Cells [start, end) of row (y, z) that no axis separates from the triangle: every axis leaves an interval."""
    cy, cz = (y + 0.5) * size[1], (z + 0.5) * size[2]
    low, high = -np.inf, np.inf
    for k in range(10):
        ax = axes[k, 0]
        rest = axes[k, 1] * cy + axes[k, 2] * cz
        least, most = axes[k, 3] - rest, axes[k, 4] - rest
        if ax == 0.0:
            if least > 0.0 or most < 0.0:
                return EMPTY
        elif ax > 0.0:
            low, high = max(low, least / ax), min(high, most / ax)
        else:
            low, high = max(low, most / ax), min(high, least / ax)
    # centre (x + 1/2) size in [low, high], inside the range of the bounding box
    start = max(math.ceil(low / size[0] - 0.5), float(ranges[0, 0]))
    end = min(math.floor(high / size[0] - 0.5), float(ranges[0, 1]))
    if not start <= end:
        return EMPTY
    return np.int64(start), np.int64(end) + 1
