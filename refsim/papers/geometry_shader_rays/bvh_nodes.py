"""A threaded hierarchy of boxes: building it by the surface area heuristic, and walking it without a stack.

Nodes stand depth first, so the one after an inner node is its first child. Each knows the node to go on with when its
box is missed or its triangles are tested: its escape index (Thrane and Simonsen, the paper's reference 11).
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.papers.geometry_shader_rays.acceleration import test_triangle
from refsim.papers.geometry_shader_rays.grid_rays import (
    inverse_direction,
    is_walked,
    larger,
    search_unwalked,
    smaller,
)

F0 = np.float32(0)
I = np.int32  # noqa: E741
U = np.uintp
BINS = 16
LARGEST_LEAF = 8
# Of a node's visit, in triangle tests
VISIT = 1.0


def build_nodes(low, high, order, boxes, links):
    """Fills `boxes` f32[m, 6] and `links` i32[m, 3] (escape, first of `order`, how many) and sorts `order`; returns m.

    `low`, `high` f32[n, 3] are the triangles' boxes, `order` i64[n] their rows. An inner node has no triangles of its
    own. Bins of the centres along each axis; of equally good planes the first.
    """
    n = order.size
    stack = np.empty((128, 3), np.int64)
    parent = np.empty(links.shape[0], np.int64)
    counts, bins = np.empty(BINS, np.int64), np.empty((BINS, 6))
    right = np.empty((BINS, 2))
    nodes, depth = 0, 1
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, n, -1
    while depth > 0:
        depth -= 1
        first, end, parent[nodes] = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        node, count = nodes, end - first
        nodes += 1
        box = boxes[node]
        box[:3], box[3:] = np.float32(np.inf), np.float32(-np.inf)
        centres = np.empty((2, 3))
        centres[0], centres[1] = np.inf, -np.inf
        for i in range(first, end):
            for a in range(3):
                least, most = low[order[i], a], high[order[i], a]
                box[a], box[a + 3] = min(box[a], least), max(box[a + 3], most)
                centre = 0.5 * (np.float64(least) + most)
                centres[0, a], centres[1, a] = min(centres[0, a], centre), max(centres[1, a], centre)
        links[node, 0], links[node, 1], links[node, 2] = 1, first, count
        best, axis, plane = np.inf, 0, 0
        for a in range(3):
            width = centres[1, a] - centres[0, a]
            if not width > 0.0:
                continue
            fill_bins(low, high, order, first, end, a, centres[0, a], width, counts, bins)
            cost, at = best_plane(counts, bins, right)
            if cost < best:
                best, axis, plane = cost, a, at
        whole = area(box[0], box[1], box[2], box[3], box[4], box[5])
        if count <= LARGEST_LEAF and not best + VISIT * whole < count * whole:
            continue
        middle = first
        if best < np.inf:
            start, width = centres[0, axis], centres[1, axis] - centres[0, axis]
            for i in range(first, end):
                if bin_of(low, high, order[i], axis, start, width) <= plane:
                    order[middle], order[i] = order[i], order[middle]
                    middle += 1
        # Nothing tells the triangles apart, or the stack is nearly full: halves
        if middle in (first, end) or depth > 90:
            middle = (first + end) // 2
        links[node, 2] = 0
        stack[depth, 0], stack[depth, 1], stack[depth, 2] = middle, end, node
        stack[depth + 1, 0], stack[depth + 1, 1], stack[depth + 1, 2] = first, middle, node
        depth += 2
    # Sizes of the subtrees, from the leaves up; a node's escape is the first after its own
    for node in range(nodes - 1, 0, -1):
        links[parent[node], 0] += links[node, 0]
    for node in range(nodes):
        links[node, 0] += I(node)
    return nodes


@func
def area(x0, y0, z0, x1, y1, z1):
    """Half the surface of a box; zero if it is empty."""
    x, y, z = max(float(x1) - x0, 0.0), max(float(y1) - y0, 0.0), max(float(z1) - z0, 0.0)
    return x * y + y * z + z * x


@func
def bin_of(low, high, row, a, start, width):
    """The bin of a triangle's centre along axis a."""
    centre = 0.5 * (np.float64(low[row, a]) + high[row, a])
    return min(int((centre - start) / width * BINS), BINS - 1)


