"""Heads of screen cells (section 3.2): "divide the screen into a grid, and compute the heads of the traversal lists for
the primary rays of each cell".

In: traversal lists and the rays of an image. Out: `CellHeads`, an element a cell and list; `cell_starts` spreads them
over the rays. What the camera is the rays say: a pinhole, depth of field, a fisheye (`refsim.scene.lenses`).

**Half-spaces.** Of the rays of one cell that pick the same list: m is the direction of their mean, (m, u, v) an
orthonormal frame, a = d · u / d · m and b = d · v / d · m a ray's slopes. For a ray with d · m > 0

    (u − a_min m) · d = d · m (a − a_min) ≥ 0

and so with a_max m − u, v − b_min m, b_max m − v and m itself. Each of the five has q = min N · o − 20 eps R |N| over
the rays of the set (`heads`). All in float64: what rounding does to slopes, 2⁻⁵⁰ of |N|, is within what the slack
leaves. Where a ray has d · m ≤ 2⁻¹⁰, or directions cancel, the set has no planes and begins at the list's head.

Dead rays belong to no set. Sets come from whole cells, so heads do not depend on threads or packets.

**Climbing.** p is the part of the beam's width that a ball covers, along u times along v: exact for a ball in the
middle of a beam that is much narrower or much wider than it. Where p C − S, summed upwards from the leaf, is least,
`head_rule="climb"` begins.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.cell_heads_kernels import heads_of_cells
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.heads import (
    Skipped,
    ball_around,
    check_head_rule,
    first_surviving_leaf,
    rejected,
)
from refsim.papers.sphere_hierarchy.heads_walk import LANES, ROWS
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.scene.rays import Rays

MOST_CELLS = 1024


class CellHeads(NamedTuple):
    """Heads of n × n screen cells, row-major from the top left.

    elements  i32[n², lists], within the list; its length where nothing survives, 0 where no ray of the cell picks it
    cell      i32[rays], the cell of each ray
    starts    i32[rays], the element at which each ray begins: `starts` of `search`
    """

    elements: NDArray[np.int32]
    cell: NDArray[np.int32]
    starts: NDArray[np.int32]


def cell_starts(lists: TraversalLists, rays: Rays, cells: int, head_rule: str = "leaf") -> NDArray[np.int32]:
    """The element at which each ray of an image begins, i32[n]; `cell_heads` has the rest."""
    return cell_heads(lists, rays, cells, head_rule).starts


def cell_heads(lists: TraversalLists, rays: Rays, cells: int, head_rule: str = "leaf") -> CellHeads:
    """Heads of cells × cells parts of the image.

    Raises `InputError` for rays that are no image, another number of cells than 1 to 1024, or another head rule.
    """
    check_head_rule(head_rule)
    cell = cells_of(rays, cells)
    picked = list_of_rays(rays.direction, lists.count)
    key = cell * np.int32(lists.count) + picked
    rows = np.argsort(key, kind="stable")
    rows = rows[rays.alive[rows]]
    sets, begins = np.unique(key[rows], return_index=True)
    heads, _ = _heads(lists, rays, rows, np.append(begins, len(rows)), sets % lists.count, head_rule)
    elements = np.zeros(cells * cells * lists.count, np.int32)
    elements[sets] = heads
    return CellHeads(elements.reshape(-1, lists.count), cell, elements[key])


def cells_of(rays: Rays, cells: int) -> NDArray[np.int32]:
    """The cell of each ray of an image, i32[n]: row × cells + column, of equal parts of width and height."""
    if isinstance(cells, bool) or not isinstance(cells, int | np.integer) or not 1 <= cells <= MOST_CELLS:
        raise InputError(f"screen_cells must be a whole number from 1 to {MOST_CELLS}, not {cells!r}.")
    if rays.width is None or rays.height is None:
        raise InputError("screen_cells needs the rays of an image, with width and height: these rays have neither.")
    column = np.arange(rays.width) * cells // rays.width
    row = np.arange(rays.height) * cells // rays.height
    return (row[:, None] * cells + column).astype(np.int32).ravel()


def skipped_by_cell(
    lists: TraversalLists, rays: Rays, cells: int, cell: int, number: int, head_rule: str = "leaf"
) -> Skipped:
    """What one cell's head skips of a list (Figure 3b)."""
    planes = cell_planes(lists, rays, cells, cell, number)
    out = rejected(lists, number, planes)
    head = int(cell_heads(lists, rays, cells, head_rule).elements[cell, number])
    return Skipped(first_surviving_leaf(lists, number, out), head, out)


def cell_planes(lists: TraversalLists, rays: Rays, cells: int, cell: int, number: int) -> NDArray[np.float64]:
    """The half-spaces of one cell and list, f64[k, 5]: N, q, |N|, of ±u, ±v and m; none where no ray picks the list, or
    its rays spread too far."""
    chosen = (cells_of(rays, cells) == cell) & (list_of_rays(rays.direction, lists.count) == number) & rays.alive
    rows = np.flatnonzero(chosen)
    if rows.size == 0:
        return np.zeros((0, ROWS))
    _, planes = _heads(lists, rays, rows, np.array([0, len(rows)]), np.array([number]), "leaf")
    return planes


def _heads(
    lists: TraversalLists, rays: Rays, rows: NDArray[np.intp], cuts: NDArray[np.intp], numbers: NDArray[np.intp],
    head_rule: str,
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:  # fmt: skip
    """The head of each set of rays, and the planes of the last."""
    hierarchy = lists.hierarchy
    heads, planes = np.empty(len(numbers), np.int32), np.empty((ROWS, LANES))
    count = specialise(heads_of_cells, {})(
        rows.astype(np.int64), cuts.astype(np.int64), numbers.astype(np.int64), rays.origin, rays.direction,
        ball_around(hierarchy.triangles), head_rule == "climb", lists.first, lists.escape, lists.spheres, lists.payload,
        hierarchy.triangles, hierarchy.margin, planes, heads,
    )  # fmt: skip
    return heads, np.ascontiguousarray(planes[:, :count].T)
