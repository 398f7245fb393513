"""Shaders and pipelines that tell which primitive covers which pixel: each adds a bit of its own.

A primitive k of a draw adds 2^(k mod 24) to component k div 24 of a float32 target: up to 96 primitives a draw leave
sums that are exact, so `covered` reads each one's coverage back, overlaps included. The facing goes to a second
target, in the same bits.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import BlendFactor, CullMode, FrontFace, PrimitiveTopology, TextureFormat
from refsim.pipeline.interpolation import Interpolation
from refsim.pipeline.layout import f32, vec4
from refsim.pipeline.state import (
    BlendComponent,
    BlendState,
    ColorTargetState,
    FragmentState,
    Pipeline,
    VertexBufferLayout,
    VertexState,
)
from tests.opengl.case import Glsl

BITS = 24
MOST = 4 * BITS
TARGETS = {"bits": TextureFormat.RGBA32FLOAT}
SUM = BlendState(*[BlendComponent(src_factor=BlendFactor.ONE, dst_factor=BlendFactor.ONE)] * 2)


class Corner(NamedTuple):
    """Clip position, point size, the primitive's bit."""

    position: vec4
    size: f32
    bits: vec4


class Marked(NamedTuple):
    """The bit."""

    bits: Annotated[vec4, Interpolation.FLAT]


class Sums(NamedTuple):
    """The target."""

    bits: vec4


@func
def vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Corner` on."""
    a = attributes[0]
    return a.position, a.size, Marked(a.bits)


@func
def fragment(u, t, v, inputs, pixel):
    """The bit is the colour."""
    return True, np.float32(0), Sums(v.bits)


GLSL = Glsl(
    """
layout(location=0) in vec4 position;
layout(location=1) in float size;
layout(location=2) in vec4 bits;
flat out vec4 v_bits;
void main() { gl_Position = position; gl_PointSize = size; v_bits = bits; }
""",
    "flat in vec4 v_bits; layout(location=0) out vec4 bits; void main() { bits = v_bits; }\n",
)


def pipeline(
    topology: PrimitiveTopology, front_face: FrontFace = FrontFace.CCW, cull_mode: CullMode = CullMode.NONE
) -> Pipeline:
    """Draws `topology`, every primitive adding its bit."""
    return Pipeline(
        VertexState(vertex, Marked, (VertexBufferLayout(Corner),)),
        FragmentState(fragment, Sums, targets=(ColorTargetState(SUM),)),
        topology,
        front_face=front_face,
        cull_mode=cull_mode,
    )


def marks(count: int, corners: int) -> np.ndarray:
    """The `bits` of `count` primitives of `corners` vertices each, f32[count · corners, 4]."""
    number = np.arange(count)
    bits = np.zeros((count, 4), np.float32)
    bits[number, number // BITS] = np.float32(2) ** (number % BITS).astype(np.float32)
    return bits.repeat(corners, axis=0)


def covered(planes: np.ndarray, count: int) -> np.ndarray:
    """bool [count, h, w]: which pixels each of the primitives covers."""
    sums = planes.astype(np.int64)
    return np.stack([sums[k // BITS] >> (k % BITS) & 1 for k in range(count)]).astype(bool)
