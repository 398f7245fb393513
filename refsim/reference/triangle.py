"""Ray-triangle test in plane form, in NumPy: The Hierarchical Ray Engine, section 4 (vertex layout), see ``pack``.

All functions broadcast over leading axes and keep the dtype: float32 gives the bits of the device function, float64
a bound.
"""

import numpy as np

from refsim.reference.vector import dot


def pack(triangles: np.ndarray, dtype: type = np.float32) -> tuple[np.ndarray, ...]:
    """``(v0, n, offset, m1, m2, degenerate)`` of triangles ``[n, 3, 3]``, computed in float64 and rounded to dtype.

    n = N/|N| with N = e1 x e2; m1 = (e2 x N)/|N|^2; m2 = (N x e1)/|N|^2; offset = n . v0. Degenerate (N exactly zero,
    or a value that is not finite in float32): all zero.
    """
    p = np.asarray(triangles).astype(np.float64)
    v0 = p[:, 0]
    e1 = p[:, 1] - v0
    e2 = p[:, 2] - v0
    big_n = np.cross(e1, e2)
    area2 = np.sum(big_n * big_n, axis=1, keepdims=True)
    with np.errstate(all="ignore"):
        planes = [big_n / np.sqrt(area2), np.cross(e2, big_n) / area2, np.cross(big_n, e1) / area2]
        fine = [np.isfinite(x.astype(np.float32)).all(axis=1) for x in planes]
    degenerate = (big_n == 0).all(axis=1) | ~np.logical_and.reduce(fine)
    n, m1, m2 = (np.where(degenerate[:, None], 0.0, x) for x in planes)
    offset = np.sum(n * v0, axis=1)
    return (*(x.astype(dtype) for x in (v0, n, offset, m1, m2)), degenerate)


def intersect(
    o: np.ndarray, d: np.ndarray, t_max: np.ndarray, v0: np.ndarray, n: np.ndarray, m1: np.ndarray, m2: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rays against triangles, broadcast over ``[..., 3]``: ``(hit, t, u, v, den)``, each ``[...]``.

    u weighs vertex 1, v vertex 2; den < 0 is a hit on the front side; a hit has 0 < t < t_max.
    """
    with np.errstate(all="ignore"):
        s = v0 - o
        den = dot(n, d)
        t = dot(n, s) / den                  # plane equation n . (o + t d - v0) = 0
        h = t[..., None] * d - s             # hit point - v0
        u = dot(h, m1)
        v = dot(h, m2)
        inside = np.logical_and(np.logical_and(u >= 0, v >= 0), u + v <= 1)
        hit = np.logical_and(inside, np.logical_and(t > 0, t < t_max))
    return hit, t, u, v, den
