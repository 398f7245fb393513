"""Packets: 64 rays walk one list together, and nothing changes. Template of `refsim.jit`.

Each lane keeps the element it goes on with and is active where that is the packet's; the packet moves to the smallest.
Hits and counts are those of the scalar loop (`traversal.walk`), which has the equations.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.papers.sphere_hierarchy.traversal import misses_sphere, per_length, slack_of

LANES = 64
F0, F1 = np.float32(0), np.float32(1)
I = np.int32  # noqa: E741
U = np.uintp
ENDED = I(2**31 - 1)


def walk_packets(
    rows, lists, starts, origin, direction, t_max, escape, spheres, payload, first, records, root, any_hit, front_only,
    offset, triangle, t, u, v, nodes, tests,
):  # fmt: skip
    """`traversal.walk` for rows of which those of one list stand together."""
    lane = np.empty((14, LANES), np.float32)
    following, visited, tested = np.empty(LANES, np.int32), np.empty(LANES, np.int32), np.empty(LANES, np.int32)
    found, row_of = np.empty(LANES, np.int32), np.empty(LANES, np.int32)
    done = 0
    while done < rows.shape[0]:
        # The next rows of one list; lanes that stay empty have ended
        number = lists[U(rows[done])]
        base = first[number]
        end = I(first[number + 1] - base)
        many = 0
        while many < LANES and done + many < rows.shape[0] and lists[U(rows[done + many])] == number:
            many += 1
        current = ENDED
        for j in range(LANES):
            j = U(j)
            row = U(rows[done + j]) if j < many else U(rows[done])
            o = origin[row, 0], origin[row, 1], origin[row, 2]
            d = direction[row, 0], direction[row, 1], direction[row, 2]
            w = per_length(d)
            lane[0, j], lane[1, j], lane[2, j] = o
            lane[3, j], lane[4, j], lane[5, j] = d
            lane[6, j], lane[7, j], lane[8, j] = w
            lane[9, j] = slack_of(o, root)
            lane[10, j] = t_max[row]
            found[j] = triangle[row]
            lane[11, j] = t[row] if found[j] >= I(0) else t_max[row]
            lane[12, j], lane[13, j] = u[row], v[row]
            row_of[j] = I(row)
            visited[j], tested[j] = I(0), I(0)
            begins = (j < many) & (t_max[row] > F0) & (starts[row] < end) & ((found[j] < I(0)) | (not any_hit))
            following[j] = starts[row] if begins else ENDED
            current = min(current, following[j])
        while current < end:
            at = U(base + current)
            step = escape[at]
            past = current + step if step > I(0) else ENDED
            low = ENDED
            if step == I(1) or step == I(0):
                a = records[U(payload[at, 3])]
                own = payload[at, 3] + offset
                v0, n, m1, m2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11])
                for j in range(LANES):
                    j = U(j)
                    active = following[j] == current
                    o = lane[0, j], lane[1, j], lane[2, j]
                    d = lane[3, j], lane[4, j], lane[5, j]
                    inside, near, weight_u, weight_v, den = intersect(o, d, lane[10, j], v0, n, m1, m2)
                    nearer = (near < lane[11, j]) | ((near == lane[11, j]) & (own < found[j]))
                    taken = active & inside & nearer & ((den < F0) | (not front_only))
                    lane[11, j] = near if taken else lane[11, j]
                    lane[12, j] = weight_u if taken else lane[12, j]
                    lane[13, j] = weight_v if taken else lane[13, j]
                    found[j] = own if taken else found[j]
                    on = ENDED if taken & any_hit else past
                    goes = on if active else following[j]
                    following[j] = goes
                    visited[j] += I(active)
                    tested[j] += I(active)
                    low = min(low, goes)
            else:
                s = spheres[at]
                x, y, z, radius = s[0], s[1], s[2], s[3]
                child = current + I(1)
                for j in range(LANES):
                    j = U(j)
                    active = following[j] == current
                    o = lane[0, j], lane[1, j], lane[2, j]
                    d = lane[3, j], lane[4, j], lane[5, j]
                    w = lane[6, j], lane[7, j], lane[8, j]
                    misses = misses_sphere(o, d, w, lane[9, j], lane[11, j], x, y, z, radius)
                    on = past if misses else child
                    goes = on if active else following[j]
                    following[j] = goes
                    visited[j] += I(active)
                    low = min(low, goes)
            current = low
        for j in range(many):
            j = U(j)
            row = U(row_of[j])
            nodes[row] += visited[j]
            tests[row] += tested[j]
            if found[j] >= I(0):
                triangle[row], t[row], u[row], v[row] = found[j], lane[11, j], lane[12, j], lane[13, j]
        done += many
