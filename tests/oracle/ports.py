"""Float32 ray–triangle intersection as various ports write it: material for the judge, each a correct implementation.

Every port maps rays (o, d: f32[n,1,3]) and triangles (f32[1,m,3,3]) to t, u, v f32[n,m] and the sign that faces the
ray; `trace` accepts and selects like a z-buffer in drawing order. Fused operations round once, through float64.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from refsim.scene.rays import Hits, Rays

F = np.float32
ONE = F(1)


def plain(a, b, c):
    return a * b + c


def fused(a, b, c):
    return (np.float64(a) * b + c).astype(F)


def dot(a, b, mad=plain, axes=(0, 1, 2)):
    total = a[..., axes[0]] * b[..., axes[0]]
    for k in axes[1:]:
        total = mad(a[..., k], b[..., k], total)
    return total


def cross(a, b, mad=plain):
    rows = [mad(a[..., i], b[..., j], -(a[..., j] * b[..., i])) for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(rows, axis=-1)


def edges(tri):
    return tri[..., 1, :] - tri[..., 0, :], tri[..., 2, :] - tri[..., 0, :]


def moeller_trumbore(tri, o, d, mad=plain, axes=(0, 1, 2), reciprocal=True):
    """As printed in 1997: p = d × e2 first."""
    e1, e2 = edges(tri)
    p = cross(d, e2, mad)
    det = dot(e1, p, mad, axes)
    s = o - tri[..., 0, :]
    q = cross(s, e1, mad)
    over = (lambda x: x * (ONE / det)) if reciprocal else (lambda x: x / det)
    return over(dot(e2, q, mad, axes)), over(dot(s, p, mad, axes)), over(dot(d, q, mad, axes)), -det


def moeller_normal_first(tri, o, d, mad=plain, axes=(0, 1, 2)):
    """N = e1 × e2 and r = s × d first, as shader listings have it."""
    e1, e2 = edges(tri)
    n, s = cross(e1, e2, mad), o - tri[..., 0, :]
    det, r = -dot(n, d, mad, axes), cross(s, d, mad)
    return dot(n, s, mad, axes) / det, dot(e2, r, mad, axes) / det, -dot(e1, r, mad, axes) / det, -det


def plane_data(tri):
    """n, m1, m2 in float64 from float32 vertices, rounded once; zero where they are not finite."""
    e1, e2 = edges(tri.astype(np.float64))
    n = np.cross(e1, e2)
    square = (n * n).sum(axis=-1, keepdims=True)
    rows = [n / np.sqrt(square), np.cross(e2, n) / square, np.cross(n, e1) / square]
    bad = ~np.all([np.isfinite(x.astype(F)).all(axis=-1) for x in rows], axis=0)
    return [np.where(bad[..., None], 0.0, x) for x in rows]


def plane(tri, o, d, mad=plain):
    """This project's test: relative to v0, operation by operation."""
    n, m1, m2 = (x.astype(F) for x in plane_data(tri))
    s = o - tri[..., 0, :]
    den = dot(n, d, mad)
    t = -dot(n, s, mad) / den
    h = mad(t[..., None], d, s)
    return t, dot(h, m1, mad), dot(h, m2, mad), den


def plane_offset(tri, o, d, mad=plain):
    """The plane's offset in absolute coordinates; the point minus v0."""
    n64, m1, m2 = plane_data(tri)
    n, c = n64.astype(F), (n64 * tri[..., 0, :].astype(np.float64)).sum(axis=-1).astype(F)
    den = dot(n, d, mad)
    t = (c - dot(n, o, mad)) * (ONE / den)
    h = mad(t[..., None], d, o) - tri[..., 0, :]
    return t, dot(h, m1.astype(F), mad), dot(h, m2.astype(F), mad), den


