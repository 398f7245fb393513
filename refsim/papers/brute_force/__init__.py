"""Brute force: every ray against every triangle, without a pipeline. The yardstick for hits, not for counts of stages.

Shares the ray–triangle test and the optics with the engines and nothing else; generations are made ray by ray.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.geometry.following_rays import new_rays
from refsim.geometry.triangle import pack_triangles
from refsim.jit import specialise
from refsim.papers.brute_force.kernels import nearest_hits
from refsim.pipeline.draw import default_threads
from refsim.results import Generation, RayKind, Trace, summed_per_ray
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays


def trace_brute_force(
    scene: Scene, rays: Rays, generations: int, ior: float, facing: str, smooth: bool, threads: int | None
) -> Trace:
    """All generations; counters: triangle tests (every live ray against every triangle) and rays by kind."""
    records = pack_triangles(scene.triangles)
    triangles = np.column_stack([records.v0, records.n, records.m1, records.m2])
    surface = scene.optical_indices(ior)
    shoot, emit = specialise(nearest_hits, {}), specialise(new_rays, {})
    workers = threads or default_threads()
    n = len(rays)
    kind = np.zeros(n, np.int32)
    eye = rays
    found: list[Generation] = []
    for k in range(generations):
        origin, direction = np.ascontiguousarray(rays.origin.T), np.ascontiguousarray(rays.direction.T)
        triangle, hit = np.full(n, -1, np.int32), np.zeros((3, n), np.float32)
        hit[0] = np.inf

        inputs, outputs = (origin, direction, rays.t_max, triangles), (triangle, hit)

        def part(bounds: tuple[int, int], inputs: Any = inputs, outputs: Any = outputs) -> None:
            shoot(*inputs, *bounds, facing == "front", *outputs)

        cuts = np.linspace(0, n, 4 * workers + 1).astype(int).tolist()
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(part, pairwise(cuts)))
        columns, new_kind = np.zeros((7, n), np.float32), np.zeros(n, np.int32)
        emit(
            origin, direction, triangle, hit, records.n, scene.vertex_normals, surface, scene.epsilon, smooth,
            columns, new_kind,
        )  # fmt: skip
        new_origin, new_direction = np.ascontiguousarray(columns[:3].T), np.ascontiguousarray(columns[3:6].T)
        following = Rays.unchecked(new_origin, new_direction, columns[6].copy(), eye.width, eye.height)
        hits = Hits(triangle, hit[0].copy(), hit[1].copy(), hit[2].copy())
        found.append(_generation(k, rays, hits, kind, following, new_kind, len(scene.triangles)))
        rays, kind = following, new_kind
    counters = Counters()
    for generation in found:
        counters.merge(generation.counters)
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    return Trace("brute_force", scene, {}, tuple(found), counters, summed_per_ray(found, n))


def _generation(
    k: int, rays: Rays, hits: Hits, kind: np.ndarray, following: Rays, new_kind: np.ndarray, triangles: int
) -> Generation:
    alive = rays.t_max > 0
    pixel = np.arange(len(rays), dtype=np.int32)
    tests = np.where(alive, triangles, 0).astype(np.int32)
    counters = Counters()
    counters.add("intersection.triangle_tests", int(tests.sum(dtype=np.int64)))
    counters.add("rays.eye", int(alive.sum()) if k == 0 else 0)
    counters.add("rays.reflected", int((alive & (kind == RayKind.REFLECTED)).sum()))
    counters.add("rays.refracted", int((alive & (kind == RayKind.REFRACTED)).sum()))
    parent = np.where(alive & (k > 0), pixel, -1).astype(np.int32)
    per_ray = {"triangle_tests": tests}
    return Generation(rays, hits, alive, kind, pixel, parent, per_ray, counters, None, following, new_kind)