@func
def fill_bins(low, high, order, first, end, a, start, width, counts, bins):
    """Counts and boxes of the triangles in each bin along axis a."""
    for k in range(BINS):
        counts[k] = 0
        bins[k, :3], bins[k, 3:] = np.inf, -np.inf
    for i in range(first, end):
        row = order[i]
        k = bin_of(low, high, row, a, start, width)
        counts[k] += 1
        for b in range(3):
            bins[k, b], bins[k, b + 3] = min(bins[k, b], low[row, b]), max(bins[k, b + 3], high[row, b])


@func
def best_plane(counts, bins, right):
    """``(cost, bin)``: the last bin to the left of the cheapest plane; cost is the sum of area times triangles."""
    x0, y0, z0, x1, y1, z1, count = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf, 0
    for k in range(BINS - 1, 0, -1):
        b = bins[k]
        x0, y0, z0 = min(x0, b[0]), min(y0, b[1]), min(z0, b[2])
        x1, y1, z1 = max(x1, b[3]), max(y1, b[4]), max(z1, b[5])
        count += counts[k]
        right[k, 0], right[k, 1] = area(x0, y0, z0, x1, y1, z1), count
    x0, y0, z0, x1, y1, z1, count = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf, 0
    best, at = np.inf, 0
    for k in range(BINS - 1):
        b = bins[k]
        x0, y0, z0 = min(x0, b[0]), min(y0, b[1]), min(z0, b[2])
        x1, y1, z1 = max(x1, b[3]), max(y1, b[4]), max(z1, b[5])
        count += counts[k]
        cost = area(x0, y0, z0, x1, y1, z1) * count + right[k + 1, 0] * right[k + 1, 1]
        if count > 0 and right[k + 1, 1] > 0 and cost < best:
            best, at = cost, k
    return best, at


@func
def search_hierarchy(hierarchy, triangles, o, d, t_max, any_hit, front_only):
    """The nearest hit by walking the hierarchy; `cells` counts nodes. One return: see `grid_traversal`."""
    lower = hierarchy.lower
    s = lower[0] - o[0], lower[1] - o[1], lower[2] - o[2]
    walked = is_walked(s, d, hierarchy.far)
    triangle, t, u, v, tests = search_unwalked(
        hierarchy.loose, hierarchy.total, walked, triangles, o, d, t_max, any_hit, front_only
    )
    inverse, _ = inverse_direction(d)
    nodes = U(hierarchy.nodes)
    node = U(0) if walked & ((any_hit == 0) | (triangle < 0)) else nodes
    cells, entered = I(0), I(0)
    while node < nodes:
        cells += I(1)
        ax = (hierarchy.boxes[node, 0] - o[0]) * inverse[0]
        ay = (hierarchy.boxes[node, 1] - o[1]) * inverse[1]
        az = (hierarchy.boxes[node, 2] - o[2]) * inverse[2]
        bx = (hierarchy.boxes[node, 3] - o[0]) * inverse[0]
        by = (hierarchy.boxes[node, 4] - o[1]) * inverse[1]
        bz = (hierarchy.boxes[node, 5] - o[2]) * inverse[2]
        enter = larger(larger(smaller(ax, bx), smaller(ay, by)), larger(smaller(az, bz), F0))
        leave = smaller(smaller(larger(ax, bx), larger(ay, by)), larger(az, bz))
        escape = U(hierarchy.links[node, 0])
        if (enter <= leave) & (enter <= t):
            entered += I(1)
            k = U(hierarchy.links[node, 1])
            count = U(hierarchy.links[node, 2])
            node = escape if count > U(0) else node + U(1)
            end = k + count
            while k < end:
                candidate = hierarchy.lists[k]
                triangle, t, u, v = test_triangle(triangles, candidate, o, d, t_max, front_only, triangle, t, u, v)
                tests += I(1)
                k += U(1)
                if (any_hit != 0) & (triangle >= 0):
                    k, node = end, nodes
        else:
            node = escape
    rejected = I((entered == 0) & (tests == 0))
    return triangle, t, u, v, cells if entered > 0 else I(0), tests, rejected
