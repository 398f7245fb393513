"""The three shaders: Listing 3 (vertex), Listing 4 (geometry), Listing 5 (fragment), generalised to any tree of rays.

State machine of a record (`record`): 0 eye ray to be made ─▶ 1 to be intersected ─▶ 3 shaded in this pass, dropped in
the next. What stands as printed is read from uniforms (`errata.Printed`), so that all errata share one compiled draw.

`Found` is instrumentation: the vertex shader notes, under the ray's number, what its search found and cost. No stage
reads it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from refsim.geometry.optics import REFLECTED, next_ray
from refsim.geometry.vector import add, add_scaled, normalise, scale
from refsim.jit import func
from refsim.papers.geometry_shader_rays.acceleration import test_triangle
from refsim.papers.geometry_shader_rays.errata import Printed
from refsim.papers.geometry_shader_rays.record import PackedHit
from refsim.papers.geometry_shader_rays.shading import lookup_normal, shadow_ray
from refsim.papers.geometry_shader_rays.triangle_textures import fetch
from refsim.pipeline.layout import f32, i32, vec3
from refsim.pipeline.resources import Texture, Texture3D

F0, F1, QUARTER = np.float32(0), np.float32(1), np.float32(0.25)
F2 = np.float32(2)
INFINITY = np.float32(np.inf)
READY = np.float32(3)
WAITING = np.float32(1)
NONE = np.float32(-1)
BLACK = (F0, F0, F0)
I = np.int32  # noqa: E741
U = np.uintp


class Found(NamedTuple):
    """A row a ray of the pass: `hits` f32[n, 3] (t, u, v), `counts` i32[n, 4] (triangle, cells, tests, rejected),
    `made` f32[n, 6] (origin, direction) of eye rays that the shader made."""

    hits: np.ndarray
    counts: np.ndarray
    made: np.ndarray


class SceneTextures(NamedTuple):
    """What the shaders read: the accelerator's structure, both triangle textures, first triangles by pixel."""

    structure: Any
    triangles: Texture3D
    surfaces: Texture3D
    first: Texture
    found: Found


class Frame(NamedTuple):
    """Uniforms. Flags are 0 or 1. `lights` f32[L, 3] positions, `radiances` f32[L, 3]; `camera` f32[4, 3]: eye, right,
    up, forward (GSR-E12); `layers`: nodes of the ray tree; `last`: Listing 4's `emitNoMore`; `rasterised`: eye rays
    look into `first` before they search."""

    lights: np.ndarray
    radiances: np.ndarray
    background: vec3
    epsilon: f32
    branching: i32
    layers: i32
    last: i32
    shadows: i32
    reflections: i32
    refractions: i32
    front_only: i32
    smooth: i32
    rasterised: i32
    camera: np.ndarray
    printed: Printed


@func
def eye_ray(u, pos):
    """Listing 3 as printed (GSR-E12): ``normalize(vec3(x, y, −1) * rot3)``, whose −1 runs along the view."""
    c = u.camera
    eye = c[0, 0], c[0, 1], c[0, 2]
    right, up, forward = (c[1, 0], c[1, 1], c[1, 2]), (c[2, 0], c[2, 1], c[2, 2]), (c[3, 0], c[3, 1], c[3, 2])
    return eye, normalise(add(add(scale(right, pos[0]), scale(up, pos[1])), forward))


