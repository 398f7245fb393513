"""Shaders and pipelines that the tests of this room share, so that few are compiled.

One vertex shader and one fragment shader serve nearly all tests; what they do (depth, discards, colours) is steered by
uniforms and attributes at run time. The states are a Latin sample: eight pipelines in which every stencil operation
stands once in every place and every comparison once in both tests, drawn with a seed that is printed, and a few by
hand that reach the special paths of the loops.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.layout import f32, i32, ivec2, vec2, vec4
from refsim.pipeline.resources import Texture
from refsim.pipeline.state import (
    CompareFunction,
    DepthStencilFormat,
    DepthStencilState,
    EarlyTests,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    StencilFaceState,
    StencilOperation,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)

SEED = 20260
C, S = CompareFunction, StencilOperation
D32, D24 = DepthStencilFormat
LARGE = 2**20  # a modulus that discards nothing
TARGETS = {
    "color": TextureFormat.RG32FLOAT,
    "id": TextureFormat.R32SINT,
    "where": TextureFormat.RG32SINT,
    "weight": TextureFormat.R32FLOAT,
}


class Sprite(NamedTuple):
    """A vertex: clip position, point size, the depth its fragments write, a colour, a number."""

    position: vec4
    size: f32
    base: f32
    color: vec2
    id: i32


class Flat(NamedTuple):
    """What a fragment knows of its primitive."""

    base: f32
    color: vec2
    id: i32


class Texels(NamedTuple):
    """Input attachments."""

    height: f32
    flags: i32


class Images(NamedTuple):
    """Textures of the draw."""

    height: Texture
    flags: Texture


class Outputs(NamedTuple):
    """Colour targets, float and integer in turn."""

    color: vec2
    id: i32
    where: ivec2
    weight: f32


class Rules(NamedTuple):
    """Every `modulus`-th fragment is discarded; depth is base + slope · height."""

    modulus: i32
    slope: f32


@func
def sprite_vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Sprite` on; instances move their number up by 1000."""
    a = attributes[0]
    return a.position, a.size, Flat(a.base, a.color, np.int32(a.id + np.int32(1000) * instance_index))


@func
def ruled_fragment(u, t, v, inputs, pixel):
    """A fragment that uses all it is given."""
    number = np.int32(pixel[0] * np.int32(7) + pixel[1] * np.int32(3) + v.id + inputs.flags)
    z = v.base + u.slope * inputs.height
    outputs = Outputs((v.color[0], v.color[1] * inputs.height), v.id, pixel, v.color[0] - z)
    return number % u.modulus != np.int32(0), z, outputs


def ruled_twin(u, v, inputs, pixel):
    """`ruled_fragment` in plain Python on float32 scalars: (keep, depth, {target: components})."""
    number = pixel[0] * 7 + pixel[1] * 3 + v.id + int(inputs.flags)
    with np.errstate(all="ignore"):
        z = np.float32(v.base) + np.float32(u.slope) * inputs.height
        color = (v.color[0], v.color[1] * inputs.height)
        outputs = {"color": color, "id": (v.id,), "where": pixel, "weight": (v.color[0] - z,)}
    return number % u.modulus != 0, z, outputs


VERTEX = VertexState(sprite_vertex, Flat, (VertexBufferLayout(Sprite),))


def pipeline(state, *, discards=True, writes_depth=True, policy=EarlyTests.IDEAL) -> Pipeline:
    """The shared shaders under `state`."""
    fragment = FragmentState(ruled_fragment, Outputs, Texels, writes_depth, discards)
    return Pipeline(VERTEX, fragment, PrimitiveTopology.POINT_LIST, state, policy)


def latin_sample(seed: int = SEED) -> dict[str, Pipeline]:
    """Eight pipelines in which every operation and comparison takes every place once."""
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(8) for _ in range(5)]
    policies = [EarlyTests.IDEAL, EarlyTests.IDEAL, EarlyTests.NONE, EarlyTests.FORCED]
    made = {}
    for k, (compare, fail, depth_fail, passed, depth) in enumerate(zip(*orders, strict=True)):
        face = StencilFaceState(C(compare), S(fail), S(depth_fail), S(passed))
        state = DepthStencilState((D32, D24)[k % 2], k % 8 < 6, C(depth), face)
        made[f"latin{k}"] = pipeline(state, discards=k % 3 != 0, writes_depth=k % 4 < 2, policy=policies[k // 2 % 4])
    return made


# A bit per generation, as the Hierarchical Ray Engine uses it; the nearest hit wins
MARKED = DepthStencilState(D32, True, C.LESS, StencilFaceState(C.EQUAL, S.KEEP, S.KEEP, S.INCREMENT_WRAP))
# Failing the depth test changes the stencil that masks the primitives after
COUNTED = DepthStencilState(D24, True, C.LESS, StencilFaceState(C.GREATER_EQUAL, S.KEEP, S.INCREMENT_CLAMP, S.KEEP))
NEAREST = DepthStencilState(D32, True, C.LESS)
BY_HAND = {
    "nearest": pipeline(NEAREST),
    "marked": pipeline(MARKED),
    "marked, none": pipeline(MARKED, policy=EarlyTests.NONE),
    "marked, forced": pipeline(MARKED, policy=EarlyTests.FORCED),
    "counted": pipeline(COUNTED, discards=False, writes_depth=False),
    "counted, none": pipeline(COUNTED, discards=False, writes_depth=False, policy=EarlyTests.NONE),
}
POOL = {**BY_HAND, **latin_sample()}
# Compiling is what these tests cost: a pipeline is run in these loops only
TAPPED = sorted(name for name in POOL if name[-1] in "0246" or (name in BY_HAND and "none" not in name))
DENSE = sorted(name for name in POOL if name in BY_HAND or name not in TAPPED)
BOTH = sorted(set(TAPPED) & set(DENSE))


def as_quads(pipe: Pipeline) -> Pipeline:
    """The same pipeline for quads."""
    return replace(pipe, topology=PrimitiveTopology.QUAD_LIST)
