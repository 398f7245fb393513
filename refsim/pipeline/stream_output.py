"""Stream output: copies primitives, before they are rasterised, into a vertex buffer as records.

Records are appended in the order of the primitives, whole primitives only: the first one that does not fit and all
after it are counted as overflowed. The buffer learns of its new rows when the draw is done; what lies beyond its count
means nothing. Sources: OpenGL 4.6 section 13.3 (transform feedback), Direct3D 11.3 functional specification section 14.
"""

# ruff: noqa: F821
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.layout import Field, Layout, device_function
from refsim.pipeline.rounds import SMALLEST_SLICE
from refsim.pipeline.state import GeometryState, Pipeline
from refsim.pipeline.taps import StreamOutputTap, by_field
from refsim.pipeline.threads import run_all
from refsim.pipeline.vertex_buffer import VertexBuffer

if TYPE_CHECKING:
    from refsim.pipeline.emission import Emitted
    from refsim.pipeline.program import Program
    from refsim.pipeline.resources import Framebuffer

U = np.uintp
BUILT_IN = {"position": Field("position", "f", 0, 4), "point_size": Field("point_size", "f", 0, 1)}


def capture(position, size, VF, VI, corners, first, count, row, floats, ints):  # type: ignore[no-untyped-def]
    """Copies primitives [first, first + count) of a slice to the columns `floats` and `ints`, from `row` on.

    A template; `copy_record` and CORNERS are its slots, the other arguments the columns of
    `refsim.pipeline.geometry.amplify`.
    """
    for j in range(first, first + count):
        for k in range(CORNERS):  # type: ignore[name-defined]
            source = U(corners[U(j), U(k)]) if CORNERS == 3 else U(j)  # type: ignore[name-defined]
            copy_record(position, size, VF, VI, source, floats, ints, U(row))  # type: ignore[name-defined]
            row += 1


def capture_slots(emission: GeometryState, record: type) -> dict[str, Any]:
    """The slots of `capture`."""
    return {"copy_record": record_copier(record, emission.varyings), "CORNERS": emission.output.corners}


def record_copier(record: type, varyings: type) -> Any:
    """Device function that copies an emitted vertex to a row of a buffer of `record`."""
    sources = {field.name: field for field in Layout.of(varyings).fields}
    lines = []
    for field in Layout.of(record).fields:
        target = "floats" if field.kind == "f" else "ints"
        for k in range(field.size):
            if field.name == "position":
                value = f"position[source, {k}]"
            elif field.name == "point_size":
                value = "size[source]"
            else:
                value = f"{'VF' if field.kind == 'f' else 'VI'}[source, {sources[field.name].first + k}]"
            lines.append(f"    {target}[{field.first + k}, row] = {value}\n")
    body = "".join(lines) or "    pass\n"
    return device_function(f"def copy(position, size, VF, VI, source, floats, ints, row):\n{body}", "copy", {})


def check_record(label: str, record: Any, varyings: type) -> None:
    """Raises `InputError` unless every field of `record` is the built-in or varying of its name, of the same type."""
    layout = Layout.of(record)
    named = {field.name: field for field in Layout.of(varyings).fields}
    if not layout.fields:
        raise InputError(f"{label}: stream_output.record {record.__name__} has no field to capture.")
    for field in layout.fields:
        if field.name in BUILT_IN and field.name in named:
            raise InputError(
                f"{label}: stream_output field {field.name!r} could be the built-in or the varying; rename the varying."
            )
        source = BUILT_IN.get(field.name) or named.get(field.name)
        if source is None:
            known = ", ".join((*BUILT_IN, *named))
            raise InputError(f"{label}: stream_output field {field.name!r} is none of {known}.")
        if (field.kind, field.size) != (source.kind, source.size):
            raise InputError(
                f"{label}: stream_output field {field.name!r} is {_type(field)}, what is captured is {_type(source)}."
            )


def _type(field: Field) -> str:
    kinds = {"f": ("f32", "vec"), "i": ("i32", "ivec")}[field.kind]
    return kinds[0] if field.size == 1 else f"{kinds[1]}{field.size}"


