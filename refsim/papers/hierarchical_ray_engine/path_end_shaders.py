"""Where paths end: one quad over all pixels writes the rays whose path ended in a pass to targets that stay.

"…until the exiting rays do not hit an ideal surface any more. These final rays we get as a result" (The Hierarchical
Ray Engine, section 5): the engine's own targets are cleared in every pass, so what ended is copied before the next.
A path ends where a live ray sends none on: it missed, or hit a surface that is not ideal.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from refsim.jit import func
from refsim.papers.hierarchical_ray_engine.shaders import NoVaryings, screen_vertex
from refsim.papers.hierarchical_ray_engine.vertices import CornerVertex
from refsim.pipeline.layout import i32, vec3, vec4
from refsim.pipeline.resources import Texture
from refsim.pipeline.state import (
    CompareFunction,
    DepthStencilFormat,
    DepthStencilState,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    StencilFaceState,
    StencilOperation,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)

ZERO = np.float32(0)

END_TARGETS = {
    "origin": TextureFormat.RGBA32FLOAT,
    "direction": TextureFormat.RGB32FLOAT,
    "hit": TextureFormat.RGB32FLOAT,
    "triangle": TextureFormat.R32SINT,
    "kind": TextureFormat.R32SINT,
    "generation": TextureFormat.R32SINT,
}


class PathTexels(NamedTuple):
    """The pixel's ray, what it hit, and the ray that follows (w: 0 = none)."""

    origin: vec4
    direction: vec3
    hit: vec3
    following: vec4
    triangle: i32
    kind: i32


class PathTextures(NamedTuple):
    """The same as textures: input attachments of the pass."""

    origin: Texture
    direction: Texture
    hit: Texture
    following: Texture
    triangle: Texture
    kind: Texture


class PathEnd(NamedTuple):
    """Colour targets: the last ray of a path, its hit (triangle −1: none), its kind, and its generation."""

    origin: vec4
    direction: vec3
    hit: vec3
    triangle: i32
    kind: i32
    generation: i32


class EndUniforms(NamedTuple):
    """The generation that was just shot."""

    generation: i32


@func
def end_fragment(u, t, v, inputs, pixel):
    """Keeps a live ray that none follows."""
    ended = (inputs.origin[3] > ZERO) & (inputs.following[3] <= ZERO)
    end = PathEnd(inputs.origin, inputs.direction, inputs.hit, inputs.triangle, inputs.kind, u.generation)
    return ended, ZERO, end


# Bit 0 of these targets' own stencil marks paths that have ended: they are not looked at again
ONCE = StencilFaceState(compare=CompareFunction.NOT_EQUAL, pass_op=StencilOperation.REPLACE)


@cache
def end_pass(depth_format: DepthStencilFormat) -> Pipeline:
    """The quad that keeps what ended. Its stencil reference, read and write mask are 1."""
    return Pipeline(
        VertexState(screen_vertex, NoVaryings, (VertexBufferLayout(CornerVertex),)),
        FragmentState(end_fragment, PathEnd, PathTexels, discards=True),
        PrimitiveTopology.QUAD_LIST,
        DepthStencilState(depth_format, stencil_front=ONCE),
        label="path ends",
    )
