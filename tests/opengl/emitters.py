"""Shaders and pipelines for the geometry stage and stream output: every primitive says what is emitted for it.

A vertex's `plan` holds two bits for each of eight entries: 0 skip, 1 and 3 emit, 2 emit and end the strip. So a random
plan emits 0 to 8 vertices in strips of any lengths. Positions move by whole 1/64, exactly; nothing is rounded.

The GLSL asks for twice the room: llvmpipe (seen in Mesa 22.3.6) keeps as many strips an invocation as one strip of
`max_vertices` has triangles, and writes beyond its memory when 8 vertices are 8 strips.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import PrimitiveTopology, TextureFormat
from refsim.pipeline.interpolation import Interpolation
from refsim.pipeline.layout import f32, i32, vec4
from refsim.pipeline.state import (
    FragmentState,
    GeometryState,
    Pipeline,
    StreamOutputState,
    VertexBufferLayout,
    VertexState,
)
from tests.opengl.case import Glsl

TARGETS = {"value": TextureFormat.R32FLOAT, "id": TextureFormat.R32SINT}
POINTS, LIST, STRIP = (
    PrimitiveTopology.POINT_LIST, PrimitiveTopology.TRIANGLE_LIST, PrimitiveTopology.TRIANGLE_STRIP
)  # fmt: skip
FLAT = Interpolation.FLAT


class Vertex(NamedTuple):
    """Clip position, a value, a number, what to emit."""

    position: vec4
    value: f32
    id: i32
    plan: i32


class Passed(NamedTuple):
    """What the vertex shader hands on."""

    value: Annotated[f32, FLAT]
    id: i32
    plan: i32


class Made(NamedTuple):
    """What an emitted vertex carries: a value, its entry and vertex, its primitive."""

    value: Annotated[f32, FLAT]
    id: i32
    primitive: i32


class Record(NamedTuple):
    """What is captured of an emitted vertex."""

    position: vec4
    point_size: f32
    value: f32
    id: i32
    primitive: i32


class PassedRecord(NamedTuple):
    """What is captured where there is no geometry shader; fields in another order than the varyings."""

    plan: i32
    position: vec4
    value: f32


class Shown(NamedTuple):
    """The targets."""

    value: f32
    id: i32


@func
def vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Vertex` on."""
    a = attributes[0]
    return a.position, np.float32(2), Passed(a.value, np.int32(a.id + np.int32(100) * instance_index), a.plan)


@func
def entry(k, corner, plan, primitive):
    """Entry k of an invocation: `corner` moved right by k / 64."""
    p, _, v = corner
    bits = np.int32((plan >> (np.int32(2) * k)) & np.int32(3))
    emission = bits if bits < np.int32(3) else np.int32(1)
    right, down = np.float32(k) * np.float32(1 / 64), np.float32(k & np.int32(1)) * np.float32(1 / 4)
    moved = (p[0] + right, p[1] + down, p[2], p[3])
    made = Made(v.value + np.float32(k), np.int32(v.id * np.int32(8) + k), primitive)
    return emission, moved, np.float32(k + np.int32(1)), made


@func
def from_point(u, t, vertices, primitive_index):
    """Eight entries from one vertex."""
    c = vertices[0]
    n, i = c[2].plan, primitive_index
    return (
        entry(np.int32(0), c, n, i), entry(np.int32(1), c, n, i), entry(np.int32(2), c, n, i),
        entry(np.int32(3), c, n, i), entry(np.int32(4), c, n, i), entry(np.int32(5), c, n, i),
        entry(np.int32(6), c, n, i), entry(np.int32(7), c, n, i),
    )  # fmt: skip


@func
def from_triangle(u, t, vertices, primitive_index):
    """Eight entries from three vertices in turn, by the plan of the first."""
    a, b, c = vertices
    n, i = a[2].plan, primitive_index
    return (
        entry(np.int32(0), a, n, i), entry(np.int32(1), b, n, i), entry(np.int32(2), c, n, i),
        entry(np.int32(3), a, n, i), entry(np.int32(4), b, n, i), entry(np.int32(5), c, n, i),
        entry(np.int32(6), a, n, i), entry(np.int32(7), b, n, i),
    )  # fmt: skip


