"""Runs the fragment stage of one round of primitives: bins them, chooses a loop, shares the bins among threads.

Primitives are sorted into bins of the screen in batches of fixed size, so that memory is bounded. Every pixel sees its
fragments in submission order, whatever the bins and the threads.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Literal

import numpy as np

from refsim.pipeline.fragment import COUNTS
from refsim.pipeline.program import Program
from refsim.pipeline.recorders import FragmentRecorder
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.rounds import Round, Scratch
from refsim.pipeline.threads import run_all

BIN_ITEMS = 2**21
FEW_FRAGMENTS = 2**12
EVERYTHING = 29  # log2 of more pixels than a framebuffer is wide or high
# Mean fragments a primitive below which the fragment list is quicker than packets: rectangles, triangles
LIST_BELOW = (16.0, 48.0)

Loop = Literal["auto", "dense", "list"]


def _bin_shape(
    mean_area: float, framebuffer: Framebuffer, threads: int, smallest: int, triangles: bool
) -> tuple[int, int]:
    """log2 of a bin's width and height: about a primitive's size, and enough bins for the threads; smaller for large
    triangles, as a bin on an edge is asked pixel by pixel."""
    log2 = np.log2(max(mean_area, 1.0)) / 2
    log2 = int(np.clip(np.rint(log2 - 1.5), 4, 5) if triangles else np.clip(np.rint(log2), 3, 5))
    while log2 > smallest and -(-framebuffer.width >> log2) * -(-framebuffer.height >> log2) < 4 * threads:
        log2 -= 1
    return log2, log2


def fragments_of(program: Program, part: Round) -> int:
    """Fragments that a round makes: it is counted as one bin that holds every pixel."""
    survivors = part.survivors()
    bins = (np.array([0, len(survivors)]), survivors, 0, 1, 1)
    return int(program.count_fragments(part.primitives, bins, (EVERYTHING, EVERYTHING), np.zeros(1, np.int64)))


def run_fragments(
    program: Program,
    arguments: Any,
    call: Any,
    part: Round,
    threads: int,
    counts: np.ndarray,
    recorder: FragmentRecorder | None,
    loop: Loop,
    scratch: Scratch,
) -> None:
    """Bins the survivors, in batches that fit, and runs the fragment stage over the bins."""
    survivors = part.survivors()
    if not len(survivors):
        return
    framebuffer = call.framebuffer
    # A triangle is half of its bounding box
    area = float(part.fates[:, 4].sum()) / len(survivors) * (0.5 if program.triangles else 1.0)
    # A pass over few pixels that all are written (nothing to probe) is listed too: packets would shade their dead lanes
    few = not program.tests.probe and area * len(survivors) < FEW_FRAGMENTS * threads
    listed = loop == "list" or (loop == "auto" and (area < LIST_BELOW[program.triangles] or few))
    shape = _bin_shape(area, framebuffer, threads, 2 if listed else 3, program.triangles)
    bins_x = -(-framebuffer.width // (1 << shape[0]))
    bins = bins_x * -(-framebuffer.height // (1 << shape[1]))
    start = np.empty(bins + 2, np.int64)
    items = scratch.array("items", (max(min(BIN_ITEMS, len(survivors) * bins), bins),), np.int32)
    primitives = part.primitives
    target = (framebuffer.floats, framebuffer.ints, framebuffer.depth, framebuffer.stencil, framebuffer.invocations)
    fixed = (*arguments, call.test_values, call.blend_constant, primitives)
    images = (shape, call.input_floats, call.input_ints, target)
    first = 0
    while first < len(survivors):
        first = program.bin_primitives(part.rect, survivors, first, *shape, bins_x, start, items)
        tap = _NO_TAP
        kernel: Any = program.listed if listed else program.dense
        if recorder is not None:
            offset = np.zeros(bins, np.int64)
            count = program.count_fragments(primitives, (start, items, 0, bins, bins_x), shape, offset)
            tap = (offset, *recorder.columns(count))
            kernel = program.tapped
        tail = (tap,) if listed or recorder is not None else ()

        def task(group: tuple[int, int], kernel: Any = kernel, tail: Any = tail) -> np.ndarray:
            local = np.zeros(COUNTS, np.int64)
            kernel(*fixed, (start, items, *group, bins_x), *images, local, *tail)
            return local

        groups = _groups(start, bins, threads)
        for local in run_all(program.pipeline.label, threads, [lambda group=group: task(group) for group in groups]):
            counts += local
        if recorder is not None:
            recorder.add(part.source, tap[1:])


_NO_TAP: tuple[np.ndarray, ...] = (
    np.zeros(1, np.int64),
    np.zeros(1, np.int32),
    np.zeros((2, 1), np.int32),
    np.zeros(1, np.int32),
    np.zeros(1, np.float32),
    *(np.zeros((1, 1), np.float32), np.zeros((1, 1), np.int32)) * 2,
)


def _groups(start: np.ndarray, bins: int, threads: int) -> list[tuple[int, int]]:
    """Runs of neighbouring bins of about equal work, a few for each thread."""
    if threads == 1:
        return [(0, bins)]
    edges = np.linspace(0, start[bins], 4 * threads + 1)
    cuts = np.unique(np.concatenate(([0], np.searchsorted(start[: bins + 1], edges[1:-1]), [bins])))
    return [(int(a), int(b)) for a, b in pairwise(cuts)]
