"""Laying out traversal lists, compiled: children in order, then positions, escape indices and payloads.

Templates of `refsim.jit`; `lists` calls them. A node's number is smaller than those of its descendants, so one sweep
backwards sums the sizes of subtrees and one forwards hands out positions: no stack.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func

I = np.int32  # noqa: E741
LAST_PRIMITIVE, NO_SUPER_SIBLING = I(0), I(-1)
SHORT = 64  # children that need no further memory


@func
def key_along(direction, spread, spheres, triangles, item, nodes, latest):
    """Where an item's projection on `direction` begins (earliest first) or ends (latest last); float64.

    Items below `nodes` are spheres, the others triangles; `spread` is the direction's length.
    """
    if item < nodes:
        s = spheres[item]
        middle = direction[0] * s[0] + direction[1] * s[1] + direction[2] * s[2]
        reach = spread * s[3]
        return middle + reach if latest else middle - reach
    t = triangles[item - nodes]
    a = direction[0] * t[0, 0] + direction[1] * t[0, 1] + direction[2] * t[0, 2]
    b = direction[0] * t[1, 0] + direction[1] * t[1, 1] + direction[2] * t[1, 2]
    c = direction[0] * t[2, 0] + direction[1] * t[2, 1] + direction[2] * t[2, 2]
    return max(a, max(b, c)) if latest else min(a, min(b, c))


@func
def comes_before(key_a, a, key_b, b):
    """By key; of equal keys (or where one is not a number) the smaller item."""
    return key_a < key_b or (not key_b < key_a and a < b)


@func
def sort_by_key(items, keys, count):
    """Sorts the first `count` items and their keys: Shell's sort, plain insertion for the few that most nodes have."""
    gap = 1
    while gap < count // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, count):
            item, key, j = items[i], keys[i], i
            while j >= gap and comes_before(key, item, keys[j - gap], items[j - gap]):
                items[j], keys[j] = items[j - gap], keys[j - gap]
                j -= gap
            items[j], keys[j] = item, key
        gap //= 3


def group_children(parent, owner, children, starts):
    """The children of each node, `children` i32[nodes + n − 1] from `starts` i64[nodes + 1] on: spheres as their
    number, triangles as nodes + row, ascending."""
    nodes = parent.shape[0]
    starts[:] = 0
    for k in range(1, nodes):
        starts[parent[k] + 1] += 1
    for row in range(owner.shape[0]):
        starts[owner[row] + 1] += 1
    for k in range(nodes):
        starts[k + 1] += starts[k]
    at = starts[:-1].copy()
    for k in range(1, nodes):
        children[at[parent[k]]] = k
        at[parent[k]] += 1
    for row in range(owner.shape[0]):
        children[at[owner[row]]] = nodes + row
        at[owner[row]] += 1


def list_sizes(parent, owner, kept, size):
    """Elements of each node's subtree with the kept triangles alone, `size` i32[nodes] (0: it holds none)."""
    size[:] = 0
    for row in range(owner.shape[0]):
        if kept[row]:
            size[owner[row]] += 1
    for k in range(parent.shape[0] - 1, -1, -1):
        if size[k] > 0:
            size[k] += 1
            if k > 0:
                size[parent[k]] += size[k]


def lay_out(
    spheres, triangles, corners, children, starts, size, kept, direction, latest, node_at, triangle_at, escape, payload
):
    """One list: `escape` i32[m] and `payload` i32[m, 4] in the paper's layout; where each node and triangle went,
    `node_at` i32[nodes], `triangle_at` i32[n] (−1: culled, or nothing of it kept)."""
    nodes = spheres.shape[0]
    spread = np.sqrt(direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2])
    bits = spheres.view(np.int32)
    end = size[0]
    items, keys = np.empty(SHORT, np.int64), np.empty(SHORT)
    after = np.empty(nodes, np.int32)  # position of a node's super-sibling, `end` if it has none
    node_at[:], triangle_at[:] = -1, -1
    if end == 0:
        return
    node_at[0], after[0] = 0, end
    for node in range(nodes):
        at = node_at[node]
        if at < 0:
            continue
        escape[at] = after[node] - at if after[node] < end else NO_SUPER_SIBLING
        for c in range(4):
            payload[at, c] = bits[node, c]
        # The kept children, sorted along the list's direction
        first, count = starts[node], starts[node + 1] - starts[node]
        if count > items.size:
            items, keys = np.empty(2 * count, np.int64), np.empty(2 * count)
        held = 0
        for i in range(first, first + count):
            item = children[i]
            if size[item] > 0 if item < nodes else kept[item - nodes]:
                items[held] = item
                keys[held] = key_along(direction, spread, spheres, triangles, item, nodes, latest)
                held += 1
        sort_by_key(items, keys, held)
        # Their places follow each other; an escape leads to the next one, or past the parent
        at += 1
        for i in range(held):
            item = items[i]
            length = size[item] if item < nodes else 1
            following = at + length if i + 1 < held else after[node]
            if item < nodes:
                node_at[item], after[item] = at, following
            else:
                row = item - nodes
                triangle_at[row] = at
                escape[at] = I(1) if at + 1 < end else LAST_PRIMITIVE
                for c in range(3):
                    payload[at, c] = corners[row, c]
                payload[at, 3] = I(row)
            at += length
