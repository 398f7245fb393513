"""The ray that leaves a hit, in NumPy: Snell's law and the law of reflection in vector form (The Hierarchical Ray
Engine, section 5).

Keeps the dtype of its inputs: float32 gives the bits of the device function.
"""

import numpy as np

from refsim.reference.vector import dot, normalise


def orient(d: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``(m, c, entering)``: the normal turned against d, the cosine of incidence (>= 0), and whether d goes against
    n."""
    dn = dot(d, n)
    entering = dn < 0
    sign = np.where(entering, 1, -1).astype(d.dtype)
    return n * sign[..., None], -dn * sign, entering


def reflect(d: np.ndarray, m: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Mirror reflection: r = d + 2 c m, m against d."""
    return d + m * (d.dtype.type(2) * c)[..., None]


def refract(d: np.ndarray, m: np.ndarray, c: np.ndarray, eta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Snell's law: r = eta d + (eta c - sqrt k) m; ``(r, k)``, k < 0 is total internal reflection (then r means
    nothing)."""
    one = d.dtype.type(1)
    k = one - eta * eta * (one - c * c)
    root = np.sqrt(np.where(k > 0, k, d.dtype.type(0)))
    return d * eta[..., None] + m * (eta * c - root)[..., None], k


def next_ray(
    o: np.ndarray, d: np.ndarray, t: np.ndarray, n_g: np.ndarray, n_s: np.ndarray, ior: np.ndarray, epsilon: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """``(origin [..., 3], direction [..., 3], kind int32 [...], alive bool [...])`` of the ray that follows a hit at t.

    ior > 0 glass, 0 mirror, < 0 diffuse (no ray: zero direction, kind 0). kind 2 reflected, 3 refracted. The origin
    is offset by epsilon along the geometric normal n_g to the side of the new direction; the direction follows the
    shading normal n_s.
    """
    real = d.dtype.type
    ior = np.asarray(ior, dtype=d.dtype)
    with np.errstate(all="ignore"):
        m, c, entering = orient(d, n_s)
        index = np.where(ior > 0, ior, real(1))
        bent, k = refract(d, m, c, np.where(entering, real(1) / index, index))
        mirrored = np.logical_or(ior == 0, k < 0)
        direction = normalise(np.where(mirrored[..., None], reflect(d, m, c), bent))
        step = np.where(dot(direction, n_g) > 0, epsilon, -epsilon).astype(d.dtype)
        origin = (o + d * t[..., None]) + n_g * step[..., None]
    alive = ior >= 0
    kind = np.where(alive, np.where(mirrored, 2, 3), 0).astype(np.int32)
    return origin, np.where(alive[..., None], direction, real(0)), kind, np.broadcast_to(alive, kind.shape)
