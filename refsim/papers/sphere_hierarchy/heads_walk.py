"""The walk that finds a head, compiled: like shooting a ray, with half-spaces in the ray's place.

Device functions of `refsim.jit`; `polygon_heads_kernels` and `cell_heads_kernels` hand them planes. Eight
half-spaces N · x ≥ q (`heads`) are the columns of `planes` f64[5, 8], rows N, q and |N|; those not in use hold
everything. All eight are asked without a branch, which is faster than to stop at the first that rejects. Elements are
counted through all lists here; `first` and `end` bound the list that is walked.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func

I = np.int32  # noqa: E741
OFFSET, LENGTH, ROWS, LANES = 3, 4, 5, 8
SLACK = 20 * 2.0**-24
SMALLEST, LARGEST = 2.0**-60, 2.0**60


@func
def slack_at(x, y, z, ball):
    """How far off a ray from (x, y, z) its accepted hits may lie; `ball` f64[4] holds the triangles."""
    x, y, z = x - ball[0], y - ball[1], z - ball[2]
    reach = np.sqrt(x * x + y * y + z * z) + ball[3]
    return max(SLACK * reach, SMALLEST) if reach < LARGEST else np.inf


@func
def clear_planes(planes):
    """Half-spaces that hold everything."""
    planes[:] = 0.0
    planes[OFFSET] = -np.inf


@func
def put_plane(planes, k, x, y, z, offset):
    """Half-space k: all points whose scalar product with (x, y, z) is at least `offset`."""
    planes[0, k], planes[1, k], planes[2, k] = x, y, z
    planes[OFFSET, k], planes[LENGTH, k] = offset, np.sqrt(x * x + y * y + z * z)


@func
def sphere_is_out(planes, s):
    """Whether one of the half-spaces does not meet the ball at all."""
    x, y, z, radius = np.float64(s[0]), np.float64(s[1]), np.float64(s[2]), np.float64(s[3])
    out = I(0)
    for k in range(LANES):
        farthest = planes[0, k] * x + planes[1, k] * y + planes[2, k] * z + planes[LENGTH, k] * radius
        out += I(farthest < planes[OFFSET, k])
    return out > I(0)


@func
def triangle_is_out(planes, t, margin):
    """Whether one of the half-spaces meets neither the triangle nor what float32 weights take for a part of it."""
    ax, ay, az = np.float64(t[0, 0]), np.float64(t[0, 1]), np.float64(t[0, 2])
    bx, by, bz = np.float64(t[1, 0]), np.float64(t[1, 1]), np.float64(t[1, 2])
    cx, cy, cz = np.float64(t[2, 0]), np.float64(t[2, 1]), np.float64(t[2, 2])
    out = I(0)
    for k in range(LANES):
        x, y, z = planes[0, k], planes[1, k], planes[2, k]
        least = planes[OFFSET, k] - planes[LENGTH, k] * margin
        a, b, c = x * ax + y * ay + z * az, x * bx + y * by + z * bz, x * cx + y * cy + z * cz
        out += I((a < least) & (b < least) & (c < least))
    return out > I(0)


@func
def first_survivor(planes, first, end, escape, spheres, payload, triangles, margin):
    """The first triangle that no half-space rejects, nor any of the nodes around it; `end` where there is none."""
    at = first
    while at < end:
        step = escape[at]
        if step == I(1) or step == I(0):
            row = payload[at, 3]
            if not triangle_is_out(planes, triangles[row], margin[row]):
                return at
            at += 1
        elif sphere_is_out(planes, spheres[at]):
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
