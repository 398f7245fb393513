"""One traced run for an experiment: scene, eye rays, method; and its counters as a row.

Every count is a logical count of the simulated pipeline. Times have no place here.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from refsim.experiments.registry import Row
from refsim.methods import trace
from refsim.results import Trace
from refsim.scene import Rays, Scene, camera_rays, load_scene
from refsim.scene.known import KNOWN_MESHES, find_mesh, is_known_file

HIERARCHICAL, RAY_ENGINE = "hierarchical_ray_engine", "ray_engine"
# How near the eye comes (`camera_rays`, fill). The blob covers every pixel at 0.55; a sphere needs 0.40; the knot's
# hole and outline stay in view.
FILL = {"torus_knot": 0.55, "blob": 0.55, "sphere": 0.40}
MISSING = "missing"
PRESENT = "present"


def fill_of(scene: str) -> float:
    """The distance at which a library body is looked at."""
    return FILL.get(scene.rpartition("_")[0], 0.55)


def mesh_state(name: str) -> str:
    """`made` for a scene of the library, else `present` or `missing`: the file known by that name, byte for byte."""
    if name not in KNOWN_MESHES:
        return "made"
    path = find_mesh(name)
    return PRESENT if path is not None and is_known_file(path) else MISSING


@lru_cache(maxsize=4)
def scene_named(name: str) -> Scene:
    """The scene; the last few are kept."""
    return load_scene(name)


def eye_rays(name: str, size: int, fill: float) -> Rays:
    """Camera rays of a square picture."""
    return camera_rays(scene_named(name), size, size, fill=fill)


def run(method: str, name: str, size: int, fill: float, **options: Any) -> Trace:
    """`refsim.trace` on the eye rays of a square picture of the scene."""
    return trace(method, scene_named(name), eye_rays(name, size, fill), **options)


def hits_percent(found: Trace) -> list[float]:
    """Rays that hit, percent of all pixels, one number a generation."""
    return [round(100.0 * float(np.mean(g.hits.triangle >= 0)), 3) for g in found.generations]


def counts(found: Trace) -> Row:
    """The counters that the figures speak of. Column names are units."""
    c = found.counters
    return {
        "cone_tests": c["cone.sphere_tests"],
        "pairs_kept": c["cone.pairs_kept"],
        "fragments": c["raster.fragments"],
        "stencil_rejected_early_fragments": c["stencil.failed_early"],
        "fragment_shader_runs": c["fragment.invocations"],
        "triangle_tests": c["intersection.triangle_tests"],
        "fragments_written": c["fragment.written"],
    }
