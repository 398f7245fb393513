"""Pipelines with a geometry stage that one table steers, and what they emit restated on whole numbers.

The geometry shader returns eight entries; a row of codes a primitive says which of them are emitted, so that a compiled
pipeline serves any pattern. Every value is a small whole number (or one over a power of two), exact in float32.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.geometry import EMIT_AND_END
from refsim.pipeline.layout import f32, i32, ivec2, vec2, vec4
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import (
    FragmentState,
    GeometryState,
    Pipeline,
    PrimitiveTopology,
    StreamOutputState,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)
from refsim.reference.geometry_stage import emitted

T = PrimitiveTopology
MOST = 8
SIDE = 64
ONE = np.float32(1)
HALF = np.float32(0.5)
PIXELS = np.float32(SIDE)


class Seed(NamedTuple):
    """A vertex: a pixel, a colour, a number."""

    pixel: vec2
    color: vec2
    number: i32


class Carried(NamedTuple):
    """What the vertex shader hands on."""

    color: vec2
    number: i32


class Grown(NamedTuple):
    """What the geometry shader hands on: integer and float fields in turn."""

    place: ivec2
    weight: f32
    color: vec2
    number: i32


class Record(NamedTuple):
    """What is captured, in another order than it was made."""

    number: i32
    position: vec4
    color: vec2
    point_size: f32
    place: ivec2


class Codes(NamedTuple):
    """Uniform: what becomes of every entry of every primitive, i32[primitives, MOST]."""

    table: np.ndarray


class Color(NamedTuple):
    """The colour target."""

    number: i32


@func
def seed_vertex(u, t, attributes, vertex_index, instance_index):
    """The centre of a pixel, moved down by the instance."""
    a = attributes[0]
    x = (a.pixel[0] + HALF) * np.float32(2) / PIXELS - ONE
    y = ONE - (a.pixel[1] + np.float32(instance_index) + HALF) * np.float32(2) / PIXELS
    return (x, y, HALF, ONE), ONE, Carried(a.color, np.int32(a.number + np.int32(1000) * instance_index))


@func
def grown(u, vertices, primitive, k):
    """Entry k: corner k (again from the first) of the primitive, k pixels to the right."""
    p, size, v = vertices[k % len(vertices)]
    step = np.float32(2 * k) / PIXELS
    place = (primitive, np.int32(k))
    return (
        u.table[primitive % u.table.shape[0], k],
        (p[0] + step, p[1], p[2], p[3]),
        size + np.float32(k % 3),
        Grown(place, np.float32(k) * HALF, (v.color[1], v.color[0] - np.float32(k)), np.int32(v.number * MOST + k)),
    )


@func
def table_geometry(u, t, vertices, primitive):
    """Eight entries, of which the table says what becomes."""
    return (
        grown(u, vertices, primitive, 0), grown(u, vertices, primitive, 1), grown(u, vertices, primitive, 2),
        grown(u, vertices, primitive, 3), grown(u, vertices, primitive, 4), grown(u, vertices, primitive, 5),
        grown(u, vertices, primitive, 6), grown(u, vertices, primitive, 7),
    )  # fmt: skip


@func
def mixed_geometry(u, t, vertices, primitive):
    """Three entries of three types: a constant code, a chosen one, and numbers that are not float32."""
    p, size, v = vertices[0]
    chosen = EMIT_AND_END if primitive % 2 == 0 else np.int32(0)
    return (
        (1, p, size, Grown((1, 2), HALF, v.color, v.number)),
        (chosen, (p[0], 0.25, p[2], 1), 2, Grown((np.int64(primitive), 0), 1.5, v.color, 7)),
        (primitive % 3 == 0, p, HALF, Grown((0, 0), 0, (0, v.color[1]), np.int32(0))),
    )


@func
def number_fragment(u, t, v, inputs, pixel):
    """Stores the number of the vertex."""
    return True, HALF, Color(v.number)


VERTEX = VertexState(seed_vertex, Carried, (VertexBufferLayout(Seed),))


def capturing(topology, output, shader=table_geometry, most=MOST, record=Record):
    """A pipeline that only captures."""
    geometry = GeometryState(shader, Grown, output, most)
    return Pipeline(VERTEX, None, topology, geometry=geometry, stream_output=StreamOutputState(record),
                    rasterizer_discard=True, label=f"{topology} to {output}")  # fmt: skip


POINTS = capturing(T.POINT_LIST, T.POINT_LIST)
STRIPS = capturing(T.POINT_LIST, T.TRIANGLE_STRIP)
POOL = {"points": POINTS, "strips": STRIPS, "list to strips": capturing(T.TRIANGLE_LIST, T.TRIANGLE_STRIP),
        "strip to points": capturing(T.TRIANGLE_STRIP, T.POINT_LIST)}  # fmt: skip


def drawing(pipe):
    """The same pipeline, rasterised as well."""
    return replace(pipe, fragment=FragmentState(number_fragment, Color), rasterizer_discard=False)


def seeds(count: int, rng=None) -> VertexBuffer:
    """Vertices with numbers 0, 1, …; random pixels of the left half if there is a generator."""
    rng = rng or np.random.default_rng(0)
    pixel = np.stack([rng.integers(0, SIDE // 2, count), rng.integers(0, SIDE - 4, count)], axis=1)
    color = np.stack([np.arange(count), -np.arange(count)], axis=1)
    return VertexBuffer.of(Seed, pixel=pixel, color=color, number=np.arange(count))


def target() -> Framebuffer:
    """One integer target, −7 all over."""
    framebuffer = Framebuffer(SIDE, SIDE, {"number": TextureFormat.R32SINT})
    framebuffer.ints[:] = -7
    return framebuffer


def expected_records(buffer, primitives, codes, pipe):
    """Records of all output primitives, one list of rows a primitive; (invocation, entry) of every vertex; primitives.

    `primitives` are the input primitives as (instance, vertex) a corner; the shader counts them within an instance.
    """
    first = sum(corners[0][0] == 0 for corners in primitives)
    index = [p % first for p in range(len(primitives))]
    vertices, out = emitted([codes[i % len(codes)] for i in index], pipe.rasterized.is_triangles)
    rows = [record_of(buffer, primitives[p], index[p], k) for p, k in vertices]
    return [[rows[i] for i in one] for one in out], vertices, out


def record_of(buffer, corners, primitive, k):
    """Record of entry k: (number, position, colour, size, place)."""
    instance, vertex = corners[k % len(corners)]
    px, py = (float(part) for part in buffer.floats[:2, vertex])
    number = int(buffer.ints[0, vertex]) + 1000 * instance
    position = ((px + 0.5 + k) * 2 / SIDE - 1, 1 - (py + instance + 0.5) * 2 / SIDE, 0.5, 1.0)
    color = (float(buffer.floats[3, vertex]), float(buffer.floats[2, vertex]) - k)
    return number * MOST + k, position, color, 1.0 + k % 3, (primitive, k)


def as_records(array):
    """A structured array of `Record` as plain tuples like those of `record_of`."""
    names = ("number", "position", "color", "point_size", "place")
    return [tuple(tuple(part) if isinstance(part, list) else part for part in row)
            for row in zip(*(array[name].tolist() for name in names), strict=True)]  # fmt: skip


def capture(pipe, buffer, codes, capacity=2000, **options):
    """Draws into a new buffer of `capacity`; returns it and the counters, which obey their laws."""
    out, counters = VertexBuffer(pipe.stream_output.record, capacity), Counters()
    draw(pipe, vertices=buffer, uniforms=Codes(np.asarray(codes, np.int32).reshape(-1, MOST)), stream_output=out,
         counters=counters, **{"threads": 1, **options})  # fmt: skip
    counters.check()
    return out, counters
