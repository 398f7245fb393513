"""Runs the geometry stage in slices and hands on what it emits: to stream output, to the rasteriser, to a tap.

Threads share slices of input primitives, each with columns of its own; a slice is small enough that memory stays
bounded even if every entry emits. Output primitives are numbered by adding up the slices before, so no number depends
on threads. A pipeline without a geometry shader that captures runs through here too: its primitives pass unchanged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.assembly import NO_TABLE
from refsim.pipeline.front import Feed
from refsim.pipeline.layout import Layout
from refsim.pipeline.rounds import SMALLEST_SLICE, Scratch
from refsim.pipeline.state import GeometryState
from refsim.pipeline.taps import GeometryTap, by_field, check_size
from refsim.pipeline.threads import run_all

if TYPE_CHECKING:
    from refsim.pipeline.program import Program

EMITTED_ROWS = 2**18  # of a slice
ROUND_ROWS = 2**20  # of all slices that run together
SLICES_A_THREAD = 2  # some cost much more than others; two threads: 2 is quicker than 1 or 4


@dataclass
class Emitted:
    """What one slice emitted, in the columns of `refsim.pipeline.geometry.amplify`.

    `first` is the number of its first input primitive, `first_out` of its first output primitive; `vertices` and
    `primitives` say how many rows of the columns are filled.
    """

    first: int
    position: np.ndarray
    size: np.ndarray
    floats: np.ndarray
    ints: np.ndarray
    origin: np.ndarray
    corners: np.ndarray
    first_out: int = 0
    vertices: int = 0
    primitives: int = 0

    @property
    def columns(self) -> tuple[np.ndarray, ...]:
        """All columns, in the order in which the kernels take them."""
        return self.position, self.size, self.floats, self.ints, self.origin, self.corners

    def feed(self, kernel: Any, arguments: Any) -> Feed:
        """The output primitives for the front end `kernel`: points take every row, triangles are indexed."""
        buffers = ((self.position, self.size), (self.floats, self.ints))
        indices, n = self.corners[: self.primitives].reshape(-1), self.primitives
        return Feed(kernel, arguments, buffers, indices, NO_TABLE, n, n, self.first_out)


def emissions(program: Program, arguments: Any, call: Any, threads: int, scratch: Scratch) -> Iterator[list[Emitted]]:
    """All that the geometry stage of a draw emits, a few slices a thread at a time, in order."""
    stage, kernel = cast(GeometryState, program.emission), program.amplify
    primitives = call.assembly.primitives * call.instances
    together = threads if threads == 1 else SLICES_A_THREAD * threads
    rows = min(EMITTED_ROWS, ROUND_ROWS // threads) * threads // together
    size = min(max(-(-primitives // together), SMALLEST_SLICE), max(rows // max(stage.max_vertices, 1), 1))
    first_out = 0
    for first in range(0, primitives, size * together):
        counts = [min(size, primitives - at) for at in range(first, primitives, size)[:together]]
        parts = [_columns(stage, first + k * size, count, k, scratch) for k, count in enumerate(counts)]

        def run(part: Emitted, count: int) -> None:
            totals = np.zeros(3, np.int64)
            kernel(
                *arguments, call.buffers, call.indices, call.assembly.table, call.assembly.primitives, part.first,
                count, *part.columns, totals,
            )  # fmt: skip
            part.vertices, part.primitives = int(totals[0]), int(totals[1])
            if totals[2]:
                raise InputError(
                    f"{program.pipeline.label}: the geometry shader returned {totals[2]} emissions that are neither "
                    "SKIP (0) nor EMIT (1) nor EMIT_AND_END (2)."
                )

        pairs = zip(parts, counts, strict=True)
        run_all(program.pipeline.label, threads, [lambda part=part, n=n: run(part, n) for part, n in pairs])
        for part in parts:
            part.first_out = first_out
            first_out += part.primitives
        yield parts


def _columns(stage: GeometryState, first: int, count: int, part: int, scratch: Scratch) -> Emitted:
    """Room for every entry of `count` invocations."""
    rows = count * stage.max_vertices
    layout = Layout.of(stage.varyings)

    def column(name: str, width: tuple[int, ...], dtype: type) -> np.ndarray:
        return scratch.array(f"emitted.{name}.{part}", (rows, *width), dtype)

    return Emitted(
        first, column("position", (4,), np.float32), column("size", (), np.float32),
        column("floats", (layout.floats,), np.float32), column("ints", (layout.ints,), np.int32),
        column("origin", (), np.int32),
        scratch.array(f"emitted.corners.{part}", (rows if stage.output.is_triangles else 0, 3), np.int32),
    )  # fmt: skip


class GeometryRecorder:
    """Gathers what the geometry stage of a draw emits, slice by slice."""

    def __init__(self, program: Program, call: Any) -> None:
        self._label, self._topology = program.pipeline.label, program.pipeline.topology
        self._stage, self._assembly = cast(GeometryState, program.emission), call.assembly
        self._count = 0
        self._parts: list[tuple[np.ndarray, ...]] = []

    def add(self, part: Emitted) -> None:
        """Copies a slice. Raises `InputError` where the tap would not fit."""
        stage, n = self._stage, part.vertices
        check_size(self._label, self._count + n)
        if stage.output.is_triangles:
            primitives = part.corners[: part.primitives].astype(np.int64) + self._count
        else:
            primitives = np.arange(self._count, self._count + n, dtype=np.int64)[:, None]
        invocation, entry = np.divmod(part.origin[:n].astype(np.int64), max(stage.max_vertices, 1))
        columns = (part.position[:n].copy(), part.size[:n].copy(), part.floats[:n].copy(), part.ints[:n].copy())
        self._parts.append((*columns, invocation + part.first, entry.astype(np.int32), primitives))
        self._count += n

    @cached_property
    def record(self) -> GeometryTap:
        """The whole draw, once it is."""
        if not self._parts:
            self.add(_columns(self._stage, 0, 0, 0, Scratch()))
        position, size, floats, ints, invocation, entry, primitives = (
            np.concatenate(column) for column in zip(*self._parts, strict=True)
        )
        varyings = by_field(Layout.of(self._stage.varyings), floats.T, ints.T)
        vertices = self._assembly.invocations(self._topology, invocation)
        return GeometryTap(self._label, position, size, varyings, invocation, entry, vertices, primitives)
