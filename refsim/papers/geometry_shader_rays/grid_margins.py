"""How far the boxes of a structure must reach beyond the triangles, so that float32 arithmetic never walks past a hit.

In: the triangles and how far from them rays start. Out: `Margins`, in float64 scene units; eps = 2⁻²⁴ throughout.

**Which rays.** `reach` bounds the distance of a ray's origin from the scene's box. A ray is *walked* when every
component of origin − corner is at most ``far`` = reach + diagonal and its largest direction component m lies in
[2⁻²⁰, 2²⁰]; any other ray meets every triangle, so it is slow and right. Let R = √3 far + 2 diagonal: no distance in
what follows is larger.

**Where a hit lies.** `intersect` accepts t = fl(n·s) / fl(n·d), s = v0 − o. n·s is off by 4 eps |s|, n·d by 3 eps |d|,
the quotient by eps, n itself by 2 eps: the point o + t d lies within 11 eps R of the plane. h = t d − s, whose
weights decide, is off by 2 eps (|s| + |h|) ≤ 4 eps R from that point; the weights' own errors admit points outside the
triangle by `refsim.geometry.sphere.acceptance_margin`. So the point is within ``dilation`` = that margin + 20 eps R
of the triangle (15 are needed).

**Where a walk is.** Directions are first kept from zero: a component below 2⁻²⁶ m is raised to that, with its sign,
which moves the ray by at most eps R / 4 before it has crossed the scene. A plane lower + k size is crossed at
fl(fl(lower − o) inv) + fl(k fl(size inv)), inv = fl(1 / d): off by 3 eps R + 3 eps R + eps R when multiplied by d. The
first cell comes from a position that is as much off. As these parameters never decrease with k, a walk that always
takes the smallest of three is, at every t that it passes, within ``slack`` = 10 eps R (8 are needed) of the cell it is
in, along every axis. The same holds of a slab test against a box.

A cell therefore lists the triangles that come within dilation + slack of it, boxes of a hierarchy grow by as much, and
the outermost box by dilation + 2 slack. Then a hit with t not beyond the parameter at which a cell is left has
been found when it is left, and the search may end there without any further allowance.

Slivers sharper than some 1e-6 have no dilation: they, and those whose dilation exceeds 1/64 of the diagonal, are
`loose`: in no cell, and tested by every ray. Triangles of zero area are hit by no ray and listed nowhere.
"""

from __future__ import annotations

import math
import numbers
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.geometry_shader_rays.grid_build import dilated
from refsim.scene.mesh import Scene

EPS = 2.0**-24
DILATION, SLACK = 20.0, 10.0  # multiples of eps R
GROWTH = (DILATION + SLACK) / SLACK  # by how many slacks a list reaches beyond its cell, slivers apart
LOOSE = 2.0**-6               # of the diagonal
DEFAULT_REACH = 8.0           # diagonals
# Outside these, products and quotients of float32 would under- or overflow: nothing is walked, or R is raised
SMALLEST, LARGEST = 2.0**-60, 2.0**80


class Margins(NamedTuple):
    """dilation f64[n] (−1: in no list); loose i32[k], ascending; slack; far f32; lower, upper f64[3] the grown box."""

    dilation: NDArray[np.float64]
    loose: NDArray[np.int32]
    slack: float
    far: np.float32
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]


def margins(scene: Scene, reach: float | None) -> Margins:
    """The margins of a scene whose rays start at most `reach` from its box (None: 8 diagonals)."""
    distance = DEFAULT_REACH * scene.diagonal if reach is None else checked_reach(reach)
    far = (distance + scene.diagonal) * (1 + 2.0**-10)
    # What float64 and a float32 corner can still tell apart
    least = max(SMALLEST, 2.0**-20 * float(np.abs(scene.triangles).max()))
    largest = max(math.sqrt(3.0) * far + 2.0 * scene.diagonal, least)
    slack = SLACK * EPS * largest
    dilation, box = np.empty(len(scene)), np.empty((2, 3))
    most = max(LOOSE * scene.diagonal, 2.0 * DILATION * EPS * largest)
    specialise(dilated, {})(scene.triangles, DILATION * EPS * largest, most, dilation, box)
    loose = np.flatnonzero(np.isinf(dilation)).astype(np.int32)
    dilation[loose] = -1.0
    if not np.isfinite(box).all():  # nothing but loose triangles
        box[:] = scene.lower, scene.upper
    reached = np.float32(far) if largest <= LARGEST else np.float32(-1)
    return Margins(dilation, loose, slack, reached, box[0] - 2.0 * slack, box[1] + 2.0 * slack)


def checked_reach(reach: object) -> float:
    """`reach` as a number. Raises `InputError`."""
    if isinstance(reach, bool) or not isinstance(reach, numbers.Real) or not 0.0 <= float(reach) < math.inf:
        raise InputError(f"reach must be a distance, zero or more, not {reach!r}.")
    return float(reach)


def rounded_down(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """The largest float32 not above each value."""
    near = values.astype(np.float32)
    return np.where(near > values, np.nextafter(near, np.float32(-np.inf)), near)


def rounded_up(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """The smallest float32 not below each value."""
    return -rounded_down(-values)
