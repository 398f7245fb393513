"""Find every triangle that may matter to a ray, and settle the ray's admissible answers.

Why a node may be skipped. Let a triangle be a candidate within λ = CAP bounds, θ its angle of incidence,
q = emax²/|N|, S = 2.2 (|o| + reach) + 1.1 edge ≥ |o| + |v0| + R of `bounds.py` (for q below SLIVER), so emax ≤ S/2.2.
A permanent is at most 2/√3 times the product of the lengths (Carlen, Lieb, Moss 2006), and (n·d)² + (m1·d/|m1|)² ≤ 1,
hence |ΔD| ≤ 1.16 γ_8 emax², |ΔU|, |ΔV| ≤ 1.25 γ_8 emax S, |ΔW| ≤ 3.6 γ_8 emax S. Weights negative by B in sum lie
within B emax of the triangle, and two of them at most are negative: 4.9 λ γ_8 q S/cos θ; t may stray by
4 λ γ_8 q S/cos θ. So the crossing point, strayed, lies within C/cos θ of the triangle, C = 10 λ γ_8 q S.

Triangles of cos θ > STEEP: the tree over positions, boxes widened by C/max(STEEP, least cos θ by the box of normals).
Triangles of cos θ ≤ STEEP: let δ ≤ C/cos θ be the distance from the crossing point to the triangle and m the point
of the line nearest to the middle of the ball that holds the scene. The crossing point is within δ + radius of m, so
the plane passes m at no more than C + STEEP·radius: the tree over planes, by n·d and n·m − offset.
"""

from __future__ import annotations

import math

import numpy as np

from refsim.oracle.bounds import CAP, DOUBT, FAR, G8, INSIDE, MUST, evaluate, numerators
from refsim.oracle.compiled import device, kernel, routine
from refsim.oracle.tree import LEAF

# Columns of a candidate's numbers.
SCORE, T, LOW, HIGH, U, V, U_BOUND, V_BOUND, ERROR, VALUES = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9

STEEP = 0.02  # smaller: wider boxes; larger: more planes. Any value is right.


@device
def _passed_by(nodes, at, ray, limit, size):
    """Whether no triangle of cos θ > STEEP below this node of the tree over positions can be a candidate."""
    turn = nodes[at, 3] * ray[3] + nodes[at, 4] * ray[4] + nodes[at, 5] * ray[5]
    turn_by = nodes[at, 10] * abs(ray[3]) + nodes[at, 11] * abs(ray[4]) + nodes[at, 12] * abs(ray[5])
    wide = size * nodes[at, 14] / max(abs(turn) - turn_by, STEEP)
    first, last = 0.0, limit
    for k in range(3):
        s = nodes[at, k] - ray[k]
        h = nodes[at, 7 + k] + wide
        if abs(ray[3 + k]) > 1e-30:
            a, b = (s - h) / ray[3 + k], (s + h) / ray[3 + k]
            first, last = max(first, min(a, b)), min(last, max(a, b))
        elif abs(s) > h:
            return True
    return (first > last) | (abs(turn) + turn_by < 0.999 * STEEP)


@device
def _not_along(nodes, at, ray, mx, my, mz, slack, size):
    """Whether no triangle of cos θ ≤ STEEP below this node of the tree over planes can be a candidate."""
    turn = nodes[at, 3] * ray[3] + nodes[at, 4] * ray[4] + nodes[at, 5] * ray[5]
    turn_by = nodes[at, 10] * abs(ray[3]) + nodes[at, 11] * abs(ray[4]) + nodes[at, 12] * abs(ray[5])
    pass_ = nodes[at, 3] * mx + nodes[at, 4] * my + nodes[at, 5] * mz - nodes[at, 6]
    pass_by = nodes[at, 10] * abs(mx) + nodes[at, 11] * abs(my) + nodes[at, 12] * abs(mz) + nodes[at, 13]
    return (abs(turn) - turn_by > 1.001 * STEEP) | (abs(pass_) - pass_by > slack + size * nodes[at, 14])


@device
def _outside(ray, table, j, size):
    """Whether the crude bounds of the module docstring already exclude the triangle (q below SLIVER only)."""
    _, det, _, un, vn = numerators(ray, table, j)
    sign = 1.0 if det > 0.0 else -1.0
    wn = sign * (det - un - vn)
    # An eighth of C is 1.25; the third weight may stray three times as far.
    crude = size * table[j, 13] * (1.0 / 8.0)
    certain = abs(det) > 2.0 * CAP * G8 * table[j, 13] * table[j, 13]
    return certain & ((sign * un < -crude) | (sign * vn < -crude) | (wn < -3.0 * crude))


