"""Where triangles that share edges close the surface around a ray, so that a watertight port may not miss.

A ray within its bound of an edge may be missed by either triangle alone. A port that claims watertightness decides an
edge once for both sides, so it cannot lose the ray when every doubtful edge has, seen along the ray, a neighbour on its
other side; around a vertex, when the fan closes. Silhouettes and open borders stay open.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from refsim.oracle.bounds import EDGE_U, EDGE_V, EDGE_W, FIRM

# An edge, as the bit that doubts it: its two corners, and the corner opposite.
_EDGES = ((EDGE_U, 0, 2, 1), (EDGE_V, 0, 1, 2), (EDGE_W, 1, 2, 0))


def _side(way: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> float:
    """Return on which side of the plane through edge ab along the ray the point c is."""
    return float(np.sign(np.dot(np.cross(b - a, way), c - a)))


def sealed_depth(
    direction: NDArray[np.float32], triangles: NDArray[np.float32], highs: Sequence[float], bits: Sequence[int]
) -> float:
    """Return the largest t at which the nearest closed patch of these candidates can be hit, inf when none is closed.

    direction: f32[3]; triangles: f32[k,3,3], of one ray; highs: upper ends of their t; bits: see `bounds.py`.
    """
    way = direction.astype(np.float64)
    corners = triangles.astype(np.float64)
    # Every edge by its end points, with the triangle and the side that it covers.
    sides: dict[frozenset[tuple[float, ...]], list[tuple[int, float]]] = {}
    for k in range(len(corners)):
        if bits[k] & FIRM:
            for _, a, b, c in _EDGES:
                key = frozenset((tuple(corners[k, a] + 0.0), tuple(corners[k, b] + 0.0)))
                # The edge's sense must not depend on which triangle names it.
                first, last = (a, b) if tuple(corners[k, a]) < tuple(corners[k, b]) else (b, a)
                sides.setdefault(key, []).append((k, _side(way, corners[k, first], corners[k, last], corners[k, c])))
    nearest = float("inf")
    for start in range(len(corners)):
        if bits[start] & FIRM:
            nearest = min(nearest, _closed(start, corners, highs, bits, sides))
    return nearest


def _closed(
    start: int, corners: NDArray[np.float64], highs: Sequence[float], bits: Sequence[int],
    sides: dict[frozenset[tuple[float, ...]], list[tuple[int, float]]],
) -> float:
    """Walk from triangle to triangle across doubtful edges; inf at an edge with nothing on its other side."""
    seen, queue = {start}, [start]
    while queue:
        k = queue.pop()
        for bit, a, b, _ in _EDGES:
            if not bits[k] & bit:
                continue
            shared = sides[frozenset((tuple(corners[k, a] + 0.0), tuple(corners[k, b] + 0.0)))]
            own = next(side for other, side in shared if other == k)
            across = [other for other, side in shared if side * own < 0.0]
            if not across:
                return float("inf")
            for other in across:
                if other not in seen:
                    seen.add(other)
                    queue.append(other)
    return max(highs[k] for k in seen)
