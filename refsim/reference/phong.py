"""Phong's light on a surface and the shadow ray towards it, in NumPy (Recursive Ray Tracing in Geometry Shader, section
4.2 and Listings 4 and 5; Whitted 1980).

One function an equation, rows of any number. Keeps the dtype of its inputs: float32 gives the bits of the shaders,
float64 a bound. Sums are taken from left to right.
"""

import numpy as np

from refsim.reference.vector import dot, length, normalise

AMBIENT = 0.2


def interpolated_normal(corners: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Unit normal of a smooth triangle: those at its vertices ``[n, 3, 3]`` weighed with 1 − u − v, u, v."""
    one = u.dtype.type(1)
    a, b, c = (corners[..., k, :] * weight[..., None] for k, weight in enumerate((one - u - v, u, v)))
    return normalise((a + b) + c)


def facing(n: np.ndarray, d: np.ndarray) -> np.ndarray:
    """`n` turned against direction d."""
    return np.where((dot(n, d) < 0)[..., None], n, -n)


def power(x: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """x to whole exponents from 0 on, by repeated squaring: bit k of the exponent multiplies in x^(2^k)."""
    result, base, left = np.ones_like(x), x, np.asarray(exponent)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        while (left > 0).any():
            result = np.where(left & 1 == 1, result * base, result)
            base, left = base * base, left >> 1
    return result


def phong(
    point: np.ndarray,
    d: np.ndarray,
    normal: np.ndarray,
    diffuse: np.ndarray,
    specular: np.ndarray,
    exponent: np.ndarray,
    light: np.ndarray,
    radiance: np.ndarray,
    weight: np.ndarray,
) -> np.ndarray:
    """RGB ``[n, 3]`` that a surface sends back along its ray from one point light: (k_d N·L + k_s (R·V)^e) · radiance ·
    weight.

    `normal` is turned against the ray d; light does not fall off with distance. At the light itself N·L is 0.
    """
    real = d.dtype.type
    with np.errstate(all="ignore"):
        towards = light - point
        to_light = towards / length(towards)[..., None]
        cosine = dot(normal, to_light)
        n_dot_l = np.where(cosine > 0, cosine, real(0))
        mirrored = normal * (real(2) * n_dot_l)[..., None] - to_light
        r_dot_v = -dot(mirrored, d)
        shines = (n_dot_l > 0) & (r_dot_v > 0) & (specular > 0)
        highlight = np.where(shines, specular * power(r_dot_v, exponent), real(0))
        return (diffuse * n_dot_l[..., None] + highlight[..., None]) * radiance * weight[..., None]


def ambient(diffuse: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """RGB ``[n, 3]`` that no shadow takes away: k_d · 0.2 · weight."""
    return diffuse * diffuse.dtype.type(AMBIENT) * weight[..., None]


def shadow_ray(
    point: np.ndarray, geometric: np.ndarray, light: np.ndarray, epsilon: np.floating
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``(origin [n, 3], direction [n, 3], distance [n])`` of the rays from hits towards a light, epsilon off the
    surface on the side on which the light is. The search ends at the distance."""
    with np.errstate(all="ignore"):
        step = np.where(dot(light - point, geometric) > 0, epsilon, -epsilon).astype(point.dtype)
        origin = point + geometric * step[..., None]
        towards = light - origin
        distance = length(towards)
        return origin, towards / distance[..., None], distance
