"""`draw`: validate, then run the stages top to bottom. The only way anything is drawn.

    vertex shader ─▶ [geometry shader ─▶ stream output] ─▶ clip, screen space ─▶ bins
        ─▶ (early tests) ─▶ fragment shader ─▶ stencil ─▶ depth ─▶ blend ─▶ targets

Memory is bounded: primitives run in rounds, and their bins in batches, of fixed size. Threads share slices of
primitives in the vertex stage and bins of the screen in the fragment stage; every pixel sees its fragments in
submission order, so the result does not depend on them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.counters import ConservationError, Counters
from refsim.errors import InputError
from refsim.pipeline.feeds import Feeds
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
from refsim.pipeline.fragment_stage import Loop, fragments_of, run_fragments
from refsim.pipeline.front import Feed, rounds
from refsim.pipeline.layout import plain, shape_of
from refsim.pipeline.program import Program, program_of
from refsim.pipeline.recorders import Recorders
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.rounds import Scratch, slice_size
from refsim.pipeline.state import DynamicState, Pipeline, TextureFormat
from refsim.pipeline.stream_output import check_capture
from refsim.pipeline.taps import Taps, VertexTap, by_field, check_size
from refsim.pipeline.threads import checked_threads, run_all
from refsim.pipeline.threads import default_threads as default_threads
from refsim.pipeline.validate import checked_draw


def draw(
    pipeline: Pipeline,
    *,
    framebuffer: Framebuffer | None = None,
    counters: Counters,
    vertices: VertexBuffer | tuple[VertexBuffer, ...] = (),
    uniforms: Any = None,
    textures: Any = None,
    indices: np.ndarray | None = None,
    instances: int = 1,
    vertex_count: int | None = None,
    stream_output: VertexBuffer | None = None,
    dynamic: DynamicState | None = None,
    taps: Taps | None = None,
    threads: int | None = None,
    loop: Loop = "auto",
) -> None:
    """Draws into `framebuffer` and adds to `counters`.

    `vertices`: one buffer per layout of the pipeline's vertex state. `indices` int[n] select vertices of the
    per-vertex buffers; without them vertices run in order (`vertex_count` of them; default: all, or 1 without a
    per-vertex buffer), `instances` times. `uniforms` and `textures` are NamedTuples of scalars, tuples and arrays
    (a texture: `refsim.pipeline.resources.Texture`). `stream_output` is the buffer that a pipeline with such a state
    appends its records to; drawn later without a `vertex_count`, it gives as many vertices as it then holds.
    `framebuffer` may be None where the pipeline discards its primitives. `loop` forces one of the two fragment loops,
    which give the same bits. Raises `InputError` naming the field that does not fit, before anything is drawn. A shader
    that reads beyond an array reads foreign memory, as on a GPU; run with NUMBA_BOUNDSCHECK=1 in the environment to be
    told.
    """
    if not isinstance(counters, Counters) or not isinstance(taps, Taps | None):
        raise InputError("counters must be a Counters and taps a Taps.")
    call = checked_draw(
        pipeline, framebuffer, vertices, uniforms, textures, indices, instances, vertex_count,
        dynamic or DynamicState(), loop,
    )  # fmt: skip
    read = {"uniforms": uniforms, "textures": textures, "indices": indices}
    check_capture(pipeline, stream_output, framebuffer, vertices, **read)
    threads = checked_threads(threads)
    shapes = shape_of(uniforms), shape_of(textures)
    program = program_of(pipeline, *shapes, indices is not None, _formats(framebuffer)).for_a_draw()
    arguments = (plain(uniforms), plain(textures))
    done = Counters()
    done.add("draw.calls", 1)
    done.add("vertex.invocations", call.assembly.vertices * instances)
    primitives = call.assembly.primitives * instances
    done.add("assembly.primitives", primitives)
    vertex_tap, recorders = None, Recorders.of(program, taps)
    if taps is not None and taps.wants("vertex"):
        vertex_tap = _tap_vertices(program, arguments, call)

    scratch = Scratch.borrow()
    feeds = Feeds(program, arguments, call, threads, scratch, stream_output, taps, recorders.any)
    _rehearse(program, feeds, call, primitives, threads, recorders, scratch)
    shaded_before = _shaded(framebuffer)
    for feed in feeds.run():
        if not pipeline.rasterizer_discard:
            _rasterise(program, feed, call, threads, loop, recorders, done, scratch)
    _check_shaded(_shaded(framebuffer) - shaded_before, done)
    scratch.give_back()
    feeds.finish(done)
    feeds.record()
    # Counters and taps hear of a draw when all of it is drawn
    counters.merge(done)
    if taps is not None and vertex_tap is not None:
        taps.vertex.append(vertex_tap)
    if taps is not None:
        recorders.record(taps, feeds.lineage)


def _rehearse(
    program: Program, feeds: Feeds, call: Any, primitives: int, threads: int, recorders: Recorders, scratch: Scratch
) -> None:
    """Runs what comes before the fragment stage without effect, where only that can tell whether the draw is refused:
    quads that are no rectangles, taps that do not fit."""
    quads = program.pipeline.rasterized.corners == 4 and primitives > slice_size(primitives, threads) * threads
    if not (recorders.any or quads or feeds.records):
        return
    reached = rows = fragments = 0
    for feed in feeds.rehearsal():
        if not (recorders.any or quads):
            continue
        reached += feed.primitives if recorders.raster else 0
        for part in rounds(program, feed, call, threads, scratch):
            rows += len(part.survivors()) if recorders.raster else 0
            fragments += fragments_of(program, part) if recorders.fragment else 0
        check_size(program.pipeline.label, max(reached, rows, fragments))


def _rasterise(
    program: Program,
    feed: Feed,
    call: Any,
    threads: int,
    loop: Loop,
    recorders: Recorders,
    done: Counters,
    scratch: Scratch,
) -> None:
    """Everything from the front end to the targets, for the primitives of `feed`; counts go to `done`."""
    done.add("raster.primitives", feed.primitives)
    counts = np.zeros(COUNTS, np.int64)
    boxed = 0
    for part in rounds(program, feed, call, threads, scratch):
        fates = part.fates.sum(axis=0)
        _add_primitive_fates(done, fates, program.triangles)
        boxed += int(fates[4])
        if recorders.raster is not None:
            recorders.raster.add(part)
        run_fragments(program, feed.arguments, call, part, threads, counts, recorders.fragment, loop, scratch)
    _add_fragment_fates(done, counts)
    if program.writes.blends:
        done.add("blend.fragments", counts[WRITTEN])
    _check_stages(program.triangles, boxed, counts)


def _shaded(framebuffer: Framebuffer | None) -> int:
    """Fragment shader runs that the framebuffer's pixels have counted."""
    return int(framebuffer.invocations.sum(dtype=np.int64)) if framebuffer is not None else 0


