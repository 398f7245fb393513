"""Traversal lists in plain Python: Efficient Stackless Ray Traversal, section 2.1, as a recursive depth-first walk.

    escape   i32, relative: to the next element after a node's subtree; 1 a triangle, 0 the last primitive, −1 an
             internal node after whose subtree the list ends
    payload  128 bits: centre and radius, or three vertex numbers and the triangle's

Same bytes as `refsim.papers.sphere_hierarchy.lists`; which triangles a list leaves out is that room's `culling`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refsim.reference.sphere_tree import SphereTree
from refsim.reference.triangle import pack

# Rounding of d · n in float32, for unit vectors: three products, two sums, 4 eps; and as much again
SURPLUS = 8.0 * 2.0**-24


@dataclass(frozen=True, eq=False)
class Lists:
    """All lists of one tree, one after the other; `first` i64[lists + 1] says where each begins.

    node_at i32[lists, m], triangle_at i32[lists, n]: element of a node or triangle within its list, −1 not in it;
    above i64[k]: the element, within its list, of an element's parent (−1 the root).
    """

    tree: SphereTree
    count: int
    escape: np.ndarray
    payload: np.ndarray
    first: np.ndarray
    node_at: np.ndarray
    triangle_at: np.ndarray
    above: np.ndarray
    records: tuple[np.ndarray, ...]

    @property
    def spheres(self) -> np.ndarray:
        """The payload read as centres and radii, f32[k, 4]."""
        return self.payload.view(np.float32)

    def is_triangle(self) -> np.ndarray:
        """bool[k]: by the escape index alone, as the paper says."""
        return (self.escape == 1) | (self.escape == 0)


def directions(lists: int) -> list[tuple[float, float, float]]:
    """Figure 2: what 1, 2, 6 or 8 lists are ordered along."""
    if lists == 8:
        return [(x, y, z) for z in (1.0, -1.0) for y in (1.0, -1.0) for x in (1.0, -1.0)]
    six = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    return six[:lists]


def list_of_rays(direction: np.ndarray, lists: int) -> np.ndarray:
    """The list of each ray, i32[n], from f32[n, 3]: the sextant's or octant's; borders go to the positive side and to
    the first of equal components."""
    below = (direction < 0).astype(np.int32)
    if lists == 8:
        return below[:, 0] + 2 * below[:, 1] + 4 * below[:, 2]
    if lists == 2:
        return below[:, 0]
    x, y, z = np.abs(direction).T
    along_x = (x >= y) & (x >= z)
    axis = np.where(along_x, 0, np.where(y >= z, 1, 2))
    six = 2 * axis + below[np.arange(len(below)), axis]
    return (six if lists == 6 else np.zeros(len(below))).astype(np.int32)


def culled(
    normals: np.ndarray, degenerate: np.ndarray, along: tuple[float, float, float], rule: str | None
) -> np.ndarray:
    """Which triangles (normals f32[n, 3]) a list leaves out by that rule, bool[n]."""
    n = normals.astype(np.float64)
    if rule is None:
        return np.zeros(len(n), np.bool_)
    if rule == "octant":
        behind = np.ones(len(n), np.bool_)
        for a in range(3):
            behind &= n[:, a] * along[a] >= SURPLUS
        return behind & ~degenerate
    axis = int(np.argmax(np.abs(along)))
    b, c = (np.abs(n[:, (axis + k) % 3]) for k in (1, 2))
    into = n[:, axis] * along[axis]
    if rule == "sextant_safe":
        return (into >= b + c + SURPLUS) & ~degenerate
    if rule == "sextant_opposite":
        into = -into
    return (into >= np.maximum(b, c)) & ~degenerate


def traversal_lists(tree: SphereTree, lists: int, order: str, rule: str | None) -> Lists:
    """The lists of a tree: order "earliest_first" or "latest_last"."""
    nodes, count = len(tree.spheres), len(tree.triangles)
    v0, n, _, m1, m2, degenerate = pack(tree.triangles)
    corners = vertex_numbers(tree.triangles)
    children: list[list[int]] = [[] for _ in range(nodes)]
    for node in range(1, nodes):
        children[tree.parent[node]].append(node)
    for row in range(count):
        children[tree.owner[row]].append(nodes + row)
    escape: list[int] = []
    payload: list[np.ndarray] = []
    above: list[int] = []
    first = [0]
    node_at, triangle_at = np.full((lists, nodes), -1, np.int32), np.full((lists, count), -1, np.int32)
    for number, along in enumerate(directions(lists)):
        kept = ~culled(n, degenerate, along, rule)
        keys = [key_of(tree, item, along, order) for item in range(nodes + count)]
        occupied = holding(tree, kept)
        begin = len(escape)

        def walk(node: int, parent: int, keys: list[float] = keys, occupied: np.ndarray = occupied,
                 begin: int = begin, number: int = number) -> None:  # fmt: skip
            at = len(escape)
            node_at[number, node] = at - begin
            escape.append(0)
            payload.append(tree.spheres[node].view(np.int32))
            above.append(parent)
            for item in sorted((i for i in children[node] if occupied[i]), key=lambda i: (keys[i], i)):
                if item < nodes:
                    walk(item, at - begin)
                else:
                    triangle_at[number, item - nodes] = len(escape) - begin
                    escape.append(1)
                    payload.append(np.array([*corners[item - nodes], item - nodes], np.int32))
                    above.append(at - begin)
            escape[at] = len(escape) - at

        if kept.any():
            walk(0, -1)
        for at in range(begin, len(escape)):
            if at + escape[at] == len(escape):  # nothing comes after
                escape[at] = 0 if escape[at] == 1 else -1
        first.append(len(escape))
    columns = np.array(escape, np.int32), np.array(payload, np.int32).reshape(-1, 4), np.array(first, np.int64)
    return Lists(tree, lists, *columns, node_at, triangle_at, np.array(above, np.int64), (v0, n, m1, m2))


def holding(tree: SphereTree, kept: np.ndarray) -> np.ndarray:
    """Which nodes and triangles are in a list, bool[m + n]: kept triangles, and the nodes above them."""
    inside = np.zeros(len(tree.spheres), np.bool_)
    for node in tree.owner[kept]:
        while node >= 0 and not inside[node]:
            inside[node] = True
            node = tree.parent[node]
    return np.concatenate([inside, kept])


def key_of(tree: SphereTree, item: int, along: tuple[float, float, float], order: str) -> float:
    """Where an item's projection on `along` begins, or ends if the latest come last. Spheres first, then triangles."""
    x, y, z = along
    if item < len(tree.spheres):
        s = tree.spheres[item].astype(np.float64)
        middle, extent = x * s[0] + y * s[1] + z * s[2], np.sqrt(x * x + y * y + z * z) * s[3]
        return float(middle + extent if order == "latest_last" else middle - extent)
    t = tree.triangles[item - len(tree.spheres)].astype(np.float64)
    ends = x * t[:, 0] + y * t[:, 1] + z * t[:, 2]
    return float(ends.max() if order == "latest_last" else ends.min())


def vertex_numbers(triangles: np.ndarray) -> np.ndarray:
    """Rows i32[n, 3] of the array of distinct vertices, by bits, in order of first appearance."""
    seen: dict[bytes, int] = {}
    numbers = [seen.setdefault(vertex.tobytes(), len(seen)) for vertex in triangles.reshape(-1, 3)]
    return np.array(numbers, np.int32).reshape(-1, 3)
