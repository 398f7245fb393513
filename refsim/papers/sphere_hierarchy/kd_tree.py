"""A kd-tree by the surface area heuristic, for the traversals that other papers compare themselves with (`kd_search`).

In: a scene; out: a `KdTree`. Built as Pharr and Humphreys do (Physically Based Rendering, chapter 4), from the
triangles' boxes: of the planes that are tried the one with the least expected cost divides a node. That cost is one
visit plus `TEST` for each triangle test that a random line is expected to need, times `EMPTY` where a side is empty. A
node that no plane makes cheaper may be divided still, twice on the way from the root; nodes deeper than
8 + 1.3 log₂ n are leaves. A node of more than 32 triangles tries 31 planes an axis at equal distances, a smaller one
the sides of all its triangles' boxes.

**Margins**, eps = 2⁻²⁴. `reach` bounds the distance of a ray's origin from the scene's centre along each axis, in
half-diagonals; R = √3 of that distance + half a diagonal, so no vertex, plane or hit is further from an origin. An
accepted hit point o + t d lies within `acceptance_margin` + 15 eps R of its triangle (`traversal`). A plane is crossed
at fl(fl(plane − o) fl(1 / e)), e the direction kept from zero (`boxes_walk`): off by 3 eps R when multiplied by e, and
by another half where e is not d. These parameters never decrease with the plane; so at every t of the closed interval
that a traversal gives a leaf, the ray is within 4 eps R of the leaf's cell. A triangle's box therefore grows by

    acceptance_margin + 20 eps R (for the hit) + 5 eps R (for the cell)

and a triangle stands in every leaf that the grown box overlaps. Then all hits with t in a leaf's interval, its ends
included, are hits of the leaf's triangles: when the best so far is not beyond the end, it is the nearest, and of
equally near ones the first. A ray from beyond reach meets all triangles: slow and right. So do all rays the `loose`
ones, whose boxes would have to grow by more than 1/64 of the diagonal (slivers). Triangles of zero area stand nowhere.
"""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin
from refsim.geometry.triangle import pack_triangles
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.kd_build import build_kd, grown_boxes
from refsim.scene.mesh import Scene

EPS = 2.0**-24
GROWTH = 25.0  # multiples of eps R
LOOSE = 2.0**-6  # of the diagonal
REACH = 16.0  # half-diagonals
SMALLEST, LARGEST = 2.0**-60, 2.0**60
# Of a visit: a triangle test; and what an empty side makes of a cost. Where nodes and tests count alike, 0.5 makes
# rays look at fewer elements than 1 or 1.5 do, in a smaller tree
TEST, EMPTY = 0.5, 0.8


@dataclass(frozen=True, eq=False)
class KdTree:
    """A tree whose nodes stand depth first, the child below the plane right after its parent.

    split    f32[m], the plane of an inner node
    links    i32[m, 4]: axis (3: a leaf), the child above the plane or where a leaf's triangles begin in `lists`,
             triangles of a leaf, parent (−1 the root)
    boxes    f32[m, 6], a node's cell: the root's box, cut by the planes above the node. Only kd-backtrack reads them
    lists    i32[k], triangles of the leaves, ascending in each; loose i32[l]
    records  f32[n, 12]; centre f32[3] and far f32: which rays are within reach; depth, planes on the longest way down
    """

    split: NDArray[np.float32]
    links: NDArray[np.int32]
    boxes: NDArray[np.float32]
    lists: NDArray[np.int32]
    loose: NDArray[np.int32]
    records: NDArray[np.float32]
    centre: NDArray[np.float32]
    far: np.float32
    depth: int

    def __len__(self) -> int:
        return len(self.split)

    @property
    def leaves(self) -> int:
        """How many of the nodes are leaves."""
        return int((self.links[:, 0] == 3).sum())


def build_kd_tree(scene: Scene, reach: float = REACH) -> KdTree:
    """The tree of a scene whose rays start at most `reach` half-diagonals from its centre. Raises `InputError`."""
    far_off, triangles = _checked_reach(reach), scene.triangles
    lower, upper = scene.lower.astype(np.float64), scene.upper.astype(np.float64)
    half = 0.5 * math.sqrt(float(((upper - lower) ** 2).sum()))
    centre = (0.5 * (lower + upper)).astype(np.float32)
    # The centre's own rounding, and that of the comparison
    far = (far_off * half + EPS * float(np.abs(centre).max())) * (1 + 2.0**-10)
    largest = max(math.sqrt(3.0) * far + half * (1 + 2.0**-10), SMALLEST)
    growth = acceptance_margin(triangles) + GROWTH * EPS * largest
    packed = pack_triangles(triangles)
    loose = ~packed.degenerate & ~(growth <= max(2.0 * LOOSE * half, 2.0 * GROWTH * EPS * largest))
    rows = np.flatnonzero(~packed.degenerate & ~loose).astype(np.int32)
    low, high = np.empty((len(triangles), 3), np.float32), np.empty((len(triangles), 3), np.float32)
    specialise(grown_boxes, {})(triangles, growth, rows, low, high)
    root = np.concatenate([scene.lower, scene.upper])
    if len(rows):
        root = np.concatenate([low[rows].min(axis=0), high[rows].max(axis=0)])
    most = round(8 + 1.3 * math.log2(max(len(rows), 1)))
    split, links, boxes, lists, depth = _nodes(rows, low, high, root, most)
    return KdTree(
        split, links, boxes, lists, np.flatnonzero(loose).astype(np.int32),
        np.column_stack([packed.v0, packed.n, packed.m1, packed.m2]), centre,
        np.float32(far) if largest <= LARGEST else np.float32(-1), depth,
    )  # fmt: skip


def _checked_reach(reach: object) -> float:
    if isinstance(reach, bool) or not isinstance(reach, numbers.Real) or not 0.0 <= float(reach) < math.inf:
        raise InputError(f"reach must be a number of half-diagonals, zero or more, not {reach!r}.")
    return float(reach)


def _nodes(
    rows: NDArray[np.int32], low: NDArray[np.float32], high: NDArray[np.float32], root: NDArray[np.float32], most: int
) -> tuple[Any, ...]:
    """``(split, links, boxes, lists, depth)``. How many nodes there will be nobody knows: where the room was too small
    it begins again with twice as much."""
    room = 12 * len(rows) + 512
    while True:
        split, links = np.empty(room, np.float32), np.empty((room, 4), np.int32)
        boxes, lists, places = np.empty((room, 6), np.float32), np.empty(room, np.int32), np.empty(room, np.int32)
        nodes, held, depth = specialise(build_kd, {})(
            rows, low, high, root, most, TEST, EMPTY, places, split, links, boxes, lists
        )
        if nodes >= 0:
            return split[:nodes].copy(), links[:nodes].copy(), boxes[:nodes].copy(), lists[:held].copy(), int(depth)
        room *= 2
