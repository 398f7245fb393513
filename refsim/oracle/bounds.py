"""The forward-error bound of one ray against one triangle: what a correct float32 implementation may answer.

Exact quantities, of the float32 input as given: s = o − v0, e1 = v1 − v0, e2 = v2 − v0, N = e1 × e2, n = N/|N|,
    D = N·d,   T = −N·s,   U = −s·(d × e2),   V = −d·(s × e1),   W = D − U − V,
so that t = T/D, u = U/D, v = V/D by Cramer's rule. Numerators are bounded, not quotients: then nothing blows up at
grazing incidence, and dividing by |D| = |N| cos θ brings in the 1/|cos θ| by itself.
ε = 2⁻²⁴, γ_k = kε/(1 − kε) (Higham, Accuracy and Stability, lemma 3.1): k roundings, in any order, change a sum of
products by at most γ_k times the same sum taken over absolute values. A fused operation only removes roundings.

Möller–Trumbore, any order of operations, base vertex v0.  A triple product a·(b × c) has six monomials; each sees at
most 1 (product) + 1 (difference) + 1 (product) + 2 (sum) = 5 roundings, and one for every factor that is itself a
difference. Summed over absolute values the monomials are the permanent P(a, b, c), which does not depend on which two
are crossed first:
    |ΔD| ≤ γ_7 P(d, e1, e2)   |ΔU| ≤ γ_7 P(s, d, e2)   |ΔV| ≤ γ_7 P(s, d, e1)   |ΔT| ≤ γ_8 P(s, e1, e2).

Plane and Woop's affine form.  Data n, m1 = (e2 × N)/|N|², m2 = (N × e1)/|N|² (rows of Woop's matrix up to a scale)
and offsets n·v0, m·v0 are made in float64 and rounded once. Let a_i = |o_i| + |v0_i| ≥ |s_i|.
The computed t satisfies, with the division (one rounding, or two through a reciprocal) charged to the denominator,
    |n·s + t n·d| ≤ A + B t,   A = γ_7 Σ|n_i| a_i,   B = γ_6 Σ|n_i||d_i|.
(datum 1, product 1, sum 2, the difference with the offset or of o − v0 1; two spare.)  This covers the plane relative
to v0, with an absolute offset, and Woop's third row. Hence |ΔT| ≤ |N| A and |ΔD| ≤ |N| B ≤ γ_6 P(d, e1, e2).
u = h·m1 is evaluated at that computed t: h = s + t d, or o + t d − v0, or Woop's m1·o + offset + t (m1·d); at
most datum 1, product 1, sum 2, and 3 inside h = 7 roundings, so it is u(t) within γ_7 Σ|m1_i|(a_i + t|d_i|), and
u(t) − u = (m1·d)(t − T/D) with |t − T/D||n·d| ≤ A + B t. For an accepted hit t ≤ R, as h is in the triangle up to
these very errors: R|d| = |s| + emax(1 + 3(b_u + b_v)) + A + B R, linear in R. Times D:
    |ΔU| ≤ |D| γ_7 Σ|m1_i|(a_i + R|d_i|) + |N||m1·d| (A + B R),   ΔV alike with m2.

The largest of the forms is taken for each numerator. ΔW = ΔU + ΔV + ΔD + γ_4(|U| + |V| + |D|): the quotients (2), their
sum and the comparison with 1. Underflow, flush to zero included, adds 32·2⁻¹²⁶ times a cubic in the magnitudes. The
float64 evaluation of all this errs by about 2⁻⁵⁰ P, 2⁻²⁶ of the bound; all γ are 2⁻²⁰ larger to hold it.

Accepted for sure: the sign σ of D is certain; σU, σV, σW, σT and σ(t_max D − T) exceed their bounds. Accepted perhaps:
for one possible σ none of them is below minus its bound. `score` is the smallest of these quantities in multiples of
its bound: above 1 the triangle must be accepted, below −1 it must not. Intervals of t:
(σT ∓ ΔT)/(|D| ± ΔD), times 1 ∓ γ_2.

Not covered: another base vertex, a cut-off such as |det| < 1e-7, plane data made in float32, oblique transforms
(Baldwin and Weber), approximate reciprocals, directions that are not unit.
"""

