"""Section 2.2, compiled: spheres top down over octants. Templates of `refsim.jit`; `hierarchy` calls them.

Boxes and spheres' centres are float32; distances, barycentres and comparisons with them float64, in one fixed order of
operations, so that `refsim.reference.sphere_tree` makes the same bits.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func

I = np.int32  # noqa: E741
INFINITY = np.float32(np.inf)


@func
def rounded_up(x):
    """The smallest float32 that is not below the float64 x, which is 0 or more (or infinite)."""
    near = np.float32(x)
    return near if np.float64(near) >= x else np.nextafter(near, INFINITY)


@func
def reach_of(triangles, row, margin, x, y, z):
    """Distance from (x, y, z) to the triangle's farthest vertex, its acceptance margin added; float64."""
    far = 0.0
    for k in range(3):
        dx = np.float64(triangles[row, k, 0]) - x
        dy = np.float64(triangles[row, k, 1]) - y
        dz = np.float64(triangles[row, k, 2]) - z
        far = max(far, dx * dx + dy * dy + dz * dz)
    return (np.sqrt(far) + margin[row]) * (1.0 + 2.0**-48)


def triangle_sizes(triangles, margin, size, barycentre):
    """The radius that a node of this triangle alone would have, `size` f64[n], and G, `barycentre` f64[n, 3]."""
    for row in range(triangles.shape[0]):
        x, y, z = box_barycentre(triangles, row)
        size[row] = reach_of(triangles, row, margin, np.float64(x), np.float64(y), np.float64(z))
        for a in range(3):
            first_two = np.float64(triangles[row, 0, a]) + np.float64(triangles[row, 1, a])
            barycentre[row, a] = (first_two + np.float64(triangles[row, 2, a])) / 3.0


@func
def box_barycentre(triangles, row):
    """The barycentre C of one triangle's box, three float32."""
    x = middle(low_of(triangles, row, 0), high_of(triangles, row, 0))
    y = middle(low_of(triangles, row, 1), high_of(triangles, row, 1))
    z = middle(low_of(triangles, row, 2), high_of(triangles, row, 2))
    return x, y, z


@func
def low_of(triangles, row, a):
    """Smallest coordinate of a triangle along axis a."""
    return min(triangles[row, 0, a], min(triangles[row, 1, a], triangles[row, 2, a]))


@func
def high_of(triangles, row, a):
    """Largest coordinate of a triangle along axis a."""
    return max(triangles[row, 0, a], max(triangles[row, 1, a], triangles[row, 2, a]))


@func
def middle(low, high):
    """The middle of two float32, rounded once."""
    return np.float32(0.5 * (np.float64(low) + np.float64(high)))


@func
def octant_of(barycentre, row, x, y, z):
    """Sign of G − C an axis, three bits; on the plane counts as below it."""
    return int(barycentre[row, 0] > x) + 2 * int(barycentre[row, 1] > y) + 4 * int(barycentre[row, 2] > z)


def build(triangles, margin, size, barycentre, threshold, order, spheres, parent, owner):
    """Makes the nodes, parents before children; returns their number.

    Read: `triangles` f32[n, 3, 3], `margin` f64[n], `size` f64[n], `barycentre` f64[n, 3], `threshold`; `order` i64[n]
    holds the rows and is sorted. Written: `spheres` f32[≥ 2 n, 4] (C, radius), `parent` i32[≥ 2 n] (−1 the root),
    `owner` i32[n], the node that a triangle is a child of.
    """
    n = triangles.shape[0]
    first_of, end_of = np.empty(n + 8, np.int64), np.empty(n + 8, np.int64)
    parent_of = np.empty(n + 8, np.int32)
    scratch, group = np.empty(n, np.int64), np.empty(n, np.uint8)
    starts = np.empty(9, np.int64)
    low, high = np.empty(3, np.float32), np.empty(3, np.float32)
    nodes, depth = 0, 1
    first_of[0], end_of[0], parent_of[0] = 0, n, -1
    while depth > 0:
        depth -= 1
        first, end, node = first_of[depth], end_of[depth], nodes
        parent[node] = parent_of[depth]
        nodes += 1
        # The tightest box of all triangles; its barycentre C
        low[:], high[:] = INFINITY, -INFINITY
        for i in range(first, end):
            for a in range(3):
                low[a] = min(low[a], low_of(triangles, order[i], a))
                high[a] = max(high[a], high_of(triangles, order[i], a))
        cx, cy, cz = middle(low[0], high[0]), middle(low[1], high[1]), middle(low[2], high[2])
        x, y, z = np.float64(cx), np.float64(cy), np.float64(cz)
        # The smallest sphere around C that holds them
        radius = 0.0
        for i in range(first, end):
            radius = max(radius, reach_of(triangles, order[i], margin, x, y, z))
        spheres[node, 0], spheres[node, 1], spheres[node, 2], spheres[node, 3] = cx, cy, cz, rounded_up(radius)
        # Big triangles are children of this node
        kept = first
        for i in range(first, end):
            row = order[i]
            if size[row] >= threshold * radius:
                owner[row] = node
            else:
                scratch[kept] = row
                kept += 1
        # The others fall into octants about C
        occupied = share_out(barycentre, scratch, group, starts, first, kept, x, y, z)
        if occupied == 1 and kept == end:
            # All in one octant: about the middle of their barycentres, or the same node would come again for ever
            x, y, z = middle_of_barycentres(barycentre, scratch, first, kept)
            occupied = share_out(barycentre, scratch, group, starts, first, kept, x, y, z)
            if occupied == 1:
                for i in range(first, kept):
                    owner[scratch[i]] = node
                continue
        for i in range(first, kept):
            k = group[i]
            order[starts[k]] = scratch[i]
            starts[k] += 1
        # `starts` now holds the ends; the last octant goes on the stack first, so that the first is built first
        for k in range(7, -1, -1):
            begin = first if k == 0 else starts[k - 1]
            if starts[k] > begin:
                first_of[depth], end_of[depth], parent_of[depth] = begin, starts[k], node
                depth += 1
    return nodes


@func
def share_out(barycentre, rows, group, starts, first, end, x, y, z):
    """Octants of rows[first:end] about (x, y, z): `group`, where each begins (`starts`), and how many hold one."""
    starts[:] = 0
    for i in range(first, end):
        k = octant_of(barycentre, rows[i], x, y, z)
        group[i] = k
        starts[k + 1] += 1
    occupied = 0
    for k in range(8):
        occupied += int(starts[k + 1] > 0)
    starts[0] = first
    for k in range(8):
        starts[k + 1] += starts[k]
    return occupied


@func
def middle_of_barycentres(barycentre, rows, first, end):
    """The middle of the box of the barycentres; float64."""
    lx, ly, lz, hx, hy, hz = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    for i in range(first, end):
        g = barycentre[rows[i]]
        lx, ly, lz = min(lx, g[0]), min(ly, g[1]), min(lz, g[2])
        hx, hy, hz = max(hx, g[0]), max(hy, g[1]), max(hz, g[2])
    return 0.5 * (lx + hx), 0.5 * (ly + hy), 0.5 * (lz + hz)
