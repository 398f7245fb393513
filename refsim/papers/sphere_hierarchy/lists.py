"""Traversal lists (section 2.1): a hierarchy as arrays in depth-first order, one an ordering direction.

    element   escape index i32, relative: where the depth-first walk would go on had the node no children
                  1   a triangle (always followed by the next element)
                  0   the last primitive             −1   an internal node with no super-sibling
              payload 128 bits: centre and radius as float32, or three vertex indices and the triangle's number
    vertices  positions in a separate array, shared by all lists

The kernels run on these very bytes. Beside them they read a triangle's record (first vertex, normal and two vectors:
48 bytes, as much as three padded vertices), made from the vertices once: `refsim.geometry.triangle`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.geometry.triangle import pack_triangles
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.culling import check_culling, kept_triangles
from refsim.papers.sphere_hierarchy.directions import LISTS, list_directions
from refsim.papers.sphere_hierarchy.hierarchy import Hierarchy
from refsim.papers.sphere_hierarchy.lists_layout import group_children, lay_out, list_sizes
from refsim.papers.sphere_hierarchy.shared_vertices import SharedVertices

ORDERS = ("earliest_first", "latest_last")
ELEMENT_BYTES = 4 + 16


@dataclass(frozen=True, eq=False)
class TraversalLists:
    """All lists of one hierarchy, one after the other.

    escape      i32[k]; payload i32[k, 4] (`spheres` is the same memory as float32)
    first       i64[lists + 1], where each list begins; a list without triangles is empty
    directions  f64[lists, 3], along which each is ordered
    node_at, triangle_at  i32[lists, m], i32[lists, n]: the element of a node or triangle within its list, −1: not in it
    records     f32[n, 12], rows (v0, n, m1, m2) for the intersection test
    """

    hierarchy: Hierarchy
    vertices: SharedVertices
    records: NDArray[np.float32]
    escape: NDArray[np.int32]
    payload: NDArray[np.int32]
    first: NDArray[np.int64]
    directions: NDArray[np.float64]
    node_at: NDArray[np.int32]
    triangle_at: NDArray[np.int32]
    order: str
    culling: str | None

    @property
    def count(self) -> int:
        """Number of lists."""
        return len(self.directions)

    @property
    def spheres(self) -> NDArray[np.float32]:
        """The payload read as centres and radii, f32[k, 4]."""
        return self.payload.view(np.float32)

    def length(self, number: int) -> int:
        """Elements of a list."""
        return int(self.first[number + 1] - self.first[number])


def build_lists(
    hierarchy: Hierarchy, lists: int = 6, order: str = "earliest_first", culling: str | None = None
) -> TraversalLists:
    """The lists of a hierarchy. Raises `InputError` for another number of lists or order, or a rule of other lists."""
    if lists not in LISTS:
        raise InputError(f"lists is {lists!r}; it must be one of {', '.join(map(str, LISTS))}.")
    if order not in ORDERS:
        raise InputError(f"order is {order!r}; it must be one of {', '.join(map(repr, ORDERS))}.")
    check_culling(culling, lists, "front")
    triangles = hierarchy.triangles
    packed = pack_triangles(triangles)
    records = np.column_stack([packed.v0, packed.n, packed.m1, packed.m2])
    vertices = SharedVertices.of(triangles)
    directions = list_directions(lists)

    # Which triangles each list keeps, and how many elements that makes
    n, m = len(triangles), len(hierarchy)
    children, starts = np.empty(m + n - 1, np.int32), np.empty(m + 1, np.int64)
    specialise(group_children, {})(hierarchy.parent, hierarchy.owner, children, starts)
    kept, sizes = [], []
    for direction in directions:
        kept.append(kept_triangles(packed.n, ~packed.degenerate, direction, culling))
        sizes.append(np.empty(m, np.int32))
        specialise(list_sizes, {})(hierarchy.parent, hierarchy.owner, kept[-1], sizes[-1])
    first = np.zeros(lists + 1, np.int64)
    np.cumsum([int(size[0]) for size in sizes], out=first[1:])

    escape, payload = np.empty(first[-1], np.int32), np.empty((first[-1], 4), np.int32)
    node_at, triangle_at = np.empty((lists, m), np.int32), np.empty((lists, n), np.int32)
    write: Any = specialise(lay_out, {})
    for k, direction in enumerate(directions):
        part = slice(first[k], first[k + 1])
        write(
            hierarchy.spheres, triangles, vertices.corners, children, starts, sizes[k], kept[k], direction,
            order == "latest_last", node_at[k], triangle_at[k], escape[part], payload[part],
        )  # fmt: skip
    return TraversalLists(
        hierarchy, vertices, records, escape, payload, first, directions, node_at, triangle_at, order, culling
    )
