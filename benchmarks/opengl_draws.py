"""The draws that are timed on refsim and on OpenGL: shaders of both, vertices, and a draw made ready on either side.

`Ours` and `Theirs` hold everything that a draw needs, so that a call draws and nothing else; `clear` comes before it.
Time on OpenGL runs until glFinish returns.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any, NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.enums import BlendFactor, CompareFunction, PrimitiveTopology, TextureFormat
from refsim.pipeline.geometry import EMIT, SKIP
from refsim.pipeline.layout import f32, i32, vec3, vec4
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.state import (
    BlendComponent,
    BlendState,
    ColorTargetState,
    DepthStencilState,
    FragmentState,
    GeometryState,
    Pipeline,
    StreamOutputState,
    VertexBufferLayout,
    VertexState,
)
from tests.opengl import gl as c
from tests.opengl import states
from tests.opengl.case import Case, Glsl, framebuffer_of, planes_of
from tests.opengl.target import Planes, Target
from tests.opengl.witness import Witness, draw_vertices

THREADS = 2
OVER = BlendComponent(src_factor=BlendFactor.SRC_ALPHA, dst_factor=BlendFactor.ONE_MINUS_SRC_ALPHA)


class Vertex(NamedTuple):
    """Clip position, point size, a colour."""

    position: vec4
    size: f32
    color: vec4


class Three(NamedTuple):
    """Three smooth varyings."""

    color: vec3


class Colored(NamedTuple):
    """A colour with alpha."""

    color: vec4


@func
def shaded_vertex(u, t, attributes, vertex_index, instance_index):
    """Three components of the colour."""
    a = attributes[0]
    return a.position, a.size, Three((a.color[0], a.color[1], a.color[2]))


@func
def shaded_fragment(u, t, v, inputs, pixel):
    """The varyings."""
    return True, np.float32(0), Colored((v.color[0], v.color[1], v.color[2], np.float32(1)))


@func
def colored_vertex(u, t, attributes, vertex_index, instance_index):
    """The whole colour."""
    a = attributes[0]
    return a.position, a.size, Colored(a.color)


@func
def colored_fragment(u, t, v, inputs, pixel):
    """The colour."""
    return True, np.float32(0), v


class Seed(NamedTuple):
    """A point that becomes `count` points."""

    position: vec4
    count: i32


class Count(NamedTuple):
    """How many."""

    count: i32


class Grown(NamedTuple):
    """Which of them."""

    number: i32


class GrownRecord(NamedTuple):
    """What is captured."""

    position: vec4
    number: i32


@func
def seed_vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Seed` on."""
    a = attributes[0]
    return a.position, np.float32(1), Count(a.count)


@func
def grown(k, p, count, primitive):
    """Point k of an invocation, moved right by k / 256."""
    moved = (p[0] + np.float32(k) * np.float32(1 / 256), p[1], p[2], p[3])
    return (EMIT if k < count else SKIP), moved, np.float32(1), Grown(np.int32(primitive * np.int32(4) + k))


@func
def grow(u, t, vertices, primitive_index):
    """Up to four points."""
    p, n, i = vertices[0][0], vertices[0][2].count, primitive_index
    return (
        grown(np.int32(0), p, n, i), grown(np.int32(1), p, n, i),
        grown(np.int32(2), p, n, i), grown(np.int32(3), p, n, i),
    )  # fmt: skip


@func
def grown_fragment(u, t, v, inputs, pixel):
    """The number."""
    return True, np.float32(0), v


