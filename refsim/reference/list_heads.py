"""Heads of traversal lists by their definition, in NumPy: Efficient Stackless Ray Traversal, section 3.

A head belongs to rays that stay in half-spaces N · x ≥ q. An element is out where one of them does not meet it at all;
the head is the first primitive in list order that is not out, nor any node around it. Planes, offsets and the rules
for climbing are those of `refsim.papers.sphere_hierarchy.heads`, which says why no hit is lost. All in float64.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from refsim.errors import InputError
from refsim.reference.traversal_lists import Lists, directions, list_of_rays
from refsim.reference.vector import cross, dot, length
from refsim.scene.rays import Rays

SLACK = 20 * 2.0**-24
SMALLEST, LARGEST = 2.0**-60, 2.0**60
LEAST_COSINE, FORWARD = 2.0**-48, 2.0**-10
MOST_CELLS = 1024


@dataclass(frozen=True)
class Planes:
    """Half-spaces: normal f64[k, 3], offset f64[k]."""

    normal: np.ndarray
    offset: np.ndarray


def ball_around(triangles: np.ndarray) -> np.ndarray:
    """The middle of the triangles' box and half its diagonal, f64[4]."""
    low, high = (x.astype(np.float64) for x in (triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))))
    return np.append(0.5 * (low + high), 0.5 * np.linalg.norm(high - low))


def slack_at(origin: np.ndarray, ball: np.ndarray) -> np.ndarray:
    """How far accepted hits may lie from the points of rays from `origin` f64[n, 3], f64[n]."""
    reach = length(origin - ball[:3]) + ball[3]
    return np.where(reach < LARGEST, np.maximum(SLACK * reach, SMALLEST), np.inf)


def side_normals(lists: int, number: int) -> list[np.ndarray]:
    """The N with N · d ≥ 0 for every direction d of one list: the planes that bound a half-space, sextant or octant."""
    along = np.array(directions(lists)[number])
    if lists == 1:
        return []
    if lists == 2:
        return [along]
    axes = np.eye(3)
    if lists == 8:
        return [along[a] * axes[a] for a in range(3)]
    return [along + sign * axes[b] for b in range(3) if along[b] == 0.0 for sign in (1.0, -1.0)]


def are_out(lists: Lists, number: int, planes: Planes) -> np.ndarray:
    """Which elements of a list a half-space does not meet, each by itself, bool[m]; triangles with their margin."""
    part = slice(lists.first[number], lists.first[number + 1])
    leaf = lists.is_triangle()[part]
    spheres, rows = lists.spheres[part][~leaf].astype(np.float64), lists.payload[part, 3][leaf]
    corners = lists.tree.triangles[rows].astype(np.float64)
    margin = lists.tree.margin[rows]
    out = np.zeros(len(leaf), np.bool_)
    for normal, offset in zip(planes.normal, planes.offset, strict=True):
        size = length(normal)
        out[~leaf] |= dot(normal[None], spheres[:, :3]) + size * spheres[:, 3] < offset
        out[leaf] |= dot(normal[None, None], corners).max(axis=1) < offset - size * margin
    return out


def first_leaf(lists: Lists, number: int, planes: Planes) -> int:
    """The first primitive that is not out, nor any node around it; the list's length where there is none."""
    first, end = lists.first[number], lists.first[number + 1]
    out = are_out(lists, number, planes)
    for at in range(end - first):
        above = lists.above[first + at]
        out[at] |= above >= 0 and out[above]
        if lists.escape[first + at] in (0, 1) and not out[at]:
            return at
    return int(end - first)


def nodes_around(lists: Lists, number: int, leaf: int) -> list[int]:
    """The nodes around an element, the root first."""
    first, path = lists.first[number], []
    at = lists.above[first + leaf]
    while at >= 0:
        path.append(int(at))
        at = lists.above[first + at]
    return path[::-1]


@dataclass(frozen=True)
class PolygonHeads:
    """Section 3.1: heads of rays that leave `polygons` f32[n, 3, 3] on the side of their `normals` f32[n, 3], starting
    `epsilon` off them. "regular": the planes of the list's directions too."""

    lists: Lists
    polygons: np.ndarray
    normals: np.ndarray
    epsilon: float
    regular: bool
    climbs: bool
    found: dict[tuple[int, int], int] = field(default_factory=dict)

    def planes(self, number: int, polygon: int) -> Planes:
        """Through the polygon's lowest vertex along N, moved by epsilon along the normal and down by a quarter."""
        corners, n = self.polygons[polygon].astype(np.float64), self.normals[polygon].astype(np.float64)
        normal = np.array([n, *(side_normals(self.lists.count, number) if self.regular else [])])
        lowest = dot(normal[:, None], corners[None]).min(axis=1)
        return Planes(normal, lowest + self.epsilon * (dot(normal, n) - 0.25))

    def head(self, number: int, polygon: int) -> int:
        """The element at which rays of that list begin that leave that polygon."""
        if (number, polygon) not in self.found:
            self.found[number, polygon] = self._head(number, polygon)
        return self.found[number, polygon]

    def _head(self, number: int, polygon: int) -> int:
        if not self.normals[polygon].any():
            return 0
        leaf = first_leaf(self.lists, number, self.planes(number, polygon))
        first = self.lists.first[number]
        if not self.climbs or first + leaf == self.lists.first[number + 1]:
            return leaf
        corners = self.polygons[polygon].astype(np.float64)
        middle = ((corners[0] + corners[1]) + corners[2]) / 3.0
        for at in nodes_around(self.lists, number, leaf):
            s = self.lists.spheres[first + at].astype(np.float64)
            if dot(s[:3] - middle, s[:3] - middle) > s[3] * s[3]:
                return at
        return leaf

    def starts(self, origin: np.ndarray, direction: np.ndarray, left: np.ndarray, any_side: bool) -> np.ndarray:
        """i32[n], of rays f32[n, 3] that leave polygon `left` i32[n] (−1 none): 0 where its head may not be used.

        `any_side`: heads serve all rays that leave a polygon (BSH-E9, as printed).
        """
        starts = np.zeros(len(left), np.int32)
        numbers = list_of_rays(direction, self.lists.count)
        o, d = origin.astype(np.float64), direction.astype(np.float64)
        slack = slack_at(o, ball_around(self.lists.tree.triangles))
        for row in np.flatnonzero(left >= 0):
            number, polygon = int(numbers[row]), int(left[row])
            planes = self.planes(number, polygon)
            leaves = dot(self.normals[polygon].astype(np.float64), d[row]) > LEAST_COSINE
            within = dot(planes.normal, o[row][None]) >= planes.offset + length(planes.normal) * slack[row]
            if any_side or (leaves and within.all()):
                starts[row] = self.head(number, polygon)
        return starts


