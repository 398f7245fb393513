"""Vertex buffers: what a draw reads its vertices from, and what stream output appends records to.

Stored as columns. The number of filled rows is the pipeline's own: a later draw takes it from here without telling
Python (draw-auto), and reading it from Python after a capture is a *read-back*, which is counted because on a GPU it
stalls the frame.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.layout import Field, Layout

PAGE, LINE = 1024, 16  # in places of four bytes


class VertexBuffer:
    """Columns of vertices: `floats` f32[k, c], `ints` i32[k, c], c ≥ capacity, of which `count` vertices are filled.

    `attributes` is the NamedTuple class whose fields are the columns. `rows` is `count` as the pipeline sees it,
    without a read-back. `overflowed` counts the primitives that captures left out for want of room, `read_backs` how
    often Python asked for the count of a captured buffer.
    """

    def __init__(self, attributes: type, capacity: int) -> None:
        layout = Layout.of(attributes)
        self.attributes = attributes
        self.capacity = int(capacity)
        self.floats = np.zeros((layout.floats, _pitch(self.capacity)), np.float32)
        self.ints = np.zeros((layout.ints, _pitch(self.capacity)), np.int32)
        self.rows = 0
        self.overflowed = 0
        self.read_backs = 0
        self._captured = False

    @property
    def count(self) -> int:
        """Vertices that are filled. Asking after a capture adds to `read_backs`."""
        self.read_backs += self._captured
        return self.rows

    @count.setter
    def count(self, count: int) -> None:
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or not 0 <= count <= self.capacity:
            raise InputError(f"count must be a whole number from 0 to the capacity {self.capacity}, not {count!r}.")
        self.rows, self._captured = int(count), False

    def clear(self) -> None:
        """Empties the buffer; `overflowed` starts again at 0. Reads nothing back."""
        self.count = self.overflowed = 0

    def commit(self, rows: int, overflowed: int) -> None:
        """What a capture leaves: `rows` are filled now, `overflowed` more primitives did not fit."""
        self.rows, self._captured = rows, True
        self.overflowed += overflowed

    @classmethod
    def of(cls, attributes: type, **columns: Any) -> VertexBuffer:
        """A full buffer from one array a field: shape [n] for a scalar, [n, k] for a vector.

        Raises `InputError` when a field is missing, unknown, or of another length or width, or when its values are no
        numbers; those of an integer field must be whole numbers that int32 holds.
        """
        fields = {field.name: field for field in Layout.of(attributes).fields}
        what = f"vertex buffer of {attributes.__name__}"
        for name in sorted(set(columns) ^ set(fields)):
            fault = "missing" if name in fields else f"unknown; there are {', '.join(fields)}"
            raise InputError(f"{what}: field {name!r} is {fault}.")
        arrays = {name: _rows(what, field, columns[name]) for name, field in fields.items()}
        _check_lengths(what, fields, arrays)
        counts = {len(array) for array in arrays.values()}
        if len(counts) != 1:
            raise InputError(f"{what}: its columns differ in length: {sorted(counts)}.")
        buffer = cls(attributes, counts.pop())
        count = buffer.count = buffer.capacity
        for name, values in arrays.items():
            field = fields[name]
            if values.size != count * field.size or math.prod(values.shape[1:]) != field.size:
                raise InputError(f"{what}: {name!r} needs {field.size} components a row, not the shape {values.shape}.")
            planes = buffer.floats if field.kind == "f" else buffer.ints
            planes[field.first : field.first + field.size, :count] = values.reshape(count, field.size).T
        return buffer

    def records(self) -> np.ndarray:
        """The filled rows interleaved, as OpenGL and Direct3D store them: a structured array (`record_type`)."""
        array = np.empty(self.count, record_type(self.attributes))
        for field in Layout.of(self.attributes).fields:
            planes = self.floats if field.kind == "f" else self.ints
            columns = planes[field.first : field.first + field.size, : len(array)]
            array[field.name] = columns[0] if array[field.name].ndim == 1 else columns.T
        return array

    @classmethod
    def of_records(cls, attributes: type, array: np.ndarray) -> VertexBuffer:
        """A full buffer from interleaved records; `InputError` unless they are of ``record_type(attributes)``."""
        wanted = record_type(attributes)
        if not isinstance(array, np.ndarray) or array.dtype != wanted or array.ndim != 1:
            got = f"{array.dtype} of shape {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
            raise InputError(f"records of {attributes.__name__} are a row of {wanted}, not {got}.")
        return cls.of(attributes, **{name: array[name] for name in wanted.names or ()})


def _pitch(capacity: int) -> int:
    """Places from one column to the next: not a multiple of a page, or a vertex's columns would share a cache set."""
    return capacity if capacity < PAGE else -(-capacity // PAGE) * PAGE + LINE


def _rows(what: str, field: Field, column: Any) -> np.ndarray:
    """The numbers of a column as an array; `InputError` where its type cannot hold them."""
    try:
        values = np.asarray(column)
    except ValueError:
        raise InputError(f"{what}: the rows of {field.name!r} differ in length.") from None
    if values.ndim == 0:
        raise InputError(f"{what}: {field.name!r} must be an array of rows.")
    if values.dtype.kind not in "fiub":
        raise InputError(f"{what}: {field.name!r} must be numbers, not {values.dtype}.")
    if field.kind == "i" and values.dtype != np.int32:
        with np.errstate(invalid="ignore"):
            odd = (values < -(2**31)) | (values >= 2**31) | (values != np.rint(values))
        if odd.any():
            raise InputError(f"{what}: {field.name!r} must be whole numbers of int32, not {values[odd][0]}.")
    return values


def _check_lengths(what: str, fields: dict[str, Field], arrays: dict[str, np.ndarray]) -> None:
    """Refuses an array [k, n] given for n rows of k components, where the other columns tell that it is one."""
    turned = {
        name: array.shape
        for name, array in arrays.items()
        if array.ndim == 2 and fields[name].size == array.shape[0] != array.shape[1]
    }
    others = {len(array) for name, array in arrays.items() if name not in turned}
    for name, (components, rows) in turned.items():
        if others == {rows} or (not others and rows > components):
            wanted = f"[{rows}, {components}]"
            raise InputError(f"{what}: {name!r} is transposed: [{components}, {rows}], where rows would be {wanted}.")


def record_type(attributes: type) -> np.dtype:
    """The little-endian structured type of a record: fields in declaration order, packed at steps of four bytes.

    A field of a NamedTuple within is named with a dot, as ``"surface.normal"``.
    """
    fields = Layout.of(attributes).fields
    scalar = {"f": "<f4", "i": "<i4"}
    return np.dtype([(field.name, scalar[field.kind], (field.size,) if field.size > 1 else ()) for field in fields])