_PLAIN = """
layout(location=0) in vec4 position; layout(location=1) in float size; layout(location=2) in vec4 color;
KIND out VEC v_color;
void main() { gl_Position = position; gl_PointSize = size; v_color = color.XYZ; }
"""
SHADED_GLSL = Glsl(
    _PLAIN.replace("KIND", "smooth").replace("VEC", "vec3").replace("XYZ", "xyz"),
    "smooth in vec3 v_color; layout(location=0) out vec4 color; void main() { color = vec4(v_color, 1.0); }\n",
)
BLENDED_GLSL = Glsl(
    _PLAIN.replace("KIND", "smooth").replace("VEC", "vec4").replace("XYZ", "xyzw"),
    "smooth in vec4 v_color; layout(location=0) out vec4 color; void main() { color = v_color; }\n",
)
GROWN_GLSL = Glsl(
    """
layout(location=0) in vec4 position; layout(location=1) in int count;
flat out int v_count;
void main() { gl_Position = position; gl_PointSize = 1.0; v_count = count; }
""",
    "flat in int g_number; layout(location=0) out int number; void main() { number = g_number; }\n",
    """
layout(points) in; layout(points, max_vertices = 4) out;
flat in int v_count[]; flat out int g_number;
void main() {
    for (int k = 0; k < v_count[0]; ++k) {
        gl_Position = gl_in[0].gl_Position + vec4(float(k) / 256.0, 0.0, 0.0, 0.0);
        gl_PointSize = 1.0; g_number = gl_PrimitiveIDIn * 4 + k;
        EmitVertex();
    }
}
""",
)
SHADED = Pipeline(
    VertexState(shaded_vertex, Three, (VertexBufferLayout(Vertex),)),
    FragmentState(shaded_fragment, Colored),
    PrimitiveTopology.TRIANGLE_LIST,
    DepthStencilState(depth_write_enabled=True, depth_compare=CompareFunction.LESS),
    label="triangles",
)
GROWN = Pipeline(
    VertexState(seed_vertex, Count, (VertexBufferLayout(Seed),)),
    FragmentState(grown_fragment, Grown),
    geometry=GeometryState(grow, Grown, PrimitiveTopology.POINT_LIST, 4),
    stream_output=StreamOutputState(GrownRecord),
    label="points in, points out",
)
WIDE, BYTES = {"color": TextureFormat.RGBA32FLOAT}, {"color": TextureFormat.RGBA8UNORM}
NUMBER = {"number": TextureFormat.R32SINT}


def blended(topology: PrimitiveTopology) -> Pipeline:
    """Every fragment laid over what is there, by its alpha."""
    stage = VertexState(colored_vertex, Colored, (VertexBufferLayout(Vertex),))
    over = ColorTargetState(BlendState(OVER, OVER))
    return Pipeline(stage, FragmentState(colored_fragment, Colored, targets=(over,)), topology, label="blended")


class Ours:
    """The case on refsim."""

    def __init__(self, case: Case) -> None:
        self.case, self.target = case, framebuffer_of(case)
        self.vertices = VertexBuffer.of(case.attributes, **case.vertices)
        self.options: dict[str, Any] = {}
        if case.capture is not None:
            self.options["stream_output"] = VertexBuffer(case.pipeline.stream_output.record, case.capture)

    def clear(self) -> None:
        """As before the first draw."""
        for name in self.case.targets:
            self.target.clear_color(name, 0)
        self.target.clear_depth()
        for buffer in self.options.values():
            buffer.clear()

    def __call__(self) -> Counters:
        counters = Counters()
        draw(self.case.pipeline, framebuffer=self.target, vertices=self.vertices, counters=counters, threads=THREADS,
             **self.options)  # fmt: skip
        return counters

    def planes(self) -> Planes:
        """What was drawn."""
        return planes_of(self.target)


class Theirs:
    """The case on OpenGL; `close` when done."""

    def __init__(self, witness: Witness, case: Case) -> None:
        self.witness, self.gl, self.case, self.stack = witness, witness.gl, case, ExitStack()
        enter = self.stack.enter_context
        self.target = enter(Target(self.gl, case.targets, case.pipeline.depth_stencil.format, case.planes))
        enter(witness.vertices(case))
        self.feedback, self.buffer = enter(witness.feedback(case))
        states.reset(self.gl)
        states.apply(self.gl, case.pipeline, case.dynamic, *case.size)
        self.gl.glUseProgram(witness.program(case))

    def clear(self) -> None:
        """As before the first draw."""
        nothing = np.zeros(4, np.float32)
        for k in range(len(self.case.targets)):
            self.gl.glClearBufferfv(c.COLOR, k, nothing.ctypes.data)
        self.gl.glClearBufferfi(c.DEPTH_STENCIL, 0, 1.0, 0)
        self.gl.glFinish()

    def __call__(self) -> None:
        if self.feedback:
            self.gl.glBeginTransformFeedback(c.POINTS)
        draw_vertices(self.gl, self.case, 0)
        if self.feedback:
            self.gl.glEndTransformFeedback()
        self.gl.glFinish()

    def close(self) -> None:
        """Gives everything back."""
        self.gl.check("benchmark")
        self.stack.close()
