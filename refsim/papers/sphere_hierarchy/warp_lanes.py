"""What a warp's lanes do together in each iteration, counted. Templates of `refsim.jit`; `warps` calls them."""

from __future__ import annotations

import numpy as np

from refsim.jit import func

I = np.int32  # noqa: E741

# Columns of the table, in the order of the fields of `warps.Account`
(NODES, TESTS, ITERATIONS, DISTINCT, SPHERE_ISSUES, TRIANGLE_ISSUES, UNION,
 ESCAPE_LINES, PAYLOAD_LINES, VERTEX_LINES) = range(10)  # fmt: skip
COLUMNS = 10
ENDED = I(2**31 - 1)


@func
def distinct(values, many, held):
    """How many of values[:many] differ; `held` is room for as many."""
    kept = 0
    for i in range(many):
        known = False
        for j in range(kept):
            known |= held[j] == values[i]
        if not known:
            held[kept] = values[i]
            kept += 1
    return kept


def account_warps(width, line, offsets, elements, escape, payload, bases, table):
    """Fills `table` i64[warps, COLUMNS] for lanes offsets i64[warps * width + 1] of `visits.Visits`; `line` in bytes.

    Lines are those of one fetch by the warp: of the escape index, of the payload, and of each of three vertices.
    """
    many = np.empty(width, np.int32)
    value, held = np.empty(width, np.int64), np.empty(width, np.int64)
    testing = np.empty(width, np.int32)
    at = np.empty(width, np.int64)
    for warp in range(table.shape[0]):
        lane = warp * width
        row = table[warp]
        row[:] = 0
        longest = 0
        for j in range(width):
            many[j] = offsets[lane + j + 1] - offsets[lane + j]
            row[NODES] += many[j]
            longest = max(longest, many[j])
        row[ITERATIONS] = longest

        # In lock-step: lane j works at its own k-th element
        for k in range(longest):
            active, tests = 0, 0
            for j in range(width):
                if k < many[j]:
                    element = elements[offsets[lane + j] + k]
                    value[active] = element
                    active += 1
                    if escape[element] == I(1) or escape[element] == I(0):
                        testing[tests] = element
                        tests += 1
            row[DISTINCT] += distinct(value, active, held)
            row[TESTS] += tests
            row[SPHERE_ISSUES] += tests < active
            row[TRIANGLE_ISSUES] += tests > 0
            for j in range(active):
                at[j] = value[j]
                value[j] = (bases[0] + 4 * at[j]) // line
            row[ESCAPE_LINES] += distinct(value, active, held)
            for j in range(active):
                value[j] = (bases[1] + 16 * at[j]) // line
            row[PAYLOAD_LINES] += distinct(value, active, held)
            for corner in range(3 if tests else 0):
                for j in range(tests):
                    value[j] = (bases[2] + 16 * payload[testing[j], corner]) // line
                row[VERTEX_LINES] += distinct(value, tests, held)

        # As a packet: the warp goes to the smallest element that a lane has still before it
        for j in range(width):
            at[j] = offsets[lane + j]
        while True:
            low = ENDED
            for j in range(width):
                if at[j] < offsets[lane + j + 1]:
                    low = min(low, elements[at[j]])
            if low == ENDED:
                break
            row[UNION] += 1
            for j in range(width):
                if at[j] < offsets[lane + j + 1] and elements[at[j]] == low:
                    at[j] += 1