def plane_absolute(tri, o, d, mad=plain):
    """All three functionals with offsets, evaluated at the absolute point."""
    rows = plane_data(tri)
    c = [(x * tri[..., 0, :].astype(np.float64)).sum(axis=-1).astype(F) for x in rows]
    n, m1, m2 = (x.astype(F) for x in rows)
    den = dot(n, d, mad)
    t = (c[0] - dot(n, o, mad)) / den
    p = mad(t[..., None], d, o)
    return t, dot(p, m1, mad) - c[1], dot(p, m2, mad) - c[2], den


def woop(tri, o, d, mad=plain, scaled=False):
    """Woop's affine map onto the unit triangle: rows m1, m2 and n (or n/|N|), each with its offset."""
    n, m1, m2 = plane_data(tri)
    if scaled:
        e1, e2 = edges(tri.astype(np.float64))
        length = np.sqrt((np.cross(e1, e2) ** 2).sum(axis=-1, keepdims=True))
        n = n / np.where(length > 1e-30, length, 1.0)
    c = [-(x * tri[..., 0, :].astype(np.float64)).sum(axis=-1).astype(F) for x in (n, m1, m2)]
    n, m1, m2 = (x.astype(F) for x in (n, m1, m2))
    den = dot(n, d, mad)
    t = -(dot(n, o, mad) + c[0]) / den
    u = mad(t, dot(m1, d, mad), dot(m1, o, mad) + c[1])
    v = mad(t, dot(m2, d, mad), dot(m2, o, mad) + c[2])
    return t, u, v, den


def _with(port, **options):
    return lambda tri, o, d: port(tri, o, d, **options)


PORTS: dict[str, Callable] = {
    "mt": moeller_trumbore,
    "mt_divide": _with(moeller_trumbore, reciprocal=False),
    "mt_backwards": _with(moeller_trumbore, axes=(2, 1, 0), reciprocal=False),
    "mt_fma": _with(moeller_trumbore, mad=fused),
    "mt_fma_mixed": _with(moeller_trumbore, mad=fused, axes=(1, 2, 0), reciprocal=False),
    "mt_normal": moeller_normal_first,
    "mt_normal_fma": _with(moeller_normal_first, mad=fused, axes=(2, 0, 1)),
    "plane": plane,
    "plane_fma": _with(plane, mad=fused),
    "plane_offset": plane_offset,
    "plane_offset_fma": _with(plane_offset, mad=fused),
    "plane_absolute": plane_absolute,
    "woop": woop,
    "woop_scaled": _with(woop, scaled=True),
    "woop_fma": _with(woop, mad=fused),
}


def everything(port, triangles, rays):
    """Return t, u, v, den f32[n,m] of all pairs."""
    with np.errstate(all="ignore"):
        values = PORTS[port](triangles[None], rays.origin[:, None], rays.direction[:, None])
        return [np.broadcast_to(x, (len(rays), len(triangles))) for x in values]


def zero_area(triangles):
    e1, e2 = edges(triangles.astype(np.float64))
    return (np.cross(e1, e2) == 0.0).all(axis=-1)


def trace(port: str, triangles: np.ndarray, rays: Rays, facing: str = "both", form: int = 0) -> Hits:
    """Closest hit by brute force; ties go to the lowest index, zero areas are skipped. form: of u + v ≤ 1."""
    t, u, v, den = everything(port, triangles, rays)
    with np.errstate(all="ignore"):
        third = (u + v <= ONE, ONE - u - v >= 0, ONE - u >= v)[form % 3]
        ok = (u >= 0) & (v >= 0) & third & (t > 0) & (t < rays.t_max[:, None]) & ~zero_area(triangles)
        ok &= (den < 0) if facing == "front" else True
    depth = np.where(ok, t, np.inf)
    k = depth.argmin(axis=1)
    r = np.arange(len(rays))
    hit = ok[r, k]
    pick = [np.where(hit, x[r, k], F(0)).astype(F) for x in (u, v)]
    return Hits(np.where(hit, k, -1).astype(np.int32), np.where(hit, t[r, k], np.inf).astype(F), *pick)
