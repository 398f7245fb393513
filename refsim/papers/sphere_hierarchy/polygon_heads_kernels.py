"""Heads of polygons, compiled: planes, head, and whether a ray may use it. Templates of `refsim.jit`."""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.papers.sphere_hierarchy.heads_walk import (
    LANES,
    LENGTH,
    OFFSET,
    ROWS,
    child_towards,
    first_survivor,
    put_plane,
    slack_at,
)

LEAST_COSINE = 2.0**-48


@func
def put_side(planes, k, x, y, z, t, n, epsilon):
    """The half-space along (x, y, z) in which rays from a triangle's front stay: its lowest vertex, moved by epsilon
    along the triangle's normal and down by a quarter of that."""
    a = x * t[0, 0] + y * t[0, 1] + z * t[0, 2]
    b = x * t[1, 0] + y * t[1, 1] + z * t[1, 2]
    c = x * t[2, 0] + y * t[2, 1] + z * t[2, 2]
    put_plane(planes, k, x, y, z, min(a, min(b, c)) + epsilon * (x * n[0] + y * n[1] + z * n[2] - 0.25))


@func
def put_sides(planes, t, n, sides, epsilon):
    """The polygon's own plane and those of the directions, `sides` f64[k, 3]; returns how many."""
    put_side(planes, 0, np.float64(n[0]), np.float64(n[1]), np.float64(n[2]), t, n, epsilon)
    for k in range(sides.shape[0]):
        put_side(planes, k + 1, sides[k, 0], sides[k, 1], sides[k, 2], t, n, epsilon)
    return sides.shape[0] + 1


def planes_of_polygon(planes, t, n, sides, epsilon):
    """`put_sides`, as a kernel."""
    return put_sides(planes, t, n, sides, epsilon)


@func
def outermost_apart(leaf, t, first, end, escape, spheres):
    """The outermost node around `leaf` whose ball does not hold the middle of triangle t, or `leaf` itself."""
    x = (np.float64(t[0, 0]) + np.float64(t[1, 0]) + np.float64(t[2, 0])) / 3.0
    y = (np.float64(t[0, 1]) + np.float64(t[1, 1]) + np.float64(t[2, 1])) / 3.0
    z = (np.float64(t[0, 2]) + np.float64(t[1, 2]) + np.float64(t[2, 2])) / 3.0
    at = first
    while at < leaf:
        s = spheres[at]
        dx, dy, dz, radius = s[0] - x, s[1] - y, s[2] - z, np.float64(s[3])
        if dx * dx + dy * dy + dz * dz > radius * radius:
            return at
        at, _ = child_towards(at, leaf, end, escape)
    return leaf


def heads_of_polygons(
    rows, polygons, normals, sides, epsilon, climbs, first, end, escape, spheres, payload, triangles, margin,
    elements,
):  # fmt: skip
    """Heads of polygons `rows` i64[k] in the list at first..end: `elements` i32[n], counted within the list.

    `polygons` f32[n, 3, 3], `normals` f32[n, 3] (zero: no plane, so the list's own head); `sides` f64[k, 3], normals of
    the list's further planes; `triangles`, `margin` of the hierarchy.
    """
    planes = np.empty((ROWS, LANES))
    for row in rows:
        n, t = normals[row], polygons[row]
        if n[0] == 0 and n[1] == 0 and n[2] == 0:
            elements[row] = 0
            continue
        count = np.uintp(put_sides(planes, t, n, sides, epsilon))
        at = first_survivor(planes, count, first, end, escape, spheres, payload, triangles, margin)
        if climbs and at < end:
            at = outermost_apart(at, t, first, end, escape, spheres)
        elements[row] = at - first


def starts_of_rays(
    origin, direction, picked, polygon, polygons, normals, sides, epsilon, ball, any_side, elements, starts
):
    """Where rays begin that leave polygons: `starts` i32[n], 0 where the head may not be used.

    `picked` i32[n] their lists, `polygon` i32[n] (−1: none); `sides` f64[lists, k, 3]; `elements` i32[lists, polygons].
    """
    planes = np.empty((ROWS, LANES))
    for row in range(starts.shape[0]):
        starts[row] = 0
        k = polygon[row]
        if k < 0:
            continue
        head = elements[picked[row], k]
        n = normals[k]
        if head == 0 or any_side:
            starts[row] = head
            continue
        # The direction: to the normal's side. That it is on the list's side is what the list was picked by
        x, y, z = np.float64(direction[row, 0]), np.float64(direction[row, 1]), np.float64(direction[row, 2])
        if not n[0] * x + n[1] * y + n[2] * z > LEAST_COSINE:
            continue
        # The origin: within every half-space, by more than float32 can be off
        x, y, z = np.float64(origin[row, 0]), np.float64(origin[row, 1]), np.float64(origin[row, 2])
        slack = slack_at(x, y, z, ball)
        inside = True
        for j in range(put_sides(planes, polygons[k], n, sides[picked[row]], epsilon)):
            along = planes[0, j] * x + planes[1, j] * y + planes[2, j] * z
            inside &= along >= planes[OFFSET, j] + planes[LENGTH, j] * slack
        if inside:
            starts[row] = head
