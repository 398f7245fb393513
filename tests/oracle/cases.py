"""Meshes and rays on which intersection codes are known to go wrong; everything from a seed."""

from __future__ import annotations

import numpy as np

from refsim.scene.rays import Rays

F = np.float32


def sphere(rows=12, columns=20):
    """A closed mesh of unit radius with common vertex positions, outward normals."""
    a, b = np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, columns + 1)
    p = np.stack([np.sin(a)[:, None] * np.cos(b), np.sin(a)[:, None] * np.sin(b), np.cos(a)[:, None] + 0 * b], axis=-1)
    p[:, -1], p[0], p[-1] = p[:, 0], p[0, 0], p[-1, 0]
    return _strips(p)


def _strips(p):
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    tri = np.concatenate([np.stack([a, b, c], axis=2).reshape(-1, 3, 3), np.stack([a, c, d], axis=2).reshape(-1, 3, 3)])
    area = np.linalg.norm(np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0]), axis=1)
    return tri[area > 1e-9].astype(F)


def soup(rng, n=60):
    return (
        rng.uniform(-1, 1, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * rng.choice([0.02, 0.3, 1.0], (n, 1, 1))
    ).astype(F)


def grid(rng, n=6):
    """A height field on integers: exact arithmetic, ties and edges everywhere."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    return _strips(np.stack([x, y, rng.integers(0, 3, x.shape).astype(float)], axis=-1))


def slivers(rng, n=50):
    """Nearly collinear corners, aspects up to 1e7."""
    a, e = rng.uniform(-1, 1, (n, 3)), rng.normal(size=(n, 3))
    tip = a + e * rng.uniform(0.1, 0.9, (n, 1)) + rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-7, -1, (n, 1))
    return np.stack([a, a + e, tip], axis=1).astype(F)


def degenerate(rng, n=40):
    """Duplicates, coplanar overlaps, points, lines, and triangles with zero area beside sound ones."""
    tri = soup(rng, n)
    tri[1::5] = tri[0::5]
    tri[2::5, 2] = tri[2::5, 1]
    tri[3::5] = tri[3::5, :1]
    tri[4::5, :, 2] = F(0.25)
    return tri


def plate(rng, n=30):
    """Many triangles in one plane, some turned around."""
    tri = rng.integers(-4, 5, (n, 3, 3)).astype(F)
    tri[:, :, 2] = 1
    return tri


MESHES = {
    "sphere": lambda rng: sphere(),
    "soup": soup,
    "grid": grid,
    "slivers": slivers,
    "degenerate": degenerate,
    "plate": plate,
}


def unit(d):
    d = np.asarray(d, np.float64)
    length = np.sqrt((d * d).sum(axis=-1, keepdims=True))
    return (d / np.where(length > 0, length, 1.0)).astype(F)


def points(rng, tri, n, kind):
    """Points on the triangles: inside, on edges, at corners; float64[n,3] and the triangle of each."""
    k = rng.integers(0, len(tri), n)
    w = rng.dirichlet([1, 1, 1], n)
    if kind == "edge":
        w[:, 0] = 0.0
    if kind == "corner":
        w[:] = [0.0, 0.0, 1.0]
    w /= w.sum(axis=1, keepdims=True)
    return (w[:, :, None] * tri[k].astype(np.float64)).sum(axis=1), k


def rays(rng, tri, n, kind):
    """Rays at a mesh. kind: inside, edge, corner, axis, glancing, surface, plane, free."""
    size = float(np.abs(tri - tri.mean(axis=(0, 1))).max()) + 1e-30
    target, k = points(rng, tri, n, kind)
    away = rng.normal(size=(n, 3))
    e1, e2 = (tri[k, i].astype(np.float64) - tri[k, 0] for i in (1, 2))
    if kind == "axis":
        away = np.zeros((n, 3))
        away[np.arange(n), rng.integers(0, 3, n)] = rng.choice([-1.0, 1.0], n)
        target = np.where(rng.random((n, 1)) < 0.5, tri[k, rng.integers(0, 3, n)].astype(np.float64), target)
    if kind in ("glancing", "plane"):
        steep = 0.0 if kind == "plane" else 10.0 ** rng.uniform(-8, -2, (n, 1))
        flat = e1 * rng.normal(size=(n, 1)) + e2 * rng.normal(size=(n, 1))
        normal = np.cross(e1, e2)
        scale = np.linalg.norm(normal, axis=1, keepdims=True)
        away = flat / (np.linalg.norm(flat, axis=1, keepdims=True) + 1e-300) + steep * normal / (scale + 1e-300)
    away /= np.linalg.norm(away, axis=1, keepdims=True) + 1e-300
    away[~np.any(away != 0, axis=1)] = [0, 0, 1]
    distance = size * (10.0 ** rng.uniform(-2, 1, (n, 1)) if kind != "surface" else 0.0)
    origin = (target + away * distance).astype(F)
    # From the rounded origin at the target again, but for rays that only start there.
    toward = target - origin.astype(np.float64)
    direction = unit(toward if kind in ("inside", "edge", "corner") else -away)
    direction[~np.any(direction != 0, axis=1)] = [0, 0, 1]
    if kind == "axis":
        direction = np.where((direction == 0) & (rng.random(direction.shape) < 0.5), F(-0.0), direction)
    if kind == "free":
        direction = unit(rng.normal(size=(n, 3)))
    return Rays(origin, direction, np.full(n, np.inf, F))


RAYS = ("inside", "edge", "corner", "axis", "glancing", "surface", "plane", "free")


def camera(tri, width=128, height=128, distance=2.0, spread=0.35):
    """A pinhole camera on a mesh; f32 rays, row-major."""
    low, high = tri.reshape(-1, 3).min(axis=0).astype(float), tri.reshape(-1, 3).max(axis=0).astype(float)
    middle, diagonal = (low + high) / 2, np.linalg.norm(high - low)
    eye = middle + distance * diagonal * np.array([0.36, 0.48, 0.8])
    front = (middle - eye) / np.linalg.norm(middle - eye)
    right = np.cross(front, [0, 1, 0]) / np.linalg.norm(np.cross(front, [0, 1, 0]))
    up = np.cross(right, front)
    y, x = np.mgrid[0:height, 0:width]
    k = spread / distance
    d = front + k * ((x[..., None] + 0.5) / width * 2 - 1) * right + k * (1 - (y[..., None] + 0.5) / height * 2) * up
    d = unit(d.reshape(-1, 3))
    return Rays(np.broadcast_to(eye, d.shape).astype(F).copy(), d, np.full(len(d), np.inf, F))
