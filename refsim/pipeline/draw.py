"""`draw`: validate, then run the stages top to bottom. The only way anything is drawn.

    vertex shader ─▶ clip, rectangles ─▶ bins ─▶ (early tests) ─▶ fragment shader ─▶ stencil ─▶ depth ─▶ targets

Memory is bounded: primitives run in slices, and their bins in batches, of fixed size. Threads share slices of
primitives in the vertex stage and bins of the screen in the fragment stage; every pixel sees its fragments in
submission order, so the result does not depend on them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numba.core.errors import NumbaError

from refsim.counters import ConservationError, Counters
from refsim.errors import InputError
from refsim.pipeline.fragment import (
    COUNTS,
    COVERED,
    DEPTH_FAILED,
    DISCARDED,
    EARLY_DEPTH,
    EARLY_STENCIL,
    STENCIL_FAILED,
    WRITTEN,
)
from refsim.pipeline.layout import plain, shape_of
from refsim.pipeline.program import Program, program_of
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.rounds import Round, Scratch, slice_size
from refsim.pipeline.state import DynamicState, Pipeline
from refsim.pipeline.taps import FragmentRecorder, Taps, VertexTap, by_field, check_size
from refsim.pipeline.validate import checked_draw

BIN_ITEMS = 2**21
FEW_FRAGMENTS = 2**12
LIST_BELOW = 16.0  # mean fragments a primitive; below it the fragment list is quicker than a packet

Loop = Literal["auto", "dense", "list"]


def default_threads() -> int:
    """The processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@lru_cache(maxsize=8)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="refsim")


def _run_all(label: str, threads: int, tasks: list[Any]) -> list[Any]:
    """Results of the tasks, in order; the kernels inside release the GIL. A shader that does not compile is named."""
    try:
        return _results(threads, tasks)
    except NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        telling = ("Unknown attribute", "wrong tuple length", "missing a required", "too many positional", "No ")
        cause = next((line for line in lines if any(word in line for word in telling)), lines[0])
        raise InputError(f"{label}: a shader does not compile: {cause}") from error


def _results(threads: int, tasks: list[Any]) -> list[Any]:
    if threads == 1 or len(tasks) == 1:
        return [task() for task in tasks]
    return [future.result() for future in [_pool(threads).submit(task) for task in tasks]]


def draw(
    pipeline: Pipeline,
    *,
    framebuffer: Framebuffer,
    counters: Counters,
    vertices: VertexBuffer | tuple[VertexBuffer, ...] = (),
    uniforms: Any = None,
    textures: Any = None,
    indices: np.ndarray | None = None,
    instances: int = 1,
    vertex_count: int | None = None,
    dynamic: DynamicState | None = None,
    taps: Taps | None = None,
    threads: int | None = None,
    loop: Loop = "auto",
) -> None:
    """Draws into `framebuffer` and adds to `counters`.

    `vertices`: one buffer per layout of the pipeline's vertex state. `indices` int[n] select vertices of the
    per-vertex buffers; without them vertices run in order (`vertex_count` of them; default: all, or 1 without a
    per-vertex buffer), `instances` times. `uniforms` and `textures` are NamedTuples of scalars, tuples and arrays
    (a texture: `refsim.pipeline.resources.Texture`). `loop` forces one of the two fragment loops, which give the same
    bits. Raises `InputError` naming the field that does not fit, before anything is drawn. A shader that reads beyond
    an array reads foreign memory, as on a GPU; run with NUMBA_BOUNDSCHECK=1 in the environment to be told.
    """
    if not isinstance(counters, Counters) or not isinstance(taps, Taps | None):
        raise InputError("counters must be a Counters and taps a Taps.")
    call = checked_draw(
        pipeline, framebuffer, vertices, uniforms, textures, indices, instances, vertex_count,
        dynamic or DynamicState(), loop,
    )  # fmt: skip
    threads = _checked_threads(threads)
    program = program_of(pipeline, shape_of(uniforms), shape_of(textures), indices is not None)
    arguments = (plain(uniforms), plain(textures))
    done = Counters()
    done.add("draw.calls", 1)
    done.add("vertex.invocations", call.vertex_count * instances)
    vertex_tap = recorder = None
    if taps is not None and taps.wants("vertex"):
        vertex_tap = _tap_vertices(program, arguments, call, instances)
    if taps is not None and taps.wants("fragment"):
        recorder = FragmentRecorder(pipeline.label, program.outputs)

    primitives = call.vertex_count // program.corners * instances
    done.add("raster.primitives", primitives)
    counts = np.zeros(COUNTS, np.int64)
    scratch = Scratch.borrow()
    covered_by_raster, shaded_before = 0, int(framebuffer.invocations.sum(dtype=np.int64))
    # What only the vertex stage can tell is refused before anything is drawn, at the price of running it twice
    if recorder is not None or (program.corners > 1 and primitives > slice_size(primitives, threads) * threads):
        rounds = _rounds(program, arguments, call, primitives, threads, scratch)
        covered = sum(int(part.fates[:, 4].sum()) for part in rounds)
        check_size(pipeline.label, covered if recorder is not None else 0)
    for part in _rounds(program, arguments, call, primitives, threads, scratch):
        _add_primitive_fates(done, part.fates.sum(axis=0))
        covered_by_raster += int(part.fates[:, 4].sum())
        _run_fragments(program, arguments, call, part, threads, counts, recorder, loop, scratch)
    scratch.give_back()
    _add_fragment_fates(done, counts)
    _check_stages(covered_by_raster, counts, int(framebuffer.invocations.sum(dtype=np.int64)) - shaded_before)
    # Counters and taps hear of a draw when all of it is drawn
    counters.merge(done)
    if taps is not None and vertex_tap is not None:
        taps.vertex.append(vertex_tap)
    if taps is not None and recorder is not None:
        taps.fragment.append(recorder.record())


