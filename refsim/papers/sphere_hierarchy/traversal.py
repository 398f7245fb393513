"""The pseudo-code of section 2.1, a ray at a time: device functions, and the scalar loop. Templates of `refsim.jit`.

**Sphere.** "intersectionParameter < param" must mean the entry root, clamped at the ray's start (BSH-E5). The segment
from 0 to param meets the ball exactly then, so the test is the distance of the centre from that segment: the same
decision without a root, and without the cancellation in the discriminant of a small sphere far away.

    k = clamp(w · (c − o), 0, param), w = d / (d · d)          |c − o − k d| ≤ r + κ

**κ** is what a ray's float32 arithmetic may be off, eps = 2⁻²⁴, R = distance of o from the root's centre plus the
root's radius. An accepted hit point lies within 15 eps R of what `acceptance_margin` grows a sphere by (derived in
`refsim.geometry.triangle`'s terms: 11 eps R off the plane, 4 eps R in h). Here c − o is off by eps R, w by 4 eps, so k
moves the point by 8 eps R along the ray; k d and the difference add 2 eps R, the square and its comparison 4 eps R.
κ = 40 eps R covers the sum of 30. So a sphere with a nearer or equal hit inside is never skipped, and the hits do not
depend on the order of the list. Where R is no ordinary number κ is infinite: slow and right.

**Ties.** Of hits at the same t the triangle with the lower number counts; the pseudo-code's strict comparison would
leave it to the order of the list.

**Any hit.** Shadow rays end at their first hit.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.jit import func

F0, F1 = np.float32(0), np.float32(1)
INFINITY = np.float32(np.inf)
KAPPA = np.float32(40 * 2.0**-24)
SMALLEST, LARGEST = np.float32(2.0**-60), np.float32(2.0**60)
I = np.int32  # noqa: E741
U = np.uintp


@func
def slack_of(o, root):
    """κ of a ray that starts at o; `root` is the first sphere's (x, y, z, radius)."""
    x, y, z = root[0] - o[0], root[1] - o[1], root[2] - o[2]
    reach = np.sqrt(x * x + y * y + z * z) + root[3]
    slack = KAPPA * reach
    slack = slack if slack > SMALLEST else SMALLEST
    return slack if reach < LARGEST else INFINITY


@func
def per_length(d):
    """w = d / (d · d): its scalar product with a vector is the ray parameter of the nearest point."""
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    return d[0] / square, d[1] / square, d[2] / square


@func
def misses_sphere(o, d, w, slack, param, x, y, z, radius):
    """Whether the ray's segment from 0 to param stays away from the ball."""
    x, y, z = x - o[0], y - o[1], z - o[2]
    k = x * w[0] + y * w[1] + z * w[2]
    k = k if k < param else param
    k = k if k > F0 else F0
    x, y, z = x - k * d[0], y - k * d[1], z - k * d[2]
    reach = radius + slack
    return x * x + y * y + z * z > reach * reach


@func
def ball_at(balls, k):
    """Centre and radius that begin at place k of the flat payload."""
    return balls[k], balls[k + U(1)], balls[k + U(2)], balls[k + U(3)]


@func
def record_at(floats, k):
    """(v0, n, m1, m2) that begin at place k of the flat records."""
    return (
        (floats[k], floats[k + U(1)], floats[k + U(2)]),
        (floats[k + U(3)], floats[k + U(4)], floats[k + U(5)]),
        (floats[k + U(6)], floats[k + U(7)], floats[k + U(8)]),
        (floats[k + U(9)], floats[k + U(10)], floats[k + U(11)]),
    )


def walk(
    rows, lists, starts, origin, direction, t_max, escape, spheres, payload, first, records, root, any_hit, front_only,
    offset, triangle, t, u, v, nodes, tests,
):  # fmt: skip
    """Rays `rows` i32[k], one after the other, through the list each picked.

    Read: `lists` i32[n], the list of a ray; `starts` i32[n], the element it begins at (the head); `origin`, `direction`
    f32[n, 3], `t_max` f32[n]; the lists (`lists.TraversalLists`); `root` f32[4]; `offset`, added to the
    triangles' numbers. Written and read, f32[n] and i32[n]:
    the best hit so far, which a list met earlier may have left; `nodes` and `tests` are added to.
    """
    # Flat, so that rows are a constant apart: strides would be read again for every element
    balls, words, floats = spheres.ravel(), payload.ravel(), records.ravel()
    for j in range(rows.shape[0]):
        row = U(rows[j])
        if not t_max[row] > F0:
            continue
        o = origin[row, 0], origin[row, 1], origin[row, 2]
        d = direction[row, 0], direction[row, 1], direction[row, 2]
        w, slack = per_length(d), slack_of(o, root)
        best, found = t[row], triangle[row]
        if found < 0:
            best = t_max[row]
        elif any_hit:
            continue
        limit = t_max[row]
        node = U(first[lists[row]] + starts[row])
        end = U(first[lists[row] + 1])
        visited, tested = I(0), I(0)
        while node < end:
            visited += I(1)
            step = escape[node]
            if step == I(1) or step == I(0):
                tested += I(1)
                own = words[U(4) * node + U(3)]
                number = I(own + offset)
                v0, n, m1, m2 = record_at(floats, U(12) * U(own))
                inside, at, weight_u, weight_v, den = intersect(o, d, limit, v0, n, m1, m2)
                nearer = (at < best) | ((at == best) & (number < found))
                if inside & nearer & ((den < F0) | (not front_only)):
                    best, found = at, number
                    triangle[row], t[row], u[row], v[row] = number, at, weight_u, weight_v
                    if any_hit:
                        break
            else:
                x, y, z, radius = ball_at(balls, U(4) * node)
                if not misses_sphere(o, d, w, slack, best, x, y, z, radius):
                    step = I(1)
            node = node + U(step) if step > I(0) else end
        nodes[row] += visited
        tests[row] += tested
