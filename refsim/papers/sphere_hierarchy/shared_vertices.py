"""The vertex array that all traversal lists share (section 2.1), and three indices a triangle.

Positions are joined where their bits agree; each keeps the number of its first appearance in file order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.jit import specialise


class SharedVertices(NamedTuple):
    """positions f32[v, 3], world space; corners i32[n, 3], rows of `positions`."""

    positions: NDArray[np.float32]
    corners: NDArray[np.int32]

    @classmethod
    def of(cls, triangles: NDArray[np.float32]) -> SharedVertices:
        """The distinct vertices of triangles f32[n, 3, 3]."""
        bits = np.ascontiguousarray(triangles).reshape(-1, 3).view(np.uint32)
        table = np.full(1 << (2 * len(bits)).bit_length(), -1, np.int32)
        first, corners = np.empty(len(bits), np.int32), np.empty(len(bits), np.int32)
        count = specialise(join, {})(bits, table, first, corners)
        positions = triangles.reshape(-1, 3)[first[:count]]
        return cls(positions, corners.reshape(-1, 3))


def join(bits, table, first, corners):  # type: ignore[no-untyped-def]
    """An open hash table of the positions' bits, u32[k, 3]; `table` i32, a power of two and all −1. Returns how many
    differ; `first` their first rows, `corners` each row's number."""
    mask = np.uint32(table.shape[0] - 1)
    count = 0
    for row in range(bits.shape[0]):
        x, y, z = bits[row, 0], bits[row, 1], bits[row, 2]
        mixed = np.uint32(x * np.uint32(0x9E3779B1)) ^ np.uint32(y * np.uint32(0x85EBCA77))
        mixed ^= np.uint32(z * np.uint32(0xC2B2AE3D))
        mixed ^= mixed >> np.uint32(15)
        mixed = np.uint32(mixed * np.uint32(0x2C1B3C6D))
        mixed ^= mixed >> np.uint32(13)
        slot = mixed & mask
        while True:
            held = table[slot]
            if held < 0:
                table[slot], first[count], corners[row] = count, row, count
                count += 1
                break
            other = bits[first[held]]
            if other[0] == x and other[1] == y and other[2] == z:
                corners[row] = held
                break
            slot = (slot + np.uint32(1)) & mask
    return count
