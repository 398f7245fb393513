"""Runs the vertex stage and the rasteriser's set-up in rounds: what is left of so many primitives at a time.

Threads share the primitives of a round in slices. A `Feed` says where vertices come from: from the draw's buffers
through its vertex shader, or from what the geometry stage emitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.rounds import Round, Scratch, slice_size
from refsim.pipeline.threads import run_all

if TYPE_CHECKING:
    from refsim.pipeline.program import Program

SPARE_ROWS = 64  # for the pieces of clipped triangles, before a slice has to run again with more


class Feed(NamedTuple):
    """What a front end runs over: its kernel, uniforms and textures, vertex columns, indices, the assembled table,
    primitives an instance and in all, and the number of the first within the draw."""

    kernel: Any
    arguments: tuple[Any, Any]
    buffers: tuple[tuple[np.ndarray, np.ndarray], ...]
    indices: np.ndarray
    assembly: np.ndarray
    per_instance: int
    primitives: int
    first: int = 0


def rounds(program: Program, feed: Feed, call: Any, threads: int, scratch: Scratch) -> Iterator[Round]:
    """All primitives of `feed` after set-up, a round at a time. Raises `InputError` for quads that are no rectangle."""
    size = slice_size(feed.primitives, threads)
    for first in range(0, feed.primitives, size * threads):
        count = min(size * threads, feed.primitives - first)
        rows = size + (SPARE_ROWS if program.triangles else 0)
        part = _set_up(program, feed, call, Round(program, first, count, size, rows, scratch), threads)
        crooked = int(part.fates[:, 3].sum())
        if crooked:
            raise InputError(
                f"{crooked} quads are not axis-aligned rectangles of the screen; quad-list draws only those."
            )
        yield part


def _set_up(program: Program, feed: Feed, call: Any, part: Round, threads: int) -> Round:
    """Fills a round, slice by slice; once more with as many rows as are needed if clipping made too many triangles."""

    def run(k: int) -> None:
        first, count = part.slice_of(k)
        feed.kernel(
            *feed.arguments, feed.buffers, feed.indices, feed.assembly, feed.per_instance, first, count, call.view,
            call.bounds, call.bias, part.columns(k), part.fates[k],
        )  # fmt: skip
        part.columns(k)[2][: part.fates[k, 0]] += feed.first

    run_all(program.pipeline.label, threads, [lambda k=k: run(k) for k in range(len(part.fates))])
    needed = int(part.fates[:, 0].max(initial=0))
    if needed <= part.rows:
        return part
    return _set_up(program, feed, call, part.with_rows(program, needed), threads)
