"""The witness: draws a `Case` on a real OpenGL and gives back what it left.

moderngl makes the context (EGL, no window) and compiles programs; everything else goes through `tests.opengl.gl`.
Transform feedback records go into a buffer of exactly `capture` records, so overflow is OpenGL's own.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import moderngl
import numpy as np

from refsim.pipeline.layout import Layout
from refsim.pipeline.vertex_buffer import record_type
from tests.opengl import gl as c
from tests.opengl import states
from tests.opengl.case import Case, Glsl, Outcome
from tests.opengl.gl import GL
from tests.opengl.target import Target

# OpenGL's counts, under the names of refsim's counters that must equal them
QUERIES = {
    "fragment.written": c.SAMPLES_PASSED,
    "primitives.generated": c.PRIMITIVES_GENERATED,
    "stream_output.primitives": c.PRIMITIVES_WRITTEN,
    "vertices.submitted": c.VERTICES_SUBMITTED,
    "assembly.primitives": c.PRIMITIVES_SUBMITTED,
    "vertex.invocations": c.VERTEX_INVOCATIONS,
    "geometry.invocations": c.GEOMETRY_INVOCATIONS,
    "geometry.primitives_out": c.GEOMETRY_PRIMITIVES,
    "clipping.input": c.CLIPPING_INPUT,
}


class Witness:
    """An OpenGL context of its own. Programs are kept; buffers and framebuffers live for one draw."""

    def __init__(self) -> None:
        self.context = moderngl.create_standalone_context(backend="egl", require=450)
        self.gl = GL()
        self.vendor, self.renderer, self.version = (self.gl.text(what) for what in (c.VENDOR, c.RENDERER, c.VERSION))
        self.subpixel_bits = self.gl.integer(c.SUBPIXEL_BITS)
        self._program = lru_cache(maxsize=None)(self._compiled)

    def _compiled(self, glsl: Glsl, captured: tuple[str, ...]) -> Any:
        first = "#version 450 core\n"
        return self.context.program(
            vertex_shader=first + glsl.vertex,
            fragment_shader=first + glsl.fragment if glsl.fragment else None,
            geometry_shader=first + glsl.geometry if glsl.geometry else None,
            varyings=captured,
        )

    def program(self, case: Case) -> int:
        """OpenGL's name of the case's program."""
        captured: tuple[str, ...] = ()
        if case.pipeline.stream_output is not None:
            stage = "g" if case.glsl.geometry else "v"
            builtin = {"position": "gl_Position", "point_size": "gl_PointSize"}
            fields = Layout.of(case.pipeline.stream_output.record).fields
            captured = tuple(builtin.get(field.name, f"{stage}_{field.name}") for field in fields)
        return int(self._program(case.glsl, captured).glo)

    def draw(self, case: Case, then: Case | None = None) -> Outcome:
        """The case on OpenGL. `then` is drawn from the captured records by glDrawTransformFeedback, and its planes are
        returned."""
        gl = self.gl
        form = case.pipeline.depth_stencil.format
        with (
            Target(gl, case.targets, form, case.planes) as target,
            self.vertices(case) as source,
            self.feedback(case) as (feedback, buffer),
        ):
            self._set(case)
            with self._counted() as counts:
                self._begin(case, feedback)
                draw_vertices(gl, case, source)
                if feedback:
                    gl.glEndTransformFeedback()
            gl.check("draw")
            records = self.records(case, buffer, counts) if feedback else None
            planes = target.planes() if then is None else self._draw_captured(then, feedback, buffer)
        return Outcome(planes, counts, records)

    def _set(self, case: Case) -> None:
        states.reset(self.gl)
        states.apply(self.gl, case.pipeline, case.dynamic, *case.size)
        self.gl.glUseProgram(self.program(case))

    def _begin(self, case: Case, feedback: int) -> None:
        if feedback:
            points = case.pipeline.rasterized.corners == 1
            self.gl.glBeginTransformFeedback(c.POINTS if points else c.TRIANGLES)

    @contextmanager
    def vertices(self, case: Case):
        """A vertex array over buffers of the case's vertices; gives the index buffer, or 0."""
        gl, array = self.gl, self.gl.new("VertexArrays")
        gl.glBindVertexArray(array)
        buffers = []
        for location, field in enumerate(Layout.of(case.attributes).fields):
            column = np.ascontiguousarray(case.vertices[field.name], "<f4" if field.kind == "f" else "<i4")
            buffers.append(_buffer(gl, c.ARRAY_BUFFER, column))
            _attribute(gl, location, field.kind, field.size, 0, 0)
        indices = 0
        if case.indices is not None:
            indices = _buffer(gl, c.ELEMENT_ARRAY_BUFFER, np.ascontiguousarray(case.indices, np.uint32))
            buffers.append(indices)
        yield indices
        gl.glBindVertexArray(0)
        gl.delete("VertexArrays", array)
        for buffer in buffers:
            gl.delete("Buffers", buffer)

    @contextmanager
    def feedback(self, case: Case):
        """A transform feedback object and its buffer, or zeros if the case captures nothing."""
        if case.capture is None:
            yield 0, 0
            return
        gl, feedback = self.gl, self.gl.new("TransformFeedbacks")
        gl.glBindTransformFeedback(c.TRANSFORM_FEEDBACK, feedback)
        room = np.zeros(case.capture, record_type(case.pipeline.stream_output.record))
        buffer = _buffer(gl, c.TRANSFORM_FEEDBACK_BUFFER, room)
        gl.glBindBufferBase(c.TRANSFORM_FEEDBACK_BUFFER, 0, buffer)
        yield feedback, buffer
        gl.glBindTransformFeedback(c.TRANSFORM_FEEDBACK, 0)
        gl.delete("TransformFeedbacks", feedback)
        gl.delete("Buffers", buffer)

    @contextmanager
    def _counted(self):
        """A dictionary that holds the counts of what was drawn inside, once the block is left."""
        gl, counts = self.gl, {}
        queries = {name: (target, gl.new("Queries")) for name, target in QUERIES.items()}
        for target, query in queries.values():
            gl.glBeginQuery(target, query)
        yield counts
        for target, _ in queries.values():
            gl.glEndQuery(target)
        for name, (_, query) in queries.items():
            value = np.zeros(1, np.uint64)
            gl.glGetQueryObjectui64v(query, c.QUERY_RESULT, value.ctypes.data)
            counts[name] = int(value[0])
            gl.delete("Queries", query)

    def records(self, case: Case, buffer: int, counts: dict[str, int]) -> np.ndarray:
        record, corners = record_type(case.pipeline.stream_output.record), case.pipeline.rasterized.corners
        made = np.zeros(counts["stream_output.primitives"] * corners, record)
        self.gl.glBindBuffer(c.TRANSFORM_FEEDBACK_BUFFER, buffer)
        self.gl.glGetBufferSubData(c.TRANSFORM_FEEDBACK_BUFFER, 0, made.nbytes, made.ctypes.data)
        self.gl.check("glGetBufferSubData")
        return made

    def _draw_captured(self, case: Case, feedback: int, buffer: int):
        """glDrawTransformFeedback: the number of vertices is known to OpenGL alone."""
        gl, array = self.gl, self.gl.new("VertexArrays")
        record = record_type(case.attributes)
        with Target(gl, case.targets, case.pipeline.depth_stencil.format, case.planes) as target:
            gl.glBindVertexArray(array)
            gl.glBindBuffer(c.ARRAY_BUFFER, buffer)
            for location, field in enumerate(Layout.of(case.attributes).fields):
                offset = int(record.fields[field.name][1])
                _attribute(gl, location, field.kind, field.size, record.itemsize, offset)
            self._set(case)
            gl.glDrawTransformFeedback(states.TOPOLOGY[case.pipeline.topology], feedback)
            gl.check("glDrawTransformFeedback")
            gl.delete("VertexArrays", array)
            return target.planes()


def _buffer(gl: GL, kind: int, content: np.ndarray) -> int:
    name = gl.new("Buffers")
    gl.glBindBuffer(kind, name)
    gl.glBufferData(kind, content.nbytes, content.ctypes.data if content.nbytes else None, c.STATIC_DRAW)
    return name


def _attribute(gl: GL, location: int, kind: str, size: int, stride: int, offset: int) -> None:
    gl.glEnableVertexAttribArray(location)
    if kind == "f":
        gl.glVertexAttribPointer(location, size, c.FLOAT, False, stride, offset)
    else:
        gl.glVertexAttribIPointer(location, size, c.INT, stride, offset)


def draw_vertices(gl: GL, case: Case, indices: int) -> None:
    topology = states.TOPOLOGY[case.pipeline.topology]
    if indices:
        gl.glDrawElementsInstanced(topology, len(case.indices), c.UNSIGNED_INT, 0, case.instances)
    else:
        count = len(next(iter(case.vertices.values())))
        gl.glDrawArraysInstanced(topology, 0, count, case.instances)
