"""A search through a kd-tree, in plain recursion: which leaves a ray passes, and what the three ways of going on cost.

Twin of `refsim.papers.sphere_hierarchy.kd_search`, and not its mirror: the order of leaves is found once, by recursion;
what a restart or a climb looks at is then counted on the path from the root to each leaf.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from refsim.reference.kd_tree import Node, Tree
from refsim.reference.list_search import Walked
from refsim.reference.one_ray import F, OneRay, every_ray


class Passed(NamedTuple):
    """A leaf; `high`, where it is left; `path`, the inner nodes from the root to it; `fresh`, how many of these were
    not looked at before; `waiting`, the most entries on a stack while they were."""

    leaf: Node
    high: np.float32
    path: tuple[Node, ...]
    fresh: int
    waiting: int


def search_kd(
    tree: Tree,
    traversal: str,
    origin: np.ndarray,
    direction: np.ndarray,
    t_max: np.ndarray,
    any_hit: bool = False,
    front_only: bool = False,
) -> tuple[Walked, np.ndarray]:
    """What rays f32[n, 3] hit, and i64[n, 4]: leaves, how often it went on after one, boxes climbed, deepest stack."""

    def search(ray: OneRay) -> tuple[int, ...]:
        inverse = F(1) / ray.kept_from_zero()
        reached = bool((np.abs(ray.o - tree.centre) <= tree.far).all())
        ray.test_each(tree.loose if reached else range(len(tree.records[0])))
        low, last = _interval(ray, inverse, tree.root.cell)
        if not reached or ray.done or not (low <= last and low <= ray.best):
            return 0, 0, 0, 0
        leaves, resumed, climbed, deepest = 0, -1, 0, 0
        path: tuple[Node, ...] = ()
        for passed in _leaves(ray, inverse, tree.root, low, last, (), 0, 0):
            resumed += 1
            looked_at = passed.fresh
            if traversal == "restart":
                looked_at = len(passed.path)
            elif traversal == "backtrack" and leaves:
                # Up to the last ancestor that both leaves have
                common = sum(a is b for a, b in zip(path, passed.path, strict=False))
                climbed += len(path) - common + 1
                looked_at = len(passed.path) - common + 1
                ray.nodes += len(path) - common + 1
            ray.nodes += looked_at + 1
            leaves, deepest, path = leaves + 1, max(deepest, passed.waiting), passed.path
            ray.test_each(passed.leaf.triangles)
            if ray.done or ray.best <= passed.high or passed.high >= last:
                break
        return leaves, resumed, climbed, deepest if traversal == "stack" else 0

    return every_ray(origin, direction, t_max, tree.records, any_hit, front_only, search)


def _interval(ray: OneRay, inverse: np.ndarray, cell: np.ndarray) -> tuple[np.float32, np.float32]:
    """Where the ray enters a box, not before 0, and where it leaves it."""
    one, other = (cell[:3] - ray.o) * inverse, (cell[3:] - ray.o) * inverse
    return max(np.minimum(one, other).max(), F(0)), np.maximum(one, other).min()


def _leaves(
    ray: OneRay, inverse: np.ndarray, node: Node, low: np.float32, high: np.float32, path: tuple[Node, ...], fresh: int,
    waiting: int,
) -> Iterator[Passed]:  # fmt: skip
    """The leaves that the ray passes between two parameters, in order."""
    if node.axis == 3:
        yield Passed(node, high, path, fresh, waiting)
        return
    cross = (node.plane - ray.o[node.axis]) * inverse[node.axis]
    near, far = node.children if inverse[node.axis] > 0 else node.children[::-1]
    path, fresh = (*path, node), fresh + 1
    if cross >= high:
        yield from _leaves(ray, inverse, near, low, high, path, fresh, waiting)
    elif cross <= low:
        yield from _leaves(ray, inverse, far, low, high, path, fresh, waiting)
    else:
        yield from _leaves(ray, inverse, near, low, cross, path, fresh, waiting + 1)
        yield from _leaves(ray, inverse, far, cross, high, path, 0, waiting)
