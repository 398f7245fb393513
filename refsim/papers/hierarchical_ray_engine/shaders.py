"""The shaders: quads or point sprites that carry a triangle to its rays, and the ray that each fragment stands for.

Every factory returns a pure device function; what it closes over is a constant of the compiled draw. Names follow the
paper: tile, cone, primitive. Rays live in two textures: origin (w: t_max, 0 = dead) and direction.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from refsim.geometry.cone import UNBOUNDED, Cone, Printed, empty, excess, include, meets_sphere, repair
from refsim.geometry.optics import next_ray
from refsim.geometry.triangle import intersect
from refsim.geometry.vector import add, normalise, scale
from refsim.jit import func
from refsim.pipeline.layout import f32, i32, vec3, vec4
from refsim.pipeline.resources import Texture, texel1, texel3, texel4

ZERO = np.float32(0)
ONE = np.float32(1)
OUTLYING = np.float32(4)
INFINITY = np.float32(np.inf)


class RayTexels(NamedTuple):
    """The pixel's own ray: input attachments of the intersection shader."""

    origin: vec4
    direction: vec3


class RayTextures(NamedTuple):
    """Rays of this generation."""

    origin: Texture
    direction: Texture


class ConeTextures(NamedTuple):
    """Rays of this generation, and the cones of their tiles; `submission="primitive"` fetches them per vertex."""

    origin: Texture
    direction: Texture
    apex: Texture
    axis: Texture
    slack: Texture


class FlatTriangle(NamedTuple):
    """What a fragment knows of its triangle: plane form, surface, number."""

    v0: vec3
    n: vec3
    m1: vec3
    m2: vec3
    surface: f32
    triangle: i32


class SmoothTriangle(NamedTuple):
    """The same with normals at the vertices."""

    v0: vec3
    n: vec3
    m1: vec3
    m2: vec3
    surface: f32
    triangle: i32
    normal0: vec3
    normal1: vec3
    normal2: vec3


class NextRay(NamedTuple):
    """Colour targets of an engine pass: the hit, and the ray of the next generation."""

    hit: vec3
    origin: vec4
    direction: vec3
    triangle: i32
    kind: i32


class ConeTexel(NamedTuple):
    """Colour targets of the cone pass: apex and cos φ, axis and sin φ, slack (−inf empty, +inf unbounded), state."""

    apex: vec4
    axis: vec4
    slack: f32
    state: i32


class EngineUniforms(NamedTuple):
    """`depth_scale` maps t into [0, 1): a power of two, so no two t fall together. `epsilon` offsets a new ray."""

    depth_scale: f32
    epsilon: f32


class TileUniforms(NamedTuple):
    """The same, the tile size in pixels, and (`submission="tile"`) the cones read back: f32[tiles, 9]."""

    depth_scale: f32
    epsilon: f32
    tile_size: f32
    cones: np.ndarray


class ConeUniforms(NamedTuple):
    """Tile size in pixels."""

    tile_size: i32


@cache
def varyings(smooth: bool) -> type:
    """The varyings of a triangle primitive."""
    return SmoothTriangle if smooth else FlatTriangle


@cache
def triangle_varyings(smooth: bool) -> Any:
    """``(TriangleVertex, number) -> varyings``."""
    if smooth:

        @func
        def carry(a, triangle):
            surface = a.texture0
            v0, n = (surface[0], surface[1], surface[2]), (a.normal[0], a.normal[1], a.normal[2])
            return SmoothTriangle(
                v0, n, a.texture1, a.texture2, surface[3], triangle, a.normal0, a.normal1, a.normal2
            )

    else:

        @func
        def carry(a, triangle):
            surface = a.texture0
            v0, n = (surface[0], surface[1], surface[2]), (a.normal[0], a.normal[1], a.normal[2])
            return FlatTriangle(v0, n, a.texture1, a.texture2, surface[3], triangle)

    return carry


@cache
def quad_vertex(smooth: bool) -> Any:
    """Section 2.1: a corner of the full-screen quad of triangle `instance`."""
    carry = triangle_varyings(smooth)

    @func
    def vertex(u, t, attributes, vertex_index, instance_index):
        corner, triangle = attributes
        return (corner.position[0], corner.position[1], ZERO, ONE), ONE, carry(triangle, instance_index)

    return vertex


