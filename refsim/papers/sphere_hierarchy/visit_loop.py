"""Which elements each ray visits: the loop of `traversal.walk` that writes them down. Template of `refsim.jit`.

The decisions are those of the same device functions on the same numbers; `visits` checks that the counts agree.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.papers.sphere_hierarchy.traversal import misses_sphere, per_length, slack_of

F0 = np.float32(0)
I = np.int32  # noqa: E741
U = np.uintp


def record_walk(
    rows, lists, starts, origin, direction, t_max, escape, spheres, payload, first, records, root, any_hit, front_only,
    offset, triangle, t, u, v, base, at, elements,
):  # fmt: skip
    """`traversal.walk` for rows i32[k], where −1 is no ray.

    Instead of counts: `elements` i32 gets `base` + the element's number, from place `at` i64[k] of each row on, which
    is moved to the place after the last.
    """
    for j in range(rows.shape[0]):
        if rows[j] < 0:
            continue
        row = U(rows[j])
        if not t_max[row] > F0:
            continue
        o = origin[row, 0], origin[row, 1], origin[row, 2]
        d = direction[row, 0], direction[row, 1], direction[row, 2]
        w, slack = per_length(d), slack_of(o, root)
        best, found = t[row], triangle[row]
        if found < 0:
            best = t_max[row]
        elif any_hit:
            continue
        limit = t_max[row]
        node = U(first[lists[row]] + starts[row])
        end = U(first[lists[row] + 1])
        place = at[j]
        hit_u, hit_v = u[row], v[row]
        while node < end:
            if place < elements.shape[0]:  # a loop that went wrong is found by its counts, not by a crash
                elements[place] = base + I(node)
            place += 1
            step = escape[node]
            if step == I(1) or step == I(0):
                a = records[U(payload[node, 3])]
                number = payload[node, 3] + offset
                v0, n, m1, m2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11])
                inside, near, weight_u, weight_v, den = intersect(o, d, limit, v0, n, m1, m2)
                nearer = (near < best) | ((near == best) & (number < found))
                if inside & nearer & ((den < F0) | (not front_only)):
                    best, found, hit_u, hit_v = near, number, weight_u, weight_v
                    if any_hit:
                        break
            else:
                s = spheres[node]
                if not misses_sphere(o, d, w, slack, best, s[0], s[1], s[2], s[3]):
                    step = I(1)
            node = node + U(step) if step > I(0) else end
        at[j] = place
        if found >= 0:
            triangle[row], t[row], u[row], v[row] = found, best, hit_u, hit_v
