"""Lists for tests of what changes them or carries them elsewhere: built, searched, and taken apart into arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim import Hits, Rays, Scene
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.papers.sphere_hierarchy.search import search
from tests.bsh.meshes import Triangles

# Numbers of lists, and every culling rule
PARTITIONS = (
    (1, None), (2, None), (6, None), (8, None), (6, "sextant_safe"), (6, "sextant_same"), (6, "sextant_opposite"),
    (8, "octant"),
)  # fmt: skip

# Two triangles with a common edge, facing +z
SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float32)


def lists_of(triangles: Triangles, lists: int = 6, order: str = "earliest_first", culling: str | None = None):
    return build_lists(build_hierarchy(Scene(triangles.copy())), lists, order, culling)


def hits_of(lists: TraversalLists, rays: Rays) -> Hits:
    return search([lists], rays, facing="front" if lists.culling else "both", threads=1).hits


def arrays(lists: TraversalLists) -> list[NDArray]:
    h, v = lists.hierarchy, lists.vertices
    return [
        lists.escape, lists.payload, lists.first, lists.node_at, lists.triangle_at, lists.records,
        h.triangles, h.spheres, h.parent, h.owner, h.margin, v.positions, v.corners,
    ]  # fmt: skip
