"""Rays from hits to the paper's one point light: "direct illumination with lambertian shading" (section 4).

A template of `refsim.jit`. A hit sends a ray only if the light is on the side that was hit: elsewhere Lambert's cosine
is zero whatever hides the light.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.vector import add_scaled, divide, dot, length, sub
from refsim.jit import func
from refsim.results import RayKind

F0 = np.float32(0)
INFINITY = np.float32(np.inf)
SHADOW = np.int32(RayKind.SHADOW)
U = np.uintp


@func
def towards_light(o, d, t, normal, light, epsilon):
    """``(origin, direction, distance, sent)``: epsilon off the surface on the side that was hit; the search ends at the
    light. `normal` is the triangle's unit normal."""
    side = epsilon if dot(d, normal) < F0 else -epsilon
    origin = add_scaled(add_scaled(o, d, t), normal, side)
    towards = sub(light, origin)
    distance = length(towards)
    faces = dot(towards, normal) * side > F0
    return origin, divide(towards, distance), distance, faces & (distance > F0) & (distance < INFINITY)


def shadow_rays(origin, direction, triangle, t, normals, surface, light, epsilon, out_origin, out_direction, out_t_max,
                out_kind):  # fmt: skip
    """Writes the rows of hits on diffuse surfaces (`surface` f32[m] below 0) that see the light's side.

    `origin`, `direction` f32[n, 3], `triangle` i32[n], `t` f32[n]; `normals` f32[m, 3], `light` f32[3].
    """
    position = light[0], light[1], light[2]
    for row in range(triangle.shape[0]):
        i = U(row)
        if triangle[i] < 0:
            continue
        k = U(triangle[i])
        if not surface[k] < F0:
            continue
        o = origin[i, 0], origin[i, 1], origin[i, 2]
        d = direction[i, 0], direction[i, 1], direction[i, 2]
        normal = normals[k, 0], normals[k, 1], normals[k, 2]
        start, towards, distance, sent = towards_light(o, d, t[i], normal, position, epsilon)
        if sent:
            for c in range(3):
                out_origin[i, U(c)], out_direction[i, U(c)] = start[c], towards[c]
            out_t_max[i], out_kind[i] = distance, SHADOW
