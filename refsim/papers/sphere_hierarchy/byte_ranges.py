"""Which bytes of traversal lists a change must copy to the device, as ranges; and the copying itself.

In: lists before and after; out: `Changes`. Ranges are i64[k, 2], rows (offset, size), bytes from the beginning of an
array of `byte_layout.ListBytes`, ascending and apart. What lies `gap` bytes apart or less is one range: a copy more
costs time too (`transfer.merging_gap`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.papers.sphere_hierarchy.byte_layout import (
    ESCAPE_BYTES,
    HEAD_BYTES,
    PAYLOAD_BYTES,
    VERTEX_BYTES,
    ListBytes,
    bytes_of,
    to_bytes,
)
from refsim.papers.sphere_hierarchy.lists import TraversalLists

Ranges = NDArray[np.int64]


class Changes(NamedTuple):
    """What a change of the scene did to the lists.

    triangles     rows whose vertices are other bits
    nodes         spheres that are other numbers
    split         vertices that came apart and were added to the array
    relaid        lists laid out anew, as culling keeps other triangles now; all others keep order and escape indices
    escape, payload  ranges of each list; vertices, heads  ranges
    sizes         bytes of escape, payload, vertices and heads afterwards
    """

    triangles: int
    nodes: int
    split: int
    relaid: tuple[int, ...]
    escape: tuple[Ranges, ...]
    payload: tuple[Ranges, ...]
    vertices: Ranges
    heads: Ranges
    sizes: tuple[int, int, int, int]

    def __repr__(self) -> str:
        counts = f"triangles={self.triangles}, nodes={self.nodes}, split={self.split}, relaid={self.relaid}"
        return f"Changes({counts}, bytes={self.bytes}, copies={self.copies})"

    @property
    def ranges(self) -> Ranges:
        """All ranges of all arrays, one copy each."""
        return np.concatenate([*self.escape, *self.payload, self.vertices, self.heads])

    @property
    def bytes(self) -> int:
        """Bytes to copy."""
        return int(self.ranges[:, 1].sum())

    @property
    def copies(self) -> int:
        """Number of copies."""
        return len(self.ranges)


def changed_entries(old: NDArray, new: NDArray) -> NDArray[np.int64]:
    """Rows of `new` (4-byte numbers) whose bits differ from those of `old`, or that are behind its end."""
    common = min(len(old), len(new))
    other = old[:common].view(np.int32) != new[:common].view(np.int32)
    differs = np.ones(len(new), np.bool_)
    differs[:common] = other.any(axis=1) if other.ndim == 2 else other
    return np.flatnonzero(differs)


def ranges_of(entries: NDArray[np.int64], size: int, gap: int) -> Ranges:
    """Ranges of ascending entries of `size` bytes each."""
    if not len(entries):
        return np.empty((0, 2), np.int64)
    begins = np.append(0, 1 + np.flatnonzero(np.diff(entries) - 1 > gap // size))
    ends = np.append(begins[1:], len(entries)) - 1
    offset = entries[begins] * size
    return np.column_stack([offset, (entries[ends] + 1) * size - offset])


def whole_copy(lists: TraversalLists) -> Changes:
    """A copy of everything: four arrays, each at once."""
    size = bytes_of(lists)
    none = np.empty((0, 2), np.int64)
    totals = sum(size.escape), sum(size.payload), size.vertices, size.heads
    escape, payload, vertices, heads = (np.array([[0, total]], np.int64) if total else none for total in totals)
    counts = len(lists.hierarchy.triangles), len(lists.hierarchy), 0
    return Changes(*counts, tuple(range(lists.count)), (escape,), (payload,), vertices, heads, totals)


def compare(old: TraversalLists, new: TraversalLists, counts: tuple[int, int, int], relaid: tuple[int, ...],
            touched: list[NDArray[np.int64]], vertices: NDArray[np.int64], gap: int) -> Changes:  # fmt: skip
    """The changes from `old` to `new`.

    counts    triangles, nodes, split of `Changes`
    touched   per list the elements whose payload may differ; not read where a list was laid out anew
    vertices  the vertices of `old` that may differ
    """
    none = np.empty(0, np.int64)
    escape, payload = [], []
    for k in range(new.count):
        begin, end = int(new.first[k]), int(new.first[k + 1])
        if relaid:  # lists behind a longer or shorter one have moved
            links = begin + changed_entries(old.escape[begin:end], new.escape[begin:end])
            words = begin + changed_entries(old.payload[begin:end], new.payload[begin:end])
        else:
            there = begin + touched[k]
            links, words = none, there[changed_entries(old.payload[there], new.payload[there])]
        escape.append(ranges_of(links, ESCAPE_BYTES, gap))
        payload.append(ranges_of(words, PAYLOAD_BYTES, gap))
    known = len(old.vertices.positions)
    moved = vertices[changed_entries(old.vertices.positions[vertices], new.vertices.positions[vertices])]
    moved = np.append(moved, np.arange(known, len(new.vertices.positions)))
    heads = np.flatnonzero(old.first != new.first)
    size = bytes_of(new)
    return Changes(
        *counts, relaid, tuple(escape), tuple(payload), ranges_of(moved, VERTEX_BYTES, gap),
        ranges_of(heads, HEAD_BYTES, gap), (sum(size.escape), sum(size.payload), size.vertices, size.heads),
    )  # fmt: skip


def copied(old: ListBytes, new: TraversalLists, changes: Changes) -> ListBytes:
    """The device's bytes after the ranges have been copied over `old`; the host's come from `new`."""
    source = to_bytes(new)
    parts = zip(("escape", "payload", "vertices", "heads"), changes.sizes, strict=True)
    done = {}
    for name, size in parts:
        ranges = getattr(changes, name)
        data = bytearray(getattr(old, name)[:size].ljust(size, b"\0"))
        for offset, count in np.concatenate(ranges) if isinstance(ranges, tuple) else ranges:
            data[offset : offset + count] = getattr(source, name)[offset : offset + count]
        done[name] = bytes(data)
    return source._replace(**done)
