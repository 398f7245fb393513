"""Checks of section 2 of the sphere hierarchy's paper: lists, directions, culling, construction.

The compiled hierarchy and lists are held against the NumPy ones (`refsim.reference`) bit for bit. `count` is the number
of triangles, or of directions, that is looked at.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import bsh_published as published
from refsim.experiments.equations import NOT_APPLICABLE, Found, bits_differ, number
from refsim.papers.sphere_hierarchy.byte_layout import bytes_of
from refsim.papers.sphere_hierarchy.culling import kept_triangles
from refsim.papers.sphere_hierarchy.directions import list_directions, list_of_rays
from refsim.papers.sphere_hierarchy.hierarchy import THRESHOLD, Hierarchy, hierarchy_of
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.reference import sphere_tree as tree_twin
from refsim.reference import traversal_lists as list_twin

ORDERS = ("earliest_first", "latest_last")
SHARE = 0.05  # percentage points
ROUNDING = 1e-6
Numbers = NDArray[Any]


@lru_cache(maxsize=4)
def triangles_of(count: int) -> NDArray[np.float32]:
    """Triangles of many sizes in a ball, f32[count, 3, 3]."""
    rng = np.random.default_rng(61)
    centres, sizes = rng.normal(size=(count, 1, 3)), 10.0 ** rng.uniform(-2.0, 0.0, (count, 1, 1))
    return np.asarray(centres + sizes * rng.normal(size=(count, 3, 3)), np.float32)


@lru_cache(maxsize=4)
def built(count: int) -> Hierarchy:
    """The compiled hierarchy of them."""
    return hierarchy_of(triangles_of(count), THRESHOLD)


@lru_cache(maxsize=4)
def tree_of(count: int) -> tree_twin.SphereTree:
    """The NumPy one."""
    return tree_twin.sphere_tree(triangles_of(count), THRESHOLD)


@lru_cache(maxsize=8)
def lists_of(count: int, lists: int = 6, order: str = ORDERS[0]) -> TraversalLists:
    """Compiled lists of it."""
    return build_lists(built(count), lists, order, None)


@lru_cache(maxsize=2)
def lists_differ(count: int) -> int:
    """Elements of 1, 2, 6 and 8 lists in both orders that differ."""
    total = 0
    for lists in (1, 2, 6, 8):
        for order in ORDERS:
            ours, theirs = lists_of(count, lists, order), list_twin.traversal_lists(tree_of(count), lists, order, None)
            if len(ours.escape) != len(theirs.escape):
                total += max(len(ours.escape), len(theirs.escape))
                continue
            off = bits_differ(ours.escape, theirs.escape) | bits_differ(ours.payload, theirs.payload)
            total += number(off)
    return total


def families(lists: TraversalLists, k: int) -> list[list[int]]:
    """Of each node the elements of its children, in list `k`, in the order of the list."""
    h, nodes = lists.hierarchy, len(lists.hierarchy)
    children: list[list[int]] = [[] for _ in range(nodes)]
    for node in range(1, nodes):
        children[h.parent[node]].append(int(lists.node_at[k, node]))
    for row, owner in enumerate(h.owner):
        children[owner].append(int(lists.triangle_at[k, row]))
    return [sorted(each) for each in children]


def sizes_of(lists: TraversalLists, k: int) -> Numbers:
    """How many elements each element's subtree has, itself included, from the tree alone."""
    h, length = lists.hierarchy, lists.length(k)
    size = np.ones(length, np.int64)
    below = np.bincount(h.owner, minlength=len(h)).astype(np.int64)
    for node in range(len(h) - 1, 0, -1):
        below[h.parent[node]] += below[node] + 1
    size[lists.node_at[k]] += below
    return size


def depth_first(count: int) -> Found:
    """The three rules: after a node its first child, after a leaf its next sibling or its ancestor's."""
    lists, wrong, cases = lists_of(count), 0, 0
    for k in range(lists.count):
        size = sizes_of(lists, k)
        for node, family in zip(lists.node_at[k], families(lists, k), strict=True):
            # Children follow their parent, each where the one before it ends
            places = int(node) + 1 + np.concatenate([[0], np.cumsum(size[family])[:-1]])
            wrong += number(places != family)
            cases += len(family)
    return Found(cases, lists_differ(count), wrong, wrong)


