"""Shooting rays at traversal lists: which list a ray picks, in which order rays go, the loop, the counts.

In: `TraversalLists`, one a layer; rays; out: `Found`. The other structures of this package that are compared with the
lists (`boxes`, `ordered_stack`, `kd_search`) return the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy import traversal
from refsim.papers.sphere_hierarchy.culling import check_culling
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.packet import PACKET, walk_packets
from refsim.pipeline.threads import checked_threads, run_all
from refsim.scene.rays import Hits, Rays

Slots = dict[str, Any]
FACINGS = ("both", "front")


class Found(NamedTuple):
    """Hits, and exact counts a ray: nodes i32[n] (elements visited, spheres and triangles), triangle_tests i32[n].

    Of any-hit searches only hit or miss means something. Sphere tests are nodes − triangle_tests.
    """

    hits: Hits
    nodes: NDArray[np.int32]
    triangle_tests: NDArray[np.int32]


def search(
    layers: Sequence[TraversalLists],
    rays: Rays,
    *,
    starts: Sequence[NDArray[np.int32] | None] | None = None,
    any_hit: bool = False,
    facing: str = "both",
    packet: bool = True,
    threads: int | None = None,
    slots: Slots | None = None,
) -> Found:
    """The nearest hit of each ray, or any.

    layers   one or more lists in a row (section 5): the best hit is carried from one to the next. Their triangles are
             numbered together: a layer's numbers follow those of the layer before
    facing   "both", or "front": only hits from a triangle's front count. Lists with culling need "front"
    packet   256 rays together, or each alone: the same hits and counts
    starts   per layer the element of its list at which each ray begins, i32[n], or None for the lists' heads
    slots    device functions in the place of others of `traversal` (errata)
    """
    check_shot(layers, rays, starts, facing)
    n = len(rays)
    hits = Hits.misses(n)
    nodes, tests = np.zeros(n, np.int32), np.zeros(n, np.int32)
    workers = checked_threads(threads)
    loop = specialise(walk_packets if packet else traversal.walk, slots or {})
    order, offset = tile_order(rays.width, rays.height, n, (16, 8, 4)), 0  # 4 × 4: a group of a packet
    alive = rays.t_max > 0
    live = order if alive.all() else order[alive[order]]
    for k, lists in enumerate(layers):
        picked = list_of_rays(rays.direction, lists.count)
        head = None if starts is None else starts[k]
        begin = np.zeros(n, np.int32) if head is None else head
        rows = by_list(live, picked)
        cuts = np.linspace(0, len(rows) // PACKET, 8 * workers + 1).astype(int) * PACKET
        cuts[-1] = len(rows)
        inputs = (
            picked, begin, rays.origin, rays.direction, rays.t_max, lists.escape, lists.spheres, lists.payload,
            lists.first, lists.records, lists.hierarchy.spheres[0], any_hit, facing == "front", np.int32(offset),
        )  # fmt: skip
        outputs = (hits.triangle, hits.t, hits.u, hits.v, nodes, tests)
        parts = [rows[a:b] for a, b in pairwise(cuts) if b > a]
        run_all("traversal", workers, [partial(loop, part, *inputs, *outputs) for part in parts])
        offset += len(lists.hierarchy.triangles)
    return Found(hits, nodes, tests)


def check_shot(
    layers: Sequence[TraversalLists],
    rays: Rays,
    starts: Sequence[NDArray[np.int32] | None] | None,
    facing: str,
) -> None:
    """Raises `InputError` where lists, rays, heads and facing do not fit each other."""
    if not isinstance(layers, Sequence) or not all(isinstance(lists, TraversalLists) for lists in layers):
        raise InputError(f"layers must be a list of TraversalLists, one a layer, not {type(layers).__name__}.")
    if facing not in FACINGS:
        raise InputError(f"facing is {facing!r}; it must be one of {', '.join(map(repr, FACINGS))}.")
    for lists in layers:
        check_culling(lists.culling, lists.count, facing)
    if starts is None:
        return
    if len(starts) != len(layers):
        raise InputError(f"starts are of {len(starts)} layers, and there are {len(layers)}.")
    for head in starts:
        if head is not None and (np.shape(head) != (len(rays),) or np.asarray(head).dtype != np.int32):
            raise InputError(f"the starts of a layer must be int32[{len(rays)}], one element a ray.")
        if head is not None and len(head) and int(np.min(head)) < 0:
            raise InputError("the starts of a layer must be elements of its lists, from 0 on.")


@lru_cache(maxsize=8)
def tile_order(
    width: int | None, height: int | None, count: int, sides: tuple[int, ...] = (16, 8)
) -> NDArray[np.int32]:
    """Rows of rays by tiles of 8 × 8 pixels, four of them a block of 16 × 16; as they come where there is no image.

    sides    of the tiles, each a part of the one before; within the last, rows as they come
    """
    rows = np.arange(count, dtype=np.int32)
    if width is None or height is None:
        return rows
    y, x = np.divmod(rows, np.int32(width))
    keys = [part.astype(np.int32) for side in sides for part in (y // side, x // side)]
    return np.ascontiguousarray(np.lexsort(keys[::-1]).astype(np.int32))


def by_list(order: NDArray[np.int32], picked: NDArray[np.int32]) -> NDArray[np.int32]:
    """The same rows, those of one list together, otherwise in the same order."""
    lists = picked[order].astype(np.int8)
    return order[np.argsort(lists, kind="stable")] if len(lists) and lists.min() < lists.max() else order
