"""Thrane and Simonsen's single list with boxes, the structure that the paper starts from (its reference 9).

In: the one traversal list of a hierarchy (``build_lists(hierarchy, lists=1)``); out: a `BoxList`, searched like any
other structure. Elements, their order and their escape indices are those of the list: only the volume of a node
differs, the tightest axis-aligned box of what stands below it. So a difference in counts is one of volumes.

A box also holds what float32 may take for a hit of its triangles (`refsim.geometry.sphere.acceptance_margin`); a
sliver without such a margin makes its box, and all above it, infinite. What a ray's own arithmetic may be off is added
ray by ray (`boxes_walk`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.boxes_walk import fill_boxes, walk_boxes
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.ray_blocks import in_blocks
from refsim.papers.sphere_hierarchy.search import Found
from refsim.scene.rays import Rays

ELEMENT_BYTES = 4 + 24


@dataclass(frozen=True, eq=False)
class BoxList:
    """One list of boxes and triangles.

    lists  the traversal list whose elements these are
    boxes  f32[k, 6], least and largest corner of each element, of a triangle too
    """

    lists: TraversalLists
    boxes: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.boxes)

    def search(
        self, rays: Rays, *, any_hit: bool = False, facing: str = "both", threads: int | None = None
    ) -> Found:
        """The nearest hit of each ray, or any; counts as of the lists."""
        lists = self.lists
        structure = (lists.escape, lists.payload, self.boxes, lists.records, lists.hierarchy.spheres[0])
        loop = specialise(walk_boxes, {})
        return in_blocks("boxes", loop, structure, rays, any_hit=any_hit, facing=facing, threads=threads)


def build_boxes(lists: TraversalLists) -> BoxList:
    """The boxes of a single list. Raises `InputError` for several."""
    if lists.count != 1:
        raise InputError(f"boxes replace the spheres of one list (lists=1), not of {lists.count}.")
    boxes = np.empty((len(lists.escape), 6), np.float32)
    hierarchy = lists.hierarchy
    specialise(fill_boxes, {})(hierarchy.triangles, hierarchy.margin, lists.escape, lists.payload, boxes)
    return BoxList(lists, boxes)