def _checked_threads(threads: int | None) -> int:
    if threads is None:
        return default_threads()
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or not 1 <= threads <= 1024:
        raise InputError(f"threads must be a whole number from 1 to 1024, not {threads!r}.")
    return int(threads)


def _rounds(
    program: Program, arguments: Any, call: Any, primitives: int, threads: int, scratch: Scratch
) -> Iterator[Round]:
    """All primitives after the vertex stage, a round at a time. Raises `InputError` for quads that are no rectangle."""
    size = slice_size(primitives, threads)
    for first in range(0, primitives, size * threads):
        part = Round(program, first, min(size * threads, primitives - first), size, scratch)
        _run_front_end(program, arguments, call, part, threads)
        _refuse_crooked(part)
        yield part


def _run_front_end(program: Program, arguments: Any, call: Any, part: Round, threads: int) -> None:
    def run(k: int) -> None:
        columns = part.columns(k)
        program.front_end(
            *arguments, call.buffers, call.indices, call.vertex_count, part.first + k * part.size, len(columns[0]),
            call.viewport, call.bounds, *columns, part.fates[k],
        )  # fmt: skip

    _run_all(program.pipeline.label, threads, [lambda k=k: run(k) for k in range(len(part.fates))])


def _bin_shape(mean_area: float, framebuffer: Framebuffer, threads: int, smallest: int) -> tuple[int, int]:
    """log2 of a bin's width and height: about a primitive's size, and enough bins for the threads."""
    log2 = int(np.clip(np.rint(np.log2(max(mean_area, 1.0)) / 2), 3, 5))
    while log2 > smallest and -(-framebuffer.width >> log2) * -(-framebuffer.height >> log2) < 4 * threads:
        log2 -= 1
    return log2, log2


