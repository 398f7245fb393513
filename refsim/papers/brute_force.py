"""Brute force: every ray against every triangle, without a pipeline. The yardstick for hits, not for counts of stages.

Shares the ray–triangle test and the optics with the engines and nothing else; generations are made ray by ray.
"""

# ruff: noqa: F821
from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.geometry.optics import next_ray
from refsim.geometry.triangle import intersect, pack_triangles
from refsim.geometry.vector import add, normalise, scale
from refsim.jit import specialise
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays
from refsim.results import Generation, RayKind, Trace, last_rays, summed_per_ray

BLOCK = 256
F0 = np.float32(0)
F1 = np.float32(1)
INFINITY = np.float32(np.inf)
I = np.int32  # noqa: E741
U = np.uintp


def nearest_hits(origin, direction, t_max, triangles, first, last, front_only, hit_triangle, hit):
    """Closest hits of rays [first, last); the triangle listed first wins a tie.

    `origin`, `direction` f32[3, n]; `triangles` f32[m, 12] rows (v0, n, m1, m2); `hit_triangle` i32[n], `hit` f32[3, n]
    (t, u, v) are written.
    """
    nearest = np.empty(BLOCK, np.float32)
    for start in range(first, last, BLOCK):
        n = min(BLOCK, last - start)
        for j in range(n):
            nearest[U(j)] = t_max[U(start + j)]
        for k in range(triangles.shape[0]):
            a = triangles[U(k)]
            v0, normal, m1, m2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11])
            for j in range(n):
                i = U(start + j)
                o = origin[0, i], origin[1, i], origin[2, i]
                d = direction[0, i], direction[1, i], direction[2, i]
                found, t, u, v, facing = intersect(o, d, nearest[U(j)], v0, normal, m1, m2)
                if found and ((facing < F0) or not front_only):
                    nearest[U(j)] = t
                    hit_triangle[i] = I(k)
                    hit[0, i], hit[1, i], hit[2, i] = t, u, v


def new_rays(origin, direction, hit_triangle, hit, normals, vertex_normals, surface, epsilon, smooth, out, kind):
    """Rays that leave the hits: `out` f32[7, n] origin, direction, t_max; `kind` i32[n]. Misses stay zero."""
    for j in range(hit_triangle.shape[0]):
        i = U(j)
        if hit_triangle[i] < 0:
            continue
        k = U(hit_triangle[i])
        o = origin[0, i], origin[1, i], origin[2, i]
        d = direction[0, i], direction[1, i], direction[2, i]
        n = normals[k, 0], normals[k, 1], normals[k, 2]
        shading = n
        if smooth:
            t, u, v = hit[0, i], hit[1, i], hit[2, i]
            n0 = vertex_normals[k, 0, 0], vertex_normals[k, 0, 1], vertex_normals[k, 0, 2]
            n1 = vertex_normals[k, 1, 0], vertex_normals[k, 1, 1], vertex_normals[k, 1, 2]
            n2 = vertex_normals[k, 2, 0], vertex_normals[k, 2, 1], vertex_normals[k, 2, 2]
            shading = normalise(add(add(scale(n0, F1 - u - v), scale(n1, u)), scale(n2, v)))
        new_origin, new_direction, new_kind, alive = next_ray(o, d, hit[0, i], n, shading, surface[k], epsilon)
        for c in range(3):
            out[U(c), i] = new_origin[c]
            out[U(c + 3), i] = new_direction[c]
        out[6, i] = INFINITY if alive else F0
        kind[i] = new_kind


def trace_brute_force(
    scene: Scene, rays: Rays, generations: int, ior: float, facing: str, smooth: bool, threads: int | None
) -> Trace:
    """All generations; counters: triangle tests (every live ray against every triangle) and rays by kind."""
    records = pack_triangles(scene.triangles)
    triangles = np.column_stack([records.v0, records.n, records.m1, records.m2])
    surface = scene.optical_indices(ior)
    shoot, emit = specialise(nearest_hits, {}), specialise(new_rays, {})
    workers = threads or len(os.sched_getaffinity(0))
    n = len(rays)
    kind = np.zeros(n, np.int32)
    eye = rays
    found: list[Generation] = []
    for k in range(generations):
        origin, direction = np.ascontiguousarray(rays.origin.T), np.ascontiguousarray(rays.direction.T)
        triangle, hit = np.full(n, -1, np.int32), np.zeros((3, n), np.float32)
        hit[0] = np.inf

        def part(bounds: tuple[int, int], fixed: Any = (origin, direction, rays.t_max), out: Any = (triangle, hit)) -> None:
            shoot(*fixed, triangles, *bounds, facing == "front", *out)

        cuts = np.linspace(0, n, 4 * workers + 1).astype(int).tolist()
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(part, zip(cuts[:-1], cuts[1:], strict=True)))
        columns, new_kind = np.zeros((7, n), np.float32), np.zeros(n, np.int32)
        emit(
            origin, direction, triangle, hit, records.n, scene.vertex_normals, surface, scene.epsilon, smooth, columns, new_kind
        )  # fmt: skip
        following = Rays.unchecked(
            np.ascontiguousarray(columns[:3].T), np.ascontiguousarray(columns[3:6].T), columns[6].copy(), eye.width, eye.height
        )
        hits = Hits(triangle, hit[0].copy(), hit[1].copy(), hit[2].copy())
        found.append(_generation(k, rays, hits, kind, following, new_kind, len(scene.triangles)))
        rays, kind = following, new_kind
    counters = Counters()
    for generation in found:
        counters.merge(generation.counters)
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    return Trace("brute_force", scene, {}, tuple(found), last_rays(found), counters, summed_per_ray(found, n))


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
