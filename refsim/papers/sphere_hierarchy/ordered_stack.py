"""An ordered stack on the hierarchy of spheres: what a traversal without the paper's constraint would do.

In: a `Hierarchy`; out: an `OrderedStack`, searched like any other structure. Of a node that the ray meets the triangles
are tested, then the child spheres; those met are visited in the order in which the ray enters them, the others of them
waiting on a stack. One whose entry lies beyond the best hit when its turn comes is dropped: the stack holds the entry,
so that is no further look at the node. Each ray has the order that suits it, which a fixed list only approximates.

What it costs is the stack; `search_counted` says how deep it gets and how many entries are written.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.geometry.triangle import pack_triangles
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.hierarchy import Hierarchy
from refsim.papers.sphere_hierarchy.lists_layout import group_children
from refsim.papers.sphere_hierarchy.ordered_stack_walk import stack_bound, walk_ordered
from refsim.papers.sphere_hierarchy.ray_blocks import in_blocks
from refsim.papers.sphere_hierarchy.search import Found
from refsim.scene.rays import Rays


class StackUse(NamedTuple):
    """What each ray needed of the stack: deepest i32[n], the most entries at once; written i32[n], entries in all."""

    deepest: NDArray[np.int32]
    written: NDArray[np.int32]

    @property
    def largest(self) -> int:
        """The deepest of all rays: what must be kept for each of them; 0 without rays."""
        return int(self.deepest.max(initial=0))

    @property
    def mean(self) -> float:
        """Mean of the rays' deepest; 0 without rays."""
        return float(self.deepest.mean()) if len(self.deepest) else 0.0


@dataclass(frozen=True, eq=False)
class OrderedStack:
    """A hierarchy with its children in one array.

    children  i32[m + n − 1], spheres as their number, triangles as m + row; starts i64[m + 1], where a node's begin
    records   f32[n, 12]
    capacity  entries that no ray's stack exceeds
    """

    hierarchy: Hierarchy
    children: NDArray[np.int32]
    starts: NDArray[np.int64]
    records: NDArray[np.float32]
    capacity: int

    def search(
        self, rays: Rays, *, any_hit: bool = False, facing: str = "both", threads: int | None = None
    ) -> Found:
        """The nearest hit of each ray, or any; counts as of the lists."""
        return self.search_counted(rays, any_hit=any_hit, facing=facing, threads=threads)[0]

    def search_counted(
        self, rays: Rays, *, any_hit: bool = False, facing: str = "both", threads: int | None = None
    ) -> tuple[Found, StackUse]:
        """`search`, and the stack that it took."""
        n = len(rays)
        use = StackUse(np.zeros(n, np.int32), np.zeros(n, np.int32))
        structure = (self.hierarchy.spheres, self.children, self.starts, self.records, self.capacity)
        found = in_blocks(
            "ordered stack", specialise(walk_ordered, {}), structure, rays,
            any_hit=any_hit, facing=facing, threads=threads, counts=tuple(use),
        )  # fmt: skip
        return found, use


def build_stack(hierarchy: Hierarchy) -> OrderedStack:
    """The hierarchy, ready for a search with a stack."""
    m, n = len(hierarchy), len(hierarchy.triangles)
    packed = pack_triangles(hierarchy.triangles)
    records = np.column_stack([packed.v0, packed.n, packed.m1, packed.m2])
    children, starts = np.empty(m + n - 1, np.int32), np.empty(m + 1, np.int64)
    specialise(group_children, {})(hierarchy.parent, hierarchy.owner, children, starts)
    capacity = int(specialise(stack_bound, {})(hierarchy.parent))
    return OrderedStack(hierarchy, children, starts, records, capacity)
