"""A round of primitives after the vertex stage, in columns that are used again from draw to draw.

A draw of a million primitives runs in rounds, so that memory is bounded whatever the number of threads. The columns of
a round are megabytes that the system would hand out and clear page by page at every draw; a `Scratch` keeps them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from refsim.pipeline.triangle import CORNER_COLUMNS, PLANE_COLUMNS

if TYPE_CHECKING:
    from refsim.pipeline.program import Program

ROUND_PRIMITIVES = 2**19
SMALLEST_SLICE = 2**13
KEPT_BYTES = 2**27
LINE = 16  # words of a cache line

_spare: list[Scratch] = []


class Scratch:
    """Named blocks of memory that grow when needed. Borrow one for a draw and give it back; contents mean nothing."""

    def __init__(self) -> None:
        self._blocks: dict[str, np.ndarray] = {}

    @staticmethod
    def borrow() -> Scratch:
        """One that nobody else uses."""
        try:
            return _spare.pop()
        except IndexError:
            return Scratch()

    def give_back(self) -> None:
        """Keeps the memory for the next draw, unless it is very much or another is kept already."""
        if not _spare and sum(block.nbytes for block in self._blocks.values()) <= KEPT_BYTES:
            _spare.append(self)

    def array(self, name: str, shape: tuple[int, ...], dtype: type) -> np.ndarray:
        """An uninitialised C-contiguous array; one of the same name loses its memory to it."""
        size = math.prod(shape) * np.dtype(dtype).itemsize
        if name not in self._blocks or self._blocks[name].nbytes < size:
            self._blocks[name] = np.empty(size, np.uint8)
        return self._blocks[name][:size].view(dtype).reshape(shape)


class Round:
    """Primitives [first, first + count) after the vertex stage: survivors in columns, and what became of the rest.

    Threads fill slices of `size` primitives each, from row slice · `rows` on. `fates` i64[slices, 8]: rows, clipped,
    empty, crooked, pixels covered (of triangles: in bounding boxes), culled, primitives drawn, pieces of clipped ones.
    `became` i8[count] is the fate of each primitive of the round, drawn or not.
    """

    def __init__(self, program: Program, first: int, count: int, size: int, rows: int, scratch: Scratch) -> None:
        self.first, self.count, self.size, self.rows = first, count, size, rows
        self._scratch = scratch
        slices = -(-count // size)
        total = slices * rows
        self.depth = scratch.array("depth", (total,), np.float32)
        self.source = scratch.array("source", (total,), np.int64)
        widths: tuple[int, ...] = (4, program.spread.floats, program.spread.ints)
        if program.triangles:
            # A bin takes triangles from here and there: all of one lies together, or every part would be a cache miss
            widths += (CORNER_COLUMNS, PLANE_COLUMNS)
            words = scratch.array("triangles", (total, -(-sum(widths) // LINE) * LINE), np.int32)
            parts = np.split(words, np.cumsum(widths), axis=1)
            self.rect, self.ints, self.corner = parts[0], parts[2], parts[3]
            self.floats, self.plane = parts[1].view(np.float32), parts[4].view(np.float32)
        else:
            self.rect = scratch.array("rect", (total, 4), np.int32)
            self.floats = scratch.array("floats", (total, widths[1]), np.float32)
            self.ints = scratch.array("ints", (total, widths[2]), np.int32)
            self.corner, self.plane = np.empty((0, CORNER_COLUMNS), np.int32), np.empty((0, PLANE_COLUMNS), np.float32)
        self.became = scratch.array("became", (count,), np.int8)
        self.fates = np.zeros((slices, 8), np.int64)

    def with_rows(self, program: Program, rows: int) -> Round:
        """The same primitives with more rows a slice, to be filled again."""
        return Round(program, self.first, self.count, self.size, rows, self._scratch)

    def slice_of(self, part: int) -> tuple[int, int]:
        """The first primitive of a slice, and how many there are."""
        return self.first + part * self.size, min(self.size, self.count - part * self.size)

    def columns(self, part: int) -> tuple[np.ndarray, ...]:
        """The columns of one slice, to be filled: a row a survivor, and last the fates, one a primitive."""
        rows = slice(part * self.rows, (part + 1) * self.rows)
        every = (self.rect, self.depth, self.source, self.floats, self.ints, self.corner, self.plane)
        first = part * self.size
        return (*(column[rows] for column in every), self.became[first : first + self.size])

    @property
    def primitives(self) -> tuple[np.ndarray, ...]:
        """The columns as the fragment stage takes them."""
        return (self.rect, self.depth, self.floats, self.ints, self.corner, self.plane)

    def survivors(self) -> np.ndarray:
        """Rows of the survivors in submission order, int32."""
        kept = [np.arange(k * self.rows, k * self.rows + n, dtype=np.int32) for k, n in enumerate(self.fates[:, 0])]
        return np.concatenate(kept)


def slice_size(primitives: int, threads: int) -> int:
    """Primitives a thread takes in a round."""
    return min(max(-(-primitives // threads), SMALLEST_SLICE), max(ROUND_PRIMITIVES // threads, 1))
