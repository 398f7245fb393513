"""The traversal on a SIMT machine: rays mapped to warps, lock-step, divergence, and what a counter there would report.

The pseudo-code of section 2.1 is one loop with one branch. A warp's lanes go round together, each at its own element,
until the last is done; in an iteration the warp issues the sphere test if a lane has a sphere, and the triangle test
if a lane has a triangle. The paper's counter ("# traversed nodes per sec.", Tables 1 and 2) says 1,077 to 1,954 nodes a
ray where a list of a scene has 222 triangles (BSH-E3, E4). What it counts is not said; `READINGS` names what it might.

    width       lanes of a warp: 32 on the paper's GTX 280, any number from 1 on
    mapping     which rays share a warp: `map_rays`
    line        bytes of a memory line, for the fetches of one warp that fall together
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.search import by_list, tile_order
from refsim.papers.sphere_hierarchy.visits import FETCH_BYTES, Layout, Recorder, Shot
from refsim.papers.sphere_hierarchy.warp_lanes import COLUMNS, NODES, account_warps

WIDTH = 32
LINE = 64  # that of `texture_cache.GT200`
MAPPINGS = ("rows", "square", "morton", "tiles", "lists", "random")
Order = NDArray[np.int32]


def map_rays(
    mapping: str, width: int, height: int, lanes: int = WIDTH, *, lists: NDArray[np.int32] | None = None, seed: int = 0
) -> Order:
    """The rays of a picture of width × height pixels as rows of warps, i32[warps, lanes]; −1 is a lane without a ray.

    "rows"      consecutive pixels of a row; no warp has pixels of two
    "8x4", …    a tile of that many columns and rows, which make `lanes` together; tiles row by row
    "square"    a tile as square as a power of two of lanes allows, or twice as wide as high
    "morton"    the pixels on Morton's curve, cut into warps
    "tiles"     8 × 8 pixels in 16 × 16, as the packets of `search` go, cut into warps
    "lists"     the same, those of one list (`lists` i32[n]) together: warps hardly mix lists
    "random"    any pixels, from a seed
    """
    if lanes < 1:
        raise InputError(f"a warp of {lanes} lanes cannot hold rays; give at least 1.")
    pixels = np.arange(width * height, dtype=np.int32)
    tile = (lanes, 1) if mapping == "rows" else _square(lanes) if mapping == "square" else _tile(mapping)
    if tile is not None:
        if tile[0] * tile[1] != lanes:
            raise InputError(f"a tile of {tile[0]} × {tile[1]} pixels does not fill a warp of {lanes} lanes.")
        return _tiled(width, height, *tile)
    if mapping == "morton":
        y, x = np.divmod(pixels, np.int32(width))
        return _cut(pixels[np.argsort(_spread(x) | _spread(y) << 1, kind="stable")], lanes)
    if mapping == "tiles":
        return _cut(tile_order(width, height, len(pixels)), lanes)
    if mapping == "lists":
        if lists is None:
            raise InputError('the mapping "lists" needs the list of each ray.')
        return _cut(by_list(tile_order(width, height, len(pixels)), lists), lanes)
    if mapping == "random":
        return _cut(np.random.default_rng(seed).permutation(pixels), lanes)
    raise InputError(f"mapping is {mapping!r}; it must be a tile like '8x4', or one of {', '.join(MAPPINGS)}.")


def without(order: Order, dead: NDArray[np.bool_]) -> Order:
    """The same order with the dead rays left out and the others moved up, as a machine that compacts rays would."""
    rows = order[order >= 0]
    return _cut(rows[~dead[rows]], order.shape[1])


def _tile(mapping: str) -> tuple[int, int] | None:
    found = re.fullmatch(r"(\d+)x(\d+)", mapping)
    return None if found is None else (int(found[1]), int(found[2]))


def _square(lanes: int) -> tuple[int, int]:
    if lanes & (lanes - 1):
        raise InputError(f"{lanes} lanes make no square tile; give a power of two, or name the tile.")
    bits = lanes.bit_length() - 1
    return 1 << (bits + 1) // 2, 1 << bits // 2


def _tiled(width: int, height: int, wide: int, high: int) -> Order:
    columns, rows = -(-width // wide), -(-height // high)
    y, x = np.mgrid[: rows * high, : columns * wide]
    pixel = np.where((x < width) & (y < height), y * width + x, -1).astype(np.int32)
    return np.ascontiguousarray(pixel.reshape(rows, high, columns, wide).swapaxes(1, 2).reshape(-1, wide * high))


def _spread(value: NDArray[np.int32]) -> NDArray[np.int64]:
    """Bit b moves to place 2 b."""
    spread = np.zeros(len(value), np.int64)
    for b in range(31):
        spread |= (value.astype(np.int64) >> b & 1) << 2 * b
    return spread


def _cut(rows: NDArray[np.int32], lanes: int) -> Order:
    order = np.full((-(-len(rows) // lanes), lanes), -1, np.int32)
    order.ravel()[: len(rows)] = rows
    return order


@dataclass(frozen=True)
class Account:
    """Sums over warps. A warp without a ray that visits anything is none.

    rays              live rays; those of a finished path are idle lanes
    warps, nodes, triangle_tests
    iterations        of warps: the longest of its lanes' lists of visited elements
    distinct          elements, once in each iteration of a warp however many lanes are at them
    sphere_issues, triangle_issues   iterations in which a warp issued that branch
    packet            elements of a warp, once at all: what it visits where its lanes walk their lists as one packet
    escape_lines, payload_lines, vertex_lines   memory lines, once in each fetch of a warp (three for vertices)
    """

    width: int
    line: int
    rays: int
    warps: int
    nodes: int
    triangle_tests: int
    iterations: int
    distinct: int
    sphere_issues: int
    triangle_issues: int
    packet: int
    escape_lines: int
    payload_lines: int
    vertex_lines: int

    @property
    def utilisation(self) -> float:
        """Share of the lanes that have an element, over all iterations; 1 where there was none."""
        return _share(self.nodes, self.iterations * self.width)

    @property
    def sphere_utilisation(self) -> float:
        """Share of the lanes that test a sphere, where a warp does."""
        return _share(self.nodes - self.triangle_tests, self.sphere_issues * self.width)

    @property
    def triangle_utilisation(self) -> float:
        """Share of the lanes that test a triangle, where a warp does."""
        return _share(self.triangle_tests, self.triangle_issues * self.width)

    @property
    def packet_utilisation(self) -> float:
        """Share of the lanes that are at the element of their packet."""
        return _share(self.nodes, self.packet * self.width)

    @property
    def lines(self) -> int:
        """Memory lines of all fetches."""
        return self.escape_lines + self.payload_lines + self.vertex_lines

    @property
    def fetched_bytes(self) -> int:
        """What the lanes ask for: escape index and payload of a node, three vertices of a triangle."""
        return self.nodes * (FETCH_BYTES[0] + FETCH_BYTES[1]) + 3 * FETCH_BYTES[2] * self.triangle_tests

    def plus(self, other: Account) -> Account:
        """Both shots together."""
        if (self.width, self.line) != (other.width, other.line):
            raise InputError("accounts of other warps or lines cannot be added.")
        names = [field.name for field in fields(self)][2:]
        return Account(self.width, self.line, *(getattr(self, name) + getattr(other, name) for name in names))


def _share(part: int, whole: int) -> float:
    return part / whole if whole else 1.0


def account(shots: Iterable[Shot], order: Order, *, line: int = LINE, threads: int | None = None) -> Account:
    """The account of shots whose rays go in the same warps, as those that a kernel shoots one after another."""
    total: Account | None = None
    for shot in shots:
        table = warp_table(shot, order, line=line, threads=threads)
        rows = order[order >= 0]
        live, busy = int((shot.rays.t_max[rows] > 0).sum()), int((table[:, NODES] > 0).sum())
        own = Account(order.shape[1], line, live, busy, *table.sum(axis=0).tolist())
        total = own if total is None else total.plus(own)
    if total is None:
        raise InputError("an account needs a shot.")
    return total


def warp_table(shot: Shot, order: Order, *, line: int = LINE, threads: int | None = None) -> NDArray[np.int64]:
    """What an account sums, a warp a row: i64[warps, columns], `nodes` and what follows it in `Account`."""
    if line < 1:
        raise InputError(f"a memory line of {line} bytes holds nothing; give at least 1.")
    if order.size and int(order.max()) >= len(shot.rays):
        raise InputError(f"the order names ray {int(order.max())}, and the shot has {len(shot.rays)} rays.")
    width = order.shape[1]
    layout, count = Layout.of(shot.layers), specialise(account_warps, {})
    table = np.zeros((len(order), COLUMNS), np.int64)
    done = 0
    for visits in Recorder(shot, threads).chunks(order):
        part = table[done : done + len(visits.rows) // width]
        count(width, line, visits.offsets, visits.elements, layout.escape, layout.payload, layout.bases, part)
        done += len(part)
    return table


# What a counter of "traversed nodes" might have counted, from an account to a number a ray. The plain ones first; a
# counter that every lane of a warp adds to, or one that is multiplied up by the host, is one of these times the width.
READINGS: dict[str, Callable[[Account], float]] = {
    "nodes": lambda a: a.nodes / a.rays,  # of its own thread
    "iterations": lambda a: a.iterations / a.rays,  # one a warp
    "distinct": lambda a: a.distinct / a.rays,  # a fetch that a warp's lanes share counts once
    "packet": lambda a: a.packet / a.rays,  # the warp walks as one
    "issues": lambda a: (a.sphere_issues + a.triangle_issues) / a.rays,  # both sides of the branch
    "lines": lambda a: a.lines / a.rays,  # memory transactions
    "texels": lambda a: (2 * a.nodes + 3 * a.triangle_tests) / a.rays,  # texture fetches of the thread
    "bytes": lambda a: a.fetched_bytes / a.rays,  # asked for by the thread
    "line bytes": lambda a: a.lines * a.line / a.rays,  # moved by those transactions
    "nodes × width": lambda a: a.nodes * a.width / a.rays,
    "iterations × width": lambda a: a.iterations * a.width / a.rays,  # all lanes count while one works
    "iterations × width²": lambda a: a.iterations * a.width**2 / a.rays,  # and the host multiplies again
    "distinct × width": lambda a: a.distinct * a.width / a.rays,
    "packet × width": lambda a: a.packet * a.width / a.rays,  # all lanes count every element of the warp
    "packet × width²": lambda a: a.packet * a.width**2 / a.rays,
    "issues × width": lambda a: (a.sphere_issues + a.triangle_issues) * a.width / a.rays,
    "lines × width": lambda a: a.lines * a.width / a.rays,
    "nodes of a warp": lambda a: a.nodes / a.warps,  # the warps' mean, where "a ray" is a warp
    "iterations of a warp": lambda a: a.iterations / a.warps,
    "packet of a warp": lambda a: a.packet / a.warps,
}


def readings(account: Account) -> dict[str, float]:
    """Every reading of an account that has rays and warps: counts or bytes a ray, those "of a warp" a warp.

    `READINGS` says what each sums; "× width" is a ray's count times the lanes of a warp. Raises `InputError`.
    """
    if not account.rays or not account.warps:
        raise InputError("an account without rays has no counts a ray.")
    return {name: read(account) for name, read in READINGS.items()}
