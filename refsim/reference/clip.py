"""Clipping a triangle in homogeneous space, in NumPy and float64: what is left of it, and where that lies in it.

In: clip positions ``[3, 4]``. Out: the convex polygon that is left, each corner with its weights of the three vertices.
Planes: w >= 0, near z >= 0, far z <= w, and the guard band that keeps screen coordinates small enough for whole
numbers. The sides of the view are left to the rasteriser, which visits no pixel outside the viewport.
Source: Blinn and Newell, Clipping using homogeneous coordinates (1978); Sutherland and Hodgman (1974).
"""

from __future__ import annotations

import numpy as np

from refsim.reference.raster import Viewport

GUARD_BAND = 32767.0  # pixels either side of the framebuffer's origin


def planes(viewport: Viewport) -> np.ndarray:
    """Planes ``[7, 4]``; a position p is inside where plane · p >= 0: w, near, far, left, right, top, bottom."""
    x, y, width, height = (float(part) for part in viewport[:4])
    half_width, half_height = width / 2, height / 2
    left, right = ((side * GUARD_BAND - (x + half_width)) / half_width for side in (-1, 1))
    top, bottom = ((side * GUARD_BAND - (y + half_height)) / -half_height for side in (-1, 1))
    return np.array(
        [
            [0, 0, 0, 1],
            [0, 0, 1, 0],
            [0, 0, -1, 1],
            [1, 0, 0, -left],
            [-1, 0, 0, right],
            [0, -1, 0, top],
            [0, 1, 0, -bottom],
        ],
        np.float64,
    )


def cut(weights: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """A convex polygon of rows ``[m, k]`` cut by a plane; `distance` ``[m]`` of its corners, inside >= 0.

    A new corner is a weighted sum that is the same from either end, so that neighbours that share an edge agree on it.
    """
    left = []
    for k in range(len(weights)):
        here, after = k, (k + 1) % len(weights)
        if distance[here] >= 0:
            left.append(weights[here])
        if (distance[here] >= 0) != (distance[after] >= 0):
            gap = distance[after] - distance[here]
            left.append(distance[after] / gap * weights[here] - distance[here] / gap * weights[after])
    return np.array(left).reshape(-1, weights.shape[1])


def clip(position: np.ndarray, viewport: Viewport) -> np.ndarray:
    """What the planes leave of a triangle ``[3, 4]``: weights float64 ``[m, 3]`` of the polygon's corners, m from 0 to
    10.

    A corner's clip position is ``weights @ position``. A triangle with a position that is not finite is gone whole. So
    is one of which a corner with w = 0 is left: it passes through the eye, which sees it from its edge.
    """
    vertices = position.astype(np.float64)
    weights = np.eye(3)
    if not np.isfinite(vertices).all():
        return weights[:0]
    for plane in planes(viewport):
        weights = cut(weights, weights @ (vertices @ plane))
    return weights if (weights @ vertices[:, 3] > 0).all() else weights[:0]


def is_outside(position: np.ndarray) -> bool:
    """Whether a triangle ``[3, 4]`` is not finite or lies whole beyond one side of the clip volume −w <= x, y <= w,
    0 <= z <= w, w > 0: counted as clipped, though it may lie within the guard band."""
    x, y, z, w = position.astype(np.float64).T
    sides = (x + w, w - x, y + w, w - y, z, w - z)
    return not np.isfinite(position).all() or any((side < 0).all() for side in sides) or bool((w <= 0).all())


def needs_clipping(position: np.ndarray, viewport: Viewport) -> bool:
    """Whether a vertex of a triangle ``[3, 4]`` is not finite, has no positive w or lies outside one of the planes."""
    vertices = position.astype(np.float64)
    inside = np.isfinite(vertices).all() and (vertices[:, 3] > 0).all()
    return not (inside and (vertices @ planes(viewport).T >= 0).all())


def convex_ring(corners: np.ndarray) -> list[int]:
    """Which corners int64 ``[m, 2]`` of a polygon are left so that it is convex: those that turn the other way than the
    polygon's area says, or not at all, go one after the other, the first such one first. None are left of no area."""

    def turn(a: int, b: int, c: int) -> int:
        (ax, ay), (bx, by), (cx, cy) = (corners[k].tolist() for k in (a, b, c))
        return (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)

    area = sum(turn(0, k - 1, k) for k in range(2, len(corners)))
    ring = list(range(len(corners)))
    while len(ring) > 2:
        bad = [k for k, b in enumerate(ring) if turn(ring[k - 1], b, ring[(k + 1) % len(ring)]) * (area or -1) <= 0]
        if not bad:
            break
        del ring[bad[0]]
    return ring if area else []
