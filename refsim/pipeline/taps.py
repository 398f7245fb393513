"""Taps: what a stage's packets held, copied out for tests, pictures and captures. A tap changes no bit and no counter.

`Taps("vertex", "fragment")` handed to `draw` collects one record a draw and stage, in submission order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.layout import Layout

STAGES = ("vertex", "fragment")
MAX_TAPPED = 2**27


@dataclass(frozen=True)
class VertexTap:
    """All vertex invocations of a draw: `position` f32[n, 4] (clip space), `point_size` f32[n], `varyings` by name."""

    label: str
    position: np.ndarray
    point_size: np.ndarray
    varyings: dict[str, np.ndarray]


@dataclass(frozen=True)
class FragmentTap:
    """All fragments of a draw, sorted by (primitive, y, x), which at every pixel is submission order.

    `primitive` i64[n] (number within the draw), `x`, `y` i32[n], `fate` i32[n] (codes of `refsim.pipeline.fragment`),
    `depth` f32[n] in the format's units, `outputs` by name: what the shader returned, written or not.
    """

    label: str
    primitive: np.ndarray
    x: np.ndarray
    y: np.ndarray
    fate: np.ndarray
    depth: np.ndarray
    outputs: dict[str, np.ndarray]


@dataclass
class Taps:
    """Collects records of the stages named; `vertex` and `fragment` hold one a draw."""

    stages: tuple[str, ...]
    vertex: list[VertexTap] = field(default_factory=list)
    fragment: list[FragmentTap] = field(default_factory=list)

    def __init__(self, *stages: str) -> None:
        unknown = [stage for stage in stages if stage not in STAGES]
        if unknown:
            raise InputError(f"there is no stage {unknown[0]!r} to tap; stages are {', '.join(STAGES)}.")
        self.stages = stages or STAGES
        self.vertex = []
        self.fragment = []

    def wants(self, stage: str) -> bool:
        """Whether `stage` is tapped."""
        return stage in self.stages


def check_size(label: str, count: int) -> None:
    """Refuses taps that would not fit."""
    if count > MAX_TAPPED:
        raise InputError(f"tapping {label!r} would copy {count} records, more than {MAX_TAPPED}; draw a smaller image.")


def by_field(layout: Layout, floats: np.ndarray, ints: np.ndarray) -> dict[str, Any]:
    """Columns [k, n] as arrays by field name: [n] for scalars, [n, size] for vectors."""
    named = {}
    for part in layout.fields:
        columns = (floats if part.kind == "f" else ints)[part.first : part.first + part.size]
        named[part.name] = columns[0].copy() if part.size == 1 else np.ascontiguousarray(columns.T)
    return named


class FragmentRecorder:
    """Gathers one draw's fragments batch by batch, then sorts them into submission order."""

    def __init__(self, label: str, outputs: Layout) -> None:
        self.label, self.outputs = label, outputs
        self._parts: list[tuple[np.ndarray, ...]] = []
        self._count = 0

    def columns(self, count: int) -> tuple[np.ndarray, ...]:
        """Empty columns for the next `count` fragments: primitive, pixel, fate, depth, floats, ints."""
        self._count += count
        check_size(self.label, self._count)
        return (
            np.empty(count, np.int32),
            np.empty((2, count), np.int32),
            np.empty(count, np.int32),
            np.empty(count, np.float32),
            np.empty((self.outputs.floats, count), np.float32),
            np.empty((self.outputs.ints, count), np.int32),
        )

    def add(self, source: np.ndarray, columns: tuple[np.ndarray, ...]) -> None:
        """Keeps filled columns; `source` i64 maps their primitives to numbers within the draw."""
        self._parts.append((source[columns[0]], *columns[1:]))

    def record(self) -> FragmentTap:
        """The whole draw, sorted."""
        none = (np.empty(0, np.int64), *self.columns(0)[1:])
        primitive, pixel, fate, depth, floats, ints = (
            np.concatenate(column, axis=-1) for column in zip(*(self._parts or [none]), strict=True)
        )
        order = np.lexsort((pixel[0], pixel[1], primitive))
        outputs = by_field(self.outputs, floats[:, order], ints[:, order])
        return FragmentTap(
            self.label, primitive[order], pixel[0][order], pixel[1][order], fate[order], depth[order], outputs
        )
