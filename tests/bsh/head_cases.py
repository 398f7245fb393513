"""Rays that leave polygons, and images of rays, for tests of heads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim import Rays, Scene
from refsim.geometry.triangle import pack_triangles

Int = NDArray[np.int32]


def leaving_rays(scene: Scene, count: int, seed: int, side: float = 1.0) -> tuple[Rays, Int]:
    """Rays that start scene.epsilon off points of triangles on the normal's side (`side` −1: the other), and which.

    By turns: straight at a point of another triangle; anywhere in the half-space; almost along the polygon; in a
    direction on the border of sextants and octants. Origins in float32, as a tracer makes them.
    """
    rng = np.random.default_rng(seed)
    normals = pack_triangles(scene.triangles).n
    usable = np.flatnonzero(normals.any(axis=1))
    rows = rng.choice(usable, count) if len(usable) else np.zeros(0, np.int64)
    n = normals[rows].astype(np.float64) * side
    weights = rng.dirichlet((0.5, 0.5, 0.5), len(rows))
    weights[::5] = np.eye(3)[rng.integers(3, size=len(weights[::5]))]
    point = (scene.triangles[rows].astype(np.float64) * weights[:, :, None]).sum(axis=1)
    origin = (point.astype(np.float32) + scene.epsilon * n.astype(np.float32)).astype(np.float32)
    others = scene.triangles[rng.integers(len(scene), size=len(rows))].astype(np.float64)
    target = (others * rng.dirichlet((1.0, 1.0, 1.0), len(rows))[:, :, None]).sum(axis=1)
    direction = rng.normal(size=(len(rows), 3))
    kind = np.arange(len(rows)) % 4
    direction[kind < 2] = (target - origin)[kind < 2]
    border = np.sign(direction) * rng.integers(0, 2, direction.shape)
    direction[kind == 3] = border[kind == 3]
    short = ~(np.linalg.norm(direction, axis=1) > 0.0)
    direction[short] = n[short]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    along = (direction * n).sum(axis=1, keepdims=True)
    wanted = np.where(kind == 2, 1e-4, np.abs(along[:, 0]))[:, None]
    direction = np.where((along < 0.0) & (kind != 3)[:, None], direction + (wanted - along) * n, direction)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Rays(origin, direction.astype(np.float32)), rows.astype(np.int32)


def image_of(scene: Scene, size: int, seed: int) -> Rays:
    """A picture of rays with origins and directions of their own, beams that no camera would make; some are dead."""
    rng = np.random.default_rng(seed)
    y, x = np.divmod(np.arange(size * size), size)
    spread = rng.choice((0.02, 0.5, 3.0))
    direction = np.stack([(x - size / 2) / size * spread, (y - size / 2) / size * spread, np.ones(size * size)], axis=1)
    direction += 0.05 * rng.normal(size=direction.shape)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    direction = direction @ turn
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    eye = scene.center - turn[2] * scene.diagonal * rng.uniform(0.0, 2.0)
    origin = eye + 0.02 * scene.diagonal * rng.normal(size=direction.shape)
    direction[rng.random(size * size) < 0.05] = 0.0
    return Rays(origin.astype(np.float32), direction.astype(np.float32), width=size, height=size)
