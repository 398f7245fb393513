"""The bounding-sphere hierarchy of section 2.2.

In: a scene's triangles; out: a `Hierarchy`, from which `lists` makes traversal lists. Of a set of triangles:

    C       barycentre of their tightest axis-aligned box
    volume  the smallest sphere around C that holds them
    big     a triangle whose own node would have a radius of at least `threshold` times that of this one is a child
    others  eight groups by the sign of G − C, G a triangle's barycentre; each that is not empty becomes a child

Not said by the paper (BSH-E8), decided here: what "big enough compared to the node" means is the threshold above, in
(0, 1]; where all that are left fall into one octant and nothing was big, they are parted about the middle of their
barycentres instead, and where these coincide they all become children, so the recursion ends.

A sphere also holds what float32 may take for a hit of its triangles (`refsim.geometry.sphere.acceptance_margin`); how
far a ray's own arithmetic is off the traversal allows for (`traversal`). A sliver without such a margin has an infinite
radius: it is a child of the root, which then is entered by every ray. Triangles of zero area are kept and never hit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.hierarchy_build import build, triangle_sizes
from refsim.scene.mesh import Scene

THRESHOLD = 0.5


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """A tree of spheres.

    triangles f32[n, 3, 3], in file order
    spheres   f32[m, 4], centre and radius; a node's number is smaller than its descendants'
    parent    i32[m], −1 the root, which is node 0
    owner     i32[n], the node that a triangle is a child of
    margin    f64[n], how far outside a triangle float32 may accept a hit, scene units
    """

    triangles: NDArray[np.float32]
    spheres: NDArray[np.float32]
    parent: NDArray[np.int32]
    owner: NDArray[np.int32]
    margin: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.spheres)


def build_hierarchy(scene: Scene, threshold: float = THRESHOLD) -> Hierarchy:
    """The hierarchy of a scene. Raises `InputError` for a threshold outside (0, 1]."""
    if isinstance(threshold, bool) or not isinstance(threshold, int | float | np.number) or not 0.0 < threshold <= 1.0:
        raise InputError(f"threshold must be a number above 0 and at most 1, not {threshold!r}.")
    return hierarchy_of(scene.triangles, float(threshold))


def hierarchy_of(triangles: NDArray[np.float32], threshold: float) -> Hierarchy:
    """The hierarchy of triangles f32[n, 3, 3]."""
    n = len(triangles)
    margin = acceptance_margin(triangles)
    size, barycentre = np.empty(n), np.empty((n, 3))
    specialise(triangle_sizes, {})(triangles, margin, size, barycentre)
    spheres, parent = np.empty((2 * n, 4), np.float32), np.empty(2 * n, np.int32)
    owner = np.empty(n, np.int32)
    order = np.arange(n)
    nodes = specialise(build, {})(triangles, margin, size, barycentre, threshold, order, spheres, parent, owner)
    return Hierarchy(triangles, spheres[:nodes].copy(), parent[:nodes].copy(), owner, margin)
