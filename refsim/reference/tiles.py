"""Tiles of rays: which pixels, which cone around them, which triangles their sprites are drawn for.

The Hierarchical Ray Engine, sections 3 and 4; the equations are in `refsim.reference.cone`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from refsim.reference import cone
from refsim.results import Cones, TileState


def errata_of(option: str | Sequence[str]) -> cone.Errata:
    """The option `errata`: "corrected", "as_printed", or names such as "HRE-E1,HRE-E4"; already checked."""
    if option == "corrected":
        return cone.CORRECTED
    if option == "as_printed":
        return cone.Errata(*[True] * len(cone.Errata._fields))
    names = option.split(",") if isinstance(option, str) else option
    return cone.Errata(**{str(name).strip().upper().removeprefix("HRE-"): True for name in names})


class Tiles:
    """Tiles of an image, row-major; the last row and column may reach past it (padding has no rays).

    `of_pixel` int64[width · height]: the tile of a pixel. `pixels` int64[count, size²]: pixels of a tile row by row,
    −1 past the image.
    """

    def __init__(self, width: int, height: int, size: int) -> None:
        self.size, self.columns, self.rows = size, -(-width // size), -(-height // size)
        self.count = self.columns * self.rows
        number = np.full((self.rows * size, self.columns * size), -1, np.int64)
        number[:height, :width] = np.arange(width * height).reshape(height, width)
        cut = number.reshape(self.rows, size, self.columns, size).swapaxes(1, 2)
        self.pixels = cut.reshape(self.count, size * size)
        y, x = np.divmod(np.arange(width * height), width)
        self.of_pixel = y // size * self.columns + x // size


@dataclass(frozen=True)
class TileCones:
    """Cones of all tiles as the cone pass leaves them, with their slack (−inf empty, +inf unbounded)."""

    tiles: Tiles
    cones: cone.Cones
    slack: np.ndarray

    @classmethod
    def around(
        cls, tiles: Tiles, origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, printed: cone.Errata
    ) -> TileCones:
        """Section 4: live rays enter their tile's cone row by row."""
        live = (tiles.pixels >= 0) & (t_max[tiles.pixels] > 0)
        # Live rays move to the front in the same order: dead ones change nothing, and then no pass is spent on them
        order = np.argsort(~live, axis=1, kind="stable")[:, : max(int(live.sum(axis=1).max()), 1)]
        rows, live = np.take_along_axis(tiles.pixels, order, axis=1), np.take_along_axis(live, order, axis=1)
        return cls(tiles, *cone.build(origin[rows], direction[rows], live, printed))

    def meet(self, centre: np.ndarray, radius: np.ndarray, printed: cone.Errata) -> np.ndarray:
        """bool[tiles]: the sprite is drawn, for the triangle in that sphere (centre [3])."""
        return cone.meets_sphere(self.cones, self.slack, centre, radius, printed)

    def result(self) -> Cones:
        """As a generation carries them."""
        c = self.cones
        angle = cone.half_angle(c).astype(c.cos.dtype)
        angle[c.state == TileState.EMPTY] = 0.0
        return Cones(c.apex, c.axis, angle, c.state, self.slack, self.tiles.columns, self.tiles.rows, self.tiles.size)
