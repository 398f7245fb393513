"""Building the grid: which cells a triangle comes near, and the lists by counting sort. Templates of `refsim.jit`.

Everything is float64 and relative to the grid's lower corner. A cell lists a triangle when its box, grown by the
triangle's dilation and the slack on every side, overlaps the triangle: the separating axes are the three of the box,
the triangle's normal and the nine products of an edge and an axis, which is exact for a triangle and a box. Rounding
in float64 is some 1e-9 of the growth, which has more to spare.

Cells are found row by row. On the row (y, z) every axis leaves an interval of x, so a large triangle costs its rows
and its cells, not the cells of its bounding box.
"""

from __future__ import annotations

import math

import numpy as np

from refsim.papers.geometry_shader_rays.grid_overlap import row, separating_axes

EPS = 2.0**-24
FLOAT32_MOST = 3.5e38
AXES = 10
MOST = 2**28
I = np.int32  # noqa: E741
U = np.uintp


def dilated(triangles, point_error, most, dilation, box):
    """How far from triangle i an accepted point can lie: `dilation` f64[n]; `box` f64[2, 3] of all grown by it.

    `acceptance_margin` + `point_error`; inf where that exceeds `most`; −1 where no ray ever hits.
    """
    for a in range(3):
        box[0, a], box[1, a] = np.inf, -np.inf
    for i in range(triangles.shape[0]):
        p = triangles[i]
        x0, y0, z0 = np.float64(p[0, 0]), np.float64(p[0, 1]), np.float64(p[0, 2])
        ax, ay, az = p[1, 0] - x0, p[1, 1] - y0, p[1, 2] - z0
        bx, by, bz = p[2, 0] - x0, p[2, 1] - y0, p[2, 2] - z0
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        area2 = math.sqrt(nx * nx + ny * ny + nz * nz)
        l1 = math.sqrt(ax * ax + ay * ay + az * az)
        l2 = math.sqrt(bx * bx + by * by + bz * bz)
        l3 = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2)
        longest = max(l1, l2, l3)
        # |m1| = l2 / area2, and its largest component is at least 0.57 of that: beyond float32, so the record is zero
        if area2 == 0.0 or 0.57 * max(l1, l2) / area2 > FLOAT32_MOST:
            dilation[i] = -1.0
            continue
        beta = 2.0 * 4.0 * EPS * 2.0 * longest * (l1 + l2) / area2 + EPS
        margin = beta * longest + point_error
        if not (beta < 0.5 and margin <= most):
            dilation[i] = np.inf
            continue
        dilation[i] = margin
        for a in range(3):
            box[0, a] = min(box[0, a], min(p[0, a], p[1, a], p[2, a]) - margin)
            box[1, a] = max(box[1, a], max(p[0, a], p[1, a], p[2, a]) + margin)


def count_references(triangles, dilation, slack, first, last, lower, size, counts):
    """Adds to `counts` i32[gz, gy, gx] the cells of triangles [first, last); returns how many those are."""
    total = 0
    axes, ranges = np.empty((AXES, 5)), np.empty((3, 2), np.int64)
    for i in range(first, last):
        if dilation[i] < 0.0:
            continue
        separating_axes(triangles[i], dilation[i] + slack, lower, size, counts.shape, axes, ranges)
        for z in range(ranges[2, 0], ranges[2, 1] + 1):
            for y in range(ranges[1, 0], ranges[1, 1] + 1):
                start, end = row(axes, ranges, size, y, z)
                total += max(end - start, 0)
                # 2²⁷ references are refused, and what is counted beyond them is not needed: no count overflows
                for x in range(start, end if total <= MOST else start):
                    counts[U(z), U(y), U(x)] += I(1)
    return total


def write_references(triangles, dilation, slack, first, last, lower, size, places, references):
    """Writes the numbers of triangles [first, last) into the lists; `places` i32[gz, gy, gx] move on."""
    axes, ranges = np.empty((AXES, 5)), np.empty((3, 2), np.int64)
    for i in range(first, last):
        if dilation[i] < 0.0:
            continue
        separating_axes(triangles[i], dilation[i] + slack, lower, size, places.shape, axes, ranges)
        for z in range(ranges[2, 0], ranges[2, 1] + 1):
            for y in range(ranges[1, 0], ranges[1, 1] + 1):
                start, end = row(axes, ranges, size, y, z)
                for x in range(start, end):
                    references[U(places[U(z), U(y), U(x)])] = I(i)
                    places[U(z), U(y), U(x)] += I(1)


def lay_out(counts, cells, bits):
    """Starts of the lists: `cells` i32[gz, gy, gx, 3]; `counts` i32[k, gz, gy, gx] of k threads becomes their starts.

    A cell's lists lie in the order of the threads, which is that of the triangles.
    """
    total = 0
    threads, depth, height, width = counts.shape
    for z in range(depth):
        for y in range(height):
            for x in range(width):
                cells[z, y, x, 0] = total & ((1 << bits) - 1)
                cells[z, y, x, 1] = total >> bits
                before = total
                for k in range(threads):
                    own = counts[k, z, y, x]
                    counts[k, z, y, x] = total
                    total += own
                cells[z, y, x, 2] = total - before
