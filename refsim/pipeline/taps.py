"""Taps: what a stage's packets held, copied out for tests, pictures and captures. A tap changes no bit and no counter.

`Taps("vertex", "fragment")` handed to `draw` collects one record a draw and stage, in submission order. Records name
each other's rows: a fragment its vertices, a vertex its row of the vertex buffers. A primitive that left no fragment
has a fate in the raster tap.
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


class _Record:
    """A record shows itself by its label and the shapes of its arrays."""

    def __repr__(self) -> str:
        columns = (f"{name} {list(part.shape)}" for name, part in vars(self).items() if isinstance(part, np.ndarray))
        return f"{type(self).__name__}({', '.join((repr(vars(self)['label']), *columns))})"


@dataclass(frozen=True, repr=False)
class VertexTap(_Record):
    """All vertex invocations of a draw: `position` f32[n, 4] (clip space), `point_size` f32[n], `varyings` by name.

    `vertex_index` i64[n]: the row of the per-vertex buffers, what the indices said (restarts are no invocations);
    `instance_index` i64[n]: the instance, and the row of the per-instance buffers.
    """

    label: str
    position: np.ndarray
    point_size: np.ndarray
    varyings: dict[str, np.ndarray]
    vertex_index: np.ndarray
    instance_index: np.ndarray


@dataclass(frozen=True, repr=False)
class GeometryTap(_Record):
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


@dataclass(frozen=True, repr=False)
class StreamOutputTap(_Record):
    """What a draw captured: `records` by field, which stand in the buffer from row `first_row` on, and the numbers of
    the captured primitives i64[m] (output primitives of the draw; `primitives` of the geometry tap)."""

    label: str
    records: dict[str, np.ndarray]
    first_row: int
    primitives: np.ndarray


@dataclass(frozen=True, repr=False)
class RasterTap(_Record):
    """What the rasteriser set up for the fragment stage, in submission order: points, quads, triangles and the pieces
    of clipped triangles.

    `primitive` i64[n] (number within the draw; pieces share it); `rect` i32[n, 4] the pixels that bound it, x0, y0, x1,
    y1, half open; `front` bool[n]; `corners` i32[n, 3, 2] of triangles, in 1/256 pixel, clockwise on the screen (no
    rows for others); `depth` f32[n, 3] at the corners with the bias of each triangle, f32[n, 1] for others.
    `vertices` and `invocation` as of `FragmentTap`. `fate` i32[m] (`refsim.pipeline.PrimitiveFate`) says what became of
    every primitive that reached the rasteriser, in the order of their numbers: all m of the draw, set up or not.
    """

    label: str
    primitive: np.ndarray
    rect: np.ndarray
    front: np.ndarray
    corners: np.ndarray
    depth: np.ndarray
    vertices: np.ndarray
    invocation: np.ndarray
    fate: np.ndarray


@dataclass(frozen=True, repr=False)
class FragmentTap(_Record):
    """All fragments of a draw, sorted by (primitive, y, x), which at every pixel is submission order.

    `primitive` i64[n] (number within the draw), `x`, `y` i32[n], `fate` i32[n] (`refsim.pipeline.FragmentFate`),
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


@dataclass(repr=False)
class Taps:
    """Collects records of the stages named (all, if none is); every list holds one a draw that has the stage.

    - `vertex`: a `VertexTap` of every draw, the results of the vertex shader.
    - `geometry`: a `GeometryTap` of every draw with a geometry shader, what that emitted.
    - `stream_output`: a `StreamOutputTap` of every draw that captures, what went into the buffer.
    - `raster`: a `RasterTap` of every draw that does not discard its primitives: the fate of each primitive, and what
      was set up of those drawn.
    - `fragment`: a `FragmentTap` of the same draws, every covered pixel of every primitive and its fate.
    """

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

    def __repr__(self) -> str:
        held = (f"{stage}: {len(getattr(self, stage))}" for stage in STAGES if self.wants(stage))
        return f"<Taps, records of {', '.join(held)}>"

    def clear(self) -> None:
        """Forgets all records; the stages stay tapped."""
        for stage in STAGES:
            getattr(self, stage).clear()

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
