"""Sharing rays out to threads, for the structures that the traversal lists are compared with.

In: a kernel that goes through the rows of rays it is given, its inputs and the extra columns that it counts in; out:
`Found`. Rays go in the order of the lists' own (`search.tile_order`); no result depends on that or on the threads.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.search import FACINGS, Found, tile_order
from refsim.pipeline.threads import checked_threads, run_all
from refsim.scene.rays import Hits, Rays


def in_blocks(
    label: str,
    loop: Any,
    structure: tuple[Any, ...],
    rays: Rays,
    *,
    any_hit: bool,
    facing: str,
    threads: int | None,
    counts: tuple[Any, ...] = (),
) -> Found:
    """Calls ``loop(rows, origin, direction, t_max, any_hit, front_only, *structure, *outputs)`` on blocks of rays.

    The outputs are triangle i32[n], t, u, v f32[n], nodes and triangle tests i32[n], then `counts`.
    """
    if facing not in FACINGS:
        raise InputError(f"facing is {facing!r}; it must be one of {', '.join(map(repr, FACINGS))}.")
    n, workers = len(rays), checked_threads(threads)
    hits = Hits.misses(n)
    nodes, tests = np.zeros(n, np.int32), np.zeros(n, np.int32)
    rows = tile_order(rays.width, rays.height, n)
    cuts = np.linspace(0, n, min(8 * workers, max(n, 1)) + 1).astype(int)
    inputs = (rays.origin, rays.direction, rays.t_max, bool(any_hit), facing == "front", *structure)
    outputs = (hits.triangle, hits.t, hits.u, hits.v, nodes, tests, *counts)
    parts = [rows[a:b] for a, b in pairwise(cuts) if b > a]
    run_all(label, workers, [lambda part=part: loop(part, *inputs, *outputs) for part in parts])
    return Found(hits, nodes, tests)
