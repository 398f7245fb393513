"""The walks through a kd-tree, compiled. Template of `refsim.jit`; `kd_search` calls it, `kd_tree` has the margins.

A node is looked at with an interval of ray parameters, and `last` is where the ray leaves the root's box. At a plane
crossed at c the interval is cut, the child on the side that the ray comes from first:

    c ≥ high   the near child alone        c ≤ low   the far child alone        else   near to c, then far from c

A ray parallel to a plane, or starting on it, needs no case of its own: its direction is kept from zero, so it crosses
far off, or at 0.

**Going on after a leaf** that is left at `high`, with no hit up to there: from low = high to
    stack      the interval that was put off last, which begins there
    restart    last, at the root
    backtrack  where the ray leaves the box of the nearest ancestor that it leaves after `high`, at that ancestor

**Why it always ends.** Where an interval is cut, low < c < high, so a leaf is left later than it was entered and `low`
increases from leaf to leaf; only the first interval can be a single parameter, and then it is the last one, too. A
box's sides are planes, and their parameters the same numbers as when these cut the interval; so an ancestor's exit is
the `high` that it was looked at with, and all three ways find the same leaf, with the same interval.
"""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.jit import func
from refsim.papers.sphere_hierarchy.boxes_walk import kept_from_zero, larger, smaller

F0, F1 = np.float32(0), np.float32(1)
I = np.int32  # noqa: E741
U = np.uintp
LEAF = I(3)
STACK, RESTART, BACKTRACK = I(0), I(1), I(2)


@func
def sides(o, inverse, box):
    """``(enter, leave)``, where the ray enters the box, not before 0, and where it leaves it."""
    ax, bx = (box[0] - o[0]) * inverse[0], (box[3] - o[0]) * inverse[0]
    ay, by = (box[1] - o[1]) * inverse[1], (box[4] - o[1]) * inverse[1]
    az, bz = (box[2] - o[2]) * inverse[2], (box[5] - o[2]) * inverse[2]
    enter = larger(larger(smaller(ax, bx), smaller(ay, by)), larger(smaller(az, bz), F0))
    return enter, smaller(smaller(larger(ax, bx), larger(ay, by)), larger(az, bz))


@func
def within(o, centre, far):
    """Whether the margins hold for rays that start at o."""
    return (abs(o[0] - centre[0]) <= far) & (abs(o[1] - centre[1]) <= far) & (abs(o[2] - centre[2]) <= far)


@func
def component(v, axis):
    """One of three, the axis known when it runs."""
    return v[0] if axis == I(0) else (v[1] if axis == I(1) else v[2])


@func
def tested_against(records, number, o, d, limit, front_only, best, found, hit_u, hit_v):
    """The best hit ``(t, triangle, u, v)`` after one more triangle; of equal ones that with the lower number."""
    a = records[U(number)]
    v0, n, m1, m2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11])
    inside, at, u, v, den = intersect(o, d, limit, v0, n, m1, m2)
    nearer = (at < best) | ((at == best) & (number < found))
    taken = inside & nearer & ((den < F0) | (not front_only))
    return at if taken else best, number if taken else found, u if taken else hit_u, v if taken else hit_v


def walk_kd(
    rows, origin, direction, t_max, any_hit, front_only, way, split, links, boxes, lists, loose, records, centre, far,
    depth, triangle, t, u, v, nodes, tests, leaves, resumed, climbed, deepest,
):  # fmt: skip
    """Rays `rows` i32[k], one after the other, by the traversal `way`."""
    waiting, until = np.empty(depth + 1, np.int32), np.empty(depth + 1, np.float32)
    for j in range(rows.shape[0]):
        row = U(rows[j])
        limit = t_max[row]
        if not limit > F0:
            continue
        o = origin[row, 0], origin[row, 1], origin[row, 2]
        d = direction[row, 0], direction[row, 1], direction[row, 2]
        e = kept_from_zero(d)
        inverse = F1 / e[0], F1 / e[1], F1 / e[2]
        best, found, hit_u, hit_v = limit, I(-1), F0, F0
        tested, passed, ended, again, up, most = I(0), I(0), I(0), I(0), I(0), I(0)
        # Triangles that no leaf holds; from beyond reach, all
        reached = within(o, centre, far)
        candidates = loose.shape[0] if reached else records.shape[0]
        for k in range(candidates):
            number = loose[k] if reached else I(k)
            tested += I(1)
            best, found, hit_u, hit_v = tested_against(
                records, number, o, d, limit, front_only, best, found, hit_u, hit_v
            )
            if any_hit & (found >= I(0)):
                break
        low, last = sides(o, inverse, boxes[0])
        high, node, top = last, I(0), 0
        going = reached & (low <= last) & (low <= best) & ((not any_hit) | (found < I(0)))
        while going:
            axis = links[U(node), 0]
            if axis < LEAF:
                passed += I(1)
                at = U(node)
                cross = (split[at] - component(o, axis)) * component(inverse, axis)
                upwards = component(e, axis) > F0
                near, beyond = node + I(1), links[at, 1]
                near, beyond = near if upwards else beyond, beyond if upwards else near
                if cross >= high:
                    node = near
                elif cross <= low:
                    node = beyond
                else:
                    if way == STACK:
                        waiting[top], until[top] = beyond, high
                        top += 1
                        most = max(most, I(top))
                    node, high = near, cross
                continue
            ended += I(1)
            k, end = links[U(node), 1], links[U(node), 1] + links[U(node), 2]
            while k < end:
                tested += I(1)
                best, found, hit_u, hit_v = tested_against(
                    records, lists[U(k)], o, d, limit, front_only, best, found, hit_u, hit_v
                )
                k = end if any_hit & (found >= I(0)) else k + I(1)
            if (best <= high) | (high >= last) | (any_hit & (found >= I(0))):
                break
            again += I(1)
            low = high
            if way == STACK:
                top -= 1
                node, high = waiting[top], until[top]
            elif way == RESTART:
                node, high = I(0), last
            else:
                while high <= low:
                    node = links[U(node), 3]
                    up += I(1)
                    _, high = sides(o, inverse, boxes[U(node)])
        nodes[row], tests[row] = passed + ended + up + tested, tested
        leaves[row], resumed[row], climbed[row], deepest[row] = ended, again, up, most
        if found >= I(0):
            triangle[row], t[row], u[row], v[row] = found, best, hit_u, hit_v
