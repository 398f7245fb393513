"""Heads of polygons (section 3.1): what rays that leave a polygon's front can skip in each list.

In: traversal lists and polygons (by default the lists' own triangles). Out: `PolygonHeads`, an element a polygon and
list, "read with the rest of the material information"; `polygon_starts` picks from them for rays.

**Half-spaces.** Rays start epsilon off the polygon along its unit normal n. For a normal N the offset is

    q = min N · v  +  epsilon (N · n − 1/4)        v the polygon's vertices

simple   N = n: what lies behind the polygon, or in its plane, is rejected
regular  also the N with N · d ≥ 0 for all directions d of the list (`heads.side_normals`): 4 for sextants, 3 for
         octants, 1 for half-spaces, none for a single list

**Which rays.** A head is right for rays that leave on the normal's side, which refracted rays, rays off a polygon's
back and reflections about shading normals below the plane do not (BSH-E9). Each ray is asked: n · d > 2⁻⁴⁸ and, for
every N above, N · o ≥ q + 20 eps R |N| (`heads`), all in float64. Other rays begin at the list's head. A quarter of
epsilon, 2⁻¹⁴ of the diagonal, leaves room for that and for what float32 does to an origin; rays from far away, or with
coordinates large beside the scene, are refused. N · d ≥ 0 of the other N is exact, as the list was picked by
comparisons. With `any_side` nobody is asked: the text as printed.

**Climbing.** Rays fan out from the polygon over its whole front, so p is 1 for a ball that holds its middle and small
for one that does not: `head_rule="climb"` takes the outermost node around the leaf whose ball does not hold it. On
Suzanne and the bunny this comes within 2 % of the best node for each polygon and list; solid angles for p do worse.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.geometry.triangle import pack_triangles
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.heads import (
    Skipped,
    ball_around,
    check_head_rule,
    first_surviving_leaf,
    rejected,
    sides_of,
)
from refsim.papers.sphere_hierarchy.heads_walk import LANES, ROWS
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.polygon_heads_kernels import heads_of_polygons, planes_of_polygon, starts_of_rays
from refsim.pipeline.threads import checked_threads, run_all
from refsim.scene.mesh import EPSILON
from refsim.scene.rays import Rays

KINDS = ("simple", "regular")


@dataclass(frozen=True, eq=False)
class PolygonHeads:
    """Heads of n polygons in the lists of one hierarchy.

    elements   i32[lists, n], within the list; its length where nothing survives, 0 of a polygon without area
    polygons   f32[n, 3, 3]; normals f32[n, 3], unit or zero; epsilon, how far off a polygon rays start
    kind       "simple" or "regular"; sides f64[lists, k, 3], normals of the further planes
    ball       f64[4], holds the lists' triangles
    """

    elements: NDArray[np.int32]
    polygons: NDArray[np.float32]
    normals: NDArray[np.float32]
    epsilon: float
    kind: str
    head_rule: str
    sides: NDArray[np.float64]
    ball: NDArray[np.float64]

    @property
    def nbytes(self) -> int:
        """Bytes of the heads alone."""
        return self.elements.nbytes


def polygon_heads(
    lists: TraversalLists,
    polygons: NDArray[np.float32] | None = None,
    kind: str = "regular",
    head_rule: str = "leaf",
    threads: int | None = None,
    epsilon: float | np.float32 | None = None,
) -> PolygonHeads:
    """Heads of every polygon in every list.

    polygons  f32[n, 3, 3] that rays leave: those of all layers where there are several; None: the lists' own triangles
    epsilon   how far off them rays start, scene units; None: that of a scene of these polygons
    """
    if kind not in KINDS:
        raise InputError(f"heads is {kind!r}; it must be one of {', '.join(map(repr, KINDS))}.")
    check_head_rule(head_rule)
    hierarchy, workers = lists.hierarchy, checked_threads(threads)
    leaving = hierarchy.triangles if polygons is None else np.ascontiguousarray(polygons, np.float32)
    normals = lists.records[:, 3:6].copy() if polygons is None else pack_triangles(leaving).n
    distance = EPSILON * 2.0 * float(ball_around(leaving)[3]) if epsilon is None else float(epsilon)
    if not 0.0 <= distance < np.inf:
        raise InputError(f"epsilon must be a finite distance, zero or more, not {epsilon!r}.")
    sides = sides_of(lists)
    if kind == "simple":
        sides = sides[:, :0].copy()
    elements = np.empty((lists.count, len(leaving)), np.int32)
    kernel = specialise(heads_of_polygons, {})
    parts = np.array_split(neighbours_together(leaving), 8 * workers)
    tasks = [
        lambda k=k, rows=rows: kernel(
            rows, leaving, normals, sides[k], distance, head_rule == "climb", lists.first[k], lists.first[k + 1],
            lists.escape, lists.spheres, lists.payload, hierarchy.triangles, hierarchy.margin, elements[k],
        )
        for k in range(lists.count)
        for rows in parts
    ]  # fmt: skip
    run_all("polygon heads", workers, tasks)
    ball = ball_around(hierarchy.triangles)
    return PolygonHeads(elements, leaving, normals, distance, kind, head_rule, sides, ball)


def neighbours_together(polygons: NDArray[np.float32]) -> NDArray[np.int64]:
    """Rows of polygons by cells of 64³ along a Z curve: those in a row walk through the same elements."""
    middle = polygons.astype(np.float64).mean(axis=1)
    low, high = middle.min(axis=0), middle.max(axis=0)
    size = np.where(high > low, high - low, 1.0)
    place = np.minimum((middle - low) / size * 64, 63).astype(np.int64)
    key = np.zeros(len(polygons), np.int64)
    for bit in range(6):
        for axis in range(3):
            key |= (place[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")


def polygon_starts(
    heads: PolygonHeads,
    lists: TraversalLists,
    rays: Rays,
    origin_triangle: NDArray[np.int32],
    *,
    any_side: bool = False,
) -> NDArray[np.int32]:
    """The element at which each ray begins, i32[n]: `starts` of `search`.

    origin_triangle  i32[n], the polygon that a ray leaves, −1: none
    any_side         use the head whatever the ray (BSH-E9 as printed)
    """
    starts = np.empty(len(rays), np.int32)
    specialise(starts_of_rays, {})(
        rays.origin, rays.direction, list_of_rays(rays.direction, lists.count),
        np.ascontiguousarray(origin_triangle, np.int32), heads.polygons, heads.normals, heads.sides, heads.epsilon,
        heads.ball, any_side, heads.elements, starts,
    )  # fmt: skip
    return starts


def polygon_planes(heads: PolygonHeads, polygon: int, number: int) -> NDArray[np.float64]:
    """The half-spaces of one polygon and list, f64[k, 5]: N, q, |N|; the polygon's own plane first."""
    planes = np.empty((ROWS, LANES))
    args = heads.polygons[polygon], heads.normals[polygon], heads.sides[number], heads.epsilon
    count = specialise(planes_of_polygon, {})(planes, *args)
    return np.ascontiguousarray(planes[:, :count].T)


def skipped_by_polygon(heads: PolygonHeads, lists: TraversalLists, polygon: int, number: int) -> Skipped:
    """What one polygon's head skips of a list (Figure 3a)."""
    out = rejected(lists, number, polygon_planes(heads, polygon, number))
    return Skipped(first_surviving_leaf(lists, number, out), int(heads.elements[number, polygon]), out)
