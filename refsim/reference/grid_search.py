"""A search through the uniform grid (Recursive Ray Tracing in Geometry Shader, section 4.3), ray by ray, with `grid`.

Here the grid is laid out, in float64: a box around all that hits can lie in, cut into cells; each cell gets the list of
the triangles near it. Hits, cells visited and triangles tested are the device's.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.reference.grid import Growth, Lattice, cells_of, growth_of, search
from refsim.reference.searches import Box, Found
from refsim.reference.triangle import pack
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

DENSITY = 6.0  # cells for a triangle where no resolution is given
MOST_CELLS = 2**25
THINNEST = 12.0  # a cell's least thickness, in slacks


def reach_of(scene: Scene, rays: Rays) -> float:
    """The largest distance from the centre of the scene's box to a live ray's origin."""
    origins = rays.origin[rays.t_max > 0].astype(np.float64)
    if not len(origins):
        return 0.0
    return math.sqrt((np.abs(origins - scene.center).max(axis=0) ** 2).sum())


def cells_wanted(extent: np.ndarray, thick: np.ndarray, count: int, resolution: Any) -> np.ndarray:
    """Cells along x, y, z: those asked for; or cubes, but one cell along an axis that is not `thick` or is thinner."""
    if resolution is not None:
        given = np.atleast_1d(np.asarray(resolution, np.float64))
        return given if len(given) == 3 else np.rint(extent / extent.max() * given[0])
    cells, edge = min(DENSITY * count, MOST_CELLS / 2), np.inf
    while thick.any():
        edge = (np.prod(extent[thick]) / cells) ** (1.0 / thick.sum())
        if (extent[thick] >= edge).all():
            break
        thick = thick & (extent >= edge)
    return np.where(thick, np.rint(extent / edge), 1.0)


def extent_of(scene: Scene, growth: Growth) -> tuple[np.ndarray, np.ndarray]:
    """Corners float64[3] of the box: as far around the triangles as their dilation and two slacks."""
    listed = np.isfinite(growth.dilation) & (growth.dilation >= 0)
    low, high = scene.lower.astype(np.float64), scene.upper.astype(np.float64)
    if listed.any():
        p, margin = scene.triangles[listed].astype(np.float64), growth.dilation[listed, None]
        low, high = (p.min(axis=1) - margin).min(axis=0), (p.max(axis=1) + margin).max(axis=0)
    return low - 2.0 * growth.slack, high + 2.0 * growth.slack


def box_of(scene: Scene, reach: float) -> Box | None:
    """What turns rays away before all triangles are tested; none where a triangle has no bound to its hits."""
    growth = growth_of(scene.triangles, reach, scene.degenerate)
    if np.isinf(growth.dilation).any():
        return None
    low, high = extent_of(scene, growth)
    return Box(-_not_below(-low), _not_below(high), np.float32((reach + scene.diagonal) * (1 + 2.0**-10)))


def lattice_of(scene: Scene, growth: Growth, reach: float, resolution: Any) -> Lattice:
    """The grid's box and cells. The box reaches beyond the triangles by their dilation and two slacks."""
    low, high = extent_of(scene, growth)
    most = np.maximum(np.floor((scene.upper.astype(np.float64) - scene.lower) / (THINNEST * growth.slack)), 1)
    wanted = cells_wanted(high - low, most > 1, len(scene), resolution)
    shape = np.clip(wanted, 1, most).astype(np.int64)
    if np.prod(shape) > MOST_CELLS:
        x, y, z = shape
        raise InputError(f"a grid of {x} × {y} × {z} cells is more than the {MOST_CELLS} that fit its memory.")
    lower = -_not_below(-low)
    size = _not_below((high - lower) / shape * (1 + 2.0**-40))
    far = (reach + scene.diagonal) * (1 + 2.0**-10)
    return Lattice(lower, size, np.float32(1) / size, shape.astype(np.float32), np.float32(far))


def _not_below(values: np.ndarray) -> np.ndarray:
    """The smallest float32 not below each value."""
    near = values.astype(np.float32)
    return np.where(near < values, np.nextafter(near, np.float32(np.inf)), near)


@dataclass(frozen=True)
class GridSearch:
    """`lists` of triangles by cell (x, y, z); `loose`, which every ray tests; `records` as `pack` makes them."""

    lattice: Lattice
    lists: dict[tuple[int, int, int], list[int]]
    loose: list[int]
    records: tuple[np.ndarray, ...]
    front_only: bool

    @classmethod
    def of(cls, scene: Scene, reach: float, resolution: Any, front_only: bool) -> GridSearch:
        """The grid of a scene whose rays start within `reach` of it."""
        growth = growth_of(scene.triangles, reach, scene.degenerate)
        lattice = lattice_of(scene, growth, reach, resolution)
        lists = defaultdict(list)
        for k, dilation in enumerate(growth.dilation):
            if 0 <= dilation < np.inf:
                for cell in cells_of(scene.triangles[k], dilation + growth.slack, lattice):
                    lists[cell].append(k)
        loose = np.flatnonzero(np.isinf(growth.dilation)).tolist()
        return cls(lattice, dict(lists), loose, pack(scene.triangles), front_only)

    def find(self, origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, any_hit: bool) -> Found:
        """What the rays hit, one after the other. One without a finite origin and direction is rejected at once."""
        found = Found.nothing(len(t_max))
        with np.errstate(all="ignore"):
            for i in range(len(t_max)):
                if not (np.isfinite(origin[i]).all() and np.isfinite(direction[i]).all() and direction[i].any()):
                    found.rejected[i] = 1
                    continue
                ray = (origin[i], direction[i], t_max[i])
                hit = search(ray, self.lattice, self.lists, self.loose, self.records, any_hit, self.front_only)
                for column, value in zip((found.triangle, found.u, found.v), (hit.triangle, hit.u, hit.v), strict=True):
                    column[i] = value
                found.t[i] = hit.t if hit.triangle >= 0 else np.inf
                found.cells[i], found.tests[i], found.rejected[i] = hit.cells, hit.tests, hit.rejected
        return found
