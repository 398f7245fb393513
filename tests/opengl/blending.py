"""Shaders and pipelines for blending, and how large the terms of a blend are.

`SAMPLE`: seven pipelines of four targets in which every factor without a second source stands before source and
destination in every format, in colour or alpha, with every operation; write masks in turn. `DUAL`: the four factors of
the second source, on one target, for OpenGL promises no more. `STACK`: blends that never enlarge what they are given,
behind stencil and depth, with a target that counts the blends of each pixel.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import (
    BlendFactor,
    BlendOperation,
    ColorWrite,
    CompareFunction,
    PrimitiveTopology,
    StencilOperation,
    TextureFormat,
)
from refsim.pipeline.interpolation import Interpolation
from refsim.pipeline.layout import f32, vec2, vec4
from refsim.pipeline.state import (
    BlendComponent,
    BlendState,
    ColorTargetState,
    DepthStencilState,
    FragmentState,
    Pipeline,
    StencilFaceState,
    VertexBufferLayout,
    VertexState,
)
from tests.opengl.case import Glsl

F = BlendFactor
SEED = 41001
T = TextureFormat
TARGETS = {"wide": T.RGBA32FLOAT, "pair": T.RG32FLOAT, "bytes": T.RGBA8UNORM, "two": T.RG8UNORM}
STACK_TARGETS = {"wide": T.RGBA32FLOAT, "count": T.R32FLOAT, "bytes": T.RGBA8UNORM, "two": T.RG8UNORM}
FLAT = Interpolation.FLAT


class Vertex(NamedTuple):
    """Clip position, point size, source and second source."""

    position: vec4
    size: f32
    source: vec4
    second: vec4


class Sources(NamedTuple):
    """What is blended."""

    source: Annotated[vec4, FLAT]
    second: Annotated[vec4, FLAT]


class Four(NamedTuple):
    """The targets of `SAMPLE`."""

    wide: vec4
    pair: vec2
    bytes: vec4
    two: vec2


class Stacked(NamedTuple):
    """The targets of `STACK`."""

    wide: vec4
    count: f32
    bytes: vec4
    two: vec2


class DualWide(NamedTuple):
    """One float target and the second source."""

    wide: vec4
    src1: vec4


class DualBytes(NamedTuple):
    """One 8-bit target and the second source."""

    bytes: vec4
    src1: vec4


@func
def vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Vertex` on."""
    a = attributes[0]
    return a.position, a.size, Sources(a.source, a.second)


@func
def four(u, t, v, inputs, pixel):
    """The source to all targets."""
    s = v.source
    return True, np.float32(0), Four(s, (s[0], s[1]), s, (s[0], s[1]))


@func
def stacked(u, t, v, inputs, pixel):
    """The source to all targets, 1 to the one that counts."""
    s = v.source
    return True, np.float32(0), Stacked(s, np.float32(1), s, (s[0], s[1]))


@func
def dual_wide(u, t, v, inputs, pixel):
    """Both sources."""
    return True, np.float32(0), DualWide(v.source, v.second)


@func
def dual_bytes(u, t, v, inputs, pixel):
    """Both sources."""
    return True, np.float32(0), DualBytes(v.source, v.second)


_VERTEX_GLSL = """
layout(location=0) in vec4 position;
layout(location=1) in float size;
layout(location=2) in vec4 source;
layout(location=3) in vec4 second;
flat out vec4 v_source; flat out vec4 v_second;
void main() { gl_Position = position; gl_PointSize = size; v_source = source; v_second = second; }
"""
_IN = "flat in vec4 v_source; flat in vec4 v_second;\n"
GLSL = Glsl(_VERTEX_GLSL, _IN + """
layout(location=0) out vec4 wide; layout(location=1) out vec2 pair;
layout(location=2) out vec4 bytes; layout(location=3) out vec2 two;
void main() { wide = bytes = v_source; pair = two = v_source.xy; }
""")  # fmt: skip
STACK_GLSL = Glsl(_VERTEX_GLSL, _IN + """
layout(location=0) out vec4 wide; layout(location=1) out float count;
layout(location=2) out vec4 bytes; layout(location=3) out vec2 two;
void main() { wide = bytes = v_source; count = 1.0; two = v_source.xy; }
""")  # fmt: skip
DUAL_GLSL = Glsl(_VERTEX_GLSL, _IN + """
layout(location=0, index=0) out vec4 first; layout(location=0, index=1) out vec4 other;
void main() { first = v_source; other = v_second; }
""")  # fmt: skip


def _pipeline(fragment: FragmentState, state: DepthStencilState | None = None) -> Pipeline:
    stage = VertexState(vertex, Sources, (VertexBufferLayout(Vertex),))
    return Pipeline(stage, fragment, PrimitiveTopology.POINT_LIST, state or DepthStencilState())


