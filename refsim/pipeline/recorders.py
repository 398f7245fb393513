"""Gathers what the rasteriser and the fragment stage hand to a tap, batch by batch, and puts it in submission order."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refsim.pipeline.rounds import Round
from refsim.pipeline.taps import FragmentTap, RasterTap, Taps, by_field, check_size

if TYPE_CHECKING:
    from refsim.pipeline.program import Program

Lineage = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class FragmentRecorder:
    """One draw's fragments."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._parts: list[tuple[np.ndarray, ...]] = []
        self._count = 0

    def columns(self, count: int) -> tuple[np.ndarray, ...]:
        """Empty columns for the next `count` fragments: primitive, pixel, fate, depth, what the shader returned, what
        the targets hold."""
        self._count += count
        check_size(self._program.pipeline.label, self._count)
        outputs, writes = self._program.outputs, self._program.writes
        return (
            np.empty(count, np.int32),
            np.empty((2, count), np.int32),
            np.empty(count, np.int32),
            np.empty(count, np.float32),
            np.empty((outputs.floats, count), np.float32),
            np.empty((outputs.ints, count), np.int32),
            np.empty((writes.floats, count), np.float32),
            np.empty((writes.ints, count), np.int32),
        )

    def add(self, source: np.ndarray, columns: tuple[np.ndarray, ...]) -> None:
        """Keeps filled columns; `source` i64 maps their primitives to numbers within the draw."""
        self._parts.append((source[columns[0]], *columns[1:]))

    def record(self, lineage: Lineage) -> FragmentTap:
        """The whole draw, sorted."""
        none = (np.empty(0, np.int64), *self.columns(0)[1:])
        primitive, pixel, fate, depth, floats, ints, stored_floats, stored_ints = (
            np.concatenate(column, axis=-1) for column in zip(*(self._parts or [none]), strict=True)
        )
        order = np.lexsort((pixel[0], pixel[1], primitive))
        outputs = self._program.outputs
        targets = self._program.target_fields
        return FragmentTap(
            self._program.pipeline.label, primitive[order], pixel[0][order], pixel[1][order], fate[order], depth[order],
            by_field(outputs, floats[:, order], ints[:, order]),
            by_field(outputs, stored_floats[:, order], stored_ints[:, order], targets),
            *lineage(primitive[order]),
        )  # fmt: skip


class RasterRecorder:
    """One draw's primitives as they leave the rasteriser's set-up, and the fates of all."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._parts: list[tuple[np.ndarray, ...]] = []
        self._fates: list[np.ndarray] = []
        self._count = 0

    def add(self, part: Round) -> None:
        """Copies what is left of a round. Rounds come in the order of their primitives."""
        self._fates.append(part.became.astype(np.int32))
        rows = part.survivors()
        self._count += len(rows)
        check_size(self._program.pipeline.label, self._count)
        if self._program.triangles:
            corner, plane = part.corner[rows], part.plane[rows]
            front, corners, depth = corner[:, 6] != 0, corner[:, :6].reshape(-1, 3, 2), plane[:, :3] + plane[:, 6:7]
        else:
            front, corners = np.ones(len(rows), bool), np.empty((0, 3, 2), np.int32)
            depth = part.depth[rows][:, None]
        self._parts.append((part.source[rows], part.rect[rows], front, corners, depth))

    def record(self, lineage: Lineage) -> RasterTap:
        """The whole draw."""
        corners = 3 if self._program.triangles else 1
        none = (
            np.empty(0, np.int64), np.empty((0, 4), np.int32), np.empty(0, bool), np.empty((0, 3, 2), np.int32),
            np.empty((0, corners), np.float32),
        )  # fmt: skip
        primitive, rect, front, edges, depth = (
            np.concatenate(column) for column in zip(*(self._parts or [none]), strict=True)
        )
        fate = np.concatenate([*self._fates, np.empty(0, np.int32)])
        label = self._program.pipeline.label
        return RasterTap(label, primitive, rect, front, edges, depth, *lineage(primitive), fate)


class Recorders(NamedTuple):
    """Those that a draw's taps ask for."""

    raster: RasterRecorder | None
    fragment: FragmentRecorder | None

    @staticmethod
    def of(program: Program, taps: Taps | None) -> Recorders:
        """Empty recorders."""
        rasterised = taps is not None and not program.pipeline.rasterizer_discard
        return Recorders(
            RasterRecorder(program) if rasterised and taps is not None and taps.wants("raster") else None,
            FragmentRecorder(program) if rasterised and taps is not None and taps.wants("fragment") else None,
        )

    @property
    def any(self) -> bool:
        """Whether something is recorded."""
        return self.raster is not None or self.fragment is not None

    def record(self, taps: Taps, lineage: Lineage) -> None:
        """Hands the taps the whole draw."""
        if self.raster is not None:
            taps.raster.append(self.raster.record(lineage))
        if self.fragment is not None:
            taps.fragment.append(self.fragment.record(lineage))
