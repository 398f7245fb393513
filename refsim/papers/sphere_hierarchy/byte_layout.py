"""Traversal lists as the bytes that go to the device (section 2.1), and back.

    escape    4 bytes an element, relative escape index
    payload   16 bytes an element, a sphere, or three vertex indices and the triangle's number
    vertices  16 bytes a vertex: x, y, z, 0
    heads     8 bytes a list: the element where it begins, counted through all lists; then where the last one ends.
              Heads of polygons and cells (`heads`) are not among these bytes

All little-endian; the arrays are separate, as the textures that the paper binds. Its vertices are read through a 1-D
texture, which has texels of one, two or four numbers: hence 16 bytes and not 12. The lists lie one after the other.

The host keeps beside them what tells a node's and a triangle's elements (section 5): `parent`, `owner`, `corners`.
Triangles, spheres, margins and records follow from these bytes, so `from_bytes` gives every array back bit for bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin
from refsim.geometry.triangle import TriangleRecords, pack_triangles
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.culling import RULES, check_culling, kept_triangles
from refsim.papers.sphere_hierarchy.directions import LISTS, list_directions
from refsim.papers.sphere_hierarchy.hierarchy import Hierarchy
from refsim.papers.sphere_hierarchy.list_check import FAULTS, check_list
from refsim.papers.sphere_hierarchy.lists import ORDERS, TraversalLists
from refsim.papers.sphere_hierarchy.refit_nodes import refit_spheres
from refsim.papers.sphere_hierarchy.shared_vertices import SharedVertices

ESCAPE_BYTES, PAYLOAD_BYTES, VERTEX_BYTES, HEAD_BYTES = 4, 16, 16, 8


class ListBytes(NamedTuple):
    """What the device holds (escape, payload, vertices, heads) and what the host keeps (parent, owner, corners)."""

    escape: bytes
    payload: bytes
    vertices: bytes
    heads: bytes
    parent: bytes
    owner: bytes
    corners: bytes


class Sizes(NamedTuple):
    """Bytes on the device. escape, payload: one number a list; vertices and heads serve all lists."""

    escape: tuple[int, ...]
    payload: tuple[int, ...]
    vertices: int
    heads: int

    @property
    def lists(self) -> tuple[int, ...]:
        """Bytes of each list without the vertices."""
        return tuple(a + b for a, b in zip(self.escape, self.payload, strict=True))

    @property
    def total(self) -> int:
        """All that a copy of the scene moves (Table 3)."""
        return sum(self.lists) + self.vertices + self.heads

    def table(self) -> list[dict[str, Any]]:
        """A row a part: what it is, how many entries it has, and its bytes."""
        rows: list[dict[str, Any]] = []
        for k, (escape, payload) in enumerate(zip(self.escape, self.payload, strict=True)):
            rows.append({"part": f"list {k}", "entries": escape // ESCAPE_BYTES, "bytes": escape + payload})
        rows.append({"part": "vertices", "entries": self.vertices // VERTEX_BYTES, "bytes": self.vertices})
        rows.append({"part": "heads", "entries": self.heads // HEAD_BYTES, "bytes": self.heads})
        return [*rows, {"part": "total", "entries": None, "bytes": self.total}]


def bytes_of(lists: TraversalLists) -> Sizes:
    """Bytes of lists on the device; those that `to_bytes` makes, without making them."""
    lengths = [lists.length(k) for k in range(lists.count)]
    escape, payload = (tuple(size * length for length in lengths) for size in (ESCAPE_BYTES, PAYLOAD_BYTES))
    return Sizes(escape, payload, VERTEX_BYTES * len(lists.vertices.positions), HEAD_BYTES * len(lists.first))


def to_bytes(lists: TraversalLists) -> ListBytes:
    """The bytes of lists."""
    h, corners = lists.hierarchy, lists.vertices.corners
    integers = [array.astype("<i4").tobytes() for array in (lists.escape, lists.payload, h.parent, h.owner, corners)]
    escape, payload, parent, owner, corner_bytes = integers
    vertices = vertex_texels(lists.vertices.positions).tobytes()
    return ListBytes(escape, payload, vertices, lists.first.astype("<i8").tobytes(), parent, owner, corner_bytes)


def vertex_texels(positions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Positions f32[v, 3] as texels, little-endian f32[v, 4]; the last number is 0."""
    texels = np.zeros((len(positions), 4), "<f4")
    texels[:, :3] = positions
    return texels


