"""Every method end to end in plain NumPy: no pipeline, no compiled code (option ``backend="numpy"``).

Same hits, rays, cones and counters as the pipeline, bit for bit, from the equations of `triangle`, `optics`, `cone`
and `sphere` in float32. One NumPy pass over the pixels a triangle, and for the cones one over the tiles a ray of the
fullest tile, each generation. Meant for images of a few thousand rays and scenes of a few hundred triangles; memory
is a few columns a pixel. Methods that follow a tree of rays a pixel are `whitted`'s recursion in another order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.reference import engines
from refsim.reference.pixel_rays import fragment_grid
from refsim.reference.point_rays import geometry_shader
from refsim.reference.sphere_paths import traversal_list
from refsim.reference.surfaces import Surfaces, following_rays, shoot
from refsim.results import Generation, Trace, summed_per_ray
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

Pass = Callable[[int, Rays, np.ndarray], Generation]
# Methods that do their own generations: those that follow a tree of rays a pixel, and the traversal lists
TREES: Mapping[str, Callable[[Scene, Rays, Mapping[str, Any]], Trace]] = {
    "geometry_shader": geometry_shader,
    "fragment_grid": fragment_grid,
    "traversal_list": traversal_list,
}


def trace(name: str, scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    """Traces with the method of that name; `options` are all of the method's, checked (`refsim.methods`).

    `threads` means nothing here and `submission` changes nothing: every pixel sees the triangles in file order either
    way. Raises `InputError` for taps (there are no stages to tap), for no rays, and for an unknown name.
    """
    if options.get("taps") is not None:
        raise InputError("backend='numpy' has no stages to tap; leave taps out or choose backend='numba'.")
    passes: dict[str, Callable[[Scene, Rays, Mapping[str, Any]], Pass]] = {
        "brute_force": brute_force,
        "ray_engine": engines.ray_engine,
        "hierarchical_ray_engine": engines.hierarchical_ray_engine,
    }
    if name not in passes and name not in TREES:
        raise InputError(f"there is no method {name!r} in the reference; choose from {', '.join((*passes, *TREES))}.")
    if len(rays) == 0:
        raise InputError("there are no rays to trace.")
    if name in TREES:
        return TREES[name](scene, rays, options)
    run = passes[name](scene, rays, options)
    found: list[Generation] = []
    shot, kind = rays, np.zeros(len(rays), np.int32)
    for k in range(options["generations"]):
        generation = run(k, shot, kind)
        found.append(generation)
        assert generation.next_rays is not None and generation.next_kind is not None
        shot, kind = generation.next_rays, generation.next_kind
    counters = Counters()
    for generation in found:
        counters.merge(generation.counters)
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    counters.check()
    return Trace(name, scene, {}, tuple(found), counters, summed_per_ray(found, len(rays)))


def brute_force(scene: Scene, eye: Rays, options: Mapping[str, Any]) -> Pass:
    """Every live ray against every triangle; nothing but tests and rays is counted."""
    surfaces = Surfaces.of(scene, options)

    def run(k: int, rays: Rays, kind: np.ndarray) -> Generation:
        columns = engines.Image.of(rays)
        found = engines.Found.nothing(len(columns))
        nearest = columns.t_max.copy()
        for triangle in range(len(scene)):
            hit, t, u, v = shoot(surfaces, triangle, columns.origin, columns.direction, nearest)
            nearest[hit] = t[hit]
            found.write(hit, triangle, t, u, v)
        hits = (found.triangle, found.t, found.u, found.v)
        new = following_rays(surfaces, columns.origin, columns.direction, *hits)
        alive = rays.t_max > 0
        tests = np.zeros(len(columns), np.int32)
        tests[: len(rays)][alive] = len(scene)
        counters = Counters()
        counters.add("intersection.triangle_tests", int(tests.sum(dtype=np.int64)))
        return engines.generation_of(k, rays, kind, found, new, tests, counters, None)

    return run
