"""The tightest cone of a bundle of rays: what the incremental construction of The Hierarchical Ray Engine, section 4,
is held against. Float64, one bundle at a time; origins p and unit directions r ``[n, 3]``.

Section 4 prefers "a fast incremental approach over a tedious one, which could possibly produce more compact results",
and orders its aims: "a minimum opening as a priority, and translated by a minimum amount as a secondary objective".
Taken at its word for a whole bundle that is

1. the smallest half-angle phi, and the axis x, such that x . r_i >= cos phi for all i;
2. with x and phi fixed, the apex a nearest to where the construction starts, the first ray's origin, such that
   p_i - a lies in the cone for all i.

**Step 1 is determined by two or three directions.** For phi < 90 degrees, x . r_i >= cos phi says that r_i lies in the
ball of centre x cos phi and radius sin phi. Conversely the smallest ball around the r_i, centre c and radius R < 1,
gives r_i . c/|c| >= (1 + |c|^2 - R^2) / (2 |c|) >= sqrt(1 - R^2): a cap of sine R at most. So the smallest cap is the
smallest ball's trace on the sphere. It is unique and grows with the set, and two or three directions on its rim that
have it as their own smallest cap decide it (the centre lies in the convex hull of those
on the rim, which lie in one plane). Hence the search below: keep such a support; while a
direction lies outside, solve for the support and the farthest direction, at most four, by trying all pairs and triples.
The half-angle grows at each turn, so no support returns. Four directions that no cap below 90 degrees holds show that
no such cap holds all: then there is no cone.

**Step 2 is a projection.** The apexes allowed, the intersection of the p_i - K (K the cone), are convex and not empty,
as p_i - (a - s x) lies in K for s large: s = max_i (w_i cot phi - z_i), with z_i along and w_i across the axis. So the
nearest one is unique. Each half-space m . a <= m . p_i, m in K's dual cone, holds all of them; the nearest point of an
intersection of some half-spaces is a least-squares problem (Lawson and Hanson, LDP), and bounds the distance from
below. The search adds the half-space of the worst origin until the apex, moved back along the axis by the closed form
so that it is allowed, is at no more than ``GAP`` beyond that bound: both are proved, the apex and its distance.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from refsim.reference.cone import NARROWEST_SIN
from refsim.reference.vector import dot, length, normalise

GAP = 1e-6                          # of the distance, or of the bundle's size where that is larger
ROUNDS = 200
ROUNDING = 2.0**-48                 # chords of unit vectors are right to a few 2^-53


class Cap(NamedTuple):
    """The smallest cone of directions: unit axis [3], half_angle in radians."""

    axis: np.ndarray
    half_angle: float


class TightestCone(NamedTuple):
    """apex, axis [3], half_angle in radians; translation, the apex' distance from the start, and the bound below which
    no apex lies."""

    apex: np.ndarray
    axis: np.ndarray
    half_angle: float
    translation: float
    bound: float


def smallest_cap(r: np.ndarray) -> Cap | None:
    """The smallest cone that holds the directions ``[n, 3]``, n >= 1, of any length; None from 90 degrees on."""
    r = normalise(np.asarray(r, np.float64))
    support = r[:1]
    axis, chord = r[0], 0.0
    while True:
        far = length(r - axis)
        worst = int(np.argmax(far))
        if far[worst] <= chord + ROUNDING:
            return Cap(axis, 2.0 * float(np.arcsin(far[worst] / 2.0)))
        found = _of_few(np.concatenate([support, r[worst : worst + 1]]))
        if found[1] >= np.sqrt(2.0):
            return None
        if found[1] <= chord:       # what is outside is the rounding of the axis: the cap of all, as it is
            return Cap(axis, 2.0 * float(np.arcsin(far[worst] / 2.0)))
        axis, chord, support = found


def _of_few(r: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """``(axis, chord, support)`` of up to four directions: of the caps that two or three have on their rim, the one
    whose farthest direction of all is nearest."""
    best = (r[0], np.inf, r[:1])
    for size in (2, 3):
        for chosen in combinations(range(len(r)), size):
            rim = r[list(chosen)]
            for axis in _axes(rim):
                chord = float(length(r - axis).max())
                # A triple has to be better than its pairs by more than rounding
                if chord < best[1] - (size - 2) * 2.0**-52:
                    best = (axis, chord, rim)
    return best


def _axes(rim: np.ndarray) -> list[np.ndarray]:
    """Axes at the same angle to two directions (the nearest one) or to three (both)."""
    total = rim[0] + rim[1] if len(rim) == 2 else np.cross(rim[1] - rim[0], rim[2] - rim[0])
    size = float(length(total))
    if size == 0.0:
        return []
    return [total / size] if len(rim) == 2 else [total / size, -total / size]


def retreat(p: np.ndarray, apex: np.ndarray, axis: np.ndarray, half_angle: float) -> float:
    """How far an apex has to move against the axis for the cone to hold the origins; at least 0."""
    c = p - apex
    z = dot(c, axis)
    w = length(c - z[:, None] * axis)
    return max(0.0, float((w * (np.cos(half_angle) / np.sin(half_angle)) - z).max()))


def nearest_apex(
    p: np.ndarray, start: np.ndarray, axis: np.ndarray, half_angle: float
) -> tuple[np.ndarray, float]:
    """``(apex, bound)``: the apex nearest to ``start`` whose cone, 0 < half_angle < 90 degrees, holds the origins; no
    apex is nearer than the bound."""
    scale = max(float(length(p - start).max()), np.finfo(np.float64).tiny)
    c = (p - start) / scale
    cos, sin = np.cos(half_angle), np.sin(half_angle)
    at = np.zeros(3)
    back = retreat(c, at, axis, half_angle)
    best = at - back * axis
    normals: list[np.ndarray] = []
    offsets: list[float] = []
    for _ in range(ROUNDS):
        if float(length(best)) - float(length(at)) <= GAP * max(1.0, float(length(at))):
            break
        d = c - at
        z = dot(d, axis)
        across = d - z[:, None] * axis
        w = length(across)
        worst = int(np.argmax(w * cos - z * sin))
        # The side of the cone that faces the origin: p - a in K needs m . (p - a) >= 0
        normal = axis * sin - (across[worst] / w[worst] if w[worst] > 0 else np.zeros(3)) * cos
        normals.append(normal)
        offsets.append(float(dot(normal, c[worst])))
        at = _nearest_in(np.array(normals), np.array(offsets))
        moved = at - retreat(c, at, axis, half_angle) * axis
        best = moved if length(moved) < length(best) else best
    return start + best * scale, float(length(at)) * scale


def _nearest_in(normals: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The point nearest to zero with normals . a <= offsets: Lawson and Hanson's least distance programming."""
    lines = np.concatenate([-normals.T, -offsets[None]])
    weights, _ = nnls(lines, np.array([0.0, 0.0, 0.0, 1.0]), maxiter=50 * len(normals) + 50)
    rest = lines @ weights - np.array([0.0, 0.0, 0.0, 1.0])
    return -rest[:3] / rest[3]


def tightest_cone(p: np.ndarray, r: np.ndarray, start: np.ndarray | None = None) -> TightestCone | None:
    """The tightest cone of n >= 1 rays; ``start``, the first origin unless given, is where the translation begins.

    None where the directions need 90 degrees or more: such a cone is not convex. Origins that a narrow cone does not
    hold open it to ``NARROWEST_SIN`` first, as in the incremental construction (HRE-E5): parallel rays have no apex.
    """
    cap = smallest_cap(r)
    if cap is None:
        return None
    p = np.asarray(p, np.float64)
    start = p[0] if start is None else np.asarray(start, np.float64)
    axis, half_angle = cap
    if not np.any(length(p - start) > 0):
        return TightestCone(start, axis, half_angle, 0.0, 0.0)
    half_angle = max(half_angle, float(np.arcsin(NARROWEST_SIN)))
    apex, bound = nearest_apex(p, start, axis, half_angle)
    return TightestCone(apex, axis, half_angle, float(length(apex - start)), bound)