def shooting(traverse: Any) -> Any:
    """Device function ``shot(u, t, record, number)``: the body of Listing 3, with `traverse` as `intersect_grid`."""

    @func
    def shot(u, t, record, number):
        state = record.uv_state[2]
        if state > WAITING:
            return record
        o = record.orig_t[0], record.orig_t[1], record.orig_t[2]
        d = record.dir_idx[0], record.dir_idx[1], record.dir_idx[2]
        kind, t_max = record.uv_state[3], record.orig_t[3]
        if (state == F0) & (u.printed.E12 != 0):
            o, d = eye_ray(u, record.pos)
            t_max = INFINITY
            for k in range(3):
                t.found.made[U(number), U(k)], t.found.made[U(number), U(k + 3)] = o[k], d[k]
        triangle, distance, b1, b2 = I(-1), t_max, F0, F0
        cells, tests, rejected = I(0), I(0), I(0)
        if (state == F0) & (u.rasterised != 0):
            # Section 6: the triangle that the rasteriser drew here, if the ray hits it too
            drawn = t.first.data[0, U(number) // U(t.first.data.shape[2]), U(number) % U(t.first.data.shape[2])]
            if drawn >= 0:
                triangle, distance, b1, b2 = test_triangle(
                    t.triangles, drawn, o, d, t_max, u.front_only, triangle, t_max, F0, F0
                )
                tests += I(1)
        if triangle < 0:
            any_hit = I(kind > F0) & (u.printed.E6 ^ I(1))
            triangle, distance, b1, b2, cells, searched, rejected = traverse(
                t.structure, t.triangles, o, d, t_max, any_hit, u.front_only
            )
            tests += searched
        i = U(number)
        t.found.hits[i, 0], t.found.hits[i, 1], t.found.hits[i, 2] = distance, b1, b2
        t.found.counts[i, 0], t.found.counts[i, 1] = triangle, cells
        t.found.counts[i, 2], t.found.counts[i, 3] = tests, rejected
        return PackedHit(
            record.pos,
            (o[0], o[1], o[2], distance),
            (d[0], d[1], d[2], np.float32(triangle)),
            (b1, b2, WAITING, kind),
        )

    return shot


def intersecting_vertex(shot: Any) -> Any:
    """Listing 3: the vertex shader intersects."""

    @func
    def vertex(u, t, attributes, vertex_index, instance_index):
        record = shot(u, t, attributes[0], vertex_index)
        return (record.pos[0], record.pos[1], F0, F1), F1, record

    return vertex


def finishing_vertex(shot: Any) -> Any:
    """The vertex shader of a pipeline without a geometry shader (Table 2): what hits is shaded at once."""

    @func
    def vertex(u, t, attributes, vertex_index, instance_index):
        r = shot(u, t, attributes[0], vertex_index)
        state = READY if (r.dir_idx[3] >= F0) & (r.uv_state[2] <= WAITING) else WAITING
        finished = PackedHit(r.pos, r.orig_t, r.dir_idx, (r.uv_state[0], r.uv_state[1], state, r.uv_state[3]))
        return layered(u, r.pos, I(0)), F1, finished

    return vertex


@func
def passing_vertex(u, t, attributes, vertex_index, instance_index):
    """A vertex shader that leaves all work to the geometry shader (section 4.1's rejected variant)."""
    record = attributes[0]
    return (record.pos[0], record.pos[1], F0, F1), F1, record


@func
def layered(u, pos, node):
    """The clip-space position of pixel `pos` in the layer of a node; as printed (GSR-E8) there is one layer."""
    layer = np.float32(0 if u.printed.E8 else node)
    y = F1 - ((F1 - pos[1]) + F2 * layer) / np.float32(u.layers)
    return pos[0], y, F0, F1


class Spawning(NamedTuple):
    """What Listing 4 decides about a ray: whether it passes on, and the rays that its hit sends out."""

    passes: i32
    spawns: i32
    node: i32
    point: vec3
    geometric: vec3
    shading: vec3
    reflects: i32
    reflected_origin: vec3
    reflected: vec3
    reflected_weight: f32
    refracts: i32
    refracted_origin: vec3
    refracted: vec3
    refracted_weight: f32


@func
def spawning(u, t, r, lights):
    """Listing 4 up to its first emission, and the ideal reflection and refraction at the hit."""
    code = I(r.uv_state[3])
    surface = code <= 0
    node = -code if surface else (code - I(1)) // I(lights)
    live = r.uv_state[2] <= WAITING
    hit = r.dir_idx[3] >= F0
    # GSR-E2: what misses has the clear colour behind it (eye rays) or the background before it. Where nothing is
    # shaded (GSR-E3 as printed) there is no background to show
    lit = (u.background[0] != F0) | (u.background[1] != F0) | (u.background[2] != F0)
    shown = surface & (node > 0) & lit & (u.printed.E2 == 0) & (u.printed.E3 == 0)
    passes = live & (hit | shown)
    spawns = live & hit & surface & (u.last == 0)
    if u.printed.E5:
        spawns = spawns & (code == 0)
    if not spawns:
        return Spawning(
            I(passes), I(0), I(node), BLACK, BLACK, BLACK, I(0), BLACK, BLACK, F0, I(0), BLACK, BLACK, F0
        )
    o = r.orig_t[0], r.orig_t[1], r.orig_t[2]
    d = r.dir_idx[0], r.dir_idx[1], r.dir_idx[2]
    triangle, distance, weight = I(r.dir_idx[3]), r.orig_t[3], r.pos[2]
    point = add_scaled(o, d, distance)
    geometric, shading = lookup_normal(t.triangles, t.surfaces, triangle, r.uv_state[0], r.uv_state[1], u.smooth)
    index, rho = fetch(t.triangles, triangle, 0)[3], fetch(t.triangles, triangle, 1)[3]
    tau = fetch(t.triangles, triangle, 2)[3]
    if u.printed.E4:
        rho = QUARTER
    origin_1, direction_1, _, _ = next_ray(o, d, distance, geometric, shading, F0, u.epsilon)
    origin_2, direction_2, kind, _ = next_ray(o, d, distance, geometric, shading, index, u.epsilon)
    if u.printed.E11:
        origin_1 = add_scaled(point, shading, u.epsilon)
        origin_2 = origin_1
    # Total internal reflection: nothing is refracted, the mirrored ray gets that light too
    glass = (tau > F0) & (u.refractions != 0)
    refracts = glass & (kind != REFLECTED)
    if glass & (not refracts):
        rho = rho + tau
    reflects = (rho > F0) & (u.reflections != 0)
    return Spawning(
        I(passes), I(1), I(node), point, geometric, shading, I(reflects), origin_1, direction_1, weight * rho,
        I(refracts), origin_2, direction_2, weight * tau,
    )  # fmt: skip


@func
def passed_on(u, r, s):
    """`emitPassThrough`: the ray itself, to be shaded in this pass (as printed, GSR-E3, unchanged)."""
    state = r.uv_state[2] if u.printed.E3 else READY
    record = PackedHit(r.pos, r.orig_t, r.dir_idx, (r.uv_state[0], r.uv_state[1], state, r.uv_state[3]))
    return s.passes, layered(u, r.pos, s.node), F1, record


@func
def new_ray(u, emission, pos, weight, origin, direction, t_max, node, kind):
    """A ray to be intersected in the next pass and skipped by the fragment shader of this one."""
    record = PackedHit(
        (pos[0], pos[1], weight, F1),
        (origin[0], origin[1], origin[2], t_max),
        (direction[0], direction[1], direction[2], NONE),
        (F0, F0, WAITING, np.float32(kind)),
    )
    return emission, layered(u, pos, node), F1, record


@func
def shadow_entry(u, r, s, light, lights):
    """`emitShadowRay`, for light `light` of `lights`."""
    origin, direction, distance = BLACK, BLACK, F0
    emission = s.spawns & u.shadows
    if emission:
        position = u.lights[light, 0], u.lights[light, 1], u.lights[light, 2]
        origin, direction, distance = shadow_ray(
            s.point, s.geometric, s.shading, position, u.epsilon, u.printed.E11
        )
    kind = I(1) + I(light) + I(lights) * s.node
    return new_ray(u, emission, r.pos, r.pos[2], origin, direction, distance, s.node, kind)


@func
def reflected_entry(u, r, s):
    """`emitReflRay`."""
    node = u.branching * s.node + I(1)
    return new_ray(
        u, s.spawns & s.reflects, r.pos, s.reflected_weight, s.reflected_origin, s.reflected, INFINITY, node, -node
    )


@func
def refracted_entry(u, r, s):
    """The third kind of ray, which the paper's amplification makes possible."""
    node = u.branching * s.node + I(2)
    return new_ray(
        u, s.spawns & s.refracts, r.pos, s.refracted_weight, s.refracted_origin, s.refracted, INFINITY, node, -node
    )
