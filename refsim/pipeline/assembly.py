"""Primitive assembly: which vertices make primitive p of an instance.

A *slot* is a place in the stream of one instance: a vertex of the buffers in order, or a place of the index array.
Lists and strips have a closed form, evaluated inside the kernels. An indexed strip may be cut by a restart index
(WebGPU: 0xFFFF in uint16 indices, 0xFFFFFFFF in uint32 ones; lists have none): the restarts are then taken out, as they
are no vertices, and a table of slots says what is left to join.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import PrimitiveTopology

RESTART = {np.dtype(np.uint16): 0xFFFF, np.dtype(np.uint32): 0xFFFFFFFF}
NO_TABLE = np.empty((0, 3), np.int32)


class Assembly(NamedTuple):
    """One instance: its numbers of `vertices` (slots) and `primitives`; `table` i32[m, 3] of a strip that was cut, of
    no rows where the closed form holds."""

    vertices: int
    primitives: int
    table: np.ndarray

    def invocations(self, topology: PrimitiveTopology, primitives: np.ndarray) -> np.ndarray:
        """Vertex invocations i64[n, corners], numbered within the draw, of `primitives` i64[n] of the draw."""
        instance, start = np.divmod(primitives, max(self.primitives, 1))
        return (instance * self.vertices)[:, None] + self._slots(topology, start)

    def _slots(self, topology: PrimitiveTopology, start: np.ndarray) -> np.ndarray:
        if len(self.table):
            return self.table[start].astype(np.int64)
        corner = np.arange(topology.corners)
        if topology != PrimitiveTopology.TRIANGLE_STRIP:
            return start[:, None] * topology.corners + corner
        turned = np.where((start & 1)[:, None] == 1, [0, 2, 1], [0, 1, 2])
        return start[:, None] + turned


def restart_places(topology: PrimitiveTopology, indices: np.ndarray) -> np.ndarray:
    """Places of `indices` that restart a strip: none in a list, or where the type of the indices has no such value."""
    restart = RESTART.get(indices.dtype) if topology == PrimitiveTopology.TRIANGLE_STRIP else None
    return np.flatnonzero(indices == restart) if restart is not None else np.empty(0, np.int64)


def assembled(topology: PrimitiveTopology, vertices: int, restarts: np.ndarray | None = None) -> Assembly:
    """The assembly of a stream of `vertices` slots, `restarts` (places in order) among them taken out.

    What is left over of a list, and a strip of fewer than three vertices, makes no primitive.
    """
    if topology != PrimitiveTopology.TRIANGLE_STRIP:
        return Assembly(vertices, vertices // topology.corners, NO_TABLE)
    if restarts is None or not len(restarts):
        return Assembly(vertices, max(vertices - 2, 0), NO_TABLE)
    # Strip k stood between two restarts; every restart before it moved its first slot down by one
    first = np.concatenate(([0], restarts + 1))
    lengths = np.diff(np.concatenate((first, [vertices + 1]))) - 1
    triangles = np.maximum(lengths - 2, 0)
    within = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    start = np.repeat(first - np.arange(len(first)), triangles) + within
    turned = np.where((within & 1)[:, None] == 1, [0, 2, 1], [0, 1, 2])
    table = np.ascontiguousarray(start[:, None] + turned, np.int32)
    return Assembly(vertices - len(restarts), len(table), table)


@func
def point_slot(table: Any, start: Any, corner: Any) -> Any:
    """Slot of a point."""
    return start


@func
def triangle_slot(table: Any, start: Any, corner: Any) -> Any:
    """Slot of a corner of triangle `start` of a list."""
    return start * 3 + corner


@func
def quad_slot(table: Any, start: Any, corner: Any) -> Any:
    """Slot of a corner of quad `start` of a list."""
    return start * 4 + corner


@func
def strip_slot(table: Any, start: Any, corner: Any) -> Any:
    """Slot of a corner of triangle `start` of a strip, or of the strips in `table`; odd triangles are turned."""
    if table.shape[0] > 0:
        return np.int64(table[np.uintp(start), np.uintp(corner)])
    odd = start & 1
    return np.int64(start + corner + (odd if corner == 1 else 0) - (odd if corner == 2 else 0))


SLOTS = {
    PrimitiveTopology.POINT_LIST: point_slot,
    PrimitiveTopology.TRIANGLE_LIST: triangle_slot,
    PrimitiveTopology.QUAD_LIST: quad_slot,
    PrimitiveTopology.TRIANGLE_STRIP: strip_slot,
}
