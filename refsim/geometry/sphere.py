"""Enclosing spheres of triangles, computed once on the CPU as in The Hierarchical Ray Engine, section 4.

"Enclosing spheres for all ray casting primitives can easily be computed, and described by a 3D position and a
radius." The smallest one: on the longest edge as diameter for an obtuse or right triangle, else the circumscribed
sphere. The centre is rounded to float32 first and the radius then measured from the rounded centre and rounded up, so
that the float32 sphere holds the float32 vertices.

The sphere also holds every point that ``triangle.intersect`` can accept. The test computes a hit point h (relative
to v0) and its weights u = h . m1, v = h . m2 in float32; each is off by at most 4 eps |h| |m| (eps = 2^-24: three for
the sum of products, one for the rounding of m), so a thin triangle's accepted region reaches past its sharp corners
by ``acceptance_margin``. How far the computed h lies from the ray is another matter, relative to the distance, and
the cone's sphere test carries it (see ``cone.py``).
"""

import numpy as np

from refsim.errors import InputError

EPS = 2.0**-24          # half a unit in the last place of 1, float32


def acceptance_margin(triangles: np.ndarray) -> np.ndarray:
    """How far outside the triangle a point can lie that the float32 weights still accept: float64 ``[n]``, scene units.

    With beta = 2 (beta_1 + beta_2) + eps bounding how negative the three weights can be in sum, the point is within
    beta times the longest edge of the triangle. A sliver whose sharp angle is some 1e-6 or less has no bound
    (``inf``); a zero-area one is never hit (0).
    """
    p = np.asarray(triangles, dtype=np.float32).astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    l1, l2 = np.linalg.norm(e1, axis=1), np.linalg.norm(e2, axis=1)
    longest = np.maximum(np.maximum(l1, l2), np.linalg.norm(e2 - e1, axis=1))
    area2 = np.linalg.norm(np.cross(e1, e2), axis=1)
    with np.errstate(all="ignore"):
        # |h| <= 2 * longest holds for every accepted point as long as beta, computed with it, is below one half.
        beta = 2.0 * 4.0 * EPS * 2.0 * longest * (l1 + l2) / area2 + EPS
        margin = np.where(beta < 0.5, beta * longest, np.inf)
    return np.where(area2 == 0, 0.0, margin)


def enclosing_spheres(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``(centre float32 [n, 3], radius float32 [n])`` of triangles ``[n, 3, 3]`` (taken as float32), scene units.

    Encloses the three vertices and the accepted region (``acceptance_margin``); for a triangle of ordinary shape the
    radius is the smallest possible one to 1e-4. A triangle shrunk to a segment or a point gets the sphere of that; an
    extreme sliver (angle below some 1e-6 yet not degenerate) gets radius ``inf``: it is never culled. Raises
    InputError for another shape.
    """
    p = np.asarray(triangles, dtype=np.float32).astype(np.float64)
    if p.ndim != 3 or p.shape[1:] != (3, 3):
        raise InputError(f"triangles have shape {np.shape(triangles)}; [n, 3, 3], three vertices each, is needed")
    rows = np.arange(len(p))

    # Squared edge lengths; edge k lies opposite vertex k.
    edge = np.stack([p[:, 2] - p[:, 1], p[:, 0] - p[:, 2], p[:, 1] - p[:, 0]], axis=1)
    square = np.sum(edge * edge, axis=2)
    k = np.argmax(square, axis=1)
    wide = 2.0 * square[rows, k] >= np.sum(square, axis=1)

    # Obtuse, right or degenerate: the longest edge is a diameter. Acute: the circumcentre by its barycentric weights.
    middle = 0.5 * p[rows, (k + 1) % 3] + 0.5 * p[rows, (k + 2) % 3]
    with np.errstate(all="ignore"):
        weight = square * (np.sum(square, axis=1)[:, None] - 2.0 * square)
        weight = weight / np.sum(weight, axis=1)[:, None]
        circumcentre = np.sum(weight[:, :, None] * p, axis=1)
    centre = np.where(wide[:, None], middle, circumcentre).astype(np.float32)

    # The radius from the rounded centre; 2^-48 covers the rounding of the float64 distance itself.
    distance = np.linalg.norm(p - centre.astype(np.float64)[:, None, :], axis=2).max(axis=1)
    exact = (distance + acceptance_margin(triangles)) * (1.0 + 2.0**-48)
    with np.errstate(over="ignore"):
        radius = exact.astype(np.float32)
        up = np.nextafter(radius, np.float32(np.inf))
    return centre, np.where(radius.astype(np.float64) < exact, up, radius)
