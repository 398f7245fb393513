"""A set-associative cache with least-recently-used replacement, and the fetches of warps that take turns on it.

Templates of `refsim.jit`; `texture_cache` calls them. Each set is a ring of its ways, doubly linked, in order of use:
a touch costs the same whatever the associativity. The state of a cache, all i32:

    slot    [lines]            the slot that holds a line of memory; −1 given up, −2 never held
    held    [sets * ways]      the line in a slot, −1 none; slots of set s are s * ways to (s + 1) * ways − 1
    newer, older  [sets * ways]  neighbours in the ring; older than the newest is the next to go
    newest  [sets]
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func

I = np.int32  # noqa: E741
HIT, EVICTED, NEVER = 0, 1, 2
FETCHES, MISSES, COMPULSORY = range(3)


@func
def clear(sets, ways, slot, held, newer, older, newest):
    """An empty cache."""
    slot[:] = I(-2)
    held[:] = I(-1)
    for s in range(sets):
        newest[s] = s * ways
        for way in range(ways):
            newer[s * ways + way] = s * ways + (way + ways - 1) % ways
            older[s * ways + way] = s * ways + (way + 1) % ways


@func
def touch(line, sets, ways, slot, held, newer, older, newest):
    """Fetches a line of memory: whether it was there (HIT), had been and was given up, or is new."""
    s = line % sets
    at = slot[line]
    outcome = HIT
    if at < 0:
        outcome = EVICTED if at == I(-1) else NEVER
        at = newer[newest[s]]  # the oldest, as the ring closes
        if held[at] >= 0:
            slot[held[at]] = I(-1)
        held[at] = line
        slot[line] = at
    top = newest[s]
    if at != top:
        if at != newer[top]:  # out of its place, in between the oldest and the newest
            older[newer[at]] = older[at]
            newer[older[at]] = newer[at]
            last = newer[top]
            older[last], newer[at] = at, last
            older[at], newer[top] = top, at
        newest[s] = at
    return outcome


@func
def count(outcome, row):
    """Into a row of fetches, misses, and those misses that no cache avoids."""
    row[FETCHES] += 1
    row[MISSES] += outcome != HIT
    row[COMPULSORY] += outcome == NEVER


def fetch_addresses(addresses, line, sets, ways, slot, held, newer, older, newest, hits):
    """One address after the other, i64[n]; `hits` bool[n]."""
    clear(sets, ways, slot, held, newer, older, newest)
    for i in range(addresses.shape[0]):
        hits[i] = touch(addresses[i] // line, sets, ways, slot, held, newer, older, newest) == HIT


def run_multiprocessor(
    passes, width, resident, offsets, elements, escape, payload, bases, line, sets, ways, slot, held, newer, older,
    newest, counts,
):  # fmt: skip
    """The warps of one multiprocessor, whose cache is empty before; adds to `counts` i64[kinds, 3].

    Lanes offsets i64[passes * warps * width + 1]: all warps' first pass, then their second. `resident` places take
    turns, an iteration each; a warp goes through its passes and leaves its place to the next warp that waits.
    In an iteration the active lanes fetch their escape indices, then payloads, then, those at a triangle, first,
    second and third vertices; one lane after the other.
    """
    warps = (offsets.shape[0] - 1) // (passes * width)
    clear(sets, ways, slot, held, newer, older, newest)
    warp, own_pass, done = np.full(resident, -1), np.zeros(resident, np.int64), np.zeros(resident, np.int64)
    waiting, busy = 0, True
    while busy:
        busy = False
        for place in range(resident):
            # Go on with this warp, its next pass, or the next warp: the first of them that has an element left
            found = False
            while not found:
                if warp[place] >= 0:
                    lane = (own_pass[place] * warps + warp[place]) * width
                    for j in range(width):
                        found |= offsets[lane + j] + done[place] < offsets[lane + j + 1]
                    if not found:
                        own_pass[place] += 1
                        done[place] = 0
                        if own_pass[place] == passes:
                            warp[place] = -1
                elif waiting < warps:
                    warp[place], own_pass[place], done[place] = waiting, 0, 0
                    waiting += 1
                else:
                    break
            if not found:
                continue
            busy = True
            lane, k = (own_pass[place] * warps + warp[place]) * width, done[place]
            done[place] += 1
            for kind in range(2):
                size = 4 if kind == 0 else 16
                for j in range(width):
                    if offsets[lane + j] + k < offsets[lane + j + 1]:
                        number = (bases[kind] + size * np.int64(elements[offsets[lane + j] + k])) // line
                        count(touch(number, sets, ways, slot, held, newer, older, newest), counts[kind])
            for corner in range(3):
                for j in range(width):
                    if offsets[lane + j] + k < offsets[lane + j + 1]:
                        element = elements[offsets[lane + j] + k]
                        if escape[element] == I(1) or escape[element] == I(0):
                            number = (bases[2] + 16 * np.int64(payload[element, corner])) // line
                            count(touch(number, sets, ways, slot, held, newer, older, newest), counts[2])
