"""The surface under a hit, its light, and the rays that leave it: the formulas that all shaders of this room share.

Float32, sums from left to right; `refsim.reference.phong` is the NumPy twin. Phong's exponent is a whole number, so
that the power is a chain of products and no library's `pow` decides a bit (Listing 5 has the diffuse term alone; the
text says Phong). The normal is turned against the ray: a hit on the back of a triangle is shaded as one on its front.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.vector import add, add_scaled, divide, dot, length, normalise, scale, sub
from refsim.jit import func
from refsim.papers.geometry_shader_rays.triangle_textures import fetch

F0 = np.float32(0)
F1 = np.float32(1)
F2 = np.float32(2)
AMBIENT = np.float32(0.2)
I = np.int32  # noqa: E741


@func
def lookup_normal(triangles, surfaces, triangle, u, v, smooth):
    """`lookupNormal` of Listings 4 and 5: ``(geometric, shading)`` unit normals of a hit.

    The shading normal interpolates those at the vertices where `smooth` is not 0, else it is the geometric one.
    """
    n = fetch(triangles, triangle, 1)
    geometric = n[0], n[1], n[2]
    if smooth == 0:
        return geometric, geometric
    a, b, c = fetch(surfaces, triangle, 0), fetch(surfaces, triangle, 1), fetch(surfaces, triangle, 2)
    n0, n1, n2 = (a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2])
    return geometric, normalise(add(add(scale(n0, F1 - u - v), scale(n1, u)), scale(n2, v)))


@func
def facing(n, d):
    """`n` turned against direction d."""
    return n if dot(n, d) < F0 else (-n[0], -n[1], -n[2])


@func
def power(x, exponent):
    """x to a whole exponent from 0 on, by repeated squaring."""
    result, base, left = F1, x, I(exponent)
    while left > 0:
        if left & 1:
            result *= base
        base *= base
        left >>= 1
    return result


@func
def phong(point, d, normal, diffuse, specular, exponent, light, radiance, weight):
    """What a surface sends back along its ray from one point light, RGB: weight · radiance · (k_d N·L + k_s (R·V)^e).

    `normal` is turned against the ray; `light` is the light's position; light does not fall off with distance.
    """
    towards = sub(light, point)
    to_light = divide(towards, length(towards))
    cosine = dot(normal, to_light)
    n_dot_l = cosine if cosine > F0 else F0
    mirrored = sub(scale(normal, F2 * n_dot_l), to_light)
    r_dot_v = -dot(mirrored, d)
    highlight = F0
    if (n_dot_l > F0) & (r_dot_v > F0) & (specular > F0):
        highlight = specular * power(r_dot_v, exponent)
    return (
        (diffuse[0] * n_dot_l + highlight) * radiance[0] * weight,
        (diffuse[1] * n_dot_l + highlight) * radiance[1] * weight,
        (diffuse[2] * n_dot_l + highlight) * radiance[2] * weight,
    )


@func
def ambient(diffuse, weight):
    """The light that no shadow takes away: weight · (k_d · 0.2), RGB."""
    return diffuse[0] * AMBIENT * weight, diffuse[1] * AMBIENT * weight, diffuse[2] * AMBIENT * weight


@func
def shadow_ray(point, geometric, shading, light, epsilon, printed_offset):
    """The ray from a hit towards a light (Listing 4): ``(origin, direction, distance)``; its search ends there.

    It starts epsilon off the surface, on the side on which the light is; as printed (GSR-E11) along the shading normal,
    whatever side that is.
    """
    step = epsilon if dot(sub(light, point), geometric) > F0 else -epsilon
    origin = add_scaled(point, geometric, step)
    if printed_offset:
        origin = add_scaled(point, shading, epsilon)
    towards = sub(light, origin)
    distance = length(towards)
    return origin, divide(towards, distance), distance
