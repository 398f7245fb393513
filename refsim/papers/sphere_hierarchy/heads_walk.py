"""The walk that finds a head, compiled: like shooting a ray, with half-spaces in the ray's place.

Device functions of `refsim.jit`; `polygon_heads_kernels` and `cell_heads_kernels` hand them planes. A plane is five
float64: a normal N, an offset q and |N|; its half-space is N · x ≥ q (`heads`). Elements are counted through all lists
here; `first` and `end` bound the list that is walked.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func

I = np.int32  # noqa: E741
PLANE = 5
MOST_PLANES = 5
SLACK = 20 * 2.0**-24
SMALLEST, LARGEST = 2.0**-60, 2.0**60


@func
def slack_at(x, y, z, ball):
    """How far off a ray from (x, y, z) its accepted hits may lie; `ball` f64[4] holds the triangles."""
    x, y, z = x - ball[0], y - ball[1], z - ball[2]
    reach = np.sqrt(x * x + y * y + z * z) + ball[3]
    return max(SLACK * reach, SMALLEST) if reach < LARGEST else np.inf


@func
def sphere_is_out(planes, count, s):
    """Whether one of the half-spaces does not meet the ball at all."""
    x, y, z, radius = np.float64(s[0]), np.float64(s[1]), np.float64(s[2]), np.float64(s[3])
    for k in range(count):
        p = planes[k]
        if p[0] * x + p[1] * y + p[2] * z + p[4] * radius < p[3]:
            return True
    return False


@func
def triangle_is_out(planes, count, t, margin):
    """Whether one of the half-spaces meets neither the triangle nor what float32 weights take for a part of it."""
    for k in range(count):
        p = planes[k]
        a = p[0] * t[0, 0] + p[1] * t[0, 1] + p[2] * t[0, 2]
        b = p[0] * t[1, 0] + p[1] * t[1, 1] + p[2] * t[1, 2]
        c = p[0] * t[2, 0] + p[1] * t[2, 1] + p[2] * t[2, 2]
        if max(a, max(b, c)) + p[4] * margin < p[3]:
            return True
    return False


@func
def first_survivor(planes, count, first, end, escape, spheres, payload, triangles, margin):
    """The first triangle that no half-space rejects, nor any of the nodes around it; `end` where there is none."""
    at = first
    while at < end:
        step = escape[at]
        if step == I(1) or step == I(0):
            row = payload[at, 3]
            if not triangle_is_out(planes, count, triangles[row], margin[row]):
                return at
            at += 1
        elif sphere_is_out(planes, count, spheres[at]):
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