def sample(seed: int = SEED) -> list[Pipeline]:
    """Seven pipelines: in the targets with alpha every factor of one source stands in each place, one with min and max
    (which allow no other); those without alpha share the factors that do not read the source's."""
    rng = np.random.default_rng(seed)
    single = [factor for factor in F if "src1" not in factor.value and factor != F.ONE]
    no_alpha = [factor for factor in single if not factor.value.startswith(("src-", "one-minus-src-"))]
    masks = [ColorWrite.ALL, ColorWrite.RED | ColorWrite.ALPHA, ColorWrite.ALL, ColorWrite.GREEN, ColorWrite.ALL]
    orders = [rng.permutation(len(no_alpha)) for _ in range(2)]
    targets: list[list[ColorTargetState]] = []
    for place, with_alpha in enumerate((True, False, True, False)):
        if with_alpha:
            parts = _sums(place, *([single[k] for k in rng.permutation(len(single))] for _ in range(2)))
            parts[3:3] = [BlendComponent(BlendOperation.MIN, F.ONE, F.ONE)]
            parts[8:8] = [BlendComponent(BlendOperation.MAX, F.ONE, F.ONE)]
            states = [BlendState(*pair) for pair in zip(parts[::2], parts[1::2], strict=True)]
        else:
            some = slice(0, 6) if place == 1 else slice(3, 9)
            parts = _sums(place, *([no_alpha[k] for k in order[some]] for order in orders))
            last = BlendOperation.MIN if place == 1 else BlendOperation.MAX
            states = [BlendState(part) for part in (*parts, BlendComponent(last, F.ONE, F.ONE))]
        targets.append([ColorTargetState(state, masks[(k + place) % 5]) for k, state in enumerate(states)])
    return [_pipeline(FragmentState(four, Four, targets=tuple(each))) for each in zip(*targets, strict=True)]


def _sums(start: int, src: list[BlendFactor], dst: list[BlendFactor]) -> list[BlendComponent]:
    """The factors joined by addition and the two subtractions in turn."""
    operations = list(BlendOperation)[:3]
    return [BlendComponent(operations[(k + start) % 3], *pair) for k, pair in enumerate(zip(src, dst, strict=True))]


def _dual() -> dict[str, Pipeline]:
    wide = BlendState(BlendComponent(src_factor=F.SRC1, dst_factor=F.ONE_MINUS_SRC1_ALPHA),
                      BlendComponent(BlendOperation.SUBTRACT, F.ONE_MINUS_SRC1, F.SRC1_ALPHA))  # fmt: skip
    byte = BlendState(BlendComponent(src_factor=F.SRC1_ALPHA, dst_factor=F.ONE_MINUS_SRC1),
                      BlendComponent(BlendOperation.REVERSE_SUBTRACT, F.ONE_MINUS_SRC1_ALPHA, F.SRC1))  # fmt: skip
    return {
        "wide": _pipeline(FragmentState(dual_wide, DualWide, targets=(ColorTargetState(wide),))),
        "bytes": _pipeline(FragmentState(dual_bytes, DualBytes, targets=(ColorTargetState(byte),))),
    }


def _stack() -> Pipeline:
    over = BlendComponent(src_factor=F.SRC_ALPHA, dst_factor=F.ONE_MINUS_SRC_ALPHA)
    states = (
        BlendState(over, BlendComponent(src_factor=F.ONE, dst_factor=F.ONE_MINUS_SRC_ALPHA)),
        BlendState(*[BlendComponent(src_factor=F.ONE, dst_factor=F.ONE)] * 2),
        BlendState(over, BlendComponent(src_factor=F.ONE_MINUS_DST_ALPHA, dst_factor=F.ONE)),
        BlendState(BlendComponent(src_factor=F.CONSTANT, dst_factor=F.ONE_MINUS_CONSTANT)),
    )
    face = StencilFaceState(CompareFunction.NOT_EQUAL, depth_fail_op=StencilOperation.INVERT)
    depth = DepthStencilState(depth_write_enabled=True, depth_compare=CompareFunction.LESS_EQUAL, stencil_front=face)
    return _pipeline(FragmentState(stacked, Stacked, targets=tuple(ColorTargetState(state) for state in states)), depth)


SAMPLE, DUAL, STACK = sample(), _dual(), _stack()


def size_of_factor(factor: BlendFactor, s, d, s1, c, s_alpha, d_alpha, s1_alpha, c_alpha):
    """An upper bound of a factor's size and of what is rounded while it is made; arguments are arrays or numbers."""
    if factor in (F.ZERO, F.ONE):
        return np.full_like(s, factor == F.ONE)
    if factor == F.SRC_ALPHA_SATURATED:
        return np.maximum(1, np.abs(s_alpha) + np.abs(d_alpha))
    named = {"src": s, "dst": d, "src1": s1, "constant": c}
    alphas = {"src": s_alpha, "dst": d_alpha, "src1": s1_alpha, "constant": c_alpha}
    name = factor.value.removeprefix("one-minus-")
    value = np.abs(alphas[name.removesuffix("-alpha")] if name.endswith("-alpha") else named[name])
    return value + 1 if factor.value.startswith("one-minus") else value