def _run_fragments(
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
    area = float(part.fates[:, 4].sum()) / len(survivors)
    # A pass over few pixels that all are written (nothing to probe) is listed too: packets would shade their dead lanes
    few = not program.tests.probe and area * len(survivors) < FEW_FRAGMENTS * threads
    listed = loop == "list" or (loop == "auto" and (area < LIST_BELOW or few))
    shape = _bin_shape(area, framebuffer, threads, 2 if listed else 3)
    bins_x = -(-framebuffer.width // (1 << shape[0]))
    bins = bins_x * -(-framebuffer.height // (1 << shape[1]))
    start = np.empty(bins + 2, np.int64)
    items = scratch.array("items", (max(min(BIN_ITEMS, len(survivors) * bins), bins),), np.int32)
    primitives = (part.rect, part.depth, part.floats, part.ints)
    target = (framebuffer.floats, framebuffer.ints, framebuffer.depth, framebuffer.stencil, framebuffer.invocations)
    fixed = (*arguments, call.stencil_values, primitives)
    images = (shape, call.input_floats, call.input_ints, target)
    first = 0
    while first < len(survivors):
        first = program.bin_primitives(part.rect, survivors, first, *shape, bins_x, start, items)
        tap = _NO_TAP
        kernel: Any = program.listed if listed else program.dense
        if recorder is not None:
            offset = np.zeros(bins, np.int64)
            count = program.count_fragments(part.rect, (start, items, 0, bins, bins_x), shape, offset)
            tap = (offset, *recorder.columns(count))
            kernel = program.tapped
        tail = (tap,) if listed or recorder is not None else ()

        def task(group: tuple[int, int], kernel: Any = kernel, tail: Any = tail) -> np.ndarray:
            local = np.zeros(COUNTS, np.int64)
            kernel(*fixed, (start, items, *group, bins_x), *images, local, *tail)
            return local

        groups = _groups(start, bins, threads)
        for local in _run_all(program.pipeline.label, threads, [lambda group=group: task(group) for group in groups]):
            counts += local
        if recorder is not None:
            recorder.add(part.source, tap[1:])


_NO_TAP: tuple[np.ndarray, ...] = (
    np.zeros(1, np.int64),
    np.zeros(1, np.int32),
    np.zeros((2, 1), np.int32),
    np.zeros(1, np.int32),
    np.zeros(1, np.float32),
    np.zeros((1, 1), np.float32),
    np.zeros((1, 1), np.int32),
)


def _groups(start: np.ndarray, bins: int, threads: int) -> list[tuple[int, int]]:
    """Runs of neighbouring bins of about equal work, a few for each thread."""
    if threads == 1:
        return [(0, bins)]
    edges = np.linspace(0, start[bins], 4 * threads + 1)
    cuts = np.unique(np.concatenate(([0], np.searchsorted(start[: bins + 1], edges[1:-1]), [bins])))
    return [(int(a), int(b)) for a, b in pairwise(cuts)]


def _check_stages(covered: int, counts: np.ndarray, shaded: int) -> None:
    """What two stages count each on its own must agree; raises `ConservationError`."""
    if covered != counts[COVERED]:
        raise ConservationError(f"the rasteriser covered {covered} pixels, the fragment stage saw {counts[COVERED]}.")
    invocations = counts[COVERED] - counts[EARLY_STENCIL] - counts[EARLY_DEPTH]
    if shaded != invocations:
        raise ConservationError(f"pixels count {shaded} fragment shader runs, their fates {invocations}.")


def _refuse_crooked(part: Round) -> None:
    crooked = int(part.fates[:, 3].sum())
    if crooked:
        raise InputError(f"{crooked} quads are not axis-aligned rectangles of the screen; quad-list draws only those.")


def _add_primitive_fates(counters: Counters, fates: np.ndarray) -> None:
    drawn, clipped, empty = (int(fate) for fate in fates[:3])
    counters.add("raster.drawn", drawn)
    counters.add("raster.clipped", clipped)
    counters.add("raster.empty", empty)


def _add_fragment_fates(counters: Counters, counts: np.ndarray) -> None:
    counters.add("raster.fragments", counts[COVERED])
    counters.add("stencil.failed_early", counts[EARLY_STENCIL])
    counters.add("depth.failed_early", counts[EARLY_DEPTH])
    counters.add("fragment.invocations", counts[COVERED] - counts[EARLY_STENCIL] - counts[EARLY_DEPTH])
    counters.add("fragment.discarded", counts[DISCARDED])
    counters.add("stencil.failed", counts[STENCIL_FAILED])
    counters.add("depth.failed", counts[DEPTH_FAILED])
    counters.add("fragment.written", counts[WRITTEN])


def _tap_vertices(program: Program, arguments: Any, call: Any, instances: int) -> VertexTap:
    count = call.vertex_count * instances
    check_size(program.pipeline.label, count)
    position, size = np.empty((4, count), np.float32), np.empty(count, np.float32)
    floats = np.empty((count, program.varyings.floats), np.float32)
    ints = np.empty((count, program.varyings.ints), np.int32)
    program.vertex_tap(
        *arguments, call.buffers, call.indices, call.vertex_count, 0, count, position, size, floats, ints
    )
    varyings = by_field(program.varyings, floats.T, ints.T)
    return VertexTap(program.pipeline.label, np.ascontiguousarray(position.T), size, varyings)
