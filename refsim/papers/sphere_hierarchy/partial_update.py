"""Moving some triangles of traversal lists without building them anew (section 5).

"Vertices of the primitives within a BVH can be updated without recomputing the whole structure ... as long as the host
keeps enough information to locate the list elements corresponding to a given BVH tree node." The tree stays, and with
it each list's order and escape indices. The spheres from the moved triangles' owners up to the root become those that
the builder would give the same triangles, and are written where `node_at` says. Triangles with other vertex numbers
(`moved_vertices`) are written where `triangle_at` says. A search needs no order, so its hits are those of new lists.

Moved triangles have other normals: a list whose culling rule now keeps other triangles is laid out anew.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin
from refsim.geometry.triangle import pack_triangles
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.byte_ranges import Changes, compare
from refsim.papers.sphere_hierarchy.culling import kept_triangles
from refsim.papers.sphere_hierarchy.hierarchy import Hierarchy
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.lists_layout import group_children, lay_out, list_sizes
from refsim.papers.sphere_hierarchy.moved_vertices import moved_vertices
from refsim.papers.sphere_hierarchy.refit_nodes import refit_spheres
from refsim.scene.mesh import Scene


class Refitted(NamedTuple):
    """Lists after a change, and what changed. The lists before it are as they were."""

    lists: TraversalLists
    changes: Changes


class OneList(NamedTuple):
    """Rows of `TraversalLists` that belong to one list."""

    escape: NDArray[np.int32]
    payload: NDArray[np.int32]
    node_at: NDArray[np.int32]
    triangle_at: NDArray[np.int32]


def update_triangles(lists: TraversalLists, rows: ArrayLike, corners: ArrayLike, gap: int = 0) -> Refitted:
    """The lists after triangles `rows` i[k] have moved to `corners` f32[k, 3, 3].

    gap  bytes; what must be copied and lies no further apart is one range. Raises `InputError` for rows that are out
    of range or named twice, and for corners of another shape or not finite.
    """
    n = len(lists.hierarchy.triangles)
    chosen, places = _checked(rows, corners, n)
    if isinstance(gap, bool) or not isinstance(gap, int | np.integer) or gap < 0:
        raise InputError(f"gap must be a whole number of bytes from 0, not {gap!r}.")
    differs = (places.view(np.int32) != lists.hierarchy.triangles[chosen].view(np.int32)).any(axis=(1, 2))
    return moved(lists, chosen[differs], places[differs], int(gap))


def moved(lists: TraversalLists, rows: NDArray[np.int64], corners: NDArray[np.float32], gap: int) -> Refitted:
    """`update_triangles` for ascending rows that really move."""
    old = lists.hierarchy
    hierarchy, nodes = _refitted(old, rows, corners)
    vertices = moved_vertices(lists.vertices, hierarchy.triangles, rows)
    packed = pack_triangles(corners)
    records = lists.records.copy()
    records[rows] = np.column_stack([packed.v0, packed.n, packed.m1, packed.m2])
    renumbered = np.flatnonzero((vertices.corners != lists.vertices.corners).any(axis=1))

    # Each list: payloads in place, or laid out anew where it keeps other triangles
    parts, relaid, touched = [], [], []
    for k, direction in enumerate(lists.directions):
        keeps = kept_triangles(packed.n, ~packed.degenerate, direction, lists.culling)
        if (keeps != (lists.triangle_at[k][rows] >= 0)).any():
            kept = lists.triangle_at[k] >= 0
            kept[rows] = keeps
            parts.append(_laid_out(hierarchy, vertices.corners, kept, direction, lists.order == "latest_last"))
            relaid.append(k)
            touched.append(np.empty(0, np.int64))
        else:
            part, elements = _rewritten(lists, k, hierarchy.spheres, nodes, vertices.corners, renumbered)
            parts.append(part)
            touched.append(elements)
    escape, payload, node_at, triangle_at = zip(*parts, strict=True)
    first = np.zeros_like(lists.first)
    np.cumsum([len(part) for part in escape], out=first[1:])
    done = replace(
        lists, hierarchy=hierarchy, vertices=vertices, records=records, first=first,
        escape=np.concatenate(escape), payload=np.concatenate(payload),
        node_at=np.stack(node_at) if relaid else lists.node_at,
        triangle_at=np.stack(triangle_at) if relaid else lists.triangle_at,
    )  # fmt: skip
    other = int((hierarchy.spheres[nodes] != old.spheres[nodes]).any(axis=1).sum())
    counts = len(rows), other, len(vertices.positions) - len(lists.vertices.positions)
    seen = np.zeros(len(lists.vertices.positions), np.bool_)
    seen[lists.vertices.corners[rows]] = True
    return Refitted(done, compare(lists, done, counts, tuple(relaid), touched, np.flatnonzero(seen), gap))


def _checked(rows: ArrayLike, corners: ArrayLike, n: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    # Ascending rows, and corners in their order
    try:
        chosen, shape = np.asarray(rows), np.shape(corners)
    except ValueError:
        raise InputError("rows of triangles to move, or their corners, are lists of different lengths.") from None
    if chosen.ndim != 1 or (chosen.dtype.kind not in "iu" and chosen.size):
        raise InputError("rows of triangles to move must be whole numbers, one dimension.")
    wrong = chosen[(chosen < 0) | (chosen >= n)]
    if wrong.size:
        raise InputError(f"rows of triangles to move hold {wrong[0]}, and there are {n} triangles.")
    chosen = chosen.astype(np.int64)
    order = np.argsort(chosen, kind="stable")
    if (np.diff(chosen[order]) == 0).any():
        raise InputError("rows of triangles to move name one twice.")
    if shape != (len(chosen), 3, 3):
        raise InputError(f"{len(chosen)} rows of triangles move to corners of shape {list(shape)}.")
    places = Scene(corners).triangles if len(chosen) else np.empty((0, 3, 3), np.float32)  # type: ignore[arg-type]
    return chosen[order], places[order]


def _refitted(
    old: Hierarchy, rows: NDArray[np.int64], corners: NDArray[np.float32]
) -> tuple[Hierarchy, NDArray[np.int64]]:
    """The same tree around moved triangles, and the nodes that hold one of them."""
    triangles, margin, spheres = old.triangles.copy(), old.margin.copy(), old.spheres.copy()
    triangles[rows], margin[rows] = corners, acceptance_margin(corners)
    holds = np.zeros(len(old), np.bool_)
    holds[old.owner[rows]] = True
    specialise(refit_spheres, {})(triangles, margin, old.owner, old.parent, holds, spheres)
    return replace(old, triangles=triangles, margin=margin, spheres=spheres), np.flatnonzero(holds)


def _rewritten(
    lists: TraversalLists, number: int, spheres: NDArray[np.float32], nodes: NDArray[np.int64],
    corners: NDArray[np.int32], renumbered: NDArray[np.int64],
) -> tuple[OneList, NDArray[np.int64]]:  # fmt: skip
    """A list with other spheres and vertex numbers in the same places, and those places."""
    part = slice(lists.first[number], lists.first[number + 1])
    node_at, triangle_at = lists.node_at[number], lists.triangle_at[number]
    payload = lists.payload[part].copy()
    nodes, renumbered = nodes[node_at[nodes] >= 0], renumbered[triangle_at[renumbered] >= 0]
    payload[node_at[nodes]] = spheres.view(np.int32)[nodes]
    payload[triangle_at[renumbered], :3] = corners[renumbered]
    elements = np.sort(np.append(node_at[nodes], triangle_at[renumbered])).astype(np.int64)
    return OneList(lists.escape[part], payload, node_at, triangle_at), elements


def _laid_out(
    hierarchy: Hierarchy, corners: NDArray[np.int32], kept: NDArray[np.bool_], direction: NDArray[np.float64],
    latest: bool,
) -> OneList:  # fmt: skip
    """One list, as `build_lists` lays it out."""
    n, m = len(hierarchy.triangles), len(hierarchy)
    children, starts, sizes = np.empty(m + n - 1, np.int32), np.empty(m + 1, np.int64), np.empty(m, np.int32)
    specialise(group_children, {})(hierarchy.parent, hierarchy.owner, children, starts)
    specialise(list_sizes, {})(hierarchy.parent, hierarchy.owner, kept, sizes)
    length = int(sizes[0])
    made = OneList(
        np.empty(length, np.int32), np.empty((length, 4), np.int32), np.empty(m, np.int32), np.empty(n, np.int32)
    )
    write: Any = specialise(lay_out, {})
    write(
        hierarchy.spheres, hierarchy.triangles, corners, children, starts, sizes, kept, direction, latest,
        made.node_at, made.triangle_at, made.escape, made.payload,
    )  # fmt: skip
    return made
