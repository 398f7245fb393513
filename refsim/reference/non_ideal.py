"""Non-ideal triangles by the letter of section 5 of The Hierarchical Ray Engine, in NumPy: final rays alone.

Brute force on the ideal triangles (the others shrunk to points, so that rows and sizes stay), then on the others with
the rays that left. `refsim.reference.methods.trace("brute_force", …)` on the whole scene is the correction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.reference.methods import trace
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays


def only(scene: Scene, kept: np.ndarray) -> Scene:
    """The scene with all triangles but `kept` bool[n] shrunk to points; two more points keep its box, which sets how
    far off a surface new rays start."""
    triangles = np.where(kept[:, None, None], scene.triangles, scene.triangles[:, :1])
    corners = np.stack([np.broadcast_to(corner, (3, 3)) for corner in (scene.lower, scene.upper)])
    normals = None
    if scene.normals is not None:
        normals = np.concatenate([scene.normals, np.zeros((2, 3, 3), np.float32)])
    ids = np.concatenate([scene.material_ids, np.zeros(2, np.int32)])
    return scene.replace(
        triangles=np.concatenate([triangles, corners]), normals=normals, material_ids=ids, texcoords=None
    )


def final_rays(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> tuple[Rays, Hits]:
    """The last ray of every path through the ideal triangles (dead where the path goes on), and what it hits of the
    others. `options` are those of "brute_force"."""
    ideal = scene.optical_indices(options["ior"]) >= 0
    generations = trace("brute_force", only(scene, ideal), rays, options).generations
    origin, direction = np.zeros_like(rays.origin), np.zeros_like(rays.direction)
    t_max = np.zeros_like(rays.t_max)
    for generation in generations:
        ends = generation.alive & (generation.hits.triangle < 0)
        origin[ends], direction[ends] = generation.rays.origin[ends], generation.rays.direction[ends]
        t_max[ends] = generation.rays.t_max[ends]
    last = Rays.unchecked(origin, direction, t_max, rays.width, rays.height)
    found = trace("brute_force", only(scene, ~ideal), last, {**options, "generations": 1})
    return last, found.hits
