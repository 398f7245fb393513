"""A model of the texture cache: what of the traversal's fetches hits, and what comes from memory.

"We used 1D texture caches to store the triangles and vertices, therefore memory reference locality concerns impact the
framerate the most" (section 4). In: shots, rays mapped to warps, a machine; out: fetches and misses of each texture.

Each multiprocessor has a cache, empty before, that all three textures share, with least-recently-used replacement.
Warps go to multiprocessors in blocks, in turn; on each, as many warps as are resident take turns, an iteration of the
loop each, and a warp that ends makes way for the next. A lane's fetch is one access; fetches never straddle lines.

**The machine.** Assumed, from public models of the GT200 that the paper's GTX 280 has; nVidia did not publish it. Two
versions of `configs/QuadroFX5800/gpgpusim.config` in gpgpu-sim/gpgpu-sim_distribution (the Quadro FX 5800 is a GT200):
    at 69f2911e   30 shader cores, 1,024 threads of each in warps of 32, texture cache 64 sets × 64 bytes × 2 ways
    at 0efd3c00   10 clusters of 3 cores, the same threads, texture cache 8 sets × 128 bytes × 5 ways
Both "per-shader", replacement L (least recently used). Neither models a second level here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.texture_cache_lines import fetch_addresses, run_multiprocessor
from refsim.papers.sphere_hierarchy.visits import FETCH_BYTES, KINDS, Layout, Recorder, Shot
from refsim.papers.sphere_hierarchy.warps import Order
from refsim.pipeline.threads import checked_threads, run_all


class Cache(NamedTuple):
    """`sets` of `ways` lines of `line` bytes; a memory line belongs to the set of its number modulo `sets`."""

    sets: int
    ways: int
    line: int

    @property
    def size(self) -> int:
        """Bytes."""
        return self.sets * self.ways * self.line

    def checked(self) -> Cache:
        """Itself; `InputError` where there is no such cache."""
        if min(self) < 1:
            raise InputError(f"a cache has at least one set, one way and one byte a line, not {tuple(self)}.")
        if self.line % max(FETCH_BYTES):
            raise InputError(f"a line of {self.line} bytes would split a fetch of {max(FETCH_BYTES)}.")
        return self


def fully_associative(size: int, line: int) -> Cache:
    """One set: any line anywhere."""
    return Cache(1, size // line, line)


def direct_mapped(size: int, line: int) -> Cache:
    """One way: each line has its place."""
    return Cache(size // line, 1, line)


GT200 = Cache(64, 2, 64)
GT200_LATER = Cache(8, 5, 128)


class Machine(NamedTuple):
    """`multiprocessors` with a cache and `resident` warps each; `block` warps in a row go to the same one."""

    cache: Cache = GT200
    multiprocessors: int = 30
    resident: int = 32
    block: int = 1


class CacheCounts(NamedTuple):
    """fetches, misses, compulsory i64[3], by `visits.KINDS`; compulsory misses are a multiprocessor's first of a line.
    `rays`: live rays; `footprint`: bytes of all textures."""

    cache: Cache
    rays: int
    footprint: int
    fetches: NDArray[np.int64]
    misses: NDArray[np.int64]
    compulsory: NDArray[np.int64]

    @property
    def hit_rates(self) -> dict[str, float]:
        """Share of the fetches that hit, by texture and of "all"; 1 where nothing was fetched."""
        fetches, misses = [*self.fetches.tolist(), int(self.fetches.sum())], [*self.misses, self.misses.sum()]
        return {
            kind: 1.0 - float(missed) / fetched if fetched else 1.0
            for kind, fetched, missed in zip((*KINDS, "all"), fetches, misses, strict=True)
        }

    @property
    def bytes_from_memory(self) -> int:
        """A line a miss."""
        return int(self.misses.sum()) * self.cache.line

    @property
    def bytes_per_ray(self) -> float:
        """From memory; 0 where there are no rays."""
        return self.bytes_from_memory / self.rays if self.rays else 0.0


def simulate(
    shots: Sequence[Shot], order: Order, machine: Machine | None = None, threads: int | None = None
) -> CacheCounts:
    """Runs shots of the same layers, which every warp of `order` i32[warps, lanes] shoots one after another.

    A multiprocessor at a time, so its share of the visited elements is what is in memory, times threads.
    """
    return sweep(shots, order, [machine or Machine()], threads)[0]


def sweep(
    shots: Sequence[Shot], order: Order, machines: Sequence[Machine], threads: int | None = None
) -> list[CacheCounts]:
    """The same for several machines; rays are searched once."""
    if not shots or any(shot.layers is not shots[0].layers for shot in shots):
        raise InputError("a simulation needs shots, all of the same layers.")
    workers = checked_threads(threads)
    layout = Layout.of(shots[0].layers)
    recorders = [Recorder(shot, threads) for shot in shots]
    live = order[order >= 0]
    rays = sum(int((shot.rays.t_max[live] > 0).sum()) for shot in shots)
    found = []
    for machine in machines:
        if min(machine[1:]) < 1:
            raise InputError(f"a machine has at least one multiprocessor, warp and warp a block, not {machine}.")
        machine.cache.checked()
        owner = np.arange(len(order)) // machine.block % machine.multiprocessors
        shares = [order[owner == k] for k in range(min(machine.multiprocessors, len(order)))]
        tasks = [lambda share=share, m=machine: _multiprocessor(recorders, share, layout, m) for share in shares]
        counts = np.zeros((len(KINDS), 3), np.int64)
        for own in run_all("texture cache", workers, tasks):
            counts += own
        found.append(CacheCounts(machine.cache, rays, layout.size, *counts.T))
    return found


def _multiprocessor(recorders: list[Recorder], share: Order, layout: Layout, machine: Machine) -> NDArray[np.int64]:
    """Counts of one multiprocessor, i64[kinds, 3]."""
    counts = np.zeros((len(KINDS), 3), np.int64)
    parts = [recorder.visits(share, threads=1) for recorder in recorders]
    ends = np.cumsum([0, *(part.offsets[-1] for part in parts)])
    offsets = np.concatenate([[0], *(part.offsets[1:] + end for part, end in zip(parts, ends[:-1], strict=True))])
    elements = np.concatenate([part.elements for part in parts])
    cache = machine.cache
    specialise(run_multiprocessor, {})(
        len(parts), share.shape[1], machine.resident, offsets, elements, layout.escape, layout.payload, layout.bases,
        cache.line, cache.sets, cache.ways, *_state(cache, layout.size), counts,
    )  # fmt: skip
    return counts


def _state(cache: Cache, size: int) -> tuple[NDArray[np.int32], ...]:
    """The arrays of `texture_cache_lines` for a memory of `size` bytes."""
    slots = cache.sets * cache.ways
    lengths = (-(-size // cache.line), slots, slots, slots, cache.sets)
    return tuple(np.empty(length, np.int32) for length in lengths)


def hits_of(addresses: ArrayLike, cache: Cache) -> NDArray[np.bool_]:
    """Whether each of the byte addresses hits, fetched one after another from an empty cache."""
    given = np.asarray(addresses, np.int64).ravel()
    if min(cache) < 1 or (given < 0).any():
        raise InputError("addresses are 0 or more, and a cache has at least one set, way and byte.")
    hits = np.zeros(len(given), np.bool_)
    specialise(fetch_addresses, {})(
        given, cache.line, cache.sets, cache.ways, *_state(cache, int(given.max(initial=0)) + 1), hits
    )
    return hits
