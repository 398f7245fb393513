"""Closest hits in exact rational arithmetic, for the rays on which float64 cannot decide.

A float32 is an integer times 2⁻¹⁴⁹; scaled by 2¹⁴⁹ every numerator of `bounds.py` is an integer without error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Vector = tuple[int, int, int]


def _whole(row: Sequence[float] | NDArray[np.float32]) -> Vector:
    """Scale three finite float32 to integers, exactly."""
    x, y, z = (int(float(c) * 2.0**149) for c in row)
    return x, y, z


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Vector, b: Vector) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def zero_area(triangle: NDArray[np.float32]) -> bool:
    """Whether the three float32 vertices (f32[3,3], finite) are exactly on one line."""
    a, b, c = (_whole(row) for row in triangle)
    return _cross(_minus(b, a), _minus(c, a)) == (0, 0, 0)


def exact_hit(
    origin: NDArray[np.float32], direction: NDArray[np.float32], t_max: float, triangle: NDArray[np.float32],
    front: bool,
) -> Fraction | None:
    """Return the exact t of a hit with 0 < t < t_max, u, v, w ≥ 0 (and n·d < 0 for front), else None.

    A ray in the plane of the triangle (n·d = 0 exactly) hits nothing.
    """
    o, d = _whole(origin), _whole(direction)
    a, b, c = (_whole(row) for row in triangle)
    s, e1, e2 = _minus(o, a), _minus(b, a), _minus(c, a)
    normal = _cross(e1, e2)
    det, top = _dot(normal, d), -_dot(normal, s)
    if det == 0 or (front and det > 0):
        return None
    u, v = -_dot(s, _cross(d, e2)), -_dot(d, _cross(s, e1))
    if det < 0:
        det, top, u, v = -det, -top, -u, -v
    if u < 0 or v < 0 or det - u - v < 0 or top <= 0:
        return None
    # s carries the scale in the numerator, d in the denominator: the quotient has none.
    t = Fraction(top, det)
    if t_max < float("inf") and t >= Fraction(float(t_max)):
        return None
    return t


def closest(
    origin: NDArray[np.float32], direction: NDArray[np.float32], t_max: float, vertices: NDArray[np.float32],
    candidates: Iterable[int], front: bool,
) -> tuple[int, float, bool]:
    """Return the triangle hit first (lowest index among exact ties), its t rounded to float64, and whether it ties.

    (-1, inf, False) when none is hit. vertices: f32[n,3,3]; candidates: indices that contain every exact hit.
    """
    best, found, tied = None, -1, False
    for index in sorted(int(c) for c in candidates):
        t = exact_hit(origin, direction, t_max, vertices[index], front)
        if t is None:
            continue
        if best is None or t < best:
            best, found, tied = t, index, False
        elif t == best:
            tied = True
    return found, (float("inf") if best is None else float(best)), tied