from __future__ import annotations

import math

from refsim.oracle.compiled import device, routine

# Columns of the triangle table (float64).
V0, E1, E2, NORMAL, LENGTH, EDGE, ASPECT, FINITE, COLUMNS = 0, 3, 6, 9, 12, 13, 14, 15, 16

# What is known of a candidate, as bits: exactly hit in float64 · float64 in doubt · must be accepted ·
# within its bound of the edge u = 0, v = 0, w = 0 · sign of D, window of t, facing and range are certain.
INSIDE, DOUBT, MUST, EDGE_U, EDGE_V, EDGE_W, FIRM = 1, 2, 4, 8, 16, 32, 64

CAP = 8.0  # margins are reported up to this many bounds: the search looks no further
FAR = 1e38  # stands for an infinite t_max
SLIVER = 2e4  # emax²/|N| above which the search bounds of the tree are not proven: such triangles are always tested


def gamma(k: int) -> float:
    """Return γ_k for float32, 2⁻²⁰ larger to hold the float64 evaluation."""
    return k * 2.0**-24 / (1.0 - k * 2.0**-24) * (1.0 + 2.0**-20)


G2, G4, G6, G7, G8 = gamma(2), gamma(4), gamma(6), gamma(7), gamma(8)
_UNDERFLOW = 32.0 * 2.0**-126
_F64 = 2.0**-48  # of a permanent: the float64 error of a triple product, with room
_SMALL, _LARGE = 2.0**-110, 2.0**110  # outside these, overflow and vanishing reciprocals are possible


@device
def _sums(ax, ay, az, bx, by, bz):
    """Return the cross product with every minus made a plus: a permanent's cofactors."""
    return ay * bz + az * by, az * bx + ax * bz, ax * by + ay * bx


@device
def _cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@device
def _dot(ax, ay, az, bx, by, bz):
    return ax * bx + ay * by + az * bz


@device
def numerators(ray, table, j):
    """Return s, D, T, U, V in float64 (module docstring)."""
    s = (ray[0] - table[j, 0], ray[1] - table[j, 1], ray[2] - table[j, 2])
    d = (ray[3], ray[4], ray[5])
    n = (table[j, 9], table[j, 10], table[j, 11])
    cx, cy, cz = _cross(d[0], d[1], d[2], table[j, 6], table[j, 7], table[j, 8])
    qx, qy, qz = _cross(s[0], s[1], s[2], table[j, 3], table[j, 4], table[j, 5])
    det = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    top = -(n[0] * s[0] + n[1] * s[1] + n[2] * s[2])
    return s, det, top, -(s[0] * cx + s[1] * cy + s[2] * cz), -(d[0] * qx + d[1] * qy + d[2] * qz)


@device
def _permanents(ray, table, j, s):
    """Return P(d, e1, e2), P(s, e1, e2), P(s, d, e2), P(s, d, e1)."""
    dx, dy, dz = abs(ray[3]), abs(ray[4]), abs(ray[5])
    sx, sy, sz = abs(s[0]), abs(s[1]), abs(s[2])
    ax, ay, az = abs(table[j, 3]), abs(table[j, 4]), abs(table[j, 5])
    bx, by, bz = abs(table[j, 6]), abs(table[j, 7]), abs(table[j, 8])
    cx, cy, cz = _sums(dx, dy, dz, bx, by, bz)
    qx, qy, qz = _sums(sx, sy, sz, ax, ay, az)
    return (_dot(ax, ay, az, cx, cy, cz), _dot(bx, by, bz, qx, qy, qz),
            _dot(sx, sy, sz, cx, cy, cz), _dot(dx, dy, dz, qx, qy, qz))