def cells_of(rays: Rays, cells: int) -> np.ndarray:
    """The cell of each ray of an image, i32[n], of cells × cells equal parts, row-major."""
    if isinstance(cells, bool) or not isinstance(cells, int | np.integer) or not 1 <= cells <= MOST_CELLS:
        raise InputError(f"screen_cells must be a whole number from 1 to {MOST_CELLS}, not {cells!r}.")
    if rays.width is None or rays.height is None:
        raise InputError("screen_cells needs the rays of an image, with width and height: these rays have neither.")
    y, x = np.divmod(np.arange(len(rays)), rays.width)
    return (y * cells // rays.height) * cells + x * cells // rays.width


def cell_starts(lists: Lists, rays: Rays, cells: int, climbs: bool) -> np.ndarray:
    """Section 3.2, i32[n]: one head for the live rays of a cell that take the same list."""
    starts = np.zeros(len(rays), np.int32)
    cell, number = cells_of(rays, cells), list_of_rays(rays.direction, lists.count)
    alive = rays.direction.any(axis=1)
    for which in range(cells * cells):
        for k in range(lists.count):
            of_set = alive & (cell == which) & (number == k)
            if of_set.any():
                starts[of_set] = cell_head(lists, k, rays.origin[of_set], rays.direction[of_set], climbs)
    return starts


def cell_head(lists: Lists, number: int, origin: np.ndarray, direction: np.ndarray, climbs: bool) -> int:
    """The head of a set of rays f32[n, 3]."""
    planes = beam(origin.astype(np.float64), direction.astype(np.float64), ball_around(lists.tree.triangles))
    if planes is None:
        return 0
    leaf = first_leaf(lists, number, planes)
    first, end = lists.first[number], lists.first[number + 1]
    if not climbs or first + leaf == end:
        return leaf
    # Expected visits, counted from the root downwards: a node around the leaf met with chance p costs p C − S
    path = [*nodes_around(lists, number, leaf), leaf]
    above = lists.above[first:end]
    cost, least, best, chance = 0.0, 0.0, path[0], 1.0
    for node, child in pairwise(path):
        sphere = lists.spheres[first + node].astype(np.float64)
        chance = min(chance, share_of(planes, 0, sphere) * share_of(planes, 2, sphere))
        children = np.flatnonzero(above == node)
        cost -= chance * len(children) - int((children > child).sum())
        if cost < least:
            least, best = cost, child
    return best


def share_of(planes: Planes, k: int, sphere: np.ndarray) -> float:
    """The part of the width between planes k and k + 1, which face each other, that a ball f64[4] covers."""
    a, b = (
        (dot(planes.normal[j], sphere[:3]) - planes.offset[j]) / length(planes.normal[j]) for j in (k, k + 1)
    )
    width, covered = a + b, np.minimum(a, sphere[3]) + np.minimum(b, sphere[3])
    with np.errstate(all="ignore"):
        return 1.0 if not covered < width else float(np.maximum(covered / width, 0.0))


def beam(origin: np.ndarray, direction: np.ndarray, ball: np.ndarray) -> Planes | None:
    """The five half-spaces that hold a set of rays f64[n, 3]: of their slopes along u and v about their mean m, and of
    m itself; None where they spread too far."""
    mean = np.cumsum(direction, axis=0)[-1] / len(direction)
    if not length(mean) > FORWARD:
        return None
    m = mean / length(mean)
    axis = int(np.argmin(np.abs(m)))  # of equal ones the first
    u = (np.array([0.0, m[2], -m[1]]), np.array([-m[2], 0.0, m[0]]), np.array([m[1], -m[0], 0.0]))[axis]
    u = u / length(u)
    v = cross(m, u)
    forward = dot(m, direction)
    if not (forward > FORWARD).all():
        return None
    a, b = dot(u, direction) / forward, dot(v, direction) / forward
    normal = np.stack([u - a.min() * m, a.max() * m - u, v - b.min() * m, b.max() * m - v, m])
    slack = slack_at(origin, ball)
    offset = (dot(normal[:, None], origin[None]) - length(normal)[:, None] * slack).min(axis=1)
    return Planes(normal, offset)
