"""Where the rasteriser's primitives come from: straight from the draw's vertices, or emitted by the geometry stage.

What is emitted is captured, counted and tapped here on its way. A rehearsal runs the stages once without any of these
effects, for what must be known before anything is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from refsim.counters import Counters
from refsim.pipeline.emission import GeometryRecorder, emissions
from refsim.pipeline.front import Feed
from refsim.pipeline.rounds import Scratch
from refsim.pipeline.stream_output import Capture
from refsim.pipeline.taps import Taps, check_size
from refsim.pipeline.vertex_buffer import VertexBuffer

if TYPE_CHECKING:
    from refsim.pipeline.program import Program


class Feeds:
    """The primitives of one draw, before the rasteriser. `lineage`: a fragment or raster tap will ask for it."""

    def __init__(
        self,
        program: Program,
        arguments: Any,
        call: Any,
        threads: int,
        scratch: Scratch,
        buffer: VertexBuffer | None,
        taps: Taps | None,
        lineage: bool,
    ) -> None:
        self._program, self._arguments, self._call = program, arguments, call
        self._threads, self._scratch, self._taps = threads, scratch, taps
        self._capture = Capture(program, buffer) if buffer is not None else None
        self._vertices = self._primitives = 0
        self._recorder = None
        if program.pipeline.geometry is not None and (lineage or self._tapped("geometry")):
            self._recorder = GeometryRecorder(program, call)

    def _tapped(self, stage: str) -> bool:
        return self._taps is not None and self._taps.wants(stage)

    @property
    def records(self) -> bool:
        """Whether a rehearsal is due, as something is tapped that may turn out not to fit."""
        return self._recorder is not None or (self._capture is not None and self._tapped("stream_output"))

    def rehearsal(self) -> Iterator[Feed]:
        """All feeds, to look at: nothing is captured or counted. Records the geometry tap.

        Raises `InputError` where a tap would not fit; for stream output, when all have been looked at.
        """
        generated = 0
        for feed, part in self._run():
            if self._recorder is not None:
                self._recorder.add(part)
            generated += feed.primitives
            yield feed
        if self._capture is not None and self._tapped("stream_output"):
            check_size(self._program.pipeline.label, self._capture.records_of(generated))

    def run(self) -> Iterator[Feed]:
        """All feeds, in the order of the primitives; what they hold has been captured and counted."""
        for feed, part in self._run(self._capture):
            if part is not None:
                self._vertices += part.vertices
                self._primitives += part.primitives
            yield feed

    def _run(self, capture: Capture | None = None) -> Iterator[tuple[Feed, Any]]:
        program, call = self._program, self._call
        if program.emission is None:
            table, per_instance = call.assembly.table, call.assembly.primitives
            total = per_instance * call.instances
            kernel = None if program.pipeline.rasterizer_discard else program.front_end
            yield Feed(kernel, self._arguments, call.buffers, call.indices, table, per_instance, total), None
            return
        kernel = None if program.pipeline.rasterizer_discard else program.front_end
        for parts in emissions(program, self._arguments, call, self._threads, self._scratch):
            if capture is not None:
                capture.take(parts, self._threads)
            for part in parts:
                yield part.feed(kernel, self._arguments), part

    def lineage(self, primitives: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of output primitives i64[n]: their vertices i64[n, corners], rows of the geometry tap or, without a geometry
        stage, of the vertex tap; and their geometry invocations i64[n], −1 without."""
        if self._recorder is None:
            vertices = self._call.assembly.invocations(self._program.pipeline.topology, primitives)
            return vertices, np.full(len(primitives), -1, np.int64)
        tap = self._recorder.record
        vertices = tap.primitives[primitives]
        return vertices, tap.invocation[vertices[:, 0]]

    def finish(self, done: Counters) -> None:
        """Adds the counters of the stages that ran, and tells the captured buffer what it holds."""
        if self._program.pipeline.geometry is not None:
            done.add("geometry.invocations", self._call.assembly.primitives * self._call.instances)
            done.add("geometry.vertices_out", self._vertices)
            done.add("geometry.primitives_out", self._primitives)
        if self._capture is not None:
            done.add("stream_output.generated", self._capture.generated)
            done.add("stream_output.primitives", self._capture.primitives)
            done.add("stream_output.overflowed", self._capture.overflowed)
            self._capture.commit()

    def record(self) -> None:
        """Hands the taps of the stages that ran what they hold."""
        if self._taps is None:
            return
        if self._recorder is not None and self._tapped("geometry"):
            self._taps.geometry.append(self._recorder.record)
        if self._capture is not None and self._tapped("stream_output"):
            self._taps.stream_output.append(self._capture.record())