@cache
def sprite_vertex(submission: str, smooth: bool, printed: Printed) -> Any:
    """Section 3: the cone–sphere test; a sprite of the tile's size, or an outlying position that clipping discards.

    `submission` "tile": vertices are triangles, instances are tiles, the cone comes from uniforms. "primitive":
    vertices are tiles, instances are triangles, the cone is fetched from textures.
    """
    carry = triangle_varyings(smooth)
    by_tile = submission == "tile"

    @func
    def place(u, triangle, tile, cone, slack, number):
        sphere = triangle.position
        meets = meets_sphere(cone, slack, (sphere[0], sphere[1], sphere[2]), sphere[3], printed)
        x = tile.position[0] if meets else OUTLYING
        y = tile.position[1] if meets else OUTLYING
        return (x, y, ZERO, ONE), u.tile_size, carry(triangle, number)

    if by_tile:

        @func
        def vertex(u, t, attributes, vertex_index, instance_index):
            triangle, tile = attributes
            c, i = u.cones, np.uintp(instance_index)
            apex, axis = (c[i, 0], c[i, 1], c[i, 2]), (c[i, 4], c[i, 5], c[i, 6])
            cone = Cone(apex, axis, c[i, 3], c[i, 7], UNBOUNDED)
            return place(u, triangle, tile, cone, c[i, 8], vertex_index)

    else:

        @func
        def vertex(u, t, attributes, vertex_index, instance_index):
            tile, triangle = attributes
            x, y = np.uintp(tile.texel[0]), np.uintp(tile.texel[1])
            a, b = texel4(t.apex, x, y), texel4(t.axis, x, y)
            cone = Cone((a[0], a[1], a[2]), (b[0], b[1], b[2]), a[3], b[3], UNBOUNDED)
            return place(u, triangle, tile, cone, texel1(t.slack, x, y), instance_index)

    return vertex


@cache
def intersection_fragment(facing: str, smooth: bool) -> Any:
    """Intersection and refracted direction in one shader: t as depth, the next ray as colour (sections 2.1, 3, 7)."""
    front_only = facing == "front"

    @func
    def fragment(u, t, v, inputs, pixel):
        o = (inputs.origin[0], inputs.origin[1], inputs.origin[2])
        d = inputs.direction
        hit, distance, b1, b2, facing_ratio = intersect(o, d, inputs.origin[3], v.v0, v.n, v.m1, v.m2)
        hit = hit & ((facing_ratio < ZERO) | (not front_only))
        normal = v.n
        if smooth:
            # Interpolated vertex normal; its sum is the zero vector only for a degenerate triangle
            weighted = add(add(scale(v.normal0, ONE - b1 - b2), scale(v.normal1, b1)), scale(v.normal2, b2))
            normal = normalise(weighted)
        origin, direction, kind, alive = next_ray(o, d, distance, v.n, normal, v.surface, u.epsilon)
        t_max = INFINITY if alive else ZERO
        ray = NextRay(
            (distance, b1, b2), (origin[0], origin[1], origin[2], t_max), direction, v.triangle, kind
        )
        return hit, distance * u.depth_scale, ray

    return fragment


@cache
def cone_fragment(printed: Printed) -> Any:
    """Section 4: the enclosing cone of a tile's live rays, by the incremental algorithm; dead rays are skipped."""

    @func
    def fragment(u, t, v, inputs, pixel):
        x0, y0 = pixel[0] * u.tile_size, pixel[1] * u.tile_size
        cone = empty()
        for y in range(y0, y0 + u.tile_size):
            for x in range(x0, x0 + u.tile_size):
                a = texel4(t.origin, np.uintp(x), np.uintp(y))
                if a[3] > ZERO:
                    cone = include(cone, (a[0], a[1], a[2]), texel3(t.direction, np.uintp(x), np.uintp(y)), printed)
        # The corrected construction measures how far float32 left its rays outside
        distance, angle = ZERO, ZERO
        if cone.state != UNBOUNDED:
            for y in range(y0, y0 + u.tile_size):
                for x in range(x0, x0 + u.tile_size):
                    a = texel4(t.origin, np.uintp(x), np.uintp(y))
                    if a[3] > ZERO:
                        far, wide = excess(
                            cone, (a[0], a[1], a[2]), texel3(t.direction, np.uintp(x), np.uintp(y))
                        )
                        distance, angle = max(distance, far), max(angle, wide)
        cone, slack = repair(cone, distance, angle, printed)
        apex = (cone.apex[0], cone.apex[1], cone.apex[2], cone.cos)
        axis = (cone.axis[0], cone.axis[1], cone.axis[2], cone.sin)
        return True, ZERO, ConeTexel(apex, axis, slack, cone.state)

    return fragment


class NoVaryings(NamedTuple):
    """A pass over pixels, which carries nothing."""


@func
def screen_vertex(u, t, attributes, vertex_index, instance_index):
    """A corner of a full-screen quad that carries nothing."""
    corner = attributes[0]
    return (corner.position[0], corner.position[1], ZERO, ONE), ONE, NoVaryings()