@func
def fragment(u, t, v, inputs, pixel):
    """Value and number to their targets."""
    return True, np.float32(0), Shown(v.value, v.id)


@func
def record_vertex(u, t, attributes, vertex_index, instance_index):
    """A `Record` as a vertex again."""
    a = attributes[0]
    return a.position, a.point_size, Made(a.value, a.id, a.primitive)


VERTEX_GLSL = """
layout(location=0) in vec4 position;
layout(location=1) in float value;
layout(location=2) in int id;
layout(location=3) in int plan;
flat out float v_value; flat out int v_id; flat out int v_plan;
void main() {
    gl_Position = position; gl_PointSize = 2.0;
    v_value = value; v_id = id + 100 * gl_InstanceID; v_plan = plan;
}
"""
GEOMETRY_GLSL = """
layout(INPUT) in;
layout(OUTPUT, max_vertices = 16) out;  // see above
flat in float v_value[]; flat in int v_id[]; flat in int v_plan[];
flat out float g_value; flat out int g_id; flat out int g_primitive;
void main() {
    for (int k = 0; k < 8; ++k) {
        int emission = (v_plan[0] >> (2 * k)) & 3, corner = k % CORNERS;
        if (emission == 0) continue;
        gl_Position = gl_in[corner].gl_Position + vec4(float(k) / 64.0, float(k & 1) / 4.0, 0.0, 0.0);
        gl_PointSize = float(k + 1);
        g_value = v_value[corner] + float(k); g_id = v_id[corner] * 8 + k; g_primitive = gl_PrimitiveIDIn;
        EmitVertex();
        if (emission == 2) EndPrimitive();
    }
}
"""
FRAGMENT_GLSL = """
flat in float S_value; flat in int S_id;
layout(location=0) out float value; layout(location=1) out int id;
void main() { value = S_value; id = S_id; }
"""
RECORD_GLSL = Glsl(
    """
layout(location=0) in vec4 position;
layout(location=1) in float point_size;
layout(location=2) in float value;
layout(location=3) in int id;
layout(location=4) in int primitive;
flat out float v_value; flat out int v_id;
void main() { gl_Position = position; gl_PointSize = point_size; v_value = value; v_id = id; }
""",
    FRAGMENT_GLSL.replace("S_", "v_"),
)


def glsl(pipeline: Pipeline) -> Glsl:
    """The shaders in GLSL, with what the pipeline says of primitives."""
    shown = None if pipeline.rasterizer_discard else FRAGMENT_GLSL
    if pipeline.geometry is None:
        return Glsl(VERTEX_GLSL, shown and shown.replace("S_", "v_"))
    points_in = pipeline.topology == POINTS
    made = "points" if pipeline.geometry.output == POINTS else "triangle_strip"
    words = {"INPUT": "points" if points_in else "triangles", "OUTPUT": made, "CORNERS": "1" if points_in else "3"}
    source = GEOMETRY_GLSL
    for word, meant in words.items():
        source = source.replace(word, meant)
    return Glsl(VERTEX_GLSL, shown and shown.replace("S_", "g_"), source)


def pipeline(topology, output=None, *, discard=False) -> Pipeline:
    """Captures what `topology` becomes through the geometry shader, or without one if `output` is None; and shows it
    unless it is discarded."""
    shader = from_point if topology == POINTS else from_triangle
    return Pipeline(
        VertexState(vertex, Passed, (VertexBufferLayout(Vertex),)),
        None if discard else FragmentState(fragment, Shown),
        topology,
        geometry=GeometryState(shader, Made, output, 8) if output else None,
        stream_output=StreamOutputState(Record if output else PassedRecord),
        rasterizer_discard=discard,
    )


PIPELINES = {
    "points to points": pipeline(POINTS, POINTS),
    "points to strips": pipeline(POINTS, STRIP),
    "triangles to strips, discarded": pipeline(LIST, STRIP, discard=True),
    "strips to points, discarded": pipeline(STRIP, POINTS, discard=True),
    "strips, no geometry shader, discarded": pipeline(STRIP, discard=True),
}
RECORDS_AS_POINTS = Pipeline(
    VertexState(record_vertex, Made, (VertexBufferLayout(Record),)), FragmentState(fragment, Shown), POINTS
)