@routine
def _affine(ray, table, j, s, det):
    """Return |N| A, the two numerator bounds of the plane and Woop forms, R, and the largest weight gradient."""
    dx, dy, dz = ray[3], ray[4], ray[5]
    length = table[j, 12]
    nx, ny, nz = table[j, 9] / length, table[j, 10] / length, table[j, 11] / length
    # |N| m1 and |N| m2: as long as the edges, so nothing overflows for slivers.
    px, py, pz = _cross(table[j, 6], table[j, 7], table[j, 8], nx, ny, nz)
    qx, qy, qz = _cross(nx, ny, nz, table[j, 3], table[j, 4], table[j, 5])
    ax, ay, az = abs(ray[0]) + abs(table[j, 0]), abs(ray[1]) + abs(table[j, 1]), abs(ray[2]) + abs(table[j, 2])
    ex, ey, ez = abs(dx), abs(dy), abs(dz)
    na, nd = _dot(abs(nx), abs(ny), abs(nz), ax, ay, az), _dot(abs(nx), abs(ny), abs(nz), ex, ey, ez)
    pa, pd = _dot(abs(px), abs(py), abs(pz), ax, ay, az), _dot(abs(px), abs(py), abs(pz), ex, ey, ez)
    qa, qd = _dot(abs(qx), abs(qy), abs(qz), ax, ay, az), _dot(abs(qx), abs(qy), abs(qz), ex, ey, ez)
    # R, linear: (|s| + emax + 3 emax α + A) / (|d| − 3 emax β − B); without a positive denominator nothing is proven.
    reach = math.sqrt(_dot(s[0], s[1], s[2], s[0], s[1], s[2]))
    top = reach + table[j, 13] * (1.0001 + 3.0 * G7 * (pa + qa) / length) + G7 * na
    below = math.sqrt(_dot(dx, dy, dz, dx, dy, dz)) - 3.0 * table[j, 13] * G7 * (pd + qd) / length - G7 * nd
    far = top / below * (1.0 + 2.0**-10) if below > 0.5 else math.inf
    off = G7 * (na + far * nd)
    slope_u, slope_v = abs(_dot(px, py, pz, dx, dy, dz)), abs(_dot(qx, qy, qz, dx, dy, dz))
    tilt = abs(det) / length
    bound_u = tilt * G7 * (pa + far * pd) + slope_u * off if below > 0.5 else math.inf
    bound_v = tilt * G7 * (qa + far * qd) + slope_v * off if below > 0.5 else math.inf
    return length * G7 * na, bound_u, bound_v, far, max(pa, qa) / length


@routine
def _score(sign, det, top, un, vn, wn, t_max, bd, bt, bu, bv, bw):
    """Return the smallest of the accepting quantities, in bounds, for this sign of the computed denominator."""
    window = (t_max * abs(det) - sign * top) / (bt + t_max * bd + G2 * t_max * abs(det))
    return min(min(min(sign * un / bu, sign * vn / bv), min(sign * wn / bw, sign * top / bt)),
               min(window, sign * det / bd))


@device
def _ranges(det, lead, un, vn, bd, bt, bu, bv, same):
    """Return t_low, t_high, u_bound, v_bound, and whether the sign of the denominator is beyond doubt.

    lead: T with the sign of the denominator that is taken; same: it is the sign of det.
    """
    size = abs(det)
    sure = size > bd * (1.0 + 2.0**-10)
    if sure and same:
        less = size - bd
        low = (lead - bt) / (size + bd) * (1.0 - G2) if lead > bt else (lead - bt) / less * (1.0 + G2)
        u, v = abs(un) / size, abs(vn) / size
        ub, vb = (bu + u * bd) / less * (1.0 + G2) + G2 * u, (bv + v * bd) / less * (1.0 + G2) + G2 * v
        return low, (lead + bt) / less * (1.0 + G2), ub, vb, sure
    return max(0.0, (lead - bt) / (size + bd) * (1.0 - G2)), math.inf, math.inf, math.inf, sure


