"""The tracer of *Recursive Ray Tracing in Geometry Shader* on OpenGL: `Port` draws what a `GeometryShaderTracer` draws.

Section 3, step by step: two vertex buffers of as many records, transform feedback from one into the other, P passes of
the shaders of `geometry_shader_rays_glsl`, glDrawTransformFeedback from the second pass on, so that no count comes back
to the processor, then the blending passes. Grid, references and triangle data are the arrays that refsim made. The eye
rays lie in a buffer of their own, so a second picture needs no filling. Layers and targets are those of `composition`.
Not here: errata as printed, smooth normals, one-sided triangles, no lights at all.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np

from refsim.papers.geometry_shader_rays.passes import blending_pass
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer
from refsim.pipeline.state import DynamicState
from refsim.scene.rays import Rays
from tests.opengl import geometry_shader_rays_glsl as glsl
from tests.opengl import gl as c
from tests.opengl import states
from tests.opengl.geometry_shader_rays_passes import Drawn
from tests.opengl.gl import GL
from tests.opengl.witness import Witness

RECORD_BYTES = 64
SAMPLERS = {"triangles", "surfaces", "cells", "references", "loose_triangles", "target"}


class Port:
    """Buffers, textures and programs for the pictures of one tracer; `close` when done."""

    def __init__(
        self,
        witness: Witness,
        tracer: GeometryShaderTracer,
        rays: Rays,
        storage: str = "textures",
        sources: dict[str, str] | None = None,
    ) -> None:
        """`storage` is one of `glsl.STORAGES`; `sources` are shaders in place of the port's own."""
        self.tracer, self.gl, self.context = tracer, witness.gl, witness.context
        self.storage, self._kept = storage, []
        self.count = len(rays)
        eye = np.ascontiguousarray(tracer.fill(rays).floats[:, : self.count].T)
        self.eye = self._keep(self.context.buffer(eye.tobytes()))
        size = max(tracer.capacity, 1) * RECORD_BYTES
        self.buffers = [self._keep(self.context.buffer(reserve=size)) for _ in range(2)]
        self.feedbacks = [_feedback(self.gl, buffer.glo) for buffer in self.buffers]
        self.arrays = [_vertex_array(self.gl, buffer.glo) for buffer in (self.eye, *self.buffers)]
        self._bind_scene = self._scene()
        self._targets()
        captured = tuple(f"g_{name}" for name in glsl.RECORD)
        shaders = sources or glsl.tracing_sources(len(tracer.options.lights), storage)
        self.program = self._keep(self.context.program(**shaders, varyings=captured))
        self.blending = self._keep(self.context.program(**glsl.blending_sources()))
        self._set_uniforms()

    def _keep(self, made: Any) -> Any:
        self._kept.append(made)
        return made

    def _targets(self) -> None:
        """Layers one below the other, a target a light and one more, and the image."""
        layers, form = self.tracer.layers, "f4" if self.tracer.options.color_format == "rgba32float" else "f1"
        self.size = layers.width, layers.height
        wide = layers.width, layers.height * layers.count

        def texture(size: tuple[int, int]) -> Any:
            made = self._keep(self.context.texture(size, 4, dtype=form))
            made.filter = moderngl.NEAREST, moderngl.NEAREST
            return made

        self.targets = [texture(wide) for _ in layers.targets]
        self.image = texture(self.size)
        self.framebuffers = [self._keep(self.context.framebuffer(made)) for made in (self.targets, [self.image])]
        # moderngl leaves all but the first target undrawn until it binds a framebuffer itself
        buffers = np.arange(len(self.targets), dtype=np.uint32) + c.COLOR_ATTACHMENT0
        self.gl.glBindFramebuffer(c.FRAMEBUFFER, self.framebuffers[0].glo)
        self.gl.glDrawBuffers(len(buffers), buffers.ctypes.data)

    def _scene(self) -> Any:
        """Uploads grid and triangles; returns what binds them."""
        t, grid = self.tracer.prepared.textures, self.tracer.prepared.accelerator.structure
        data = [t.triangles.data, t.surfaces.data]
        loose = np.append(grid.loose, np.int32(-1)).astype(np.int32)
        if self.storage == "buffers":
            start = grid.cells[..., 1].astype(np.int64) * grid.references.shape[1] + grid.cells[..., 0]
            cells = np.stack([start, grid.cells[..., 2]], axis=-1).astype(np.int32)
            arrays = [*data, cells, grid.references, loose]
            made = [self._keep(self.context.buffer(np.ascontiguousarray(array).tobytes())) for array in arrays]
            return lambda: [buffer.bind_to_storage_buffer(k) for k, buffer in enumerate(made)]
        # [y, x, slice, component] becomes OpenGL's [slice, y, x, component]
        sliced = [np.ascontiguousarray(np.moveaxis(array, 2, 0)) for array in data]
        made = [self.context.texture3d(a.shape[2::-1], 4, a.tobytes(), dtype="f4") for a in sliced]
        made.append(self.context.texture3d(grid.cells.shape[2::-1], 3, grid.cells.tobytes(), alignment=1, dtype="i4"))
        made += [
            self.context.texture(array.shape[::-1], 1, array.tobytes(), alignment=1, dtype="i4")
            for array in (grid.references, loose[None])
        ]
        for texture in made:
            self._keep(texture).filter = moderngl.NEAREST, moderngl.NEAREST
        return lambda: [texture.use(k) for k, texture in enumerate(made)]

    def _set_uniforms(self) -> None:
        frame, grid, options = self.tracer.frame, self.tracer.prepared.accelerator.structure, self.tracer.options
        values = {
            "lower": grid.lower, "cell_size": grid.size, "inverse_size": grid.inverse_size, "cells_along": grid.shape,
            "far": grid.far, "loose_count": np.int32(len(grid.loose)),
            "triangle_count": np.int32(len(self.tracer.prepared.scene)),
            "background": frame.background, "lights": frame.lights, "radiances": frame.radiances,
            "epsilon": np.float32(frame.epsilon), "branching": frame.branching, "layers": frame.layers,
            "shadows": np.int32(options.shadows), "reflections": np.int32(options.reflections),
            "refractions": np.int32(options.refractions), "emit_no_more": np.int32(0),
        }  # fmt: skip
        for name in self.program:
            if isinstance(self.program[name], moderngl.Uniform) and name not in SAMPLERS:
                self.program[name].write(np.asarray(values[name]).tobytes())

    def draw(self) -> None:
        """One picture. Nothing is read back and nothing waited for."""
        self._begin()
        for k in range(self.tracer.options.passes):
            self._draw_pass(k)
        self._blend()

    def recorded(self) -> list[Drawn]:
        """One picture, and what each pass drew and captured, copied out between passes; no draw depends on it."""
        self._begin()
        drawn, source = [], self._read(self.eye, self.count)
        for k in range(self.tracer.options.passes):
            with _counted(self.gl, c.PRIMITIVES_GENERATED) as made, _counted(self.gl, c.PRIMITIVES_WRITTEN) as kept:
                self._draw_pass(k)
            captured = self._read(self.buffers[k % 2], int(kept[0]))
            drawn.append(Drawn(source, captured, int(made[0]), int(kept[0])))
            source = captured
        self._blend()
        return drawn

    def _read(self, buffer: Any, records: int) -> np.ndarray:
        return np.frombuffer(buffer.read(records * RECORD_BYTES), np.float32).reshape(records, 16)

    def _begin(self) -> None:
        """Clears: black, the eye's layer the background; binds the scene and sets the state of a tracing pass."""
        gl, (width, height), layers = self.gl, self.size, self.tracer.layers.count
        gl.glBindFramebuffer(c.FRAMEBUFFER, self.framebuffers[0].glo)
        states.reset(gl)
        states.apply(gl, self.tracer.pipeline, DynamicState(), width, height * layers)
        black = np.zeros(4, np.float32)
        for k in range(len(self.targets)):
            gl.glClearBufferfv(c.COLOR, k, black.ctypes.data)
        behind = np.array([*self.tracer.options.background, 0], np.float32)
        gl.glScissor(0, 0, width, height)
        gl.glClearBufferfv(c.COLOR, 0, behind.ctypes.data)
        gl.glScissor(0, 0, width, height * layers)
        self._bind_scene()

    def _draw_pass(self, k: int) -> None:
        """Step 5: draws one vertex buffer and captures into the other."""
        gl = self.gl
        self.program["emit_no_more"].value = int(k == self.tracer.options.passes - 1)
        gl.glUseProgram(self.program.glo)
        gl.glBindVertexArray(self.arrays[0 if k == 0 else 1 + (k - 1) % 2])
        gl.glBindTransformFeedback(c.TRANSFORM_FEEDBACK, self.feedbacks[k % 2])
        gl.glBeginTransformFeedback(c.POINTS)
        if k == 0:
            gl.glDrawArraysInstanced(c.POINTS, 0, self.count, 1)
        else:
            gl.glDrawTransformFeedback(c.POINTS, self.feedbacks[(k - 1) % 2])
        gl.glEndTransformFeedback()
        gl.glBindTransformFeedback(c.TRANSFORM_FEEDBACK, 0)

    def _blend(self) -> None:
        """The blending passes: every target of every layer, in order."""
        gl, (width, height) = self.gl, self.size
        gl.glBindFramebuffer(c.FRAMEBUFFER, self.framebuffers[1].glo)
        states.reset(gl)
        states.apply(gl, blending_pass(), DynamicState(), width, height)
        black = np.zeros(4, np.float32)
        gl.glClearBufferfv(c.COLOR, 0, black.ctypes.data)
        gl.glBindVertexArray(self.arrays[0])
        for layer in range(self.tracer.layers.count):
            for target in self.targets:
                target.use(0)
                self.blending["first_row"].value = layer * height
                gl.glUseProgram(self.blending.glo)
                gl.glDrawArraysInstanced(c.TRIANGLES, 0, 3, 1)

    def picture(self) -> np.ndarray:
        """The image f32[h, w, 3]; waits for what was drawn."""
        self.gl.check("geometry shader rays")
        eight_bits = self.tracer.options.color_format != "rgba32float"
        pixels = np.frombuffer(self.image.read(), np.uint8 if eight_bits else np.float32)
        pixels = pixels.reshape(*self.size[::-1], 4)[..., :3]
        return pixels.astype(np.float32) / np.float32(255) if eight_bits else pixels

    def close(self) -> None:
        """Gives everything back."""
        self.gl.check("geometry shader rays")
        self.gl.glBindVertexArray(0)
        for kind, names in (("VertexArrays", self.arrays), ("TransformFeedbacks", self.feedbacks)):
            for name in names:
                self.gl.delete(kind, name)
        for made in reversed(self._kept):
            made.release()


