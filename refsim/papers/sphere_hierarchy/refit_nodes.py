"""The spheres of a hierarchy whose triangles have moved, compiled. Template of `refsim.jit`; `partial_update` calls it.

The rules are the builder's: C is the middle of the box of all triangles below a node, the radius reaches the farthest
of them. Boxes are joined from the leaves up; a radius about a new C needs every triangle below, so each triangle climbs
from its owner to the root: as many distances as the builder takes, n times the depth, and the same sphere to the bit.
"""

from __future__ import annotations

import numpy as np

from refsim.papers.sphere_hierarchy.hierarchy_build import high_of, low_of, middle, reach_of, rounded_up

INFINITY = np.float32(np.inf)


def refit_spheres(triangles, margin, owner, parent, moved, spheres):
    """Writes the spheres of the nodes that hold a moved triangle.

    Read: `triangles` f32[n, 3, 3], `margin` f64[n], `owner` i32[n], `parent` i32[m]. `moved` bool[m] marks owners of
    moved triangles; their ancestors are marked here. Written: `spheres` f32[m, 4] of the marked nodes.
    """
    nodes = parent.shape[0]
    low, high = np.full((nodes, 3), INFINITY, np.float32), np.full((nodes, 3), -INFINITY, np.float32)
    for row in range(owner.shape[0]):
        for a in range(3):
            low[owner[row], a] = min(low[owner[row], a], low_of(triangles, row, a))
            high[owner[row], a] = max(high[owner[row], a], high_of(triangles, row, a))
    for k in range(nodes - 1, 0, -1):
        above = parent[k]
        moved[above] |= moved[k]
        for a in range(3):
            low[above, a] = min(low[above, a], low[k, a])
            high[above, a] = max(high[above, a], high[k, a])
    for k in range(nodes):
        if moved[k]:
            for a in range(3):
                spheres[k, a] = middle(low[k, a], high[k, a])
    radius = np.zeros(nodes)
    for row in range(owner.shape[0]):
        node = owner[row]
        while node >= 0 and not moved[node]:
            node = parent[node]
        while node >= 0:  # the ancestors of a marked node are marked
            x, y, z = np.float64(spheres[node, 0]), np.float64(spheres[node, 1]), np.float64(spheres[node, 2])
            radius[node] = max(radius[node], reach_of(triangles, row, margin, x, y, z))
            node = parent[node]
    for k in range(nodes):
        if moved[k]:
            spheres[k, 3] = rounded_up(radius[k])
