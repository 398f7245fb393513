"""A round of primitives after the vertex stage, in columns that are used again from draw to draw.

A draw of a million primitives runs in rounds, so that memory is bounded whatever the number of threads. The columns of
a round are megabytes that the system would hand out and clear page by page at every draw; a `Scratch` keeps them.
"""

from __future__ import annotations

import math

import numpy as np

from refsim.pipeline.program import Program

ROUND_PRIMITIVES = 2**19
SMALLEST_SLICE = 2**13
KEPT_BYTES = 2**27

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

    Threads fill slices of `size` primitives each, from row slice · size on. `fates` i64[slices, 5]: drawn, clipped,
    empty, crooked, pixels covered.
    """

    def __init__(self, program: Program, first: int, count: int, size: int, scratch: Scratch) -> None:
        self.first, self.count, self.size = first, count, size
        self.rect = scratch.array("rect", (count, 4), np.int32)
        self.depth = scratch.array("depth", (count,), np.float32)
        self.source = scratch.array("source", (count,), np.int64)
        self.floats = scratch.array("floats", (count, program.varyings.floats), np.float32)
        self.ints = scratch.array("ints", (count, program.varyings.ints), np.int32)
        self.fates = np.zeros((-(-count // size), 5), np.int64)

    def columns(self, part: int) -> tuple[np.ndarray, ...]:
        """The columns of one slice, to be filled."""
        rows = slice(part * self.size, min((part + 1) * self.size, self.count))
        return (self.rect[rows], self.depth[rows], self.source[rows], self.floats[rows], self.ints[rows])

    def survivors(self) -> np.ndarray:
        """Rows of the survivors in submission order, int32."""
        kept = [np.arange(k * self.size, k * self.size + n, dtype=np.int32) for k, n in enumerate(self.fates[:, 0])]
        return np.concatenate(kept)


def slice_size(primitives: int, threads: int) -> int:
    """Primitives a thread takes in a round."""
    return min(max(-(-primitives // threads), SMALLEST_SLICE), max(ROUND_PRIMITIVES // threads, 1))