def escapes(count: int) -> Found:
    """1 for a leaf and no other; 0 the last primitive, −1 a node after whose subtree the list ends."""
    lists, wrong, cases = lists_of(count), 0, 0
    for k in range(lists.count):
        size, length = sizes_of(lists, k), lists.length(k)
        escape = lists.escape[lists.first[k] : lists.first[k + 1]]
        leaf = np.zeros(length, np.bool_)
        leaf[lists.triangle_at[k]] = True
        wanted = np.where(np.arange(length) + size == length, np.where(leaf, 0, -1), size)
        wrong += number(escape != wanted) + number((escape == 1) & ~leaf)
        cases += length
    return Found(cases, lists_differ(count), wrong, wrong)


def element_bytes(count: int) -> Found:
    """An escape pointer of 32 bits and a word of 128; vertices in one array for all lists."""
    lists = lists_of(count)
    wanted = [lists.length(k) * (4 + 16) for k in range(lists.count)]
    wrong = sum(a != b for a, b in zip(bytes_of(lists).lists, wanted, strict=True))
    corner = lists.vertices.positions[lists.vertices.corners]
    wrong += number((corner != triangles_of(count)).any(axis=(1, 2)))
    return Found(count, lists_differ(count), wrong, wrong)


def _keys(lists: TraversalLists, k: int, order: str) -> Numbers:
    """Where each element's projection on the list's direction begins, or ends."""
    h, along = lists.hierarchy, lists.directions[k]
    key = np.empty(lists.length(k))
    spheres, corners = h.spheres.astype(np.float64), h.triangles.astype(np.float64) @ along
    reach = np.linalg.norm(along) * spheres[:, 3]
    late = order == "latest_last"
    key[lists.node_at[k]] = spheres[:, :3] @ along + (reach if late else -reach)
    key[lists.triangle_at[k]] = corners.max(axis=1) if late else corners.min(axis=1)
    return key


def ordering(order: str) -> Any:
    """Siblings in ascending order of where their projections begin (x_min) or end (x_max)."""
    def check(count: int) -> Found:
        lists, wrong, cases = lists_of(count, 6, order), 0, 0
        for k in range(lists.count):
            key = _keys(lists, k, order)
            for family in families(lists, k):
                wrong += number(np.diff(key[family]) < -ROUNDING)
                cases += len(family)
        return Found(cases, lists_differ(count), wrong, wrong)

    return check


def reversed_order(count: int) -> Found:
    """Of two lists one has the nodes in the reverse order of the other: families for which that is not so.

    Where children overlap, the order by what begins first along +x is not that by what begins first along −x, reversed.
    """
    lists = lists_of(count, 2)
    h = lists.hierarchy
    items = [np.concatenate([lists.node_at[k], lists.triangle_at[k]]) for k in (0, 1)]
    parent = np.concatenate([h.parent, h.owner])
    wrong = 0
    for node in range(len(h)):
        own = np.flatnonzero(parent == node)
        wrong += not np.array_equal(own[np.argsort(items[0][own])], own[np.argsort(items[1][own])][::-1])
    return Found(len(h), lists_differ(count), wrong)


def directions(count: int) -> Numbers:
    """Unit directions, f32[count, 3]."""
    d = np.random.default_rng(62).normal(size=(count, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True), np.float32)


def partition(lists: int) -> Any:
    """A ray picks the list whose direction is nearest to its own."""
    def check(count: int) -> Found:
        d = directions(count)
        picked, along = list_of_rays(d, lists), list_directions(lists)
        near = d.astype(np.float64) @ along.T
        wrong = number(near[np.arange(count), picked] < near.max(axis=1) - ROUNDING)
        return Found(count, number(picked != list_twin.list_of_rays(d, lists)), wrong, wrong)

    return check


def _culled(rule: str, lists: int, normals: Numbers) -> Numbers:
    usable = np.ones(len(normals), np.bool_)
    return np.stack([~kept_triangles(normals, usable, along, rule) for along in list_directions(lists)])


def culling(printed: str, corrected: str, lists: int) -> Any:
    """Rays that would hit the front of a triangle which their list leaves out: pairs of a direction and a normal."""
    def check(count: int) -> Found:
        d, n = directions(count), directions(2 * count)[count:]
        picked = list_of_rays(d, lists)
        facing = (d.astype(np.float64) * n).sum(axis=1) < 0.0
        fails = [
            number(_culled(rule, lists, n)[picked, np.arange(count)] & facing) for rule in (printed, corrected)
        ]
        flat, differs = np.zeros(count, np.bool_), 0
        for rule in {printed, corrected}:
            again = [list_twin.culled(n, flat, along, rule) for along in list_twin.directions(lists)]
            differs += number(_culled(rule, lists, n) != np.stack(again))
        return Found(count, differs, *fails)

    return check


