"""Three traversals of a kd-tree: with a stack, and the two without of Foley and Sugerman (2005).

    "stack"      the far children wait on a stack with their intervals: the yardstick
    "restart"    after a leaf the search begins again at the root, from where the leaf was left
    "backtrack"  after a leaf it climbs to the nearest ancestor whose box the ray has not left yet, and goes on from it

In: a `KdTree`; out: a `KdSearch`, searched like any other structure. All three go through the same leaves in the same
order; what differs is how many nodes they look at in between. `nodes` of `Found` counts all of these (inner nodes,
leaves, boxes looked at while climbing) and the triangles tested, as a list's elements are spheres and triangles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.kd_tree import KdTree
from refsim.papers.sphere_hierarchy.kd_walk import walk_kd
from refsim.papers.sphere_hierarchy.ray_blocks import in_blocks
from refsim.papers.sphere_hierarchy.search import Found
from refsim.scene.rays import Rays

TRAVERSALS = ("stack", "restart", "backtrack")


class KdCounts(NamedTuple):
    """Of each ray, i32[n]: leaves; resumed, how often a search went on after a leaf (pops, restarts or backtracks);
    climbed, boxes looked at on the way up; deepest, the most entries on the stack at once.

    Inner nodes are nodes − triangle tests − leaves − climbed.
    """

    leaves: NDArray[np.int32]
    resumed: NDArray[np.int32]
    climbed: NDArray[np.int32]
    deepest: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class KdSearch:
    """A tree and the traversal to search it with."""

    tree: KdTree
    traversal: str

    def search(
        self, rays: Rays, *, any_hit: bool = False, facing: str = "both", threads: int | None = None
    ) -> Found:
        """The nearest hit of each ray, or any."""
        return self.search_counted(rays, any_hit=any_hit, facing=facing, threads=threads)[0]

    def search_counted(
        self, rays: Rays, *, any_hit: bool = False, facing: str = "both", threads: int | None = None
    ) -> tuple[Found, KdCounts]:
        """`search`, and what `nodes` is made of."""
        n, tree = len(rays), self.tree
        counts = KdCounts(*(np.zeros(n, np.int32) for _ in KdCounts._fields))
        structure = (
            np.int32(TRAVERSALS.index(self.traversal)), tree.split, tree.links, tree.boxes, tree.lists, tree.loose,
            tree.records, tree.centre, tree.far, tree.depth,
        )  # fmt: skip
        found = in_blocks(
            "kd-tree", specialise(walk_kd, {}), structure, rays,
            any_hit=any_hit, facing=facing, threads=threads, counts=tuple(counts),
        )  # fmt: skip
        return found, counts


def kd_search(tree: KdTree, traversal: str) -> KdSearch:
    """A search through a tree. Raises `InputError` for another traversal."""
    if traversal not in TRAVERSALS:
        raise InputError(f"traversal is {traversal!r}; it must be one of {', '.join(map(repr, TRAVERSALS))}.")
    return KdSearch(tree, traversal)
