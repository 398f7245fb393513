"""Building the kd-tree, compiled: top down by the surface area heuristic. Templates of `refsim.jit`; `kd_tree` calls
them and has the margins and costs.

Boxes and planes are float32, areas and costs float64 in one fixed order, so that `refsim.reference.kd_tree` makes the
same tree. Counts are exact: a triangle is below a plane where its box begins below it, above where it ends above it,
so at least one of them.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.papers.sphere_hierarchy.hierarchy_build import high_of, low_of, rounded_up

I = np.int32  # noqa: E741
U = np.uintp
LEAF = I(3)
BINS, FEW = 32, 32
BAD_REFINES = 3


def grown_boxes(triangles, growth, rows, low, high):
    """Boxes of `rows` i32[k] of `triangles` f32[n, 3, 3], grown by `growth` f64[n]: `low`, `high` f32[n, 3]."""
    for row in rows:
        for a in range(3):
            low[row, a] = -rounded_up(growth[row] - np.float64(low_of(triangles, row, a)))
            high[row, a] = rounded_up(np.float64(high_of(triangles, row, a)) + growth[row])


@func
def half_area(x, y, z):
    """Half the surface of a box of these edges."""
    return x * y + y * z + z * x


@func
def cost_of(cell, axis, plane, below, above, test, empty):
    """What a division is expected to cost, times the cell's area, without the visit itself."""
    x = np.float64(cell[3]) - np.float64(cell[0])
    y = np.float64(cell[4]) - np.float64(cell[1])
    z = np.float64(cell[5]) - np.float64(cell[2])
    down = np.float64(plane) - np.float64(cell[axis])
    up = np.float64(cell[axis + 3]) - np.float64(plane)
    if axis == 0:
        areas = half_area(down, y, z) * below + half_area(up, y, z) * above
    elif axis == 1:
        areas = half_area(x, down, z) * below + half_area(x, up, z) * above
    else:
        areas = half_area(x, y, down) * below + half_area(x, y, up) * above
    return test * areas * (empty if below == 0 or above == 0 else 1.0)


@func
def spread_planes(low, high, rows, first, end, axis, cell, planes, begins, ends):
    """BINS − 1 planes at equal distances; how many boxes begin below each, `begins`, and end above it, `ends`."""
    start, width = np.float64(cell[axis]), np.float64(cell[axis + 3]) - np.float64(cell[axis])
    for k in range(BINS - 1):
        planes[k] = np.float32(start + width * (k + 1) / BINS)
        begins[k], ends[k] = 0, 0
    begins[BINS - 1], ends[BINS - 1] = 0, 0
    for i in range(first, end):
        x, y = low[rows[i], axis], high[rows[i], axis]
        # The first plane above where the box begins; a guess, then exactly
        k = int(min(max((np.float64(x) - start) / width * BINS, 0.0), BINS - 1.0))
        while k > 0 and planes[k - 1] > x:
            k -= 1
        while k < BINS - 1 and not planes[k] > x:
            k += 1
        begins[k] += 1
        # One past the last plane below where it ends
        k = int(min(max((np.float64(y) - start) / width * BINS, 0.0), BINS - 1.0))
        while k > 0 and not planes[k - 1] < y:
            k -= 1
        while k < BINS - 1 and planes[k] < y:
            k += 1
        ends[k] += 1
    for k in range(1, BINS):
        begins[k] += begins[k - 1]
    for k in range(BINS - 1, 0, -1):
        ends[k - 1] += ends[k]
    # Of those that end in bin k, k planes are below: above plane k end those of bins k + 1 on
    for k in range(BINS - 1):
        ends[k] = ends[k + 1]
    return BINS - 1


@func
def side_planes(low, high, rows, first, end, axis, planes, begins, ends):
    """Planes at the sides of few boxes, with the same counts."""
    many = end - first
    for i in range(many):
        planes[U(i)], planes[U(many + i)] = low[rows[first + i], axis], high[rows[first + i], axis]
    for k in range(2 * many):
        plane, below, above = planes[U(k)], I(0), I(0)
        for i in range(many):
            below += I(planes[U(i)] < plane)
            above += I(planes[U(many + i)] > plane)
        begins[k], ends[k] = below, above
    return 2 * many