def _feedback(gl: GL, buffer: int) -> int:
    """A transform feedback object that captures into the buffer."""
    name = gl.new("TransformFeedbacks")
    gl.glBindTransformFeedback(c.TRANSFORM_FEEDBACK, name)
    gl.glBindBufferBase(c.TRANSFORM_FEEDBACK_BUFFER, 0, buffer)
    gl.glBindTransformFeedback(c.TRANSFORM_FEEDBACK, 0)
    return name


def _vertex_array(gl: GL, buffer: int) -> int:
    """The buffer's records as vertices: the four vectors of Listing 2."""
    name = gl.new("VertexArrays")
    gl.glBindVertexArray(name)
    gl.glBindBuffer(c.ARRAY_BUFFER, buffer)
    for location in range(4):
        gl.glEnableVertexAttribArray(location)
        gl.glVertexAttribPointer(location, 4, c.FLOAT, False, RECORD_BYTES, 16 * location)
    gl.glBindVertexArray(0)
    return name


@contextmanager
def _counted(gl: GL, target: int):
    """An array that holds a query's count once the block is left."""
    value, query = np.zeros(1, np.uint64), gl.new("Queries")
    gl.glBeginQuery(target, query)
    yield value
    gl.glEndQuery(target)
    gl.glGetQueryObjectui64v(query, c.QUERY_RESULT, value.ctypes.data)
    gl.delete("Queries", query)
