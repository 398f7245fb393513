"""Heads of traversal lists by their definition, in NumPy: Efficient Stackless Ray Traversal, section 3.

A head belongs to rays that stay in half-spaces N · x ≥ q. An element is out where one of them does not meet it at all;
the head is the first primitive in list order that is not out, nor any node around it. Planes, offsets and the rules
for climbing are those of `refsim.papers.sphere_hierarchy.heads`, which says why no hit is lost. All in float64.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from refsim.reference.sphere import acceptance_margin
from refsim.reference.traversal_lists import Lists, directions, list_of_rays
from refsim.reference.vector import dot, length

SLACK = 20 * 2.0**-24
SMALLEST, LARGEST = 2.0**-60, 2.0**60
LEAST_COSINE = 2.0**-48


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
    margin = acceptance_margin(lists.tree.triangles)[rows]
    out = np.zeros(len(leaf), np.bool_)
    for normal, offset in zip(planes.normal, planes.offset, strict=True):
        size = length(normal)
        out[~leaf] |= dot(normal[None], spheres[:, :3]) + size * spheres[:, 3] < offset
        out[leaf] |= dot(normal[None, None], corners).max(axis=1) + size * margin < offset
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
