"""Whether a traversal list is one, and where its nodes and triangles are; compiled. Template of `refsim.jit`.

`byte_layout` calls it on what it reads: a list that passes sends no ray out of its bounds and lets each ray end.
"""

from __future__ import annotations

FAULTS = (
    "",
    "an escape index that leads out of its node or is none",
    "a last primitive in its middle, or none at its end",
    "an element outside its root",
    "a triangle's number that is out of range",
    "a triangle for the second time",
    "vertices that are not those of its triangle",
    "an element that is not where the hierarchy has it",
)
SOUND, ESCAPE, LAST, ROOT, NUMBER, TWICE, CORNERS, PLACE = range(8)


def check_list(escape, payload, corners, owner, parent, node_at, triangle_at, open_at, open_end, open_node):
    """(0, 0), or what is wrong (a row of `FAULTS`) and with which element.

    Read: one list, `escape` i32[k], `payload` i32[k, 4]; `corners` i32[n, 3]; a sound tree, `owner` i32[n], `parent`
    i32[m]. Written: `node_at` i32[m], `triangle_at` i32[n] (−1: not in the list); `open_*` i64[k] are scratch, the
    spheres around an element from the root down: where they begin and end, and their numbers once known.
    """
    end = escape.shape[0]
    node_at[:], triangle_at[:] = -1, -1
    depth = 0
    for at in range(end):
        while depth > 0 and open_end[depth - 1] == at:
            depth -= 1
        if depth == 0 and at > 0:
            return ROOT, at
        bound = open_end[depth - 1] if depth > 0 else end
        step = escape[at]
        if step != 0 and step != 1:
            # A sphere holds at least the next element; only where it ends with the list it has no super-sibling
            following = end if step == -1 else at + step
            if step < -1 or (step > 0 and following >= end) or following > bound or following < at + 2:
                return ESCAPE, at
            open_at[depth], open_end[depth], open_node[depth] = at, following, -1
            depth += 1
            continue
        if (step == 0) != (at + 1 == end):
            return LAST, at
        if depth == 0:
            return ROOT, at
        row = payload[at, 3]
        if row < 0 or row >= owner.shape[0]:
            return NUMBER, at
        if triangle_at[row] >= 0:
            return TWICE, at
        for c in range(3):
            if payload[at, c] != corners[row, c]:
                return CORNERS, at
        triangle_at[row] = at
        # Its ancestors are the open spheres, innermost first
        node, level = owner[row], depth - 1
        while level >= 0 and open_node[level] < 0:
            if node < 0 or node_at[node] >= 0:
                return PLACE, at
            open_node[level], node_at[node] = node, open_at[level]
            node, level = parent[node], level - 1
        if node != (open_node[level] if level >= 0 else -1):
            return PLACE, at
    return SOUND, 0
