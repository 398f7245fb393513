"""The elements that each ray visits, in order, and where in texture memory they lie, for `warps` and `texture_cache`.

In: a `Shot`, one search of the lists, and rows of its rays; out: ragged arrays. An element is numbered through all
lists of all layers, as they lie in memory, so the numbers that a ray visits ascend.

Memory is bounded by the caller: a `Recorder` writes down the rows that it is asked for, and `chunks` cuts an order of
rows so that no piece has more than a given number of elements.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.counters import ConservationError
from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.search import Slots, search
from refsim.papers.sphere_hierarchy.visit_loop import record_walk
from refsim.pipeline.threads import checked_threads, run_all
from refsim.scene.rays import Hits, Rays

MOST_ELEMENTS = 1 << 24

# Bytes of a fetch of each texture: escape index, payload, vertex. "We used 1D texture caches to store the triangles and
# vertices" (section 4); an escape "of 32 bits", a word "of 128 bits"; a vertex fills such a word as well
KINDS = ("escape", "payload", "vertex")
FETCH_BYTES = (4, 16, 16)
# Every texture begins at a multiple of this ("Texture alignment: 256 bytes", deviceQuery of a Tesla C1060, a GT200)
ALIGNMENT = 256


class Shot(NamedTuple):
    """One search: layers, rays, and what else `search.search` takes."""

    layers: Sequence[TraversalLists]
    rays: Rays
    starts: Sequence[NDArray[np.int32] | None] | None = None
    any_hit: bool = False
    facing: str = "both"
    slots: Slots | None = None


class Visits(NamedTuple):
    """rows i32[k] of rays, −1 none; the i-th visited elements[offsets[i]:offsets[i + 1]], i32[total] and i64[k + 1]."""

    rows: NDArray[np.int32]
    offsets: NDArray[np.int64]
    elements: NDArray[np.int32]


class Layout(NamedTuple):
    """Textures of layers that lie one after another: escape i32[k], payload i32[k, 4] with vertex indices that count
    through all layers, and the three byte addresses at which the textures begin, i64[3]; `size` bytes altogether."""

    escape: NDArray[np.int32]
    payload: NDArray[np.int32]
    bases: NDArray[np.int64]
    size: int

    @classmethod
    def of(cls, layers: Sequence[TraversalLists]) -> Layout:
        """The textures, each after the one before, aligned."""
        escape, payload = layers[0].escape, layers[0].payload
        vertices = len(layers[0].vertices.positions)
        for lists in layers[1:]:
            triangle = (lists.escape == 0) | (lists.escape == 1)
            moved = lists.payload.copy()
            moved[triangle, :3] += vertices
            escape, payload = np.concatenate([escape, lists.escape]), np.concatenate([payload, moved])
            vertices += len(lists.vertices.positions)
        sizes = np.array([len(escape), len(escape), vertices], np.int64) * FETCH_BYTES
        bases = np.zeros(3, np.int64)
        bases[1:] = np.cumsum(-(-sizes[:2] // ALIGNMENT) * ALIGNMENT)
        return cls(escape, payload, bases, int(bases[2] + sizes[2]))


class Recorder:
    """Writes down what rays of a shot visit. `nodes` i32[n] says how many elements, by `search.search`."""

    def __init__(self, shot: Shot, threads: int | None = None) -> None:
        self.shot, self.threads = shot, checked_threads(threads)
        self.nodes = search(
            shot.layers, shot.rays, starts=shot.starts, any_hit=shot.any_hit, facing=shot.facing, threads=threads,
            slots=shot.slots,
        ).nodes  # fmt: skip
        self.picked = [list_of_rays(shot.rays.direction, lists.count) for lists in shot.layers]

    def visits(self, rows: NDArray[np.int32], threads: int | None = None) -> Visits:
        """What these rows visit, −1 nothing; a row may not come twice. `threads`: others than were given before.

        Raises `ConservationError` where the loop that writes and the one that counts do not agree.
        """
        rows = np.ascontiguousarray(rows.ravel(), np.int32)
        counts = np.where(rows < 0, 0, self.nodes[rows])
        offsets = np.zeros(len(rows) + 1, np.int64)
        np.cumsum(counts, out=offsets[1:])
        elements, at = np.empty(offsets[-1], np.int32), offsets[:-1].copy()
        workers = self.threads if threads is None else threads
        cuts = np.linspace(0, len(rows), workers + 1).astype(int)
        parts = [slice(a, b) for a, b in pairwise(cuts) if b > a]
        run_all("visits", workers, [self._task(rows[part], at[part], elements) for part in parts])
        if not np.array_equal(at, offsets[1:]):
            raise ConservationError("rays were seen to visit other elements than were counted.")
        return Visits(rows, offsets, elements)

    def _task(self, rows: NDArray[np.int32], at: NDArray[np.int64], elements: NDArray[np.int32]) -> Any:
        """Rows through all layers, on a thread."""
        shot, rays, n = self.shot, self.shot.rays, len(self.shot.rays)
        loop = specialise(record_walk, shot.slots or {})
        hits = Hits.misses(n)

        def walk() -> None:
            base = offset = 0
            for k, lists in enumerate(shot.layers):
                head = None if shot.starts is None else shot.starts[k]
                loop(
                    rows, self.picked[k], np.zeros(n, np.int32) if head is None else head, rays.origin,
                    rays.direction, rays.t_max, lists.escape, lists.spheres, lists.payload, lists.first,
                    lists.records, lists.hierarchy.spheres[0], shot.any_hit, shot.facing == "front",
                    np.int32(offset), hits.triangle, hits.t, hits.u, hits.v, np.int32(base), at, elements,
                )  # fmt: skip
                base += len(lists.escape)
                offset += len(lists.hierarchy.triangles)

        return walk

    def chunks(self, order: NDArray[np.int32], most: int = MOST_ELEMENTS) -> Iterator[Visits]:
        """What the rows of an order i32[warps, lanes] visit, in pieces of whole warps with at most `most` elements, or
        of a single warp that has more."""
        if most < 1:
            raise InputError(f"a piece of {most} elements cannot hold any; give at least 1.")
        lanes = order.shape[1]
        total = np.cumsum(np.where(order < 0, 0, self.nodes[order]).sum(axis=1, dtype=np.int64))
        begin = 0
        while begin < len(order):
            before = int(total[begin - 1]) if begin else 0
            end = max(begin + 1, int(np.searchsorted(total, before + most, side="right")))
            yield self.visits(order[begin:end].reshape(-1, lanes))
            begin = end


def list_and_place(
    layers: Sequence[TraversalLists], elements: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Layer, list of that layer, and place within that list, of elements numbered through all."""
    edges = np.cumsum([0, *(len(lists.escape) for lists in layers)])
    layer = np.searchsorted(edges, elements, side="right").astype(np.int32) - np.int32(1)
    number, place = np.zeros_like(elements), np.zeros_like(elements)
    for k, lists in enumerate(layers):
        own = layer == k
        local = elements[own] - edges[k]
        number[own] = np.searchsorted(lists.first, local, side="right") - 1
        place[own] = local - lists.first[number[own]]
    return layer, number, place
