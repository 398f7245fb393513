"""Partitions of the directions of space (section 2.1, Figure 2) and the list that a ray picks.

1 list    ordered along +x, for every ray
2 lists   along +x and −x: a ray takes that of the half-space of its direction
6 lists   along +x, −x, +y, −y, +z, −z: sextants, d_a ≥ |d_b| and d_a ≥ |d_c| for the axis a of the list
8 lists   along (±1, ±1, ±1): octants, bit a of the list's number is set where d_a is negative

A direction on a border belongs to both sides; it takes the positive side, and of equal components the first axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.jit import specialise

LISTS = (1, 2, 6, 8)
U = np.uintp
AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
OCTANTS = np.array([[1 - 2 * (k >> a & 1) for a in range(3)] for k in range(8)], np.float64)


def list_directions(lists: int) -> NDArray[np.float64]:
    """The sorting direction of each list, f64[lists, 3], components −1, 0 and 1."""
    return OCTANTS if lists == 8 else AXES[:lists]


def list_of_rays(direction: NDArray[np.float32], lists: int) -> NDArray[np.int32]:
    """The list that each ray takes, i32[n], from directions f32[n, 3]. Comparisons only: nothing is rounded."""
    negative = direction < 0
    if lists == 1:
        return np.zeros(len(direction), np.int32)
    if lists == 2:
        return negative[:, 0].astype(np.int32)
    if lists == 8:
        return (negative[:, 0] + 2 * negative[:, 1] + 4 * negative[:, 2]).astype(np.int32)
    picked = np.empty(len(direction), np.int32)
    specialise(sextants, {})(direction, picked)
    return picked


def sextants(direction, picked):  # type: ignore[no-untyped-def]
    """The list of six that each ray takes: template of `refsim.jit`, a tenth of the time of NumPy's argmax."""
    for k in range(picked.shape[0]):
        row = U(k)
        x, y, z = direction[row, 0], direction[row, 1], direction[row, 2]
        along, axis = (y, 2) if abs(y) > abs(x) else (x, 0)
        if abs(z) > abs(along):
            along, axis = z, 4
        picked[row] = axis + (along < 0)
