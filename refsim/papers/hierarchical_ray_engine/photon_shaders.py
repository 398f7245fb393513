"""What photons do after the engine's passes: glass tints them, and those that reach the receiver are splatted on it.

The splat is one draw of points without vertices: point i fetches where photon i's path ended, and stands at the texel
of the receiver's light map that it hit, or in an outlying place that clipping discards. Blending adds up (source · 1 +
destination · 1 in float targets). Caustics are what section 9 of The Hierarchical Ray Engine leaves as future work.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from refsim.geometry.vector import add_scaled, dot, sub
from refsim.jit import func
from refsim.papers.hierarchical_ray_engine.shaders import OUTLYING, NoVaryings, screen_vertex
from refsim.papers.hierarchical_ray_engine.vertices import CornerVertex
from refsim.pipeline.layout import f32, i32, vec3, vec4
from refsim.pipeline.resources import Texture, texel1, texel3
from refsim.pipeline.state import (
    BlendComponent,
    BlendFactor,
    BlendState,
    ColorTargetState,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)

ZERO = np.float32(0)
HALF = np.float32(0.5)
ONE = np.float32(1)
TWO = np.float32(2)

TINT_TARGETS = {"tint": TextureFormat.RGB32FLOAT}
MAP_TARGETS = {"caustic": TextureFormat.RGBA32FLOAT, "direct": TextureFormat.RGBA32FLOAT}

ADDITIVE = BlendComponent(src_factor=BlendFactor.ONE, dst_factor=BlendFactor.ONE)
MULTIPLY = BlendComponent(src_factor=BlendFactor.DST, dst_factor=BlendFactor.ZERO)


class TintTexels(NamedTuple):
    """What a photon hit, and the ray that follows (w: 0 = none)."""

    following: vec4
    triangle: i32


class TintTextures(NamedTuple):
    """The same as textures, and the colour of every triangle: texel (k mod width, k / width)."""

    following: Texture
    triangle: Texture
    colors: Texture


class TintUniforms(NamedTuple):
    """Width of the texture of colours."""

    width: i32


class Tint(NamedTuple):
    """Share of a photon's energy that is left, RGB."""

    tint: vec3


@func
def tint_fragment(u, t, v, inputs, pixel):
    """The colour of the ideal surface by which a photon's path goes on."""
    goes_on = inputs.following[3] > ZERO
    row = np.uintp(inputs.triangle if goes_on else 0)
    width = np.uintp(u.width)
    return goes_on, ZERO, Tint(texel3(t.colors, row % width, row // width))


class EndTextures(NamedTuple):
    """Where paths ended (`path_end_shaders.PathEnd`), and the photons' tint."""

    origin: Texture
    direction: Texture
    hit: Texture
    triangle: Texture
    generation: Texture
    tint: Texture


class SplatUniforms(NamedTuple):
    """`width` of the photons' texture and rows `columns` × `rows` of the light map; the receiver: its first triangle
    (all that follow are its own), its corner, and the two vectors whose scalar products with (point − corner) run from
    0 to 1 over it; `share`: irradiance that one photon gives a texel, W/m²."""

    width: i32
    columns: i32
    rows: i32
    receiver: i32
    corner: vec3
    along: vec3
    up: vec3
    share: vec3


class Photon(NamedTuple):
    """What a point carries: irradiance, and whether it came by glass or a mirror (1) or straight (0)."""

    share: vec3
    bent: f32


class LightMap(NamedTuple):
    """Colour targets: RGB irradiance and (alpha) number of photons, bent ones and straight ones apart."""

    caustic: vec4
    direct: vec4


@func
def texel_of(part, texels):
    """The texel of a map of `texels` that holds `part` of it; rounding may take a hit off the receiver's edge."""
    texel = np.int32(np.floor(part * np.float32(texels)))
    return max(np.int32(0), min(texel, texels - np.int32(1)))


@func
def splat_vertex(u, t, attributes, vertex_index, instance_index):
    """Photon `vertex_index`, at the middle of the texel that it hit."""
    photon = np.uintp(vertex_index)
    x, y = photon % np.uintp(u.width), photon // np.uintp(u.width)
    origin, direction = texel3(t.origin, x, y), texel3(t.direction, x, y)
    arrives = texel1(t.triangle, x, y) >= u.receiver
    distance = texel1(t.hit, x, y) if arrives else ZERO
    place = sub(add_scaled(origin, direction, distance), u.corner)
    column = texel_of(dot(place, u.along), u.columns)
    row = texel_of(dot(place, u.up), u.rows)
    right = (np.float32(column) + HALF) / np.float32(u.columns) * TWO - ONE
    below = ONE - (np.float32(row) + HALF) / np.float32(u.rows) * TWO
    position = (right if arrives else OUTLYING, below if arrives else OUTLYING, ZERO, ONE)
    tint = texel3(t.tint, x, y)
    share = (u.share[0] * tint[0], u.share[1] * tint[1], u.share[2] * tint[2])
    bent = ONE if texel1(t.generation, x, y) > np.int32(0) else ZERO
    return position, ONE, Photon(share, bent)


@func
def splat_fragment(u, t, v, inputs, pixel):
    """One photon in its texel."""
    straight = ONE - v.bent
    r, g, b = v.share
    caustic = (r * v.bent, g * v.bent, b * v.bent, v.bent)
    return True, ZERO, LightMap(caustic, (r * straight, g * straight, b * straight, straight))


@cache
def tint_pass() -> Pipeline:
    """A quad that multiplies what is left of every photon with the colour of the surface it goes on by."""
    return Pipeline(
        VertexState(screen_vertex, NoVaryings, (VertexBufferLayout(CornerVertex),)),
        FragmentState(
            tint_fragment, Tint, TintTexels, discards=True, targets=(ColorTargetState(BlendState(MULTIPLY, MULTIPLY)),)
        ),
        PrimitiveTopology.QUAD_LIST,
        label="tint of photons",
    )


@cache
def splat_pass() -> Pipeline:
    """Photons as points on the light map, added up."""
    add = ColorTargetState(BlendState(ADDITIVE, ADDITIVE))
    return Pipeline(
        VertexState(splat_vertex, Photon),
        FragmentState(splat_fragment, LightMap, targets=(add, add)),
        PrimitiveTopology.POINT_LIST,
        label="photon splats",
    )
