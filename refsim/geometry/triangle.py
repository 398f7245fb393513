"""Ray-triangle test in plane form: what is computed once for a triangle, and the device function for a ray.

The vertex layout of The Hierarchical Ray Engine, section 4, carries the triangle's plane (normal and offset) and
"pre-processed triangle vertex position data for fast intersection computation". Here these are the unit normal n, the
offset n . v0 and two vectors m1, m2 in the plane whose scalar products with h = hit point - v0 are the barycentric
weights u and v.

An accepted hit lies within a few float32 roundings of |o - v0| from the triangle's plane, at grazing angles too,
which is what lets a bounding sphere cull safely (see ``sphere.py``). Not watertight: a ray through a shared edge may
hit both or neither.
"""

from typing import NamedTuple

import numpy as np

from refsim.errors import InputError
from refsim.geometry.vector import dot, sub
from refsim.jit import func

ZERO = np.float32(0)
ONE = np.float32(1)


class TriangleRecords(NamedTuple):
    """What a vertex carries for its triangle; rows in file order, float32, scene units.

    v0 [n,3] first vertex; n [n,3] unit normal (e1 x e2); offset [n] plane offset n . v0; m1, m2 [n,3] with u = h . m1,
    v = h . m2, in 1/length; degenerate [n] bool: the vectors are zero and nothing ever hits the triangle.
    """

    v0: np.ndarray
    n: np.ndarray
    offset: np.ndarray
    m1: np.ndarray
    m2: np.ndarray
    degenerate: np.ndarray


def pack_triangles(triangles: np.ndarray) -> TriangleRecords:
    """Plane and barycentric vectors of float32 triangles ``[n, 3, 3]``: in float64, rounded once to float32.

    A triangle is degenerate when the float64 cross product of its edges is exactly zero, or when n, m1 or m2 is not
    finite in float32; it is kept, with zero vectors. Raises InputError for another shape.
    """
    vertices = np.asarray(triangles, dtype=np.float32).astype(np.float64)
    if vertices.ndim != 3 or vertices.shape[1:] != (3, 3):
        raise InputError(f"triangles have shape {np.shape(triangles)}; [n, 3, 3], three vertices each, is needed")
    v0, v1, v2 = vertices[:, 0], vertices[:, 1], vertices[:, 2]
    with np.errstate(all="ignore"):
        e1, e2 = v1 - v0, v2 - v0
        normal = np.cross(e1, e2)
        square = np.sum(normal * normal, axis=1)[:, None]
        n = normal / np.sqrt(square)
        m1 = np.cross(e2, normal) / square
        m2 = np.cross(normal, e1) / square
        rounded = [x.astype(np.float32) for x in (n, m1, m2)]
    usable = np.any(normal != 0, axis=1)
    for x in rounded:
        usable &= np.all(np.isfinite(x), axis=1)
    n32, m1_32, m2_32 = (np.where(usable[:, None], x, ZERO) for x in rounded)
    with np.errstate(all="ignore"):
        offset = np.where(usable, np.sum(np.where(usable[:, None], n, 0.0) * v0, axis=1), 0.0).astype(np.float32)
    return TriangleRecords(v0.astype(np.float32), n32, offset, m1_32, m2_32, ~usable)


@func
def intersect(o, d, t_max, v0, n, m1, m2):
    """Ray against triangle: ``(hit, t, u, v, den)``; u is the weight of vertex 1, v that of vertex 2.

    o, d, v0, n, m1, m2 are tuples of three float32, t_max float32. den = n . d is negative on the front side (the
    side from which the vertices run counter-clockwise); a one-sided caller adds ``den < 0``. hit needs 0 < t < t_max.
    Branch-free; a degenerate triangle gives t = NaN, which compares false.
    """
    s = sub(v0, o)
    den = dot(n, d)
    t = dot(n, s) / den                                         # plane equation n . (o + t d - v0) = 0
    h = t * d[0] - s[0], t * d[1] - s[1], t * d[2] - s[2]       # hit point - v0
    u = dot(h, m1)
    v = dot(h, m2)
    hit = (u >= ZERO) & (v >= ZERO) & (u + v <= ONE) & (t > ZERO) & (t < t_max)
    return hit, t, u, v, den
