"""The shared vertex array after triangles have moved: vertices that come apart are split, none changes its number.

Of the corners that shared a vertex and now differ, those that stay where it was keep it (if none does, those with the
first corner); the others share a new vertex an old one and place, behind all old ones. Vertices that come to coincide
stay two: the hits are the same. Every vertex keeps a corner, so there are never more than 3 n.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.papers.sphere_hierarchy.shared_vertices import SharedVertices


def moved_vertices(
    vertices: SharedVertices, triangles: NDArray[np.float32], rows: NDArray[np.int64]
) -> SharedVertices:
    """Vertices of `triangles` f32[n, 3, 3], of which `rows` differ from those that `vertices` is of."""
    touched = np.zeros(len(vertices.positions), np.bool_)
    touched[vertices.corners[rows]] = True
    flat = vertices.corners.reshape(-1)
    at = np.flatnonzero(touched[flat])
    number = flat[at]
    places = triangles.reshape(-1, 3)[at]
    bits = places.view(np.int32)

    # Corners of a vertex go to one place, whichever is read, unless they differ
    positions = vertices.positions.copy()
    positions[number] = places
    apart = (positions.view(np.int32)[number] != bits).any(axis=1)
    if not apart.any():
        return SharedVertices(positions, vertices.corners)

    # Groups of one vertex and place, in order of their first corners
    split = np.zeros(len(positions), np.bool_)
    split[number[apart]] = True
    chosen = split[number]
    at, number, places, bits = at[chosen], number[chosen], places[chosen], bits[chosen]
    old = vertices.positions.view(np.int32)[number]
    _, lead, group = np.unique(np.column_stack([number, bits]), axis=0, return_index=True, return_inverse=True)
    group = group.reshape(-1)
    stays = (bits == old).all(axis=1)[lead]
    # The keeper of each vertex: the group that stays, else the one with the first corner
    keeper = np.full(len(positions), -1, np.int64)
    worst_first = np.lexsort((lead, ~stays))[::-1]
    keeper[number[lead[worst_first]]] = worst_first
    keeps = keeper[number[lead]] == np.arange(len(lead))
    target = np.empty(len(lead), np.int32)
    target[keeps] = number[lead[keeps]]
    added = np.flatnonzero(~keeps)
    added = added[np.argsort(lead[added])]
    target[added] = len(positions) + np.arange(len(added), dtype=np.int32)

    corners = flat.copy()
    corners[at] = target[group]
    grown = np.concatenate([positions, np.empty((len(added), 3), np.float32)])
    grown[target] = places[lead]
    return SharedVertices(grown, corners.reshape(-1, 3))