def even_normals(count: int) -> Numbers:
    """Evenly spread directions (a Fibonacci lattice), f32[count, 3]."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1).astype(np.float32)


def share(rule: str, lists: int, said: float, exact: float) -> Any:
    """Percent of all normals that a list leaves out: the printed figure, and the exact one."""
    def check(count: int) -> Found:
        percent = 100.0 * _culled(rule, lists, even_normals(10 * count)).mean(axis=1)
        wrong = [number(np.abs(percent - figure) > SHARE) for figure in (said, exact)]
        return Found(lists, NOT_APPLICABLE, *wrong)

    return check


SAFE_PERCENT = float(100.0 * np.arcsin(1.0 / 3.0) / np.pi)
sextant_share = share("sextant_safe", 6, published.SAID_CULLED_SEXTANT, SAFE_PERCENT)
octant_share = share("octant", 8, published.SAID_CULLED_OCTANT, 12.5)


def tree_differs(count: int) -> int:
    """Spheres, parents and owners that differ."""
    ours, theirs = built(count), tree_of(count)
    if len(ours.spheres) != len(theirs.spheres):
        return max(len(ours.spheres), len(theirs.spheres))
    spheres = bits_differ(ours.spheres, theirs.spheres) | bits_differ(ours.parent, theirs.parent)
    return number(spheres) + number(bits_differ(ours.owner, theirs.owner))


def rows_below(h: Hierarchy) -> list[Numbers]:
    """Rows of the triangles in each node's subtree."""
    found: list[list[int]] = [[] for _ in range(len(h))]
    for row, owner in enumerate(h.owner):
        found[owner].append(row)
    for node in range(len(h) - 1, 0, -1):
        found[h.parent[node]] += found[node]
    return [np.array(rows) for rows in found]


def smallest_spheres(count: int) -> Found:
    """C is the middle of the triangles' box; the sphere about it holds them, and no smaller one would."""
    h, wrong = built(count), 0
    for rows, sphere in zip(rows_below(h), h.spheres.astype(np.float64), strict=True):
        points = h.triangles[rows].astype(np.float64).reshape(-1, 3)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        reach = np.linalg.norm(points - sphere[:3], axis=1).max()
        # Larger by what float32 may take for a hit, and a rounding
        room = float(h.margin[rows].max()) + ROUNDING * reach
        wrong += bool(np.abs(middle - sphere[:3]).max() > ROUNDING * (1.0 + reach)) or not (
            reach <= sphere[3] <= reach + room
        )
    return Found(len(h), tree_differs(count), wrong, wrong)


def big_triangles(count: int) -> Found:
    """A triangle that is big compared to its node, as the threshold says, is the node's child; no smaller one is, but
    where all that is left would stay together."""
    h, wrong = built(count), 0
    exact = h.triangles.astype(np.float64)
    middle = 0.5 * (exact.min(axis=1) + exact.max(axis=1))
    own = np.linalg.norm(exact - middle[:, None], axis=2).max(axis=1)
    above = h.parent[h.owner]
    radius = h.spheres[:, 3].astype(np.float64)
    # It was not big in the node above
    early = (above >= 0) & (own >= THRESHOLD * radius[above] * (1.0 + ROUNDING))
    late = own < THRESHOLD * radius[h.owner] * (1.0 - ROUNDING)
    wrong = number(early) + number(late & (np.bincount(h.owner, minlength=len(h))[h.owner] == 1))
    return Found(count, tree_differs(count), corrected_fails=wrong)


def eight_groups(count: int) -> Found:
    """Each child of a node holds barycentres of one octant about C."""
    h, wrong, cases = built(count), 0, 0
    below = rows_below(h)
    barycentre = h.triangles.astype(np.float64).mean(axis=1)
    for node in range(1, len(h)):
        parent = h.parent[node]
        if len(below[node]) == len(below[parent]):
            continue  # nothing was parted: the rule for that is ours (BSH-E8)
        signs = barycentre[below[node]] - h.spheres[parent, :3].astype(np.float64)
        near = np.abs(signs).min(axis=1) < ROUNDING
        cases += 1
        wrong += len(np.unique(signs[~near] > 0.0, axis=0)) > 1
    return Found(cases, tree_differs(count), wrong, wrong)
