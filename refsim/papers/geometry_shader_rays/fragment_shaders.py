"""Listing 5 and Eq. 1: a shaded ray's contribution to each render target, and the passes that add the targets up.

Targets of a layer: "unshadowed" (ambient light, background) and one a light. Eq. 1,

    RGB_out = 1.0 · RGB_src + α_src · RGB_dst,

blends all of them. A surface ray replaces what its layer holds (α 0); a shadow ray that hit extinguishes the target of
its light (RGB 0, α 0) and leaves the others (RGB 0, α 1). RGB_src is multiplied by the path's weight beforehand, as the
text asks of ρ.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from refsim.geometry.vector import add_scaled
from refsim.jit import func
from refsim.papers.geometry_shader_rays.shading import ambient, facing, lookup_normal, phong
from refsim.papers.geometry_shader_rays.triangle_textures import fetch
from refsim.pipeline.layout import device_function, f32, i32, vec3, vec4
from refsim.pipeline.resources import Texture

F0, F1 = np.float32(0), np.float32(1)
READY = np.float32(3)
BLACK = (F0, F0, F0)
I = np.int32  # noqa: E741
U = np.uintp


@cache
def layer_colors(lights: int) -> Any:
    """The colour targets of a layer, a NamedTuple class: "unshadowed", "light0", …"""
    fields: list[tuple[str, Any]] = [("unshadowed", vec4), *((f"light{k}", vec4) for k in range(lights))]
    return NamedTuple(f"LayerColors{lights}", fields)  # type: ignore[misc]


class Shaded(NamedTuple):
    """A fragment's ray: whether it is shaded, a surface (or a shadow ray of light `light`), and what lights it."""

    ready: i32
    surface: i32
    light: i32
    missed: i32
    point: vec3
    direction: vec3
    normal: vec3
    diffuse: vec3
    specular: f32
    exponent: f32
    weight: f32
    ambient: vec3
    alpha: f32


@func
def shaded(u, t, r, lights):
    """Listing 5 up to its colours: which ray this is, and the surface that it hit."""
    ready = r.uv_state[2] >= READY
    code = I(r.uv_state[3])
    surface = code <= 0
    missed = r.dir_idx[3] < F0
    light = I(-1) if surface else (code - I(1)) % I(lights)
    # GSR-E9: α of eye fragments; GSR-E8: in one target reflected fragments add
    alpha = np.float32(u.printed.E9 if code == 0 else u.printed.E8)
    d = r.dir_idx[0], r.dir_idx[1], r.dir_idx[2]
    weight = r.pos[2]
    if (not ready) | (not surface) | missed:
        constant = u.background[0] * weight, u.background[1] * weight, u.background[2] * weight
        return Shaded(
            I(ready), I(surface), I(light), I(missed), BLACK, d, BLACK, BLACK, F0, F0, weight, constant, alpha
        )
    triangle = I(r.dir_idx[3])
    point = add_scaled((r.orig_t[0], r.orig_t[1], r.orig_t[2]), d, r.orig_t[3])
    _, normal = lookup_normal(t.triangles, t.surfaces, triangle, r.uv_state[0], r.uv_state[1], u.smooth)
    color = fetch(t.surfaces, triangle, 3)
    diffuse = color[0], color[1], color[2]
    specular, exponent = fetch(t.surfaces, triangle, 0)[3], fetch(t.triangles, triangle, 3)[3]
    return Shaded(
        I(ready), I(1), I(-1), I(0), point, d, facing(normal, d), diffuse, specular, exponent, weight,
        ambient(diffuse, weight), alpha,
    )  # fmt: skip


@func
def one_target(u):
    """GSR-E8 as printed: everything goes to the first light's target."""
    return (u.printed.E8 != 0) & (u.lights.shape[0] > 0)


@func
def unshadowed(u, s):
    """RGB_src and α_src for the target that no shadow touches; as printed (GSR-E10, E8) ambient light is not there."""
    if (s.surface == 0) | one_target(u):
        return F0, F0, F0, F1
    if (u.printed.E10 != 0) & (s.missed == 0):
        return F0, F0, F0, s.alpha
    return s.ambient[0], s.ambient[1], s.ambient[2], s.alpha


@func
def lit(u, s, light, lights):
    """RGB_src and α_src of Eq. 1 for the target of one light."""
    together = one_target(u)
    if s.surface == 0:
        mine = (s.light == light) | (together & (light == 0))
        # GSR-E1: the shadow's own colour
        shade = np.float32(u.printed.E1 - u.printed.E1b)
        return (shade, shade, shade, F0) if mine else (F0, F0, F0, F1)
    if together & (light > 0):
        return F0, F0, F0, F1
    r, g, b = F0, F0, F0
    if (light == 0) & (together | ((u.printed.E10 != 0) & (s.missed == 0))):
        r, g, b = s.ambient
    if s.missed == 0:
        first, last = I(light), I(light) + I(1)
        if together:
            first, last = I(0), I(lights)
        for k in range(first, last):
            position = u.lights[k, 0], u.lights[k, 1], u.lights[k, 2]
            radiance = u.radiances[k, 0], u.radiances[k, 1], u.radiances[k, 2]
            color = phong(
                s.point, s.direction, s.normal, s.diffuse, s.specular, s.exponent, position, radiance, s.weight
            )
            r, g, b = r + color[0], g + color[1], b + color[2]
    return r, g, b, s.alpha


@cache
def shading_fragment(lights: int) -> Any:
    """Listing 5, for so many lights: discards what is not ready."""
    targets = ", ".join(["unshadowed(u, s)", *(f"lit(u, s, {k}, {lights})" for k in range(lights))])
    source = (
        "def fragment(u, t, v, inputs, pixel):\n"
        f"    s = shaded(u, t, v, {max(lights, 1)})\n"
        f"    return s.ready != 0, F0, Colors({targets})\n"
    )
    names = {"shaded": shaded, "unshadowed": unshadowed, "lit": lit, "Colors": layer_colors(lights), "F0": F0}
    return device_function(source, "fragment", names)


class LayerTextures(NamedTuple):
    """All planes of the layers, f32[4 · targets, layers · height, width]."""

    layers: Texture


class LayerSize(NamedTuple):
    """Uniforms of the blending passes: height of a layer in pixels, targets of a layer."""

    height: i32
    targets: i32


class WhichTarget(NamedTuple):
    """First row of the layer, and first plane of the target, that a blending pass adds."""

    row: i32
    plane: i32


class Picture(NamedTuple):
    """The composed image."""

    color: vec4


@func
def blending_vertex(u, t, attributes, vertex_index, instance_index):
    """A corner of the full-screen quad of one blending pass."""
    corner = attributes[0].position
    layer, target = instance_index // u.targets, instance_index % u.targets
    return (corner[0], corner[1], F0, F1), F1, WhichTarget(I(layer * u.height), I(4 * target))


@func
def blending_fragment(u, t, v, inputs, pixel):
    """A texel of one target of one layer, to be added to the image."""
    x, y, first = U(pixel[0]), U(v.row + pixel[1]), U(v.plane)
    data = t.layers.data
    color = data[first, y, x], data[first + U(1), y, x], data[first + U(2), y, x], F1
    return True, F0, Picture(color)
