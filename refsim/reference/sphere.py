"""Enclosing spheres of triangles in NumPy (The Hierarchical Ray Engine, section 4), exact and in float32."""

import numpy as np

from refsim.reference.vector import cross, dot, length


def smallest_sphere(triangle: np.ndarray) -> tuple[np.ndarray, float]:
    """``(centre [3], radius)`` of one triangle ``[3, 3]``, in float64, unrounded.

    Tries the three spheres on an edge as diameter and takes the smallest that holds the third vertex; if none does,
    the circumscribed one.
    """
    a, b, c = np.asarray(triangle, dtype=np.float64)
    best: tuple[np.ndarray, float] | None = None
    for p, q, other in ((a, b, c), (b, c, a), (c, a, b)):
        centre, radius = p + 0.5 * (q - p), 0.5 * float(np.linalg.norm(q - p))
        if np.linalg.norm(other - centre) <= radius and (best is None or radius < best[1]):
            best = centre, radius
    if best is not None:
        return best
    # Equidistant point in the plane: solve [e1; e2; e1 x e2] x = [e1.e1/2, e2.e2/2, 0].
    e1, e2 = b - a, c - a
    x = np.linalg.solve(np.stack([e1, e2, np.cross(e1, e2)]), np.array([e1 @ e1 / 2, e2 @ e2 / 2, 0.0]))
    return a + x, float(np.linalg.norm(x))


def acceptance_margin(triangles: np.ndarray) -> np.ndarray:
    """How far outside a triangle ``[n, 3, 3]`` the float32 weights still accept a point, float64 ``[n]``.

    The weights u = h . m1, v = h . m2 are each off by at most 4 eps |h| |m|, where |h| <= 2 longest edges,
    |m1| = |e2| / 2A and |m2| = |e1| / 2A; the third adds up both and a rounding: beta = 2 (beta_1 + beta_2) + eps. The
    point is then within beta longest edges, or anywhere if beta reaches one half.
    """
    eps = 2.0**-24
    a, b, c = np.moveaxis(np.asarray(triangles, dtype=np.float64), 1, 0)
    e1, e2 = b - a, c - a
    l1, l2, l3 = length(e1), length(e2), length(e2 - e1)
    longest = np.maximum(np.maximum(l1, l2), l3)
    area2 = length(cross(e1, e2))
    with np.errstate(all="ignore"):
        beta = 2.0 * 4.0 * eps * 2.0 * longest * (l1 + l2) / area2 + eps
        margin = np.where(beta < 0.5, beta * longest, np.inf)
    return np.where(area2 == 0, 0.0, margin)


def enclosing_spheres(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``(centre float32 [n, 3], radius float32 [n])`` as the vertex buffer holds them (section 4).

    The smallest sphere's centre rounded to float32; then the radius about that centre, with the margin above and
    2^-48 for the rounding of the distance, rounded up.
    """
    p = np.asarray(triangles, dtype=np.float32).astype(np.float64)
    a, b, c = p[:, 0], p[:, 1], p[:, 2]
    # Squared lengths of the edges opposite vertices 0, 1, 2
    square = np.stack([dot(c - b, c - b), dot(a - c, a - c), dot(b - a, b - a)], axis=1)
    total = (square[:, 0] + square[:, 1]) + square[:, 2]
    longest = np.argmax(square, axis=1)
    on_edge = np.stack([0.5 * b + 0.5 * c, 0.5 * c + 0.5 * a, 0.5 * a + 0.5 * b], axis=1)
    middle = on_edge[np.arange(len(p)), longest]
    with np.errstate(all="ignore"):
        weight = square * (total[:, None] - 2.0 * square)
        weight = weight / ((weight[:, 0] + weight[:, 1]) + weight[:, 2])[:, None]
        circumcentre = (weight[:, :1] * a + weight[:, 1:2] * b) + weight[:, 2:] * c
    obtuse = 2.0 * square.max(axis=1) >= total
    centre = np.where(obtuse[:, None], middle, circumcentre).astype(np.float32)
    distance = length(p - centre.astype(np.float64)[:, None, :]).max(axis=1)
    exact = (distance + acceptance_margin(p)) * (1.0 + 2.0**-48)
    with np.errstate(over="ignore"):
        radius = exact.astype(np.float32)
        return centre, np.where(radius < exact, np.nextafter(radius, np.float32(np.inf)), radius)