@device
def _exactly(sign, det, top, un, vn, wn, t_max, front, pd, pt, pu, pv):
    """Return INSIDE, DOUBT or 0: what float64 can say of the exact hit, and the float64 error of t."""
    ed, et, eu, ev = _F64 * pd, _F64 * pt, _F64 * pu, _F64 * pv
    ew, em = ed + eu + ev, et + t_max * ed
    size = abs(det)
    edge = t_max * size - sign * top
    most = min(min(min(sign * un + eu, sign * vn + ev), min(sign * wn + ew, sign * top + et)), edge + em)
    least = min(min(min(sign * un - eu, sign * vn - ev), min(sign * wn - ew, sign * top - et)), edge - em)
    error = (et + abs(top / det) * ed) / size if size > ed else math.inf
    if most < 0.0 or (front and sign > 0.0 and size > ed):
        return 0, error
    return (INSIDE if least > 0.0 and size > ed else DOUBT), error


@routine
def evaluate(ray, t_max, table, j, front):
    """Judge one triangle for one ray.

    ray: (ox, oy, oz, dx, dy, dz) float64, t_max finite, table: triangle table, j: its row, front: bool.
    Returns score, t, t_low, t_high, u, v, bound of u, bound of v, float64 error of t, bits (module constants).
    """
    s, det, top, un, vn = numerators(ray, table, j)
    wn = det - un - vn
    pd, pt, pu, pv = _permanents(ray, table, j, s)
    extent = 1.0 + abs(s[0]) + abs(s[1]) + abs(s[2]) + 2.0 * table[j, 13]
    tiny = _UNDERFLOW * extent * extent * extent
    at, au, av, far, gradient = _affine(ray, table, j, s, det)
    bd, bt = G8 * pd + tiny, max(G8 * pt, at) + tiny
    bu, bv = max(G7 * pu, au) + tiny, max(G7 * pv, av) + tiny
    bw = bu + bv + bd + G4 * (abs(un) + abs(vn) + abs(det))
    # The exact denominator has this sign; the computed one may have the other, only within its bound.
    sign = 1.0 if det > 0.0 else -1.0
    score, taken = -math.inf, sign
    if (not front) or sign < 0.0:
        score = _score(sign, det, top, un, vn, wn, t_max, bd, bt, bu, bv, bw)
    if (not front) or sign > 0.0:
        other = _score(-sign, det, top, un, vn, wn, t_max, bd, bt, bu, bv, bw)
        if other > score:
            score, taken = other, -sign
    low, high, ub, vb, sure = _ranges(det, taken * top, un, vn, bd, bt, bu, bv, taken == sign)
    t, u, v = (top / det, un / det, vn / det) if det != 0.0 else (low, 0.0, 0.0)
    t = t if high < math.inf else max(low, t)
    # Range: no overflow, no vanishing reciprocal, plane data finite, R proven for this t.
    ranged = table[j, 15] > 0.0 and abs(det) > _SMALL and max(max(pt, pd), max(pu, pv)) < _LARGE and gradient < _LARGE
    firm = sure and ranged and (sign < 0.0 or not front) and high <= far and high < t_max and low > 0.0
    if not firm:
        score = min(score, 1.0)
    bits, error = _exactly(sign, det, top, un, vn, wn, t_max, front, pd, pt, pu, pv)
    bits |= (FIRM if firm else 0) | (MUST if firm and score > 1.0 else 0)
    bits |= (EDGE_U if sign * un <= bu else 0) | (EDGE_V if sign * vn <= bv else 0) | (EDGE_W if sign * wn <= bw else 0)
    return score, t, low, high, u, v, ub, vb, error, bits
