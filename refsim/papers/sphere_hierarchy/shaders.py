"""The traversal of section 2.1 as shaders: one ray a fragment of a viewport quad, or one ray a point.

Both call one device function, `traverser`, which is the pseudo-code with the lists fetched from textures by index. What
a sphere and a triangle are tested with are the functions of the bare loop (`traversal`, `refsim.geometry.triangle`), so
hits and counts have its bits. A ray comes with the best hit so far and leaves with the better one: a draw a layer.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.layout import f32, i32, ivec2, ivec3, vec2, vec3, vec4
from refsim.pipeline.resources import Texture

F0, F1 = np.float32(0), np.float32(1)
INFINITY = np.float32(np.inf)
I = np.int32  # noqa: E741
U = np.uintp


class SearchFrame(NamedTuple):
    """Uniforms: the flags 0 or 1; `offset` is added to the numbers of this layer's triangles."""

    any_hit: i32
    front_only: i32
    offset: i32


class ListTextures(NamedTuple):
    """A layer's lists as one-dimensional textures, texel i is element i (`list_textures.list_textures`).

    escape    i32[k]: R32SINT
    spheres   f32[k, 4]: RGBA32F, the payload of an internal node; `payload` i32[k, 4]: RGBA32SINT, the same memory
    records   f32[n, 12]: three texels a triangle, (v0, n, m1, m2)
    root      f32[4]: the first sphere of the hierarchy
    """

    escape: np.ndarray
    spheres: np.ndarray
    payload: np.ndarray
    records: np.ndarray
    root: np.ndarray


class Best(NamedTuple):
    """What a ray has found so far: `hit` (t, u, v), `found` (triangle or −1, nodes, triangle tests).

    Colour targets, varyings, captured records, and the input of the next layer's draw.
    """

    hit: vec3
    found: ivec3


class RayTexels(NamedTuple):
    """The pixel's ray, read as input attachments. `origin` has t_max as w; `entry` is where it begins and where its
    list ends, as elements of the texture."""

    origin: vec4
    direction: vec3
    entry: ivec2
    hit: vec3
    found: ivec3


class FragmentTextures(NamedTuple):
    """What the fragment form reads."""

    lists: ListTextures
    origin: Texture
    direction: Texture
    entry: Texture
    hit: Texture
    found: Texture


class VertexTextures(NamedTuple):
    """What the vertex form reads: the rays are its vertices."""

    lists: ListTextures


class RayVertex(NamedTuple):
    """A ray as a point."""

    origin: vec3
    t_max: f32
    direction: vec3


class EntryVertex(NamedTuple):
    """Where it begins in this layer's lists, and where its list ends."""

    entry: ivec2


class Corner(NamedTuple):
    """A corner of the viewport in clip space."""

    position: vec2


class NoVaryings(NamedTuple):
    """A pass over pixels, which carries nothing."""


@func
def sphere_at(texture, i):
    """The texel of an internal node: centre and radius."""
    return texture[i, 0], texture[i, 1], texture[i, 2], texture[i, 3]


@func
def record_at(texture, i):
    """The three texels of a triangle, as ``(v0, n, m1, m2)``."""
    return (
        (texture[i, 0], texture[i, 1], texture[i, 2]),
        (texture[i, 3], texture[i, 4], texture[i, 5]),
        (texture[i, 6], texture[i, 7], texture[i, 8]),
        (texture[i, 9], texture[i, 10], texture[i, 11]),
    )


@cache
def traverser(misses_sphere: Any, slack_of: Any, per_length: Any, intersect: Any) -> Any:
    """Device function ``traverse(u, lists, o, d, t_max, entry, hit, found)``: section 2.1 for one ray, as a `Best`.

    One return, and no branch out of the loop: with several, numba counts references to the textures for every ray.
    """

    @func
    def traverse(u, lists, o, d, t_max, entry, hit, found):
        t, hit_u, hit_v = hit
        triangle, visited, tested = found
        w, slack = per_length(d), slack_of(o, lists.root)
        best = t if triangle >= I(0) else t_max
        node, end = U(entry[0]), U(entry[1])
        # Dead rays, and shadow rays that an earlier layer stopped, have no way to go
        if not t_max > F0 or (u.any_hit != I(0) and triangle >= I(0)):
            end = node
        while node < end:
            visited += I(1)
            step = lists.escape[node]
            if step == I(1) or step == I(0):
                tested += I(1)
                local = lists.payload[node, 3]
                number = local + u.offset
                v0, n, m1, m2 = record_at(lists.records, U(local))
                inside, at, weight_u, weight_v, den = intersect(o, d, t_max, v0, n, m1, m2)
                nearer = (at < best) | ((at == best) & (number < triangle))
                if inside & nearer & ((den < F0) | (u.front_only == I(0))):
                    best, triangle, hit_u, hit_v = at, number, weight_u, weight_v
                    if u.any_hit != I(0):
                        step = I(0)
            else:
                x, y, z, radius = sphere_at(lists.spheres, node)
                if not misses_sphere(o, d, w, slack, best, x, y, z, radius):
                    step = I(1)
            node = node + U(step) if step > I(0) else end
        t = best if triangle >= I(0) else INFINITY
        return Best((t, hit_u, hit_v), (triangle, visited, tested))

    return traverse


@func
def quad_vertex(u, t, attributes, vertex_index, instance_index):
    """A corner of the viewport."""
    corner = attributes[0].position
    return (corner[0], corner[1], F0, F1), F1, NoVaryings()


@cache
def searching_fragment(traverse: Any) -> Any:
    """One fragment a ray: reads the pixel's ray, writes what it found."""

    @func
    def fragment(u, t, v, inputs, pixel):
        o, d = inputs.origin, inputs.direction
        best = traverse(u, t.lists, (o[0], o[1], o[2]), d, o[3], inputs.entry, inputs.hit, inputs.found)
        return True, F0, best

    return fragment


@cache
def searching_vertex(traverse: Any) -> Any:
    """One point a ray: what it found are its varyings. It stands nowhere, as nothing is rasterised."""

    @func
    def vertex(u, t, attributes, vertex_index, instance_index):
        ray, place, before = attributes
        best = traverse(u, t.lists, ray.origin, ray.direction, ray.t_max, place.entry, before.hit, before.found)
        return (F0, F0, F0, F1), F1, best

    return vertex
