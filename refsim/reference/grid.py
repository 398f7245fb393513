"""The uniform grid of Recursive Ray Tracing in Geometry Shader, section 4.3, in plain NumPy.

Which cells list a triangle, in float64; and the walk of one ray through the grid, in float32, with the operations of
the device function in the same order, so that cells visited, triangles tested and hits agree bit for bit.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from refsim.reference.sphere import acceptance_margin
from refsim.reference.triangle import intersect

EPS = 2.0**-24
F = np.float32
Ray = tuple[np.ndarray, np.ndarray, np.float32]


class Growth(NamedTuple):
    """dilation f64[n] of each triangle (−1: hit by no ray, inf: in no cell, tested by every ray); slack of a cell."""

    dilation: np.ndarray
    slack: float


class Lattice(NamedTuple):
    """Corner, a cell's edges, one over them, cells along x, y, z: float32[3] each; far float32."""

    lower: np.ndarray
    size: np.ndarray
    inverse_size: np.ndarray
    shape: np.ndarray
    far: np.float32


class Found(NamedTuple):
    """What a search returns."""

    triangle: int
    t: np.float32
    u: np.float32
    v: np.float32
    cells: int
    tests: int
    rejected: int


def growth_of(triangles: np.ndarray, reach: float, degenerate: np.ndarray) -> Growth:
    """How far from a triangle an accepted hit can lie, and how far from its cell a walk can be.

    No ray starts further than far = (reach + diagonal)(1 + 2⁻¹⁰) from the corner along an axis; R = √3 far + 2
    diagonals, but no less than 2⁻²⁰ of the largest coordinate. Dilation: `acceptance_margin` + 20 eps R, at most 1/64
    of the diagonal or twice 20 eps R; slack: 10 eps R.
    """
    p = np.asarray(triangles, np.float64)
    diagonal = float(np.linalg.norm(p.max(axis=(0, 1)) - p.min(axis=(0, 1))))
    far = (reach + diagonal) * (1 + 2.0**-10)
    largest = max(np.sqrt(3.0) * far + 2.0 * diagonal, 2.0**-60, 2.0**-20 * np.abs(p).max())
    dilation = acceptance_margin(triangles) + 20.0 * EPS * largest
    dilation[dilation > max(diagonal / 64, 40.0 * EPS * largest)] = np.inf
    dilation[degenerate] = -1.0
    return Growth(dilation, 10.0 * EPS * largest)


def cells_of(triangle: np.ndarray, growth: float, lattice: Lattice) -> set[tuple[int, int, int]]:
    """Cells (x, y, z) whose box, `growth` larger on every side, the triangle [3, 3] overlaps.

    No axis separates them: the box's three, the normal, the nine products of an edge and an axis. The outermost cells
    go on without end.
    """
    low, size, shape = (np.asarray(x, np.float64) for x in (lattice.lower, lattice.size, lattice.shape))
    p = np.asarray(triangle, np.float64) - low
    ranges = []
    for a in range(3):
        first, last = np.floor((p[:, a].min() - growth) / size[a]), np.floor((p[:, a].max() + growth) / size[a])
        ranges.append(range(int(np.clip(first, 0, shape[a] - 1)), int(np.clip(last, 0, shape[a] - 1)) + 1))
    cells = np.array(list(itertools.product(*ranges)))
    edges = np.roll(p, -1, axis=0) - p
    axes = [np.cross(edges[0], edges[1])] + [np.cross(axis, edge) for edge in edges for axis in np.eye(3)]
    overlap = np.ones(len(cells), bool)
    for axis in axes:
        centre, radius, own = (cells + 0.5) * size @ axis, np.abs(axis) @ (0.5 * size + growth), p @ axis
        overlap &= (centre >= own.min() - radius) & (centre <= own.max() + radius)
    return {(int(x), int(y), int(z)) for x, y, z in cells[overlap]}


def walk(ray: Ray, lattice: Lattice) -> Iterator[tuple[tuple[int, int, int], np.float32]]:
    """``((x, y, z), t)``: the cells that a ray passes in order, and the parameter at which each is left.

    The ray is (origin float32[3], direction float32[3], t_max). Nothing is passed if it misses the grid's box, or meets
    it beyond t_max.
    """
    origin, direction, t_max = ray
    least = F(2.0**-26) * np.abs(direction).max()
    e = np.copysign(np.maximum(np.abs(direction), least), direction).astype(F)
    inverse = F(1) / e
    corner = (lattice.lower - origin) * inverse
    spacing = lattice.size * inverse
    end = corner + lattice.shape * spacing
    enter = max(np.minimum(corner, end).max(), F(0))
    leave = np.maximum(corner, end).min()
    if not (enter <= leave and enter <= t_max):
        return
    place = (enter - corner) * (e * lattice.inverse_size)
    cell = np.clip(place, F(0), lattice.shape - F(1)).astype(np.int64)
    step = np.where(e > 0, 1, -1)
    plane = cell + (step > 0)
    while True:
        t = corner + plane.astype(F) * spacing
        axis = int(np.argmin(t))  # of equal ones the first, as x comes before y and y before z
        yield (int(cell[0]), int(cell[1]), int(cell[2])), t[axis]
        if not t[axis] < leave:
            return
        cell[axis] += step[axis]
        plane[axis] += step[axis]


def is_walked(ray: Ray, lattice: Lattice) -> bool:
    """Whether the margins hold: the ray starts near enough, its direction is neither too long nor too short."""
    origin, direction, _ = ray
    near = np.abs(lattice.lower - origin) <= lattice.far
    return bool(near.all() and 2.0**-20 <= np.abs(direction).max() <= 2.0**20)


def search(
    ray: Ray,
    lattice: Lattice,
    lists: dict[tuple[int, int, int], list[int]],
    loose: list[int],
    records: tuple[np.ndarray, ...],
    any_hit: bool,
    front_only: bool,
) -> Found:
    """The nearest hit, or any, of one finite ray; `lists` of triangles by cell, `records` from `triangle.pack`."""
    t: Any = ray[2]
    u: Any = F(0)
    v: Any = F(0)
    triangle, cells, tests = -1, 0, 0

    def test(candidates: list[int]) -> None:
        nonlocal triangle, t, u, v, tests
        for k in candidates:
            if any_hit and triangle >= 0:
                return
            hit, s, p, q, facing = _intersect(ray, records, k)
            tests += 1
            if hit and (facing < 0 or not front_only) and (s < t or (s == t and k < triangle)):
                triangle, t, u, v = k, s, p, q

    walked = is_walked(ray, lattice)
    test(loose if walked else list(range(len(records[0]))))
    if walked and not (any_hit and triangle >= 0):
        for cell, exit_t in walk((ray[0], ray[1], t), lattice):
            cells += 1
            test(lists.get(cell, []))
            if (any_hit and triangle >= 0) or exit_t >= t:
                break
    return Found(triangle, t, u, v, cells, tests, int(cells == 0 and tests == 0))


def _intersect(ray: Ray, records: tuple[np.ndarray, ...], k: int) -> tuple[np.ndarray, ...]:
    v0, n, _, m1, m2, _ = records
    return intersect(ray[0], ray[1], np.asarray(ray[2]), v0[k], n[k], m1[k], m2[k])
