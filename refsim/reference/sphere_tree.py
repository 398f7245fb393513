"""The bounding-sphere hierarchy in plain NumPy and recursion: Efficient Stackless Ray Traversal, section 2.2.

A node is made of a set of triangles: the barycentre C of their box, the smallest sphere around C that holds them; big
triangles are its children, the others go on by the octant of their barycentre about C. Nodes are numbered as they are
made, first octant first. Boxes and centres in float32, all else in float64, operations in the order that
`refsim.papers.sphere_hierarchy.hierarchy_build` names, so the bits are its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refsim.reference.sphere import acceptance_margin
from refsim.reference.vector import dot


@dataclass(frozen=True, eq=False)
class SphereTree:
    """spheres f32[m, 4], centre and radius; parent i32[m], −1 the root; owner i32[n], the node a triangle belongs to;
    margin f64[n], how far outside a triangle float32 may accept a hit."""

    triangles: np.ndarray
    margin: np.ndarray
    spheres: np.ndarray
    parent: np.ndarray
    owner: np.ndarray


def sphere_tree(triangles: np.ndarray, threshold: float) -> SphereTree:
    """The tree of triangles f32[n, 3, 3]: big is a triangle whose own node has `threshold` times the node's radius."""
    margin = acceptance_margin(triangles)
    alone = [reach(triangles[[k]], margin[[k]], box_centre(triangles[[k]])) for k in range(len(triangles))]
    exact = triangles.astype(np.float64)
    barycentre = ((exact[:, 0] + exact[:, 1]) + exact[:, 2]) / 3.0
    spheres: list[tuple[np.float32, ...]] = []
    parent: list[int] = []
    owner = np.full(len(triangles), -1, np.int32)

    def node_of(rows: np.ndarray, above: int) -> None:
        node, centre = len(spheres), box_centre(triangles[rows])
        radius = reach(triangles[rows], margin[rows], centre)
        spheres.append((*centre, rounded_up(radius)))
        parent.append(above)
        big = np.array([alone[k] >= threshold * radius for k in rows])
        owner[rows[big]] = node
        rest = rows[~big]
        groups = octants(barycentre[rest], centre.astype(np.float64))
        if len(groups) == 1 and not big.any():
            # The same node would come again: part them about the middle of their barycentres
            low, high = barycentre[rest].min(axis=0), barycentre[rest].max(axis=0)
            groups = octants(barycentre[rest], 0.5 * (low + high))
            if len(groups) == 1:
                owner[rest] = node
                return
        for group in groups:
            node_of(rest[group], node)

    node_of(np.arange(len(triangles)), -1)
    return SphereTree(triangles, margin, np.array(spheres, np.float32), np.array(parent, np.int32), owner)


def box_centre(triangles: np.ndarray) -> np.ndarray:
    """The barycentre of the tightest axis-aligned box, f32[3], each coordinate rounded once."""
    points = triangles.reshape(-1, 3)
    columns = np.arange(3)
    # Of equal coordinates the first: 0 and −0 are equal and have different bits
    low = points[points.argmin(axis=0), columns].astype(np.float64)
    high = points[points.argmax(axis=0), columns].astype(np.float64)
    return (0.5 * (low + high)).astype(np.float32)


def reach(triangles: np.ndarray, margin: np.ndarray, centre: np.ndarray) -> float:
    """The smallest radius about `centre` that holds the triangles with their margins f64[k], and 2⁻⁴⁸ of it."""
    apart = triangles.astype(np.float64) - centre.astype(np.float64)
    farthest = np.sqrt(dot(apart, apart).max(axis=1))
    return float(((farthest + margin) * (1.0 + 2.0**-48)).max())


def rounded_up(x: float) -> np.float32:
    """The smallest float32 that is not below x."""
    with np.errstate(over="ignore"):
        near = np.float32(x)
    return near if float(near) >= x else np.nextafter(near, np.float32(np.inf))


def octants(barycentre: np.ndarray, centre: np.ndarray) -> list[np.ndarray]:
    """The rows of each octant about `centre` that holds a barycentre, f64[k, 3]; on the plane counts as below it."""
    above = barycentre > centre
    octant = above[:, 0] + 2 * above[:, 1] + 4 * above[:, 2]
    return [np.flatnonzero(octant == k) for k in range(8) if (octant == k).any()]
