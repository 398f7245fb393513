"""Embree's nearest hits, through embreex: somebody else's tracer on the same rays."""

from __future__ import annotations

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from refsim import Hits, Rays, Scene


def embree_hits(scene: Scene, rays: Rays) -> Hits:
    """What Embree finds for each ray, both sides of triangles; rays without limit only."""
    assert np.isinf(rays.t_max[rays.alive]).all()
    world = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(world, np.ascontiguousarray(scene.triangles))
    found = world.run(rays.origin, rays.direction, output=1)
    hit = (found["primID"] >= 0) & rays.alive
    missed = {"tfar": np.inf, "u": 0.0, "v": 0.0}
    columns = (np.where(hit, found[name], value).astype(np.float32) for name, value in missed.items())
    return Hits(np.where(hit, found["primID"], -1).astype(np.int32), *columns)
