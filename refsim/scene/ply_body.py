"""The rows of a PLY file behind its header: tables of scalars and lists, binary or ASCII.

The header (``ply.py``) says which tables follow; ``read`` takes them off the file one after the other. A column of
scalars becomes an array [rows], a column of lists a ``Lists``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError

__all__ = ["BinaryBody", "Columns", "Element", "Lists", "Property", "TextBody"]


@dataclass
class Property:
    """One column: ``kind`` is a NumPy scalar code; ``count_kind`` is that of a list's length, None for a scalar."""

    name: str
    kind: str
    count_kind: str | None = None


@dataclass
class Element:
    """A table of the file: name, rows, columns."""

    name: str
    rows: int
    properties: list[Property] = field(default_factory=list)


@dataclass
class Lists:
    """A list column: length of each row, and all values one after the other."""

    counts: NDArray[np.int64]
    values: NDArray[np.float64]


Columns = dict[str, "NDArray | Lists"]


class BinaryBody:
    """Reads tables from bytes, one after the other."""

    def __init__(self, label: str, data: bytes, offset: int, order: str) -> None:
        self.label, self.data, self.offset, self.order = label, data, offset, order

    def read(self, element: Element) -> Columns:
        """The next rows of the file as the columns of ``element``; ``InputError`` if they are not there."""
        if element.rows == 0 or not element.properties:
            return {column.name: _empty(column) for column in element.properties}
        uniform = self._uniform(element)
        return self._rows(element) if uniform is None else uniform

    def _uniform(self, element: Element) -> Columns | None:
        # Nearly every file has lists of one length only: the table is a record array of the first row's layout.
        fields: list[tuple] = []
        for number, column in enumerate(element.properties):
            if column.count_kind is None:
                fields.append((f"v{number}", self.order + column.kind))
                continue
            ahead = np.dtype(fields).itemsize if fields else 0
            length = int(self._take(self.order + column.count_kind, 1, self.offset + ahead, element)[0])
            if length < 0:
                raise InputError(f"{self.label} has a list of negative length in its element {element.name}")
            # An absurd length is a damaged file; do not even build the type.
            self._need(self.offset + ahead, length * int(column.kind[1]), element)
            fields.append((f"n{number}", self.order + column.count_kind))
            fields.append((f"v{number}", self.order + column.kind, (length,)))
        layout = np.dtype(fields)
        fits = self.offset + element.rows * layout.itemsize <= len(self.data)
        has_lists = any(column.count_kind for column in element.properties)
        if not fits and has_lists:
            return None
        table = self._take(layout, element.rows, self.offset, element)
        columns: Columns = {}
        for number, column in enumerate(element.properties):
            values = table[f"v{number}"]
            if column.count_kind is None:
                columns[column.name] = values
                continue
            counts = table[f"n{number}"]
            if (counts != counts[0]).any():
                return None
            columns[column.name] = Lists(counts.astype(np.int64), values.reshape(-1))
        self.offset += element.rows * layout.itemsize
        return columns

    def _rows(self, element: Element) -> Columns:
        # Polygons of several sizes: row by row.
        parts: list[list] = [[] for _ in element.properties]
        for _ in range(element.rows):
            for column, part in zip(element.properties, parts, strict=True):
                length = 1
                if column.count_kind is not None:
                    length = int(self._next(column.count_kind, 1, element)[0])
                    if length < 0:
                        raise InputError(f"{self.label} has a list of negative length in its element {element.name}")
                part.append(self._next(column.kind, length, element))
        columns: Columns = {}
        for column, part in zip(element.properties, parts, strict=True):
            values = np.concatenate(part)
            counts = np.array([len(row) for row in part], np.int64)
            columns[column.name] = values if column.count_kind is None else Lists(counts, values)
        return columns

    def _next(self, kind: str, count: int, element: Element) -> NDArray:
        values = self._take(self.order + kind, count, self.offset, element)
        self.offset += values.nbytes
        return values

    def _take(self, kind: str | np.dtype, count: int, offset: int, element: Element) -> NDArray:
        dtype = np.dtype(kind)
        self._need(offset, count * dtype.itemsize, element)
        return np.frombuffer(self.data, dtype, count, offset)

    def _need(self, offset: int, size: int, element: Element) -> None:
        if offset + size > len(self.data):
            raise InputError(
                f"{self.label} is truncated: it ends inside its {element.rows} rows of element {element.name}"
            )


class TextBody:
    """Reads tables from the words of an ASCII body, one after the other."""

    def __init__(self, label: str, body: bytes) -> None:
        self.label, self.words, self.next = label, body.split(), 0

    def read(self, element: Element) -> Columns:
        """The next rows of the file as the columns of ``element``; ``InputError`` if they are not there."""
        if all(column.count_kind is None for column in element.properties):
            width = len(element.properties)
            table = self._numbers(element.rows * width, element).reshape(element.rows, width)
            return {column.name: table[:, number] for number, column in enumerate(element.properties)}
        if element.rows == 0:
            return {column.name: _empty(column) for column in element.properties}
        uniform = self._uniform(element)
        return self._rows(element) if uniform is None else uniform

    def _uniform(self, element: Element) -> Columns | None:
        # As for binary files: try the widths of the first row for all rows.
        start, widths = self.next, []
        for column in element.properties:
            widths.append(1 if column.count_kind is None else self._length(element))
            self.next += widths[-1]
        columns: Columns = {}
        width = self.next - start
        self.next = start
        if element.rows * width > len(self.words) - start:
            return None
        table = self._numbers(element.rows * width, element).reshape(element.rows, width)
        at = 0
        for column, length in zip(element.properties, widths, strict=True):
            if column.count_kind is None:
                columns[column.name] = table[:, at]
            elif (table[:, at] != length).any():
                self.next = start
                return None
            else:
                at += 1
                columns[column.name] = Lists(np.full(element.rows, length), table[:, at : at + length].reshape(-1))
            at += length
        return columns

    def _rows(self, element: Element) -> Columns:
        counts: list[list[int]] = [[] for _ in element.properties]
        parts: list[list] = [[] for _ in element.properties]
        for _ in range(element.rows):
            for number, column in enumerate(element.properties):
                length = 1 if column.count_kind is None else self._length(element)
                counts[number].append(length)
                parts[number].append(self._numbers(length, element))
        columns: Columns = {}
        for number, column in enumerate(element.properties):
            values = np.concatenate(parts[number])
            columns[column.name] = values if column.count_kind is None else Lists(np.array(counts[number]), values)
        return columns

    def _length(self, element: Element) -> int:
        length = float(self._numbers(1, element)[0])
        if not (length >= 0.0 and length.is_integer()):
            raise InputError(f"{self.label} has a list of length {length:g} in its element {element.name}")
        return int(length)

    def _numbers(self, count: int, element: Element) -> NDArray[np.float64]:
        words = self.words[self.next : self.next + count]
        if len(words) < count:
            raise InputError(
                f"{self.label} is truncated: it ends inside its {element.rows} rows of element {element.name}"
            )
        self.next += count
        try:
            return np.array([float(word) for word in words])
        except ValueError:
            culprit = next(word for word in words if not _is_number(word))
            raise InputError(
                f"{self.label} has {culprit.decode('latin-1')!r} in its element {element.name} where a number should be"
            ) from None


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _empty(column: Property) -> NDArray | Lists:
    return np.zeros(0) if column.count_kind is None else Lists(np.zeros(0, np.int64), np.zeros(0))
