"""Partially precomputed traversal (section 3): where in a list rays with something in common may begin.

A *head* replaces a list's first element for a set of rays that stay in the half-spaces N · x ≥ q. "A mostly efficient
and inexpensive test": an element is rejected where one of the half-spaces does not meet it at all. The head is found by
a walk "very similar to ray shooting", which escapes from what is rejected and ends at the first triangle that is not.

    polygon_heads   of rays that leave a polygon on its front (section 3.1): one a polygon and list
    cell_heads      of the rays of one screen cell (section 3.2): one a cell and list

**Head rules.** `"leaf"` begins at the triangle found. That bypasses the nodes around it, whose escapes might have
skipped more, so some rays visit more elements than without a head (BSH-E4). `"climb"` begins at one of those nodes.
Let A be one with C children, S of them after the one towards the leaf, and p the chance that a ray meets A's ball. To
begin at A rather than below it costs p C − S visits: a ray that meets A visits all its children, whichever were
rejected; a ray that misses it is spared S children which it would otherwise visit one by one. Where p is 0 climbing
pays, where it is 1 it never does. What each kind of head takes for p: `polygon_heads`, `cell_heads`.

**Why no hit is lost.** Let P = o + t d be a point of such a ray at which float32 accepts a hit of triangle T, R the
distance of o from the middle of the triangles' box plus half its diagonal, eps = 2⁻²⁴. P lies within 15 eps R of a
point x that is within T's acceptance margin of T (`traversal` has the sum), and every ball of a node around T holds x
(`hierarchy`). The planes are such that N · P ≥ q + 20 eps R |N|: so N · x > q, and neither T with its margin nor a ball
around it is rejected. T is not before the head. The five eps R that are left are more than float64 is off in all that
is computed here, some 2⁻⁵⁰ R. Where R is no ordinary number the slack is infinite and no head is used. From the head on
a ray visits what the pseudo-code visits from there; its hits are the same bits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.lists import TraversalLists

RULES = ("leaf", "climb")


def check_head_rule(head_rule: str) -> None:
    """Raises `InputError` for another rule."""
    if head_rule not in RULES:
        raise InputError(f"head_rule is {head_rule!r}; it must be one of {', '.join(map(repr, RULES))}.")


def ball_around(triangles: NDArray[np.float32]) -> NDArray[np.float64]:
    """The middle of the triangles' box and half its diagonal, f64[4]."""
    corners = triangles.reshape(-1, 3)
    low, high = corners.min(axis=0).astype(np.float64), corners.max(axis=0).astype(np.float64)
    return np.append(0.5 * (low + high), 0.5 * np.linalg.norm(high - low))


def side_normals(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals N with N · d ≥ 0 for every direction d of the partition that a list along `direction` serves, f64[k, 3].

    Octants: ±x, ±y, ±z; half-spaces: ±x; sextants: a ± b and a ± c, a the list's axis. `direction` comes from
    `directions.list_directions`; who calls says of how many lists it is, see `sides_of`.
    """
    axes = np.flatnonzero(direction)
    if len(axes) == 3:
        return np.diag(direction)
    others = [b for b in range(3) if b != axes[0]]
    signed = [sign * np.eye(3)[b] for b in others for sign in (1.0, -1.0)]
    return np.array([direction + other for other in signed])


def sides_of(lists: TraversalLists) -> NDArray[np.float64]:
    """The normals of `side_normals` for every list, f64[lists, k, 3]: k is 0, 1, 4, 3 of 1, 2, 6, 8 lists."""
    if lists.count == 1:
        return np.zeros((1, 0, 3))
    if lists.count == 2:
        return lists.directions[:, None, :].copy()
    return np.array([side_normals(direction) for direction in lists.directions])


class Skipped(NamedTuple):
    """What one head skips, for pictures (Figure 3): the elements below `head`.

    leaf, head  elements within the list (its length where nothing survives); they differ where the rule climbs
    out         bool[m]: the element is rejected by a half-space, wherever it stands
    """

    leaf: int
    head: int
    out: NDArray[np.bool_]


def rejected(lists: TraversalLists, number: int, planes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which elements of a list a half-space of `planes` f64[k, 5] rejects, each by itself, bool[m]."""
    part = slice(lists.first[number], lists.first[number + 1])
    leaf = (lists.escape[part] == 1) | (lists.escape[part] == 0)
    rows = lists.payload[part, 3][leaf]
    out = np.zeros(len(leaf), np.bool_)
    for plane in planes:
        normal, offset, length = plane[:3], plane[3], plane[4]
        spheres = lists.spheres[part][~leaf].astype(np.float64)
        out[~leaf] |= spheres[:, :3] @ normal + length * spheres[:, 3] < offset
        highest = (lists.hierarchy.triangles[rows].astype(np.float64) @ normal).max(axis=1)
        out[leaf] |= highest < offset - length * lists.hierarchy.margin[rows]
    return out


def first_surviving_leaf(lists: TraversalLists, number: int, out: NDArray[np.bool_]) -> int:
    """The first triangle of a list that is not `out`, nor any node around it; the list's length where there is none."""
    part = slice(lists.first[number], lists.first[number + 1])
    escape, at = lists.escape[part], 0
    while at < len(out):
        triangle = escape[at] in (0, 1)
        if triangle and not out[at]:
            return at
        if out[at] and escape[at] <= 0:
            return len(out)
        at += int(escape[at]) if out[at] else 1
    return at
