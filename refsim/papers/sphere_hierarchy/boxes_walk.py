"""Boxes of a traversal list and the walk through them, compiled. Templates of `refsim.jit`; `boxes` calls them.

**Box.** The slab test, with the interval from 0 to the best hit so far: with e the direction kept from zero,

    enter = max(0, the three nearer of (lower − κ − o) / e and (upper + κ − o) / e)      leave = min(the three farther)
    the box is entered where enter ≤ leave and enter ≤ param

**κ** is the spheres' own, 40 eps R (`traversal`, eps = 2⁻²⁴, R the distance of o from the root's centre plus the root's
radius, no vertex being further). Less is needed. An accepted hit point o + t d lies within 15 eps R of what
`acceptance_margin` grows a box by. Here (lower − o) − κ is off by 2 eps R, the reciprocal and the product by 2 eps, so
e times a parameter by 4 eps R in all; a component of d below 2⁻²⁶ of the largest is raised to that, which moves a
point of the ray by eps R / 2 at most. So 20 eps R keep each nearer parameter at or below the t of a hit in the box,
and each farther one at or above. Where R is no ordinary number κ is infinite, and every box is entered.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.jit import func
from refsim.papers.sphere_hierarchy.hierarchy_build import high_of, low_of, rounded_up
from refsim.papers.sphere_hierarchy.traversal import slack_of

F0, F1 = np.float32(0), np.float32(1)
INFINITY = np.float32(np.inf)
LEAST = np.float32(2.0**-26)
I = np.int32  # noqa: E741
U = np.uintp


@func
def smaller(x, y):
    """min of two float32, as one instruction."""
    return x if x < y else y


@func
def larger(x, y):
    """max of two float32, as one instruction."""
    return x if x > y else y


@func
def kept_from_zero(d):
    """The direction with every component at least 2⁻²⁶ of the largest in size, its sign kept (0 and −0 become
    positive)."""
    least = LEAST * larger(larger(abs(d[0]), abs(d[1])), abs(d[2]))
    return raised(d[0], least), raised(d[1], least), raised(d[2], least)


@func
def raised(x, least):
    """x, or ± least where it is smaller in size."""
    small = least if x >= F0 else -least
    return x if abs(x) > least else small


def fill_boxes(triangles, margin, escape, payload, boxes):
    """The box of every element, `boxes` f32[k, 6], from `triangles` f32[n, 3, 3] grown by `margin` f64[n] and the one
    list's `escape` i32[k] and `payload` i32[k, 4]. Children follow their parent, so from the end on all are there."""
    for at in range(escape.shape[0] - 1, -1, -1):
        step = escape[at]
        if step == I(1) or step == I(0):
            row = payload[at, 3]
            for a in range(3):
                boxes[at, a] = -rounded_up(margin[row] - np.float64(low_of(triangles, row, a)))
                boxes[at, a + 3] = rounded_up(np.float64(high_of(triangles, row, a)) + margin[row])
            continue
        end = at + step if step > I(0) else escape.shape[0]
        for a in range(3):
            boxes[at, a], boxes[at, a + 3] = INFINITY, -INFINITY
        child = at + 1
        while child < end:
            for a in range(3):
                boxes[at, a] = min(boxes[at, a], boxes[child, a])
                boxes[at, a + 3] = max(boxes[at, a + 3], boxes[child, a + 3])
            child = child + escape[child] if escape[child] > I(0) else end


@func
def misses_box(o, inverse, slack, param, box):
    """Whether the ray's segment from 0 to param stays away from the box, which κ grows."""
    ax = ((box[0] - o[0]) - slack) * inverse[0]
    ay = ((box[1] - o[1]) - slack) * inverse[1]
    az = ((box[2] - o[2]) - slack) * inverse[2]
    bx = ((box[3] - o[0]) + slack) * inverse[0]
    by = ((box[4] - o[1]) + slack) * inverse[1]
    bz = ((box[5] - o[2]) + slack) * inverse[2]
    enter = larger(larger(smaller(ax, bx), smaller(ay, by)), larger(smaller(az, bz), F0))
    leave = smaller(smaller(larger(ax, bx), larger(ay, by)), larger(az, bz))
    return ((enter > leave) | (enter > param)) & (slack < INFINITY)


def walk_boxes(
    rows, origin, direction, t_max, any_hit, front_only, escape, payload, boxes, records, root, triangle, t, u, v,
    nodes, tests,
):  # fmt: skip
    """Rays `rows` i32[k], one after the other: `traversal.walk` with boxes in the place of spheres."""
    end = U(escape.shape[0])
    for j in range(rows.shape[0]):
        row = U(rows[j])
        limit = t_max[row]
        if not limit > F0:
            continue
        o = origin[row, 0], origin[row, 1], origin[row, 2]
        d = direction[row, 0], direction[row, 1], direction[row, 2]
        e = kept_from_zero(d)
        inverse, slack = (F1 / e[0], F1 / e[1], F1 / e[2]), slack_of(o, root)
        best, found, hit_u, hit_v = limit, I(-1), F0, F0
        node, visited, tested = U(0), I(0), I(0)
        while node < end:
            visited += I(1)
            step = escape[node]
            if step == I(1) or step == I(0):
                tested += I(1)
                number = payload[node, 3]
                a = records[U(number)]
                v0, n, m1, m2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11])
                inside, at, weight_u, weight_v, den = intersect(o, d, limit, v0, n, m1, m2)
                nearer = (at < best) | ((at == best) & (number < found))
                if inside & nearer & ((den < F0) | (not front_only)):
                    best, found, hit_u, hit_v = at, number, weight_u, weight_v
                    if any_hit:
                        break
            elif not misses_box(o, inverse, slack, best, boxes[node]):
                step = I(1)
            node = node + U(step) if step > I(0) else end
        nodes[row], tests[row] = visited, tested
        if found >= I(0):
            triangle[row], t[row], u[row], v[row] = found, best, hit_u, hit_v
