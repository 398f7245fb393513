"""Rays are pixels: the two fragment shaders of the method that the paper is compared with (Ralovich 2007, reference 6).

"In each rendering pass rasterizing a view-port sized quadrilateral to activate the fragment shader on a regular 2D
matrix of pixels where every pass operates on one single ray generation only" (section 1). A generation lies in three
textures: `origin` (w: t_max, 0 where the pixel has no such ray), `direction` (w: weight of the path) and `hit` (t, u,
v, triangle, −1 none). In: the textures of the surface rays whose hits send the new ones; out: those of the new ones.
What a ray is, how it is lit and what leaves its hit are the device functions of the geometry shader's method.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from refsim.geometry.vector import add_scaled
from refsim.jit import func
from refsim.papers.geometry_shader_rays.fragment_shaders import Picture, lit, shaded, unshadowed
from refsim.papers.geometry_shader_rays.record import PackedHit
from refsim.papers.geometry_shader_rays.shaders import Frame, spawning
from refsim.papers.geometry_shader_rays.shading import lookup_normal, shadow_ray
from refsim.pipeline.blend import to_unorm8
from refsim.pipeline.layout import i32, ivec3, vec4
from refsim.pipeline.resources import Texture, Texture3D
from refsim.results import RayKind

F0, F1 = np.float32(0), np.float32(1)
INFINITY = np.float32(np.inf)
WAITING, READY = np.float32(1), np.float32(3)
BLACK = (F0, F0, F0)
NONE = np.int32(-1)
EYE, SHADOW, REFLECTED = np.int32(RayKind.EYE), np.int32(RayKind.SHADOW), np.int32(RayKind.REFLECTED)
I = np.int32  # noqa: E741


class QuadFrame(NamedTuple):
    """Uniforms of a pass. `frame`: those of the geometry shader's method; `kind` (`RayKind`), `node` and `light` (−1
    none) of the ray generation that is shot or shaded; `unorm8`: 1 where the image has 8 bits."""

    frame: Frame
    kind: i32
    node: i32
    light: i32
    unorm8: i32


class NoVaryings(NamedTuple):
    """A pass over pixels, which carries nothing."""


class SenderTexels(NamedTuple):
    """The pixel's surface ray whose hit sends the new ray (of eye rays: the eye ray itself)."""

    origin: vec4
    direction: vec4
    hit: vec4


class ShotTextures(NamedTuple):
    """What a shooting pass reads: the structure, both triangle textures, the senders' textures."""

    structure: Any
    triangles: Texture3D
    surfaces: Texture3D
    origin: Texture
    direction: Texture
    hit: Texture


class Shot(NamedTuple):
    """Render targets of a shooting pass; `counts` (cells, triangle tests, box rejections) is read by no other pass."""

    origin: vec4
    direction: vec4
    hit: vec4
    counts: ivec3


class LitTexels(NamedTuple):
    """The pixel's surface ray, and the hit of its shadow ray towards the light."""

    origin: vec4
    direction: vec4
    hit: vec4
    occluder: vec4


class LitTextures(NamedTuple):
    """What a shading pass reads."""

    triangles: Texture3D
    surfaces: Texture3D
    origin: Texture
    direction: Texture
    hit: Texture
    occluder: Texture


@func
def quad_vertex(u, t, attributes, vertex_index, instance_index):
    """A corner of the viewport."""
    corner = attributes[0].position
    return (corner[0], corner[1], F0, F1), F1, NoVaryings()


@func
def record_of(texels, state, node):
    """The texels of a surface ray as the record that the shared functions take."""
    o, d, hit = texels.origin, texels.direction, texels.hit
    return PackedHit(
        (F0, F0, d[3], F1),
        (o[0], o[1], o[2], hit[0]),
        (d[0], d[1], d[2], hit[3]),
        (hit[1], hit[2], state, np.float32(-node)),
    )


@func
def sent_ray(u, t, sender):
    """The ray that the sender's hit sends out: ``(origin, direction, t_max, weight)``; t_max is 0 if it sends none."""
    if sender.hit[3] < F0:
        return BLACK, BLACK, F0, F0
    r = record_of(sender, WAITING, I(0))
    if u.kind == SHADOW:
        d = r.dir_idx[0], r.dir_idx[1], r.dir_idx[2]
        point = add_scaled((r.orig_t[0], r.orig_t[1], r.orig_t[2]), d, r.orig_t[3])
        geometric, shading = lookup_normal(
            t.triangles, t.surfaces, I(r.dir_idx[3]), r.uv_state[0], r.uv_state[1], u.frame.smooth
        )
        position = u.frame.lights[u.light, 0], u.frame.lights[u.light, 1], u.frame.lights[u.light, 2]
        origin, direction, distance = shadow_ray(point, geometric, shading, position, u.frame.epsilon, I(0))
        return origin, direction, distance, r.pos[2]
    s = spawning(u.frame, t, r, I(1))
    if (u.kind == REFLECTED) & (s.reflects != 0):
        return s.reflected_origin, s.reflected, INFINITY, s.reflected_weight
    if (u.kind > REFLECTED) & (s.refracts != 0):
        return s.refracted_origin, s.refracted, INFINITY, s.refracted_weight
    return BLACK, BLACK, F0, F0


@cache
def shooting_fragment(traverse: Any) -> Any:
    """One ray generation: makes the pixel's ray from the hit that sends it, and intersects it."""

    @func
    def fragment(u, t, v, inputs, pixel):
        o, d = inputs.origin, inputs.direction
        origin, direction, t_max, weight = (o[0], o[1], o[2]), (d[0], d[1], d[2]), o[3], d[3]
        if u.kind != EYE:
            origin, direction, t_max, weight = sent_ray(u, t, inputs)
        triangle, distance, b1, b2 = NONE, t_max, F0, F0
        cells, tests, rejected = I(0), I(0), I(0)
        if t_max > F0:
            any_hit = I(u.kind == SHADOW)
            triangle, distance, b1, b2, cells, tests, rejected = traverse(
                t.structure, t.triangles, origin, direction, t_max, any_hit, u.frame.front_only
            )
        shot = Shot(
            (origin[0], origin[1], origin[2], t_max),
            (direction[0], direction[1], direction[2], weight),
            (distance, b1, b2, np.float32(triangle)),
            (cells, tests, rejected),
        )
        return True, F0, shot

    return fragment


@func
def lighting_fragment(u, t, v, inputs, pixel):
    """What a surface ray adds to the image: ambient light or background, or the Phong term of one light.

    Where there is no ray, background of weight 0 is added; eye rays weigh 1, dead or not (GSR-E2's clear colour). The
    geometry shader's method draws this into a layer and adds the layer; with 8 bits it is rounded both times. Here the
    shader rounds before the blend stage adds, so that the bits are the same.
    """
    s = shaded(u.frame, t, record_of(inputs, READY, u.node), I(1))
    r, g, b = F0, F0, F0
    if u.light < 0:
        r, g, b, _ = unshadowed(u.frame, s)
    elif inputs.occluder[3] < F0:
        r, g, b, _ = lit(u.frame, s, u.light, I(1))
    if u.unorm8 != 0:
        r, g, b = to_unorm8(r), to_unorm8(g), to_unorm8(b)
    return True, F0, Picture((r, g, b, F1))
