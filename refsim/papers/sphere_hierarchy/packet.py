"""Packets: 256 rays walk one list together, and nothing changes. Template of `refsim.jit`.

Each lane keeps the element it goes on with and is active where that is the packet's; the packet moves to the smallest.
The lanes are sixteen groups of 16, a vector each, and a group none of whose lanes is active is passed over: so elements
are fetched and their kind decided once for a tile of the picture, and only groups that need it do the arithmetic. Hits
and counts are those of the scalar loop (`traversal.walk`), which has the equations.

The columns of a group lie together. Indices stay int32 (numba adds int32 to int64, which would halve the vectors), and
lanes are filled in a loop with an early end, so that it stays scalar: gathers are slower than loads.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.papers.sphere_hierarchy.traversal import ball_at, misses_sphere, per_length, record_at, slack_of

GROUPS, LANES = 16, 16
PACKET = GROUPS * LANES  # a tile of 16 × 16 pixels; 64 and 128 rays are slower, coherent or not
F0 = np.float32(0)
I = np.int32  # noqa: E741
U = np.uintp
I0, I1 = I(0), I(1)
ENDED = I(2**31 - 1)


def walk_packets(
    rows, lists, starts, origin, direction, t_max, escape, spheres, payload, first, records, root, any_hit, front_only,
    offset, triangle, t, u, v, nodes, tests,
):  # fmt: skip
    """`traversal.walk` for rows of which those of one list stand together."""
    # Columns of a group: o, d, w, κ, t_max, best t, u, v; the next element, the triangle found, nodes and tests
    ray = np.empty((GROUPS, 14, LANES), np.float32)
    ints = np.empty((GROUPS, 4, LANES), np.int32)
    smallest = np.empty(GROUPS, np.int32)
    balls, words, floats = spheres.ravel(), payload.ravel(), records.ravel()
    done = 0
    while done < rows.shape[0]:
        # The next rows of one list; lanes that stay empty have ended
        number = lists[U(rows[done])]
        base = first[number]
        end = I(first[number + 1] - base)
        many = min(PACKET, rows.shape[0] - done)
        if lists[U(rows[done + many - 1])] != number:
            many = 1
            while lists[U(rows[done + many])] == number:
                many += 1
        for i in range(PACKET):
            if i >= many:
                break
            row = U(rows[done + i])
            g, j = U(i) // U(LANES), U(i) % U(LANES)
            ray[g, 0, j], ray[g, 1, j], ray[g, 2, j] = origin[row, 0], origin[row, 1], origin[row, 2]
            ray[g, 3, j], ray[g, 4, j], ray[g, 5, j] = direction[row, 0], direction[row, 1], direction[row, 2]
            limit, held = t_max[row], triangle[row]
            ray[g, 10, j] = limit
            ray[g, 11, j] = t[row] if held >= I0 else limit
            ints[g, 1, j] = held
            begins = (limit > F0) & ((held < I0) | (not any_hit))
            ints[g, 0, j] = starts[row] if begins else ENDED
        for i in range(many, PACKET):
            ints[U(i) // U(LANES), 0, U(i) % U(LANES)] = ENDED
        current = ENDED
        for g in range(GROUPS):
            g = U(g)
            low = ENDED
            for j in range(LANES):
                j = U(j)
                w = per_length((ray[g, 3, j], ray[g, 4, j], ray[g, 5, j]))
                ray[g, 6, j], ray[g, 7, j], ray[g, 8, j] = w
                ray[g, 9, j] = slack_of((ray[g, 0, j], ray[g, 1, j], ray[g, 2, j]), root)
                ints[g, 2, j], ints[g, 3, j] = I0, I0
                low = min(low, ints[g, 0, j])
            smallest[g] = low
            current = min(current, low)
        tested = False
        while current < end:
            at = U(base + current)
            step = escape[at]
            child = I(current + I1)
            past = I(current + step) if step > I0 else ENDED
            if (step == I1) | (step == I0):
                tested = True
                own = words[U(4) * at + U(3)]
                v0, n, m1, m2 = record_at(floats, U(12) * U(own))
                own = I(own + offset)
                for g in range(GROUPS):
                    g = U(g)
                    if smallest[g] != current:
                        continue
                    low = ENDED
                    for j in range(LANES):
                        j = U(j)
                        active = ints[g, 0, j] == current
                        o = ray[g, 0, j], ray[g, 1, j], ray[g, 2, j]
                        d = ray[g, 3, j], ray[g, 4, j], ray[g, 5, j]
                        inside, near, weight_u, weight_v, den = intersect(o, d, ray[g, 10, j], v0, n, m1, m2)
                        best, held = ray[g, 11, j], ints[g, 1, j]
                        nearer = (near < best) | ((near == best) & (own < held))
                        taken = active & inside & nearer & ((den < F0) | (not front_only))
                        ray[g, 11, j] = near if taken else best
                        ray[g, 12, j] = weight_u if taken else ray[g, 12, j]
                        ray[g, 13, j] = weight_v if taken else ray[g, 13, j]
                        ints[g, 1, j] = own if taken else held
                        on = ENDED if taken & any_hit else past
                        goes = on if active else ints[g, 0, j]
                        ints[g, 0, j] = goes
                        ints[g, 2, j] = I(ints[g, 2, j] + I(active))
                        ints[g, 3, j] = I(ints[g, 3, j] + I(active))
                        low = min(low, goes)
                    smallest[g] = low
            else:
                x, y, z, radius = ball_at(balls, U(4) * at)
                for g in range(GROUPS):
                    g = U(g)
                    if smallest[g] != current:
                        continue
                    low = ENDED
                    for j in range(LANES):
                        j = U(j)
                        active = ints[g, 0, j] == current
                        o = ray[g, 0, j], ray[g, 1, j], ray[g, 2, j]
                        d = ray[g, 3, j], ray[g, 4, j], ray[g, 5, j]
                        w = ray[g, 6, j], ray[g, 7, j], ray[g, 8, j]
                        misses = misses_sphere(o, d, w, ray[g, 9, j], ray[g, 11, j], x, y, z, radius)
                        on = past if misses else child
                        goes = on if active else ints[g, 0, j]
                        ints[g, 0, j] = goes
                        low = min(low, goes)
                        ints[g, 2, j] = I(ints[g, 2, j] + I(active))
                    smallest[g] = low
            current = smallest[0]
            for g in range(1, GROUPS):
                current = min(current, smallest[U(g)])
        # Only a triangle test can have found something
        for i in range(many):
            nodes[U(rows[done + i])] += ints[U(i) // U(LANES), 2, U(i) % U(LANES)]
        if tested:
            for i in range(many):
                row = U(rows[done + i])
                g, j = U(i) // U(LANES), U(i) % U(LANES)
                tests[row] += ints[g, 3, j]
                if ints[g, 1, j] != triangle[row]:
                    triangle[row], t[row], u[row], v[row] = ints[g, 1, j], ray[g, 11, j], ray[g, 12, j], ray[g, 13, j]
        done += many