def _check_shaded(shaded: int, done: Counters) -> None:
    """Raises `ConservationError` unless pixels and fates count the same fragment shader runs."""
    if shaded != done["fragment.invocations"]:
        fates = done["fragment.invocations"]
        raise ConservationError(f"pixels count {shaded} fragment shader runs, their fates {fates}.")


def _check_stages(bounded: bool, covered: int, counts: np.ndarray) -> None:
    """What two stages count each on its own must agree; raises `ConservationError`.

    `bounded`: the rasteriser knows of triangles only what their boxes cover, which is more than they do.
    """
    if counts[COVERED] > covered or (counts[COVERED] < covered and not bounded):
        raise ConservationError(f"the rasteriser covered {covered} pixels, the fragment stage saw {counts[COVERED]}.")


def _add_primitive_fates(counters: Counters, fates: np.ndarray, triangles: bool) -> None:
    names = {"clipped": 1, "empty": 2, "drawn": 6} | ({"culled": 5, "clipped_pieces": 7} if triangles else {})
    for name, place in names.items():
        counters.add(f"raster.{name}", fates[place])


def _formats(framebuffer: Framebuffer | None) -> tuple[TextureFormat, ...]:
    return tuple(framebuffer.targets.values()) if framebuffer is not None else ()


def _add_fragment_fates(counters: Counters, counts: np.ndarray) -> None:
    counters.add("raster.fragments", counts[COVERED])
    counters.add("stencil.failed_early", counts[EARLY_STENCIL])
    counters.add("depth.failed_early", counts[EARLY_DEPTH])
    counters.add("fragment.invocations", counts[COVERED] - counts[EARLY_STENCIL] - counts[EARLY_DEPTH])
    counters.add("fragment.discarded", counts[DISCARDED])
    counters.add("stencil.failed", counts[STENCIL_FAILED])
    counters.add("depth.failed", counts[DEPTH_FAILED])
    counters.add("fragment.written", counts[WRITTEN])


def _tap_vertices(program: Program, arguments: Any, call: Any) -> VertexTap:
    count = call.assembly.vertices * call.instances
    check_size(program.pipeline.label, count)
    position, size = np.empty((4, count), np.float32), np.empty(count, np.float32)
    floats = np.empty((count, program.varyings.floats), np.float32)
    ints = np.empty((count, program.varyings.ints), np.int32)
    columns = (position, size, floats, ints)
    rows = (*arguments, call.buffers, call.indices, call.assembly.vertices, 0, count)
    run_all(program.pipeline.label, 1, [lambda: program.vertex_tap(*rows, *columns)])
    varyings = by_field(program.varyings, floats.T, ints.T)
    instance, slot = np.divmod(np.arange(count), max(call.assembly.vertices, 1))
    vertex = call.indices[slot].astype(np.int64) if program.indexed else slot
    return VertexTap(program.pipeline.label, np.ascontiguousarray(position.T), size, varyings, vertex, instance)