def from_bytes(parts: ListBytes, order: str, culling: str | None) -> TraversalLists:
    """The lists that bytes are of. `order` and `culling` are those they were made with.

    Raises `InputError` for bytes that are none: lengths that do not fit, an escape index out of its list or a special
    value where it may not be, an index out of range, a triangle that a list lacks or has twice, a sphere that is not
    that of its triangles. Lists that are returned keep every ray within their bounds.
    """
    if order not in ORDERS or (culling is not None and culling not in RULES):
        raise InputError(f"the lists' order {order!r} or culling {culling!r} is none that there is.")
    escape, payload, parent, owner, corners = (
        _entries(parts, name, "<i4", columns)
        for name, columns in (("escape", 1), ("payload", 4), ("parent", 1), ("owner", 1), ("corners", 3))
    )
    texels, first = _entries(parts, "vertices", "<f4", 4), _entries(parts, "heads", "<i8", 1)
    _check_tree(parent, owner, corners, len(texels))
    if len(first) - 1 not in LISTS or first[0] != 0 or first[-1] != len(escape) or (np.diff(first) < 0).any():
        raise InputError("heads of the lists' bytes are not where 1, 2, 6 or 8 lists of this length begin.")
    check_culling(culling, len(first) - 1, "front")
    if len(payload) != len(escape):
        raise InputError(f"payload of the lists' bytes has {len(payload)} elements, but escape {len(escape)}.")
    if not np.isfinite(texels).all() or texels[:, 3].any():
        raise InputError("vertices of the lists' bytes hold a number that is not finite, or a fourth that is not 0.")
    vertices = SharedVertices(np.ascontiguousarray(texels[:, :3]), corners)
    triangles = vertices.positions[corners]
    packed = pack_triangles(triangles)
    directions = list_directions(len(first) - 1)

    node_at, triangle_at = _located(escape, payload, first, corners, owner, parent)
    _check_kept(packed, triangle_at, directions, culling)
    spheres = _spheres(payload, first, node_at)
    hierarchy = Hierarchy(triangles, spheres, parent, owner, acceptance_margin(triangles))
    anew = np.empty_like(spheres)
    specialise(refit_spheres, {})(triangles, hierarchy.margin, owner, parent, np.ones(len(parent), np.bool_), anew)
    if (anew != spheres).any():
        node = int(np.argmax((anew != spheres).any(axis=1)))
        raise InputError(f"sphere {node} of the lists' bytes is not that of the triangles below it.")
    records = np.column_stack([packed.v0, packed.n, packed.m1, packed.m2])
    return TraversalLists(
        hierarchy, vertices, records, escape, payload, first, directions, node_at, triangle_at, order, culling
    )


def _entries(parts: ListBytes, name: str, kind: str, columns: int) -> NDArray[Any]:
    data, size = getattr(parts, name), columns * int(kind[2])
    if len(data) % size:
        raise InputError(f"{name} of the lists' bytes has {len(data)} bytes, no multiple of {size}.")
    array = np.frombuffer(data, kind).astype(np.dtype(kind[1:]))  # a copy: frombuffer's arrays cannot be written
    return array.reshape(-1, columns) if columns > 1 else array


def _check_tree(parent: NDArray[np.int32], owner: NDArray[np.int32], corners: NDArray[np.int32], vertices: int) -> None:
    # A parent comes before its children, so climbing ends.
    if not len(parent) or not len(owner) or len(owner) != len(corners):
        raise InputError("the lists' bytes hold no hierarchy, or one with other triangles than corners.")
    if parent[0] != -1 or (parent[1:] < 0).any() or (parent[1:] >= np.arange(1, len(parent))).any():
        raise InputError("parent of the lists' bytes is no tree whose nodes come before their children.")
    if (owner < 0).any() or (owner >= len(parent)).any():
        raise InputError(f"owner of the lists' bytes names a node that is none of {len(parent)}.")
    if (corners < 0).any() or (corners >= vertices).any():
        raise InputError(f"corners of the lists' bytes name a vertex that is none of {vertices}.")


def _located(
    escape: NDArray[np.int32], payload: NDArray[np.int32], first: NDArray[np.int64], corners: NDArray[np.int32],
    owner: NDArray[np.int32], parent: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:  # fmt: skip
    lists = len(first) - 1
    node_at, triangle_at = np.empty((lists, len(parent)), np.int32), np.empty((lists, len(owner)), np.int32)
    check: Any = specialise(check_list, {})
    scratch = np.empty((3, int(np.diff(first).max())), np.int64)
    for k in range(lists):
        part = slice(first[k], first[k + 1])
        fault, at = check(escape[part], payload[part], corners, owner, parent, node_at[k], triangle_at[k], *scratch)
        if fault:
            raise InputError(f"list {k} of the lists' bytes has {FAULTS[fault]}: element {at}.")
    return node_at, triangle_at


def _check_kept(
    packed: TriangleRecords, triangle_at: NDArray[np.int32], directions: NDArray[np.float64], culling: str | None
) -> None:
    for k, direction in enumerate(directions):
        wrong = kept_triangles(packed.n, ~packed.degenerate, direction, culling) != (triangle_at[k] >= 0)
        if wrong.any():
            row = int(np.argmax(wrong))
            state = "lacks" if triangle_at[k, row] < 0 else "has"
            raise InputError(f"list {k} of the lists' bytes {state} triangle {row}, against culling={culling!r}.")


def _spheres(payload: NDArray[np.int32], first: NDArray[np.int64], node_at: NDArray[np.int32]) -> NDArray[np.float32]:
    # Each node's sphere, the same in every list that has it.
    bits = np.zeros((node_at.shape[1], 4), np.int32)
    known = np.zeros(len(bits), np.bool_)
    for begin, at in zip(first, node_at, strict=False):
        there = np.flatnonzero(at >= 0)
        here, again = payload[begin + at[there]], known[there]
        if (here[again] != bits[there[again]]).any():
            raise InputError("two of the lists in the bytes have different spheres for one node.")
        bits[there], known[there] = here, True
    if not known.all():
        raise InputError(f"node {int(np.argmin(known))} of the lists' bytes is in no list.")
    return bits.view(np.float32)
