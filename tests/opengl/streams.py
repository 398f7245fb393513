"""Shaders and pipelines of the random streams: fragments whose colour, number, depth and fate are the vertices' own.

Everything a fragment carries is flat, and nothing is computed that could be rounded, so OpenGL and refsim are handed
the same fragments and only the stages after the shader are compared. A pipeline takes 1 to 3 seconds to compile, so
the states are samples: `STENCIL_DEPTH` uses every operation and comparison in every place.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import (
    CompareFunction,
    DepthStencilFormat,
    EarlyTests,
    PrimitiveTopology,
    StencilOperation,
    TextureFormat,
)
from refsim.pipeline.interpolation import Interpolation
from refsim.pipeline.layout import f32, i32, ivec2, vec4
from refsim.pipeline.state import (
    DepthStencilState,
    FragmentState,
    Pipeline,
    StencilFaceState,
    VertexBufferLayout,
    VertexState,
)
from tests.opengl.case import Glsl

SEED = 20261
SIZE = (48, 32)
D32, D24 = DepthStencilFormat
TARGETS = {
    "color": TextureFormat.RGBA32FLOAT,
    "bytes": TextureFormat.RGBA8UNORM,
    "id": TextureFormat.R32SINT,
    "where": TextureFormat.RG32SINT,
}
FLAT = Interpolation.FLAT


class Vertex(NamedTuple):
    """Clip position, point size, colour, the depth its fragments write, a number."""

    position: vec4
    size: f32
    color: vec4
    base: f32
    id: i32


class Carried(NamedTuple):
    """What a fragment knows."""

    color: Annotated[vec4, FLAT]
    base: Annotated[f32, FLAT]
    id: i32


class Outputs(NamedTuple):
    """The targets."""

    color: vec4
    bytes: vec4
    id: i32
    where: ivec2


@func
def vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Vertex` on."""
    a = attributes[0]
    return a.position, a.size, Carried(a.color, a.base, a.id)


@func
def fragment(u, t, v, inputs, pixel):
    """Discards every fifth fragment, by pixel and number."""
    number = np.int32(pixel[0] * np.int32(7) + pixel[1] * np.int32(3) + v.id)
    return number % np.int32(5) != np.int32(0), v.base, Outputs(v.color, v.color, v.id, pixel)


VERTEX_GLSL = """
layout(location=0) in vec4 position;
layout(location=1) in float size;
layout(location=2) in vec4 color;
layout(location=3) in float base;
layout(location=4) in int id;
flat out vec4 v_color; flat out float v_base; flat out int v_id;
void main() { gl_Position = position; gl_PointSize = size; v_color = color; v_base = base; v_id = id; }
"""
FRAGMENT_GLSL = """
FORCED
flat in vec4 v_color; flat in float v_base; flat in int v_id;
layout(location=0) out vec4 color;
layout(location=1) out vec4 bytes;
layout(location=2) out int id;
layout(location=3) out ivec2 where;
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (DISCARDS && (pixel.x * 7 + pixel.y * 3 + v_id) % 5 == 0) discard;
    color = bytes = v_color; id = v_id; where = pixel;
    DEPTH
}
"""


def glsl(pipeline: Pipeline) -> Glsl:
    """The shaders in GLSL, with what the pipeline says of discards, depth and early tests."""
    stage = pipeline.fragment
    forced = "layout(early_fragment_tests) in;" if pipeline.early_tests == EarlyTests.FORCED else ""
    depth = "gl_FragDepth = v_base;" if stage.writes_depth else ""
    source = FRAGMENT_GLSL.replace("FORCED", forced).replace("DISCARDS", "true" if stage.discards else "false")
    return Glsl(VERTEX_GLSL, source.replace("DEPTH", depth))


def stencil_depth_sample(seed: int = SEED) -> dict[str, Pipeline]:
    """Eight pipelines, drawn with `seed`: every stencil operation and comparison stands once in every place of the
    front face, and once more, shifted, in the back face; both depth formats, depth written and not, discards and
    early tests in turn. Even ones draw points, odd ones triangles, for only triangles have a back."""
    rng = np.random.default_rng(seed)
    front, back = ([rng.permutation(8) for _ in range(4)] for _ in range(2))
    depth = rng.permutation(8)
    made = {}
    for k in range(8):
        faces = [
            StencilFaceState(CompareFunction(side[0][k]), *(StencilOperation(side[place][k]) for place in (1, 2, 3)))
            for side in (front, back)
        ]
        state = DepthStencilState((D32, D24)[k // 2 % 2], k % 8 < 6, CompareFunction(depth[k]), *faces)
        policy = (EarlyTests.IDEAL, EarlyTests.NONE, EarlyTests.MESA, EarlyTests.FORCED)[k // 2]
        topology = (PrimitiveTopology.POINT_LIST, PrimitiveTopology.TRIANGLE_LIST)[k % 2]
        made[f"{k} {topology.value} {policy.value}"] = Pipeline(
            VertexState(vertex, Carried, (VertexBufferLayout(Vertex),)),
            FragmentState(fragment, Outputs, None, k % 3 == 0, k % 3 != 1),
            topology,
            state,
            policy,
        )
    return made


STENCIL_DEPTH = stencil_depth_sample()


def columns(rng: np.random.Generator, topology: PrimitiveTopology, count: int) -> dict[str, np.ndarray]:
    """`count` random primitives over the whole screen: points of 1 to 24 pixels that stand inside it, or triangles of
    either facing. They stand at odd eighths of a pixel, so no centre lies on a level edge (`test_coverage` says why)
    and nothing is rounded. Depths are multiples of 1/16, so that many are equal and no format rounds them across
    another."""
    corners = topology.corners
    if topology == PrimitiveTopology.POINT_LIST:
        place = rng.integers(0, 4 * np.array(SIZE), (count, 2)) / 4 + 0.125
        size = rng.integers(1, 25, count).astype(np.float32)
    else:
        place = rng.integers(0, 4 * np.array(SIZE), (count * 3, 2)) / 4 + 0.125
        size = np.ones(count * 3, np.float32)
    depth = rng.integers(0, 17, count).repeat(corners) / 16
    return {
        "position": clip(place, depth),
        "size": size,
        "color": rng.integers(0, 256, (count, 4)).repeat(corners, axis=0).astype(np.float32) / np.float32(255),
        "base": rng.integers(0, 17, count).repeat(corners).astype(np.float32) / 16,
        "id": rng.integers(0, 1000, count).repeat(corners),
    }


def clip(place: np.ndarray, depth: np.ndarray, size: tuple[int, int] = SIZE, w: np.ndarray | float = 1.0) -> np.ndarray:
    """Clip positions of window places (pixels, y down) and depths."""
    ndc = np.asarray(place, np.float64) / np.array(size) * 2 - 1
    wide = np.broadcast_to(np.asarray(w, np.float64), len(ndc))
    return np.column_stack([ndc[:, 0] * wide, -ndc[:, 1] * wide, np.asarray(depth) * wide, wide]).astype(np.float32)
