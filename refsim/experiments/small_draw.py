"""One small draw call that reaches every stage: its shaders, its state, and the draw itself with all taps on.

Four particles become strips of 2, 0, 1 and 2 triangles in the geometry shader. The triangles are captured by stream
output, into a buffer that is too small for all of them, and rasterised over a picture in which a wall stands nearer
and the stencil protects a post. What survives discard, stencil and depth is blended into 8 bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.experiments.registry import Case
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.geometry import EMIT, SKIP
from refsim.pipeline.layout import f32, i32, vec3, vec4
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import (
    BlendComponent,
    BlendFactor,
    BlendOperation,
    BlendState,
    ColorTargetState,
    CompareFunction,
    CullMode,
    DepthStencilState,
    EarlyTests,
    FragmentState,
    GeometryState,
    Pipeline,
    PrimitiveTopology,
    StencilFaceState,
    StreamOutputState,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)
from refsim.pipeline.taps import Taps

WIDTH, HEIGHT = 24, 16
ZERO, ONE, HALF = np.float32(0), np.float32(1), np.float32(0.5)
ASPECT = np.float32(WIDTH / HEIGHT)
NEAR, FAR = np.float32(1), np.float32(5)
BAND = np.float32(0.07)  # half the width of the band of heat that is discarded
OPACITY = np.float32(0.8)
# Pixels [x0, x1) × [y0, y1), grey level, depth, stencil value
WALL, POST = ((1, 8, 7, 13), 165, 0.4, 0), ((18, 0, 21, 16), 215, 1.0, 1)
COLD, HOT = (np.float32(0.10), np.float32(0.22), np.float32(0.50)), (np.float32(1), np.float32(0.84), np.float32(0.25))


class Particle(NamedTuple):
    """A vertex: where it is seen from the eye, half the size of its strip, and of how many triangles that is."""

    eye: vec3
    radius: f32
    pieces: i32


class Carried(NamedTuple):
    """What the vertex shader hands to the geometry shader."""

    eye: vec3
    radius: f32
    pieces: i32


class Warm(NamedTuple):
    """What is interpolated over a triangle."""

    heat: f32


class Record(NamedTuple):
    """What is captured of an emitted vertex."""

    position: vec4
    heat: f32


class Pixel(NamedTuple):
    """Colour targets: the picture, and the varying as it arrived."""

    color: vec4
    heat: f32


@func
def projected(eye: Any) -> Any:
    """Clip-space position of a point seen from the eye, which looks along −z."""
    w = -eye[2]
    return eye[0] / ASPECT, eye[1], (w - NEAR) * FAR / (FAR - NEAR), w


@func
def vertex_shader(u: Any, t: Any, attributes: Any, vertex_index: Any, instance_index: Any) -> Any:
    """Projects the middle of the strip to be."""
    a = attributes[0]
    return projected(a.eye), ONE, Carried(a.eye, a.radius, a.pieces)


@func
def corner_of_strip(k: Any, v: Any) -> Any:
    """Entry k of the strip: a zigzag from left to right whose upper vertices lie farther away."""
    along = np.float32(k) / np.float32(max(v.pieces, np.int32(1)) + 1)
    up = ONE - np.float32(k & 1)
    x = v.eye[0] + v.radius * (along + along - ONE)
    y = v.eye[1] + v.radius * (up - HALF) * np.float32(1.7)
    emission = EMIT if (v.pieces > 0) & (k < v.pieces + 2) else SKIP
    return emission, projected((x, y, v.eye[2] - up * HALF * v.radius)), ONE, Warm(along)


@func
def geometry_shader(u: Any, t: Any, vertices: Any, primitive: Any) -> Any:
    """Up to four vertices, two more than there shall be triangles."""
    _, _, v = vertices[0]
    return corner_of_strip(0, v), corner_of_strip(1, v), corner_of_strip(2, v), corner_of_strip(3, v)


@func
def fragment_shader(u: Any, t: Any, v: Any, inputs: Any, pixel: Any) -> Any:
    """Colours by heat; a band in the middle is discarded."""
    heat = v.heat
    keep = abs(heat - HALF) > BAND
    r = COLD[0] + heat * (HOT[0] - COLD[0])
    g = COLD[1] + heat * (HOT[1] - COLD[1])
    b = COLD[2] + heat * (HOT[2] - COLD[2])
    return keep, ZERO, Pixel((r, g, b, OPACITY), heat)


OVER = BlendComponent(BlendOperation.ADD, BlendFactor.SRC_ALPHA, BlendFactor.ONE_MINUS_SRC_ALPHA)
SMALL = Pipeline(
    VertexState(vertex_shader, Carried, (VertexBufferLayout(Particle),)),
    FragmentState(
        fragment_shader, Pixel, discards=True, targets=(ColorTargetState(BlendState(OVER, OVER)), ColorTargetState())
    ),
    PrimitiveTopology.POINT_LIST,
    DepthStencilState(
        depth_write_enabled=True,
        depth_compare=CompareFunction.LESS,
        stencil_front=StencilFaceState(CompareFunction.EQUAL),
    ),
    EarlyTests.NONE,
    "small draw",
    cull_mode=CullMode.BACK,
    geometry=GeometryState(geometry_shader, Warm, PrimitiveTopology.TRIANGLE_STRIP, 4),
    stream_output=StreamOutputState(Record),
)

def picture_before() -> Framebuffer:
    """What is there before the draw: a wall in front of what follows, and a post that its stencil value protects."""
    target = Framebuffer(WIDTH, HEIGHT, {"color": TextureFormat.RGBA8UNORM, "heat": TextureFormat.R32FLOAT})
    target.clear_color("color", (0.96, 0.96, 0.96, 1.0))
    for (x0, y0, x1, y1), gray, depth, stencil in (WALL, POST):
        pixels = (slice(y0, y1), slice(x0, x1))
        target.color("color")[:3, *pixels] = np.float32(gray) / np.float32(255)
        target.depth[pixels], target.stencil[pixels] = depth, stencil
    return target


@dataclass
class Drawn:
    """The draw: target before and after it, what stream output left, all taps, and counters."""

    before: Framebuffer
    target: Framebuffer
    captured: VertexBuffer
    taps: Taps
    counters: Counters


def drawn(capacity: int, threads: int | None = None, tapped: bool = True) -> Drawn:
    """Makes the picture that is there before, then draws the particles over it."""
    before, target = picture_before(), picture_before()
    particles = VertexBuffer.of(
        Particle,
        eye=[(-1.5, 0.05, -2.0), (1.75, 1.6, -2.0), (0.2, 0.4, -2.1), (1.0, -0.3, -1.8)],
        radius=[1.35, 1.0, 1.4, 1.25],
        pieces=[2, 0, 1, 2],
    )
    captured, taps, counters = VertexBuffer(Record, capacity), Taps(), Counters()
    draw(
        SMALL, framebuffer=target, counters=counters, vertices=particles, stream_output=captured,
        taps=taps if tapped else None, threads=threads,
    )  # fmt: skip
    counters.check()
    return Drawn(before, target, captured, taps, counters)


def cases(quick: bool) -> list[Case]:
    """One draw; the captured buffer has room for four triangles and a rest of one record."""
    return [{"capacity": 13}]