def check_capture(
    pipeline: Pipeline,
    buffer: VertexBuffer | None,
    framebuffer: Framebuffer | None,
    vertices: VertexBuffer | tuple[VertexBuffer, ...],
    **read: Any,
) -> None:
    """Raises `InputError` unless `buffer` takes the pipeline's records and shares no memory with what the draw reads
    (`read`: arrays by name, in tuples) or draws to."""
    label, state = pipeline.label, pipeline.stream_output
    if buffer is None and state is None:
        return
    if state is None:
        raise InputError(f"{label}: a stream_output buffer was given, but the pipeline has no stream_output state.")
    if not isinstance(buffer, VertexBuffer):
        raise InputError(f"{label}: stream_output must be a VertexBuffer to capture into, not {type(buffer).__name__}.")
    if buffer.attributes is not state.record:
        expected, got = state.record.__name__, buffer.attributes.__name__
        raise InputError(f"{label}: stream_output captures records of {expected}, a buffer of {got} was given.")
    buffers = vertices if isinstance(vertices, tuple) else (vertices,)
    if any(_shares(buffer, (part.floats, part.ints)) for part in buffers):
        raise InputError(f"{label}: stream_output would capture into a vertex buffer that the draw reads.")
    for name, value in read.items():
        if _shares(buffer, value):
            raise InputError(f"{label}: stream_output shares memory with the {name} that the draw reads.")
    targets = framebuffer and (framebuffer.floats, framebuffer.ints, framebuffer.depth, framebuffer.stencil)
    if _shares(buffer, targets) or (framebuffer and _shares(buffer, framebuffer.invocations)):
        raise InputError(f"{label}: stream_output shares memory with the framebuffer.")


def _shares(buffer: VertexBuffer, value: Any) -> bool:
    """Whether an array within `value` shares memory with the buffer."""
    if isinstance(value, tuple):
        return any(_shares(buffer, part) for part in value)
    if not isinstance(value, np.ndarray):
        return False
    return bool(np.may_share_memory(value, buffer.floats) or np.may_share_memory(value, buffer.ints))


class Capture:
    """One draw's capture into `buffer`: takes slices in order, commits at the end."""

    def __init__(self, program: Program, buffer: VertexBuffer) -> None:
        self._program, self._buffer = program, buffer
        self._first = buffer.rows
        self._corners = program.pipeline.rasterized.corners
        self._room = (buffer.capacity - buffer.rows) // self._corners
        self.generated = 0

    @property
    def primitives(self) -> int:
        """Primitives written so far."""
        return min(self.generated, self._room)

    @property
    def overflowed(self) -> int:
        """Primitives that did not fit so far."""
        return self.generated - self.primitives

    def records_of(self, primitives: int) -> int:
        """Records that capturing so many primitives would write."""
        return min(primitives, self._room) * self._corners

    def take(self, parts: list[Emitted], threads: int) -> None:
        """Copies what fits of the slices; threads share their primitives."""
        kernel, buffer = self._program.capture, self._buffer
        tasks = []
        for part in parts:
            fits = min(part.primitives, self._room - self.primitives)
            size = max(-(-fits // threads), SMALLEST_SLICE)
            for at in range(0, fits, size):
                row = self._first + (self.generated + at) * self._corners
                columns = (part.position, part.size, part.floats, part.ints, part.corners)
                rest = (at, min(size, fits - at), row, buffer.floats, buffer.ints)
                tasks.append(lambda columns=columns, rest=rest: kernel(*columns, *rest))
            self.generated += part.primitives
        run_all(self._program.pipeline.label, threads, tasks)

    def commit(self) -> None:
        """Tells the buffer what it holds."""
        self._buffer.commit(self._first + self.primitives * self._corners, self.overflowed)

    def record(self) -> StreamOutputTap:
        """What was captured."""
        rows = slice(self._first, self._first + self.primitives * self._corners)
        layout = Layout.of(self._buffer.attributes)
        records = by_field(layout, self._buffer.floats[:, rows], self._buffer.ints[:, rows])
        numbers = np.arange(self.primitives, dtype=np.int64)
        return StreamOutputTap(self._program.pipeline.label, records, self._first, numbers)
