"""Refitting traversal lists after all vertices may have moved (section 5): the tree and the lists' order stay.

A refit is an update of every triangle that is elsewhere (`partial_update`): the same exact spheres, the same ranges to
copy. After large motion the spheres overlap more than those of a new hierarchy: hits stay right, walks grow longer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.partial_update import Refitted, update_triangles

__all__ = ["Refitted", "refit"]


def refit(lists: TraversalLists, triangles: ArrayLike, gap: int = 0) -> Refitted:
    """The lists around `triangles` f32[n, 3, 3], row for row those of the lists, moved.

    gap as in `update_triangles`. Raises `InputError` for another number of triangles or shape: that is another scene.
    """
    n = len(lists.hierarchy.triangles)
    try:
        shape = list(np.shape(triangles))
    except ValueError:
        shape = ["lists of different lengths"]
    if shape != [n, 3, 3]:
        raise InputError(f"a refit of {n} triangles needs as many, [{n}, 3, 3], not {shape}: build lists anew.")
    return update_triangles(lists, np.arange(n), triangles, gap)
