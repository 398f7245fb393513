"""The walk with an ordered stack, compiled. Templates of `refsim.jit`; `ordered_stack` calls them.

Whether a sphere is met is `traversal.misses_sphere`, the lists' own decision. Where it is entered decides the order,
and whether it is still of interest when its turn comes; so it must not be later than any hit inside:

    entry = max(0, k − √((r + κ)² − |c − o − k d|²) / |d| − κ)        k = w · (c − o), not clamped

With κ = 40 eps R, of which a hit point needs 15 (`traversal`): k is off by 8 eps R, the vector from the centre by
11 eps R, so the square below the root by 26 eps R r; what κ grows the radius by adds 50 eps R r to it. The root, its
product with 1 / |d| and the differences are off by 9 eps R. The last term pays for these and for k's own.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.jit import func
from refsim.papers.sphere_hierarchy.traversal import misses_sphere, per_length, slack_of

F0 = np.float32(0)
I = np.int32  # noqa: E741
U = np.uintp


def stack_bound(parent):
    """The most entries that can wait: on a way down, one less than the children of each node that is left. Read:
    `parent` i32[m], −1 the root."""
    nodes = parent.shape[0]
    spheres, waiting = np.zeros(nodes, np.int64), np.zeros(nodes, np.int64)
    for k in range(1, nodes):
        spheres[parent[k]] += 1
    most = 1
    for k in range(1, nodes):
        waiting[k] = waiting[parent[k]] + spheres[parent[k]] - 1
        most = max(most, waiting[k] + 1)
    return most


@func
def entry_of(o, d, w, slack, x, y, z, radius):
    """A parameter at or before the one where the ray enters the sphere; 0 if it starts inside."""
    x, y, z = x - o[0], y - o[1], z - o[2]
    k = x * w[0] + y * w[1] + z * w[2]
    x, y, z = x - k * d[0], y - k * d[1], z - k * d[2]
    reach = radius + slack
    half = reach * reach - (x * x + y * y + z * z)
    half = half if half > F0 else F0
    spread = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    entry = k - np.sqrt(half) * spread - slack
    return entry if entry > F0 else F0


def walk_ordered(
    rows, origin, direction, t_max, any_hit, front_only, spheres, children, starts, records, capacity, triangle, t, u,
    v, nodes, tests, deepest, written,
):  # fmt: skip
    """Rays `rows` i32[k], one after the other. A node's children are taken from the last to the first, triangles
    before spheres; of equal entries the sphere with the lower number is visited first."""
    waiting, entries = np.empty(capacity + 1, np.int32), np.empty(capacity + 1, np.float32)
    inner = I(spheres.shape[0])
    root = spheres[0]
    for j in range(rows.shape[0]):
        row = U(rows[j])
        limit = t_max[row]
        if not limit > F0:
            continue
        o = origin[row, 0], origin[row, 1], origin[row, 2]
        d = direction[row, 0], direction[row, 1], direction[row, 2]
        w, slack = per_length(d), slack_of(o, root)
        best, found, hit_u, hit_v = limit, I(-1), F0, F0
        visited, tested, most, pushed = I(1), I(0), I(0), I(0)
        top = 0
        if not misses_sphere(o, d, w, slack, best, root[0], root[1], root[2], root[3]):
            waiting[0], entries[0] = 0, F0
            top = 1
        while top > 0:
            # The nearest of those that wait; the one taken needs no place
            top -= 1
            if entries[top] > best:
                continue
            node = waiting[top]
            base = top
            first, i = starts[node], starts[node + 1]
            while i > first:
                i -= 1
                item = children[i]
                visited += I(1)
                if item < inner:
                    s = spheres[item]
                    if not misses_sphere(o, d, w, slack, best, s[0], s[1], s[2], s[3]):
                        entry = entry_of(o, d, w, slack, s[0], s[1], s[2], s[3])
                        place = top
                        while place > base and entries[place - 1] < entry:
                            waiting[place], entries[place] = waiting[place - 1], entries[place - 1]
                            place -= 1
                        waiting[place], entries[place] = item, entry
                        top += 1
                else:
                    tested += I(1)
                    number = item - inner
                    a = records[U(number)]
                    v0, n, m1, m2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11])
                    inside, at, weight_u, weight_v, den = intersect(o, d, limit, v0, n, m1, m2)
                    nearer = (at < best) | ((at == best) & (number < found))
                    if inside & nearer & ((den < F0) | (not front_only)):
                        best, found, hit_u, hit_v = at, number, weight_u, weight_v
                        if any_hit:
                            i, top, base = first, 0, 0
            if top > base:
                most = max(most, I(top - 1))
                pushed += I(top - base - 1)
        nodes[row], tests[row] = visited, tested
        deepest[row], written[row] = most, pushed
        if found >= I(0):
            triangle[row], t[row], u[row], v[row] = found, best, hit_u, hit_v