@device
def _grazes(ray, table, j):
    """Whether the triangle belongs to the tree over planes for this ray."""
    return abs(table[j, 9] * ray[3] + table[j, 10] * ray[4] + table[j, 11] * ray[5]) <= STEEP * table[j, 12]


@routine
def _consider(j, ray, t_max, table, front, ids, values, bits, count, limit):
    """Append triangle j when it is within CAP bounds; return the number of candidates and the new limit of t."""
    score, t, low, high, u, v, ub, vb, error, known = evaluate(ray, t_max, table, j, front)
    if score >= -CAP:
        ids[count], bits[count] = j, known
        values[count, 0], values[count, 1], values[count, 2], values[count, 3] = score, t, low, high
        values[count, 4], values[count, 5], values[count, 6], values[count, 7] = u, v, ub, vb
        values[count, 8] = error
        count += 1
        if known & MUST:
            limit = min(limit, t + CAP * (high - t))
    return count, limit


@routine
def _wider(ids, values, bits, room):
    """Return the three arrays with the same content and room for more rows."""
    more, longer, larger = np.empty(room, np.int32), np.empty(room, np.int32), np.empty((room, VALUES))
    more[:len(ids)], longer[:len(ids)], larger[:len(ids)] = ids, bits, values
    return more, larger, longer


@routine
def _sort(ids, values, bits, count):
    """Order candidates by triangle index: the result must not depend on how they were found."""
    gap = 1
    while gap < count:
        gap = 3 * gap + 1
    while gap > 1:
        gap //= 3
        for i in range(gap, count):
            k = i
            while k >= gap and ids[k - gap] > ids[k]:
                ids[k], ids[k - gap] = ids[k - gap], ids[k]
                bits[k], bits[k - gap] = bits[k - gap], bits[k]
                for c in range(VALUES):
                    values[k, c], values[k - gap, c] = values[k - gap, c], values[k, c]
                k -= gap


@routine
def _first(values, bits, count):
    """Return the row of the closest float64 hit (-1 for none) and whether float64 may be wrong about it."""
    best = -1
    for i in range(count):
        if bits[i] & INSIDE and (best < 0 or values[i, 1] < values[best, 1]):
            best = i
    unsure = False
    for i in range(count):
        if bits[i] & DOUBT and (best < 0 or values[i, 2] <= values[best, 3]):
            unsure = True
        if i != best and bits[i] & INSIDE and values[i, 1] - values[best, 1] <= values[i, 8] + values[best, 8]:
            unsure = True
    return best, unsure


@routine
def _margin(values, count, best, limit):
    """Return by how many bounds the nearest other answer is away, at most CAP."""
    margin = CAP if best < 0 else min(CAP, max(0.0, values[best, 0]))
    for i in range(count):
        if i == best:
            continue
        need = max(0.0, -values[i, 0])
        if best >= 0:
            gap = values[i, 1] - values[best, 1]
            if values[i, 1] - CAP * (values[i, 1] - values[i, 2]) > limit:
                continue
            if gap > 0.0:
                need = max(need, gap / ((values[i, 1] - values[i, 2]) + (values[best, 3] - values[best, 1])))
        margin = min(margin, need)
    return margin


@routine
def _near(tree, table, ray, long, front, size, found, stack):
    """Add the candidates of the tree over positions, nearest child first. found: ids, values, bits, count, limit."""
    order, links, nodes = tree
    ids, values, bits, count, limit = found
    stack[0], top = 0, 1
    while top > 0:
        top -= 1
        at = stack[top]
        if _passed_by(nodes, at, ray, limit, size):
            continue
        if links[at, 1] > 0:
            left, right = links[at, 0], links[at, 1]
            ahead = 0.0
            for k in range(3):
                ahead += (nodes[right, k] - nodes[left, k]) * ray[3 + k]
            stack[top], stack[top + 1] = (right, left) if ahead > 0.0 else (left, right)
            top += 2
            continue
        if count + LEAF > len(ids):
            ids, values, bits = _wider(ids, values, bits, 2 * len(ids))
        for k in range(links[at, 0], links[at, 0] - links[at, 1]):
            if not _outside(ray, table, order[k], size) and not _grazes(ray, table, order[k]):
                count, limit = _consider(order[k], ray, long, table, front, ids, values, bits, count, limit)
    return ids, values, bits, count, limit


