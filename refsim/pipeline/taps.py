"""Taps: what a stage's packets held, copied out for tests, pictures and captures. A tap changes no bit and no counter.

`Taps("vertex", "fragment")` handed to `draw` collects one record a draw and stage, in submission order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.layout import Field, Layout

STAGES = ("vertex", "geometry", "stream_output", "raster", "fragment")
MAX_TAPPED = 2**27


@dataclass(frozen=True)
class VertexTap:
    """All vertex invocations of a draw: `position` f32[n, 4] (clip space), `point_size` f32[n], `varyings` by name."""

    label: str
    position: np.ndarray
    point_size: np.ndarray
    varyings: dict[str, np.ndarray]


@dataclass(frozen=True)
class GeometryTap:
    """All that the geometry stage of a draw emitted, in order: `position` f32[n, 4], `point_size` f32[n], `varyings`.

    Emitted vertex i is entry `entry[i]` i32 of what invocation `invocation[i]` i64 returned, made from the vertex
    invocations `vertices[i]` i64[corners], which are rows of the vertex tap. `primitives` i64[m, 1 or 3] are the output
    primitives, as rows of this tap.
    """

    label: str
    position: np.ndarray
    point_size: np.ndarray
    varyings: dict[str, np.ndarray]
    invocation: np.ndarray
    entry: np.ndarray
    vertices: np.ndarray
    primitives: np.ndarray


@dataclass(frozen=True)
class StreamOutputTap:
    """What a draw captured: `records` by field, which stand in the buffer from row `first_row` on, and the numbers of
    the captured primitives i64[m] (output primitives of the draw; `primitives` of the geometry tap)."""

    label: str
    records: dict[str, np.ndarray]
    first_row: int
    primitives: np.ndarray


@dataclass(frozen=True)
class RasterTap:
    """What the rasteriser set up for the fragment stage, in submission order: points, quads, triangles and the pieces
    of clipped triangles.

    `primitive` i64[n] (number within the draw; pieces share it); `rect` i32[n, 4] the pixels that bound it, x0, y0, x1,
    y1, half open; `front` bool[n]; `corners` i32[n, 3, 2] of triangles, in 1/256 pixel, clockwise on the screen (no
    rows for others); `depth` f32[n, 3] at the corners with the bias of each triangle, f32[n, 1] for others.
    `vertices` and `invocation` as of `FragmentTap`.
    """

    label: str
    primitive: np.ndarray
    rect: np.ndarray
    front: np.ndarray
    corners: np.ndarray
    depth: np.ndarray
    vertices: np.ndarray
    invocation: np.ndarray


@dataclass(frozen=True)
class FragmentTap:
    """All fragments of a draw, sorted by (primitive, y, x), which at every pixel is submission order.

    `primitive` i64[n] (number within the draw), `x`, `y` i32[n], `fate` i32[n] (codes of `refsim.pipeline.fragment`),
    `depth` f32[n] in the format's units, `outputs` by name: what the shader returned, written or not; `stored` by
    name: what the colour targets held after the fragment. `vertices` i64[n, corners] are the primitive's vertices: rows
    of the geometry tap if there is a geometry shader, of the vertex tap if not; `invocation` i64[n] is the run of the
    geometry shader that emitted it, −1 without one.
    """

    label: str
    primitive: np.ndarray
    x: np.ndarray
    y: np.ndarray
    fate: np.ndarray
    depth: np.ndarray
    outputs: dict[str, np.ndarray]
    stored: dict[str, np.ndarray]
    vertices: np.ndarray
    invocation: np.ndarray


@dataclass
class Taps:
    """Collects records of the stages named; every list holds one a draw that has the stage."""

    stages: tuple[str, ...]
    vertex: list[VertexTap] = field(default_factory=list)
    geometry: list[GeometryTap] = field(default_factory=list)
    stream_output: list[StreamOutputTap] = field(default_factory=list)
    raster: list[RasterTap] = field(default_factory=list)
    fragment: list[FragmentTap] = field(default_factory=list)

    def __init__(self, *stages: str) -> None:
        unknown = [stage for stage in stages if stage not in STAGES]
        if unknown:
            raise InputError(f"there is no stage {unknown[0]!r} to tap; stages are {', '.join(STAGES)}.")
        self.stages = stages or STAGES
        self.vertex = []
        self.geometry = []
        self.stream_output = []
        self.raster = []
        self.fragment = []

    def wants(self, stage: str) -> bool:
        """Whether `stage` is tapped."""
        return stage in self.stages


def check_size(label: str, count: int) -> None:
    """Refuses taps that would not fit."""
    if count > MAX_TAPPED:
        raise InputError(f"tapping {label!r} would copy {count} records, more than {MAX_TAPPED}; draw a smaller image.")


def by_field(
    layout: Layout, floats: np.ndarray, ints: np.ndarray, fields: Sequence[Field] | None = None
) -> dict[str, Any]:
    """Columns [k, n] as arrays by field name (all, or those of `fields`): [n] for scalars, [n, size] for vectors."""
    named = {}
    for part in layout.fields if fields is None else fields:
        columns = (floats if part.kind == "f" else ints)[part.first : part.first + part.size]
        named[part.name] = columns[0].copy() if part.size == 1 else np.ascontiguousarray(columns.T)
    return named
