"""One list against several: does a ray's texture cache hit more often where there are more lists?

The paper claims (section 2.1) that "creating multiple traversal lists is expected to increase memory reference locality
despite also increasing significantly the overall memory consumption", (Table 2) that "as polygon count increases, the
locality of memory references of the rays of a block is progressively lost", and (Table 1) that its optimisations
"happen at the cost of memory access locality". In: a trace of the method, which says scene, rays and options; out: what
`texture_cache` and `warps` count for the same rays, for each number of lists, mapping and machine.

Hit rates alone mislead: whoever fetches less, and so misses less, may hit a smaller share. Bytes from memory a ray are
what a memory-bound program waits for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.culling import check_culling
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.errata import slots_of
from refsim.papers.sphere_hierarchy.setup import ListOptions, Prepared, prepare
from refsim.papers.sphere_hierarchy.texture_cache import CacheCounts, Machine, sweep
from refsim.papers.sphere_hierarchy.tracer import starts_of, trace_prepared
from refsim.papers.sphere_hierarchy.visits import Shot
from refsim.papers.sphere_hierarchy.warps import WIDTH, Account, Order, account, map_rays
from refsim.results import RayKind, Trace
from refsim.scene.rays import Rays

LISTS = (1, 2, 6, 8)
TILE = "8x4"


class Locality(NamedTuple):
    """Counts of one choice; `culling`, heads and the rest are the trace's."""

    lists: int
    mapping: str
    machine: Machine
    account: Account
    cache: CacheCounts

    @property
    def bytes_per_node(self) -> float:
        """From memory, a visited node; 0 where none was."""
        return self.cache.bytes_from_memory / self.account.nodes if self.account.nodes else 0.0


def measure(
    trace: Trace, lists: Sequence[int] = LISTS, mappings: Sequence[str] = (TILE,),
    machines: Sequence[Machine] = (Machine(),), *, lanes: int = WIDTH, seed: int = 0,
) -> list[Locality]:  # fmt: skip
    """All combinations for a trace by "traversal_list" of a picture's rays; `lanes` a warp, `seed` of "random"."""
    options = list_options(trace)
    found = []
    for number in lists:
        check_culling(options.culling, number, options.facing)
        prepared = prepare(trace.scene, options._replace(lists=number))
        eye = trace.generations[0].rays
        shots = shots_of(prepared, trace_prepared(prepared, eye))
        for mapping in mappings:
            order = order_of(eye, mapping, number, lanes, seed)
            own = account(shots, order, line=machines[0].cache.line, threads=options.threads)
            counts = sweep(shots, order, machines, options.threads)
            found += [Locality(number, mapping, *pair) for pair in
                      ((machine, own, count) for machine, count in zip(machines, counts, strict=True))]  # fmt: skip
    return found


def list_options(trace: Trace) -> ListOptions:
    """The options of a trace. Raises `InputError` for another method."""
    if trace.method != "traversal_list":
        raise InputError(f"a trace by {trace.method!r} visits no traversal lists; 'traversal_list' does.")
    return ListOptions.of(trace.options)


def shots_of(prepared: Prepared, trace: Trace) -> list[Shot]:
    """The searches that a trace made: of each generation its shadow rays, which end at any hit, and its others."""
    options = prepared.options
    shots, left = [], np.full(len(trace.generations[0].rays), -1, np.int32)
    for k, generation in enumerate(trace.generations):
        rays, shadow = generation.rays, generation.kind == RayKind.SHADOW
        starts = starts_of(prepared, rays, k, left)
        for any_hit, chosen in ((True, generation.alive & shadow), (False, generation.alive & ~shadow)):
            if chosen.any():
                t_max = np.where(chosen, rays.t_max, np.float32(0))
                own = Rays.unchecked(rays.origin, rays.direction, t_max, rays.width, rays.height)
                shots.append(Shot(prepared.layers, own, starts, any_hit, options.facing, slots_of(options.printed)))
        left = generation.hits.triangle
    return shots


def order_of(rays: Rays, mapping: str, lists: int, lanes: int = WIDTH, seed: int = 0) -> Order:
    """`warps.map_rays` for a picture's eye rays. Raises `InputError` for rays without a picture."""
    if rays.width is None or rays.height is None:
        raise InputError("rays are mapped to warps by their pixels; these have no picture's width and height.")
    picked = list_of_rays(rays.direction, lists)
    return map_rays(mapping, rays.width, rays.height, lanes, lists=picked, seed=seed)