@func
def best_division(low, high, rows, first, end, cell, test, empty, planes, begins, ends):
    """``(cost, axis, plane)`` of the cheapest plane inside the cell; of equal costs the first axis, then the lowest
    plane. Infinite if there is none."""
    best, best_axis, best_plane = np.inf, 0, np.float32(0)
    for axis in range(3):
        if not cell[axis] < cell[axis + 3]:
            continue
        if end - first > FEW:
            count = spread_planes(low, high, rows, first, end, axis, cell, planes, begins, ends)
        else:
            count = side_planes(low, high, rows, first, end, axis, planes, begins, ends)
        for k in range(count):
            plane = planes[k]
            if not (plane > cell[axis] and plane < cell[axis + 3]):
                continue
            cost = cost_of(cell, axis, plane, begins[k], ends[k], test, empty)
            if cost < best or (cost == best and axis == best_axis and plane < best_plane):
                best, best_axis, best_plane = cost, axis, plane
    return best, best_axis, best_plane


def build_kd(listed, low, high, root, most, test, empty, rows, split, links, boxes, lists):
    """``(nodes, held, depth)``: how much of `split`, `links`, `boxes` and `lists` was filled, as `kd_tree.KdTree` has
    them, and the planes on the longest way; nodes is −1 where one of them, or `rows`, was too short.

    `listed` i32[k], the triangles, ascending; `low`, `high` f32[n, 3] their grown boxes; `root` f32[6]; `most`, the
    greatest depth; `test`, `empty` costs; `rows` i32, room for the triangles of nodes to come.
    """
    # Nodes to come, those below the planes on top; their triangles stand one after the other in `rows`
    waiting, cells = np.empty((most + 2, 5), np.int64), np.empty((most + 2, 6), np.float32)
    lower = np.empty(listed.shape[0], np.int32)
    planes = np.empty(2 * FEW, np.float32)
    begins, ends = np.empty(2 * FEW, np.int64), np.empty(2 * FEW, np.int64)
    nodes, held, deepest, top = 0, 0, 0, 1
    waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3], waiting[0, 4] = 0, listed.shape[0], 0, 0, -1
    for i in range(listed.shape[0]):
        rows[i] = listed[i]
    for c in range(6):
        cells[0, c] = root[c]
    while top > 0:
        top -= 1
        first, end, depth, bad, parent = (
            waiting[top, 0], waiting[top, 1], waiting[top, 2], waiting[top, 3], waiting[top, 4],
        )  # fmt: skip
        node, count = nodes, end - first
        if node == split.shape[0] or held + count > lists.shape[0] or end + count > rows.shape[0]:
            return -1, 0, 0
        nodes += 1
        deepest = max(deepest, depth)
        cell = boxes[node]
        for c in range(6):
            cell[c] = cells[top, c]
        links[node, 3] = parent
        # The second child of its parent: the first stands right after it
        if parent >= 0 and parent != node - 1:
            links[parent, 1] = node
        best, axis, plane = np.inf, 0, np.float32(0)
        if count > 1 and depth < most:
            best, axis, plane = best_division(low, high, rows, first, end, cell, test, empty, planes, begins, ends)
        whole = half_area(
            np.float64(cell[3]) - np.float64(cell[0]),
            np.float64(cell[4]) - np.float64(cell[1]),
            np.float64(cell[5]) - np.float64(cell[2]),
        )
        alone = test * whole * count
        bad += int(not best + whole < alone)
        if best == np.inf or bad >= BAD_REFINES or (best + whole > 4.0 * alone and count < 16):
            split[node], links[node, 0], links[node, 1], links[node, 2] = np.float32(0), LEAF, held, count
            for i in range(first, end):
                lists[held] = rows[i]
                held += 1
            continue
        split[node], links[node, 0], links[node, 1], links[node, 2] = plane, axis, -1, 0
        below, above = 0, first
        for i in range(first, end):
            row = rows[i]
            if low[row, axis] < plane:
                lower[below] = row
                below += 1
            if high[row, axis] > plane:
                rows[above] = row
                above += 1
        for i in range(below):
            rows[above + i] = lower[i]
        for side in range(2):
            waiting[top, 0], waiting[top, 1] = (first, above) if side == 0 else (above, above + below)
            waiting[top, 2], waiting[top, 3], waiting[top, 4] = depth + 1, bad, node
            for c in range(6):
                cells[top, c] = cell[c]
            cells[top, axis + 3 * side] = plane
            top += 1
    return nodes, held, deepest
