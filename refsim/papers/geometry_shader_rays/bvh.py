"""Another structure in the grid's place (section 6): a bounding-box hierarchy with escape indices.

In: a scene; out: an `Accelerator` for `acceleration`'s interface. Boxes grow as the grid's cells do (`grid_margins`),
so it finds the same bits. The walk is that of the paper's reference 11, which needs no stack and suits a shader.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.jit import specialise
from refsim.papers.geometry_shader_rays.acceleration import Accelerator
from refsim.papers.geometry_shader_rays.bvh_nodes import build_nodes, search_hierarchy
from refsim.papers.geometry_shader_rays.grid_margins import margins, rounded_down, rounded_up
from refsim.scene.mesh import Scene


class Hierarchy(NamedTuple):
    """What the traversal reads.

    boxes   f32[nodes, 6], smallest and largest corner, depth first: after an inner node comes its first child
    links   i32[nodes, 3]: escape index, start in `lists` and number of triangles (0: an inner node)
    lists   i32[k] triangles of the leaves; `loose`, `far`, `total` as in `grid.Grid`; lower: corner of the root
    """

    boxes: NDArray[np.float32]
    links: NDArray[np.int32]
    lists: NDArray[np.int32]
    nodes: np.int32
    lower: tuple[Any, Any, Any]
    loose: NDArray[np.int32]
    far: np.float32
    total: np.int32


def bvh(scene: Scene, reach: float | None = None) -> Accelerator:
    """The scene's hierarchy; `reach` as for `grid.grid`. The counter `cells` counts nodes."""
    bounds = margins(scene, reach)
    held = np.flatnonzero(bounds.dilation >= 0)
    growth = (bounds.dilation[held] + bounds.slack)[:, None]
    low = rounded_down(scene.triangles[held].min(axis=1) - growth)
    high = rounded_up(scene.triangles[held].max(axis=1) + growth)
    most = max(2 * len(held), 1)
    boxes, links = np.empty((most, 6), np.float32), np.empty((most, 3), np.int32)
    order = np.arange(len(held))
    nodes = specialise(build_nodes, {})(low, high, order, boxes, links) if len(held) else 0
    x, y, z = rounded_down(bounds.lower)
    structure = Hierarchy(
        boxes[:nodes].copy(), links[:nodes].copy(), held[order].astype(np.int32), np.int32(nodes), (x, y, z),
        bounds.loose, bounds.far, np.int32(len(scene)),
    )  # fmt: skip
    return Accelerator("bvh", structure, search_hierarchy)
