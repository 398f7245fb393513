"""Heads of screen cells, compiled: planes around a set of rays, and the head behind them. Template of `refsim.jit`."""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.papers.sphere_hierarchy.heads_walk import (
    LENGTH,
    OFFSET,
    child_towards,
    first_survivor,
    past,
    put_plane,
    slack_at,
)

LEAST_COSINE = 2.0**-10
BEAM = 5


@func
def put_frame(frame, x, y, z):
    """Rows m, u, v of an orthonormal frame, m along (x, y, z); whether there is one."""
    length = np.sqrt(x * x + y * y + z * z)
    if not length > LEAST_COSINE:
        return False
    x, y, z = x / length, y / length, z / length
    frame[0, 0], frame[0, 1], frame[0, 2] = x, y, z
    # u is square to m and to the axis that m is least along
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax <= ay and ax <= az:
        ux, uy, uz = 0.0, z, -y
    elif ay <= az:
        ux, uy, uz = -z, 0.0, x
    else:
        ux, uy, uz = y, -x, 0.0
    length = np.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux / length, uy / length, uz / length
    frame[1, 0], frame[1, 1], frame[1, 2] = ux, uy, uz
    frame[2, 0], frame[2, 1], frame[2, 2] = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    return True


@func
def along(vector, x, y, z):
    """Scalar product with (x, y, z)."""
    return vector[0] * x + vector[1] * y + vector[2] * z


@func
def put_beam(planes, frame, rows, origin, direction, ball):
    """The half-spaces that hold all rays of `rows`: two along u, two along v, one along m; returns how many, 0 or 5."""
    x, y, z = 0.0, 0.0, 0.0
    for row in rows:
        x, y, z = x + direction[row, 0], y + direction[row, 1], z + direction[row, 2]
    count = rows.shape[0]
    if not put_frame(frame, x / count, y / count, z / count):
        return 0
    # Slopes of the directions about m
    low_u, low_v, high_u, high_v = np.inf, np.inf, -np.inf, -np.inf
    for row in rows:
        x, y, z = np.float64(direction[row, 0]), np.float64(direction[row, 1]), np.float64(direction[row, 2])
        forward = along(frame[0], x, y, z)
        if not forward > LEAST_COSINE:
            return 0
        a, b = along(frame[1], x, y, z) / forward, along(frame[2], x, y, z) / forward
        low_u, high_u, low_v, high_v = min(low_u, a), max(high_u, a), min(low_v, b), max(high_v, b)
    m, u, v = frame[0], frame[1], frame[2]
    put_plane(planes, 0, u[0] - low_u * m[0], u[1] - low_u * m[1], u[2] - low_u * m[2], np.inf)
    put_plane(planes, 1, high_u * m[0] - u[0], high_u * m[1] - u[1], high_u * m[2] - u[2], np.inf)
    put_plane(planes, 2, v[0] - low_v * m[0], v[1] - low_v * m[1], v[2] - low_v * m[2], np.inf)
    put_plane(planes, 3, high_v * m[0] - v[0], high_v * m[1] - v[1], high_v * m[2] - v[2], np.inf)
    put_plane(planes, 4, m[0], m[1], m[2], np.inf)
    # How far back each has to be for all origins
    for row in rows:
        x, y, z = np.float64(origin[row, 0]), np.float64(origin[row, 1]), np.float64(origin[row, 2])
        slack = slack_at(x, y, z, ball)
        for k in range(BEAM):
            distance = planes[0, k] * x + planes[1, k] * y + planes[2, k] * z - planes[LENGTH, k] * slack
            planes[OFFSET, k] = min(planes[OFFSET, k], distance)
    return BEAM


@func
def share_of(planes, k, s):
    """The part of the beam's width between plane k and the one that faces it, k + 1, that a ball covers."""
    x, y, z, radius = np.float64(s[0]), np.float64(s[1]), np.float64(s[2]), np.float64(s[3])
    a = (planes[0, k] * x + planes[1, k] * y + planes[2, k] * z - planes[OFFSET, k]) / planes[LENGTH, k]
    k += 1
    b = (planes[0, k] * x + planes[1, k] * y + planes[2, k] * z - planes[OFFSET, k]) / planes[LENGTH, k]
    width, covered = a + b, min(a, radius) + min(b, radius)
    return 1.0 if not covered < width else max(covered / width, 0.0)


@func
def best_to_climb_to(planes, leaf, first, end, escape, spheres):
    """The node around `leaf`, or itself, with the least sum of p C − S below it: the fewest visits expected."""
    at = best = first
    cost = least = 0.0
    chance = 1.0
    while at < leaf:
        chance = min(chance, share_of(planes, 0, spheres[at]) * share_of(planes, 2, spheres[at]))
        over = past(at, end, escape)
        at, before = child_towards(at, leaf, end, escape)
        after, other = 0, past(at, end, escape)
        while other < over:
            after += 1
            other = past(other, end, escape)
        # Not to begin at the parent saves its children's visits, and costs those of the later ones
        cost -= chance * (before + 1 + after) - after
        if cost < least:
            least, best = cost, at
    return best


def heads_of_cells(
    rows, cuts, numbers, origin, direction, ball, climbs, first, escape, spheres, payload, triangles, margin, planes,
    heads,
):  # fmt: skip
    """One head a set of rays: `rows` i64[n], set k is rows[cuts[k]:cuts[k + 1]] and takes list numbers[k].

    Written: `heads` i32[sets], and `planes` f64[5, 5], those of the last set; returns how many these are.
    """
    frame = np.empty((3, 3))
    count = 0
    for k in range(heads.shape[0]):
        base, end = first[numbers[k]], first[numbers[k] + 1]
        count = put_beam(planes, frame, rows[cuts[k]:cuts[k + 1]], origin, direction, ball)
        heads[k] = 0
        if count == 0:
            continue
        at = first_survivor(planes, np.uintp(count), base, end, escape, spheres, payload, triangles, margin)
        if climbs and at < end:
            at = best_to_climb_to(planes, at, base, end, escape, spheres)
        heads[k] = at - base
    return count
