"""The kd-tree of `refsim.papers.sphere_hierarchy.kd_tree`, in plain recursion: boxes in float32, costs in float64."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from refsim.reference.one_ray import F, rounded_out
from refsim.reference.sphere import acceptance_margin
from refsim.reference.triangle import pack

EPS = 2.0**-24


@dataclass(frozen=True, eq=False)
class Node:
    """A leaf (axis 3) with its triangles, or two children on the sides of a plane; `cell` f32[6]."""

    cell: np.ndarray
    axis: int
    plane: np.float32
    triangles: tuple[int, ...]
    below: Node | None = None
    above: Node | None = None

    @property
    def children(self) -> tuple[Node, Node]:
        """The nodes below and above the plane."""
        assert self.below is not None and self.above is not None
        return self.below, self.above


@dataclass(frozen=True, eq=False)
class Tree:
    """`root`; `loose` triangles, which every ray tests; rays are within `far` of `centre` along each axis, or test
    all; `records` as `pack` makes them."""

    root: Node
    loose: tuple[int, ...]
    centre: np.ndarray
    far: np.float32
    records: tuple[np.ndarray, ...]


def kd_tree(triangles: np.ndarray, reach: float, test: float, empty: float) -> Tree:
    """The tree of triangles f32[n, 3, 3] for rays from within `reach` half-diagonals of the middle."""
    points = triangles.reshape(-1, 3)
    lower, upper = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    half = 0.5 * math.sqrt(float(((upper - lower) ** 2).sum()))
    centre = (0.5 * (lower + upper)).astype(F)
    far = (reach * half + EPS * float(np.abs(centre).max())) * (1 + 2.0**-10)
    largest = max(math.sqrt(3.0) * far + half * (1 + 2.0**-10), 2.0**-60)
    margin = acceptance_margin(triangles) + 25.0 * EPS * largest
    records = pack(triangles)
    usable = ~records[5]
    bounded = margin <= max(half / 32.0, 50.0 * EPS * largest)
    exact = triangles.astype(np.float64)
    low, high = rounded_out(exact.min(axis=1) - margin[:, None], exact.max(axis=1) + margin[:, None])
    rows = np.flatnonzero(usable & bounded)
    cell = np.concatenate([points.min(axis=0), points.max(axis=0)])
    if len(rows):
        cell = np.concatenate([low[rows].min(axis=0), high[rows].max(axis=0)])
    most = round(8 + 1.3 * math.log2(max(len(rows), 1)))
    root = _node(rows, low, high, cell, most, 0, test, empty)
    reached = F(far) if largest <= 2.0**60 else F(-1)
    return Tree(root, tuple(np.flatnonzero(usable & ~bounded).tolist()), centre, reached, records)


def _node(
    rows: np.ndarray, low: np.ndarray, high: np.ndarray, cell: np.ndarray, depth: int, bad: int, test: float,
    empty: float,
) -> Node:  # fmt: skip
    """The node of triangles `rows`, and all below it; `depth` planes may still follow, `bad` were not worth it."""
    cost, axis, plane = math.inf, 0, F(0)
    if len(rows) > 1 and depth > 0:
        cost, axis, plane = _best(rows, low, high, cell, test, empty)
    size = cell[3:].astype(np.float64) - cell[:3]
    whole = _half_area(size)
    alone = test * whole * len(rows)
    bad += not cost + whole < alone
    if cost == math.inf or bad >= 3 or (cost + whole > 4.0 * alone and len(rows) < 16):
        return Node(cell, 3, F(0), tuple(rows.tolist()))
    under, over = cell.copy(), cell.copy()
    under[axis + 3] = over[axis] = plane
    below, above = rows[low[rows, axis] < plane], rows[high[rows, axis] > plane]
    return Node(
        cell, axis, plane, (),
        _node(below, low, high, under, depth - 1, bad, test, empty),
        _node(above, low, high, over, depth - 1, bad, test, empty),
    )  # fmt: skip


def _best(
    rows: np.ndarray, low: np.ndarray, high: np.ndarray, cell: np.ndarray, test: float, empty: float
) -> tuple[float, int, np.float32]:
    """``(cost, axis, plane)``: the smallest cost; of equal ones the first axis, then the lowest plane."""
    found = [(math.inf, 0, F(0))]
    edges = cell[3:].astype(np.float64) - cell[:3]
    for axis in range(3):
        start, end = cell[axis], cell[axis + 3]
        if len(rows) > 32:
            planes = (float(start) + edges[axis] * np.arange(1, 32) / 32).astype(F)
        else:
            planes = np.concatenate([low[rows, axis], high[rows, axis]])
        for plane in planes[(planes > start) & (planes < end)]:
            below, above = int((low[rows, axis] < plane).sum()), int((high[rows, axis] > plane).sum())
            under, over = edges.copy(), edges.copy()
            under[axis], over[axis] = float(plane) - float(start), float(end) - float(plane)
            cost = test * (_half_area(under) * below + _half_area(over) * above)
            found.append((cost * (empty if below == 0 or above == 0 else 1.0), axis, plane))
    return min(found)


def _half_area(edges: np.ndarray) -> float:
    """Half the surface of a box."""
    x, y, z = map(float, edges)
    return x * y + y * z + z * x
