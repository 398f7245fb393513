"""How the reference finds what rays hit: all triangles, one after the other.

A search finds the nearest hit, of two at the same t that on the triangle listed first; or any hit, which ends it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from refsim.reference.surfaces import Surfaces, shoot


class Found(NamedTuple):
    """What n rays hit: triangle int32[n] (−1 none), t (inf), u, v f32[n]; and what it took, int32[n]: cells visited,
    triangle tests, 1 where the scene's box alone answered."""

    triangle: np.ndarray
    t: np.ndarray
    u: np.ndarray
    v: np.ndarray
    cells: np.ndarray
    tests: np.ndarray
    rejected: np.ndarray

    @classmethod
    def nothing(cls, n: int) -> Found:
        """No hits, and nothing done."""
        number = [np.zeros(n, np.int32) for _ in range(4)]
        t, u, v = np.full(n, np.inf, np.float32), np.zeros(n, np.float32), np.zeros(n, np.float32)
        return cls(number[0] - np.int32(1), t, u, v, *number[1:])

    def where(self, rows: np.ndarray) -> Found:
        """Some of the rays."""
        return Found(*(column[rows] for column in self))


class Box(NamedTuple):
    """A box around all that hits can lie in: lower, upper f32[3]; rays that start further than `far` from `lower` along
    an axis are not turned away by it."""

    lower: np.ndarray
    upper: np.ndarray
    far: np.float32


def misses_box(box: Box, o: np.ndarray, d: np.ndarray, t_max: np.ndarray) -> np.ndarray:
    """Slab test of rays f32[n, 3]: bool[n], the ray does not meet the box before t_max."""
    most = np.abs(d).max(axis=1)
    s = box.lower - o
    covered = (np.abs(s) <= box.far).all(axis=1) & (most >= 2.0**-20) & (most <= 2.0**20)
    e = np.copysign(np.maximum(np.abs(d), (np.float32(2.0**-26) * most)[:, None]), d).astype(np.float32)
    inverse = np.float32(1) / e
    a, b = s * inverse, (box.upper - o) * inverse
    enter = np.maximum(np.minimum(a, b).max(axis=1), np.float32(0))
    leave = np.maximum(a, b).min(axis=1)
    return covered & ~(enter <= np.minimum(t_max, leave))


class Search(Protocol):
    """Whatever finds hits."""

    def find(self, origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, any_hit: bool) -> Found:
        """What the rays hit: origin, direction f32[n, 3], t_max f32[n]."""


@dataclass(frozen=True)
class AllTriangles:
    """Every triangle in file order, for rays that do not miss the box (None: there is none)."""

    surfaces: Surfaces
    box: Box | None

    def find(self, origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, any_hit: bool) -> Found:
        """The nearest hit; with `any_hit` a ray's search ends at its first."""
        found = Found.nothing(len(t_max))
        with np.errstate(all="ignore"):
            finite = np.isfinite(origin).all(axis=1) & np.isfinite(direction).all(axis=1)
            turned_away = ~(finite & direction.any(axis=1))
            if self.box is not None:
                turned_away |= misses_box(self.box, origin, direction, t_max)
        found.rejected[turned_away] = 1
        for k in range(len(self.surfaces.n)):
            rows = np.flatnonzero(~turned_away & ((found.triangle < 0) | (not any_hit)))
            if not len(rows):
                break
            limit = np.minimum(t_max[rows], found.t[rows])
            hit, t, u, v = shoot(self.surfaces, k, origin[rows], direction[rows], limit)
            found.triangle[rows[hit]] = k
            for column, new in ((found.t, t), (found.u, u), (found.v, v)):
                column[rows[hit]] = new[hit]
            found.tests[rows] += 1
        return found
