"""Spheres in the order in which a ray enters them, in plain recursion: twin of
`refsim.papers.sphere_hierarchy.ordered_stack`, which has an explicit stack and the derivation of `entry`.
"""

from __future__ import annotations

import numpy as np

from refsim.reference.list_search import Walked
from refsim.reference.one_ray import F, OneRay, every_ray
from refsim.reference.sphere_tree import SphereTree
from refsim.reference.triangle import pack
from refsim.reference.vector import dot


def search_ordered(
    tree: SphereTree,
    origin: np.ndarray,
    direction: np.ndarray,
    t_max: np.ndarray,
    any_hit: bool = False,
    front_only: bool = False,
) -> tuple[Walked, np.ndarray]:
    """What rays f32[n, 3] hit, and of the stack that it would take: i64[n, 2], most entries, entries written."""
    children: list[list[int]] = [[] for _ in tree.parent]
    for node, above in enumerate(tree.parent[1:], start=1):
        children[above].append(node)
    own = [np.flatnonzero(tree.owner == node).tolist() for node in range(len(tree.parent))]

    def search(ray: OneRay) -> tuple[int, ...]:
        slack = ray.slack(tree.spheres[0])
        w = ray.d / dot(ray.d, ray.d)
        deepest, written = 0, 0

        def entry_if_met(node: int) -> np.float32 | None:
            ray.nodes += 1
            to_centre, reach = tree.spheres[node, :3] - ray.o, tree.spheres[node, 3] + slack
            k = dot(to_centre, w)
            apart = to_centre - max(F(0), min(k, ray.best)) * ray.d
            if dot(apart, apart) > reach * reach:
                return None
            apart = to_centre - k * ray.d
            half = max(F(0), reach * reach - dot(apart, apart))
            return max(F(0), k - np.sqrt(half) * np.sqrt(dot(w, w)) - slack)

        def visit(node: int, waiting: int) -> None:
            nonlocal deepest, written
            ray.test_each(reversed(own[node]))
            if ray.done:
                return
            met = [(entry, child) for child in reversed(children[node]) if (entry := entry_if_met(child)) is not None]
            written += max(len(met) - 1, 0)
            for left, (entry, child) in zip(range(len(met) - 1, -1, -1), sorted(met), strict=True):
                deepest = max(deepest, waiting + left)
                if not entry > ray.best and not ray.done:
                    visit(child, waiting + left)

        if entry_if_met(0) is not None:
            visit(0, 0)
        return deepest, written

    return every_ray(origin, direction, t_max, pack(tree.triangles), any_hit, front_only, search)
