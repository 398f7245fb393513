"""The pseudo-code of Efficient Stackless Ray Traversal, section 2.1, in NumPy: all rays take their next step together.

Every ray has its own place in its own list; a step tests the spheres and triangles that the rays stand at, in float32,
with the operations of `refsim.papers.sphere_hierarchy.traversal`, where κ is derived: same bits, same counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refsim.reference.traversal_lists import Lists, list_of_rays
from refsim.reference.triangle import intersect
from refsim.reference.vector import dot

KAPPA = np.float32(40 * 2.0**-24)
SMALLEST, LARGEST = np.float32(2.0**-60), np.float32(2.0**60)
ZERO, INFINITY = np.float32(0), np.float32(np.inf)


@dataclass(frozen=True)
class Walked:
    """Nearest hits so far (triangle i32[n], −1 none; t, u, v f32[n]) and elements visited, triangles among them."""

    triangle: np.ndarray
    t: np.ndarray
    u: np.ndarray
    v: np.ndarray
    nodes: np.ndarray
    tests: np.ndarray

    @classmethod
    def nothing(cls, n: int) -> Walked:
        """Before the first list."""
        number = [np.zeros(n, np.int32) for _ in range(3)]
        u, v = np.zeros(n, np.float32), np.zeros(n, np.float32)
        return cls(number[0] - np.int32(1), np.full(n, np.inf, np.float32), u, v, number[1], number[2])


@dataclass(frozen=True)
class Segments:
    """Rays as the walk reads them: o, d, w = d / (d · d) f32[n, 3], κ f32[n], t_max f32[n]."""

    o: np.ndarray
    d: np.ndarray
    w: np.ndarray
    slack: np.ndarray
    t_max: np.ndarray

    @classmethod
    def of(cls, o: np.ndarray, d: np.ndarray, t_max: np.ndarray, root: np.ndarray) -> Segments:
        """With κ against the root's sphere f32[4]."""
        with np.errstate(all="ignore"):
            away = root[:3] - o
            reach = np.sqrt(dot(away, away)) + root[3]
            slack = np.where(reach < LARGEST, np.maximum(KAPPA * reach, SMALLEST), INFINITY)
            return cls(o, d, d / dot(d, d)[:, None], slack, t_max)

    def where(self, rows: np.ndarray) -> Segments:
        """Some of the rays."""
        return Segments(self.o[rows], self.d[rows], self.w[rows], self.slack[rows], self.t_max[rows])


def misses_sphere(rays: Segments, param: np.ndarray, spheres: np.ndarray, exit_root: bool) -> np.ndarray:
    """bool[n]: the segment from 0 to `param` f32[n] stays away from the ray's own sphere f32[n, 4].

    `exit_root`: what is printed, taken at its word (BSH-E5): not hit, or its exit root is not below param.
    """
    with np.errstate(all="ignore"):
        to_centre = spheres[:, :3] - rays.o
        k = dot(to_centre, rays.w)
        if not exit_root:
            k = np.where(k < param, k, param)
            k = np.where(k > 0, k, ZERO)
        apart = to_centre - k[:, None] * rays.d
        distance, reach = dot(apart, apart), spheres[:, 3] + rays.slack
        if not exit_root:
            return distance > reach * reach
        half = reach * reach - distance
        leaves = k + np.sqrt(np.where(half > 0, half, ZERO))
        return ~((half >= 0) & (leaves > 0) & (leaves < param))


def walk(
    lists: Lists,
    origin: np.ndarray,
    direction: np.ndarray,
    t_max: np.ndarray,
    best: Walked,
    *,
    starts: np.ndarray | None = None,
    offset: int = 0,
    any_hit: bool = False,
    front_only: bool = False,
    exit_root: bool = False,
) -> None:
    """Rays f32[n, 3] through the list that each picks, from the element of it that `starts` i32[n] names.

    `best` holds what lists met earlier have left and is written to; `offset` is added to triangle numbers.
    """
    rays = Segments.of(origin, direction, t_max, lists.tree.spheres[0])
    number = list_of_rays(direction, lists.count)
    at = lists.first[number] + (0 if starts is None else starts)
    end = lists.first[number + 1]
    best.t[best.triangle < 0] = t_max[best.triangle < 0]
    going = (t_max > 0) & (at < end) & ((best.triangle < 0) | (not any_hit))
    is_triangle, spheres = lists.is_triangle(), lists.spheres
    while going.any():
        rows = np.flatnonzero(going)
        element = at[rows]
        step = lists.escape[element].astype(np.int64)
        best.nodes[rows] += 1
        leaf = is_triangle[element]

        # Triangles: of equal t the lower number counts
        tested, row = rows[leaf], lists.payload[element[leaf], 3]
        v0, n, m1, m2 = (column[row] for column in lists.records)
        inside, t, u, v, den = intersect(origin[tested], direction[tested], t_max[tested], v0, n, m1, m2)
        nearer = (t < best.t[tested]) | ((t == best.t[tested]) & (row + offset < best.triangle[tested]))
        taken = inside & nearer & ((den < 0) | (not front_only))
        hit = tested[taken]
        best.triangle[hit] = row[taken] + offset
        for column, value in ((best.t, t), (best.u, u), (best.v, v)):
            column[hit] = value[taken]
        best.tests[tested] += 1

        # Spheres: a ray that meets one goes on to its first child, else past it
        inner = ~leaf
        missed = misses_sphere(rays.where(rows[inner]), best.t[rows[inner]], spheres[element[inner]], exit_root)
        goes_past = np.ones(len(rows), np.bool_)
        goes_past[inner] = missed
        step[~goes_past] = 1
        at[rows] += step
        going[rows] = step > 0
        if any_hit:
            going[hit] = False
    best.t[best.triangle < 0] = np.inf
