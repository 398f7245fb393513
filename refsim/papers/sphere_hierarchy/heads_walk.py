"""The walk that finds a head, compiled: like shooting a ray, with half-spaces in the ray's place.

Device functions of `refsim.jit`; `polygon_heads_kernels` and `cell_heads_kernels` hand them planes. Up to
five half-spaces N · x ≥ q (`heads`) are the columns of `planes` f64[5, 5], rows N, q and |N|. Elements are
counted through all lists here; `first` and `end` bound the list that is walked.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func

I = np.int32  # noqa: E741
U = np.uintp
OFFSET, LENGTH, ROWS, LANES = 3, 4, 5, 5
SLACK = 20 * 2.0**-24
SMALLEST, LARGEST = 2.0**-60, 2.0**60


@func
def slack_at(x, y, z, ball):
    """How far off a ray from (x, y, z) its accepted hits may lie; `ball` f64[4] holds the triangles."""
    x, y, z = x - ball[0], y - ball[1], z - ball[2]
    reach = np.sqrt(x * x + y * y + z * z) + ball[3]
    return max(SLACK * reach, SMALLEST) if reach < LARGEST else np.inf


@func
def put_plane(planes, k, x, y, z, offset):
    """Half-space k: all points whose scalar product with (x, y, z) is at least `offset`."""
    planes[0, k], planes[1, k], planes[2, k] = x, y, z
    planes[OFFSET, k], planes[LENGTH, k] = offset, np.sqrt(x * x + y * y + z * z)


@func
def sphere_behind(planes, k, s):
    """Whether half-space k does not meet the ball at all."""
    x, y, z, radius = np.float64(s[0]), np.float64(s[1]), np.float64(s[2]), np.float64(s[3])
    farthest = planes[0, k] * x + planes[1, k] * y + planes[2, k] * z + planes[LENGTH, k] * radius
    return farthest < planes[OFFSET, k]


@func
def triangle_behind(planes, k, t, margin):
    """Whether half-space k meets neither the triangle nor what float32 weights take for a part of it."""
    x, y, z = planes[0, k], planes[1, k], planes[2, k]
    a = x * t[0, 0] + y * t[0, 1] + z * t[0, 2]
    b = x * t[1, 0] + y * t[1, 1] + z * t[1, 2]
    c = x * t[2, 0] + y * t[2, 1] + z * t[2, 2]
    least = planes[OFFSET, k] - planes[LENGTH, k] * margin
    return (a < least) & (b < least) & (c < least)


@func
def first_survivor(planes, count, first, end, escape, spheres, payload, triangles, margin):
    """The first triangle that no half-space rejects, nor any of the nodes around it; `end` where there is none.

    The half-space that rejected last is asked first: it often rejects the next element, too.
    """
    at, last = first, U(0)
    while at < end:
        step = escape[U(at)]
        if step == I(1) or step == I(0):
            row = U(payload[U(at), U(3)])
            t, reach = triangles[row], margin[row]
            if not triangle_behind(planes, last, t, reach):
                k = U(0)
                while k < count and not triangle_behind(planes, k, t, reach):
                    k += U(1)
                if k == count:
                    return at
                last = k
            at += 1
        else:
            s = spheres[U(at)]
            if sphere_behind(planes, last, s):
                at = at + step if step > I(0) else end
                continue
            k = U(0)
            while k < count and not sphere_behind(planes, k, s):
                k += U(1)
            if k < count:
                last = k
                at = at + step if step > I(0) else end
            else:
                at += 1
    return end


@func
def past(at, end, escape):
    """The element after a subtree."""
    step = escape[at]
    return at + step if step > I(0) else end


@func
def child_towards(at, leaf, end, escape):
    """``(child, before)``: the child of node `at` in whose subtree `leaf` is, and how many children come before it."""
    child, before = at + 1, 0
    following = past(child, end, escape)
    while following <= leaf:
        child, before = following, before + 1
        following = past(child, end, escape)
    return child, before