@routine
def _along(tree, table, ray, long, front, size, found, stack, ball):
    """Add the candidates of the tree over planes, through the point m of the ray nearest to the ball's middle."""
    order, links, nodes = tree
    ids, values, bits, count, limit = found
    mx, my, mz = ray[0] - ball[0], ray[1] - ball[1], ray[2] - ball[2]
    slack = 1.01 * STEEP * ball[3] + 2.0**-40 * (abs(mx) + abs(my) + abs(mz) + ball[3])
    ahead = -(mx * ray[3] + my * ray[4] + mz * ray[5]) / (ray[3] * ray[3] + ray[4] * ray[4] + ray[5] * ray[5])
    mx, my, mz = mx + ahead * ray[3], my + ahead * ray[4], mz + ahead * ray[5]
    stack[0], top = 0, 1
    while top > 0:
        top -= 1
        at = stack[top]
        if _not_along(nodes, at, ray, mx, my, mz, slack, size):
            continue
        if links[at, 1] > 0:
            stack[top], stack[top + 1] = links[at, 0], links[at, 1]
            top += 2
            continue
        if count + LEAF > len(ids):
            ids, values, bits = _wider(ids, values, bits, 2 * len(ids))
        for k in range(links[at, 0], links[at, 0] - links[at, 1]):
            if _grazes(ray, table, order[k]) and not _outside(ray, table, order[k], size):
                count, limit = _consider(order[k], ray, long, table, front, ids, values, bits, count, limit)
    return ids, values, bits, count, limit


@kernel
def search(table, space, planes, slivers, ball, reach, edge, everything,
           origin, direction, t_max, live, front, miss, closest, closest_t, margin, unsure, counts):
    """Settle a run of rays; fill the per-ray columns and return the admissible triangles, one after another.

    space, planes: order, links and nodes of the trees. ball: middle and radius. everything: bool, test all triangles of
    `slivers` and no tree. live: bool per ray.
    Returns ids i32[k], values f64[k,9], bits i32[k]; counts[i] of them belong to ray i.
    """
    n = len(origin)
    out_ids, out_bits, out_values = np.empty(n + 16, np.int32), np.empty(n + 16, np.int32), np.empty((n + 16, VALUES))
    ids, bits, values = np.empty(64, np.int32), np.empty(64, np.int32), np.empty((64, VALUES))
    used, stack = 0, np.empty(128, np.int32)
    for r in range(n):
        miss[r], closest[r], closest_t[r], margin[r], unsure[r], counts[r] = True, -1, np.inf, CAP, False, 0
        if not live[r]:
            continue
        ray = (float(origin[r, 0]), float(origin[r, 1]), float(origin[r, 2]),
               float(direction[r, 0]), float(direction[r, 1]), float(direction[r, 2]))
        long = min(float(t_max[r]), FAR)
        limit, count = long, 0
        away = math.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2])
        size = 10.01 * CAP * G8 * (2.2 * (away + reach) + 1.1 * edge)
        # Candidates: slivers always, then what is near, then what nearly contains the ray.
        if len(slivers) > len(ids):
            ids, values, bits = _wider(ids, values, bits, 2 * len(slivers))
        for k in range(len(slivers)):
            count, limit = _consider(slivers[k], ray, long, table, front, ids, values, bits, count, limit)
        if not everything:
            found = (ids, values, bits, count, limit)
            found = _near(space, table, ray, long, front, size, found, stack)
            ids, values, bits, count, limit = _along(planes, table, ray, long, front, size, found, stack, ball)
        if count == 0:
            continue
        _sort(ids, values, bits, count)
        best, unsure[r] = _first(values, bits, count)
        margin[r] = _margin(values, count, best, limit)
        if best >= 0:
            closest[r], closest_t[r] = ids[best], values[best, 1]
        # What may be seen: accepted perhaps, and not surely behind another.
        nearest = np.inf
        for i in range(count):
            if bits[i] & MUST:
                nearest, miss[r] = min(nearest, values[i, 3]), False
        if used + count > len(out_ids):
            out_ids, out_values, out_bits = _wider(out_ids, out_values, out_bits, 2 * (used + count))
        for i in range(count):
            if values[i, 0] >= -1.0 and values[i, 2] <= nearest:
                out_ids[used], out_bits[used] = ids[i], bits[i]
                for c in range(VALUES):
                    out_values[used, c] = values[i, c]
                used += 1
                counts[r] += 1
    return out_ids[:used].copy(), out_values[:used].copy(), out_bits[:used].copy()
