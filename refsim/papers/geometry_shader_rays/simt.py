"""Divergence: what warps of a given width lose when their lanes branch apart (section 4.1's reason for two shaders).

"Shorter shaders result in lower branching divergence behavior." Here that is counted. A lane is an invocation, and
neighbours in the order of the draw share a warp. A shader is a list of blocks; each lane says how often it runs
each (0: its branch goes elsewhere). A warp issues a block if any of its lanes takes it, and a loop until the last lane
is done. Steps are operations and fetches (`costs`). The loop of triangle tests is taken as one loop over all cells
of a ray, so the account is a lower bound: in lock-step, a warp waits in each cell anew.

When lanes come together again is the machine's choice, so there are two accounts:
    reconverge=True     at the end of each branch, as every SIMT machine does that is known
    reconverge=False    not before the shader ends: each path runs by itself from where it leaves the others
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError

WIDTHS = (8, 16, 32, 64)
QUAD = 4


class Block(NamedTuple):
    """Part of a shader: steps of one run, and int64[lanes] how often each lane runs it. `branch`: whether taking it is
    a lane's choice, and so part of its path (a loop's length is not)."""

    name: str
    steps: int
    trips: NDArray[np.int64]
    branch: bool = True


@dataclass(frozen=True)
class Account:
    """Lane-steps of a shader in a draw. `paths`: distinct paths, summed over warps; `divergent`: warps with several."""

    width: int
    lanes: int
    warps: int
    active: int
    issued: int
    paths: int
    divergent: int

    @property
    def utilisation(self) -> float:
        """Share of the issued lane-steps in which a lane worked; 1 where nothing was issued."""
        return self.active / self.issued if self.issued else 1.0

    @property
    def paths_per_warp(self) -> float:
        """Mean number of distinct paths."""
        return self.paths / self.warps if self.warps else 0.0

    def plus(self, other: Account) -> Account:
        """Both draws together."""
        if self.width != other.width:
            raise InputError(f"accounts of warps of {self.width} and of {other.width} lanes cannot be added.")
        sums = (getattr(self, name) + getattr(other, name) for name in
                ("lanes", "warps", "active", "issued", "paths", "divergent"))  # fmt: skip
        return Account(self.width, *sums)


def account(blocks: Sequence[Block], width: int, reconverge: bool = True, quads: bool = False) -> Account:
    """The account of a shader's blocks, in their order, all of as many lanes.

    `quads`: each lane is the fragment of a point, alone in a quad of 2 × 2 whose other three lanes run along and are
    thrown away. Rasterisers make quads; a viewport's fragments fill theirs, those of points one pixel large do not.
    """
    if width < 1 or (quads and width % QUAD):
        raise InputError(f"warps of {width} lanes cannot be accounted for.")
    lanes = len(blocks[0].trips) if blocks else 0
    if any(len(block.trips) != lanes for block in blocks):
        raise InputError("the blocks of a shader must have the same lanes.")
    copies = QUAD if quads else 1
    warp = np.arange(lanes) * copies // width
    warps = -(-lanes * copies // width)
    code = np.zeros(lanes, np.int64)
    group, groups = warp, warps
    active = issued = 0
    for block in blocks:
        taken = block.trips > 0
        if block.branch:
            code = 2 * code + taken
        if block.branch and not reconverge:
            group, groups = _numbered(warp, code)
        longest = np.zeros(groups, np.int64)
        np.maximum.at(longest, group, block.trips)
        active += block.steps * int(block.trips.sum())
        issued += block.steps * int(longest.sum()) * width
    paths = _numbered(warp, code)
    first = np.zeros(paths[1], np.int64)
    first[paths[0]] = warp
    per_warp = np.bincount(first, minlength=warps)
    return Account(width, lanes, warps, active, issued, paths[1], int((per_warp > 1).sum()))


def _numbered(warp: NDArray[np.int64], code: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Numbers of the distinct (warp, code) pairs, a lane each, and how many there are."""
    if not len(warp):
        return warp, 0
    _, small = np.unique(code, return_inverse=True)
    pairs, number = np.unique(warp * (int(small.max()) + 1) + small.reshape(-1), return_inverse=True)
    return number.reshape(-1), len(pairs)


def pixel_order(width: int, height: int, lanes: int) -> NDArray[np.int64]:
    """Pixels (row-major numbers, −1 outside) in the order in which a viewport quad's fragments fill warps of `lanes`.

    2 × 2 quads, and those of a warp in a tile as square as it can be, or twice as wide as high; tiles row by row.
    """
    if lanes < QUAD or lanes & (lanes - 1):
        raise InputError(f"a tile of {lanes} pixels has no whole quads; give a power of two from 4 on.")
    bits = lanes.bit_length() - 1
    wide, high = 1 << (bits + 1) // 2, 1 << bits // 2
    columns, rows = -(-width // wide), -(-height // high)
    y, x = np.mgrid[: rows * high, : columns * wide]
    inside = (x < width) & (y < height)
    place = (y // high * columns + x // wide) * lanes
    quad = y % high // 2 * (wide // 2) + x % wide // 2
    place = place + quad * QUAD + y % 2 * 2 + x % 2
    order = np.empty(place.size, np.int64)
    order[place.ravel()] = np.where(inside, y * width + x, -1).ravel()
    return order
