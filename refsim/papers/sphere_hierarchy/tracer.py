"""The paper's ray tracer: a search a generation through the traversal lists.

In: a scene and rays; out: a `Trace` whose rows are pixels. One ray a path: what a hit on glass or a mirror sends on,
and with `shadows` the ray from a diffuse hit to the light, which is the path's last ("a very simple example rendering
algorithm", section 4). Eye rays begin at their screen cell's head, rays that leave a polygon at that polygon's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.counters import ConservationError, Counters
from refsim.geometry.following_rays import new_rays
from refsim.jit import specialise
from refsim.papers.sphere_hierarchy.cell_heads import cell_starts
from refsim.papers.sphere_hierarchy.errata import slots_of
from refsim.papers.sphere_hierarchy.polygon_heads import polygon_starts
from refsim.papers.sphere_hierarchy.search import Found, search
from refsim.papers.sphere_hierarchy.setup import ListOptions, Prepared, prepare
from refsim.papers.sphere_hierarchy.shader_search import shader_search
from refsim.papers.sphere_hierarchy.shadow_rays import shadow_rays
from refsim.results import Generation, RayKind, Trace, summed_per_ray
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays

Starts = list[NDArray[np.int32] | None]


def trace_lists(scene: Scene, rays: Rays, options: ListOptions) -> Trace:
    """Builds what the options ask for and traces."""
    return trace_prepared(prepare(scene, options), rays)


def trace_prepared(prepared: Prepared, rays: Rays) -> Trace:
    """All generations; counters: nodes, sphere and triangle tests, rays by kind (and of the stages, if any ran)."""
    scene, options = prepared.scene, prepared.options
    kind, left = np.zeros(len(rays), np.int32), np.full(len(rays), -1, np.int32)
    generations: list[Generation] = []
    for k in range(options.generations):
        counters = Counters()
        starts = starts_of(prepared, rays, k, left)
        found = _shoot(prepared, rays, kind, starts, counters)
        _check_lengths(prepared, found)
        following, new_kind = following_rays(prepared, rays, kind, found.hits)
        generations.append(_generation(k, rays, kind, found, following, new_kind, counters))
        rays, kind, left = following, new_kind, found.hits.triangle
    total = Counters()
    for generation in generations:
        total.merge(generation.counters)
    total.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    total.check()
    return Trace(
        "traversal_list", scene, {}, tuple(generations), total, summed_per_ray(generations, len(generations[0].rays))
    )


def starts_of(prepared: Prepared, rays: Rays, k: int, left: NDArray[np.int32]) -> Starts | None:
    """Where each ray begins in each layer's list; None for the lists' heads."""
    options = prepared.options
    if k == 0 and options.screen_cells is not None:
        return [cell_starts(lists, rays, options.screen_cells, options.head_rule) for lists in prepared.layers]
    if k > 0 and prepared.heads is not None:
        return [
            polygon_starts(heads, lists, rays, left, any_side=options.printed.E9)
            for heads, lists in zip(prepared.heads, prepared.layers, strict=True)
        ]
    return None


def _shoot(
    prepared: Prepared, rays: Rays, kind: NDArray[np.int32], starts: Starts | None, counters: Counters
) -> Found:
    """Nearest hits; of shadow rays, which are all that is left of a path, any hit. The two are searched apart."""
    options = prepared.options
    shared: dict[str, Any] = {"facing": options.facing, "threads": options.threads, "slots": slots_of(options.printed)}
    if options.stage is None:
        shared["packet"] = options.packet
        shoot: Any = search
    else:
        shared |= {"stage": options.stage, "counters": counters}
        shoot = shader_search
    shadow = kind == RayKind.SHADOW
    if not shadow.any():
        return shoot(prepared.layers, rays, starts=starts, **shared)
    any_found = shoot(prepared.layers, _only(rays, shadow), starts=starts, any_hit=True, **shared)
    if not (rays.alive & ~shadow).any():
        return any_found
    found = shoot(prepared.layers, _only(rays, ~shadow), starts=starts, **shared)
    hits = [np.where(shadow, a, b) for a, b in zip(_columns(any_found), _columns(found), strict=True)]
    return Found(Hits(*hits[:4]), hits[4], hits[5])


def _only(rays: Rays, chosen: NDArray[np.bool_]) -> Rays:
    """The same rows, all but the chosen ones dead."""
    direction = np.where(chosen[:, None], rays.direction, np.float32(0))
    t_max = np.where(chosen, rays.t_max, np.float32(0))
    return Rays.unchecked(rays.origin, direction, t_max, rays.width, rays.height)


def _columns(found: Found) -> tuple[NDArray[Any], ...]:
    hits = found.hits
    return hits.triangle, hits.t, hits.u, hits.v, found.nodes, found.triangle_tests


def _check_lengths(prepared: Prepared, found: Found) -> None:
    """No ray may visit more elements than the longest lists of all layers have together."""
    most = sum(max(lists.length(k) for k in range(lists.count)) for lists in prepared.layers)
    if found.nodes.size and int(found.nodes.max()) > most:
        raise ConservationError(f"a ray visited {int(found.nodes.max())} nodes of lists with {most} elements.")


def following_rays(
    prepared: Prepared, rays: Rays, kind: NDArray[np.int32], hits: Hits
) -> tuple[Rays, NDArray[np.int32]]:
    """The rays that leave the hits, and their kind; paths end where a ray missed and after a shadow ray."""
    scene, options, n = prepared.scene, prepared.options, len(rays)
    records = np.concatenate([lists.records for lists in prepared.layers])
    normals = np.ascontiguousarray(records[:, 3:6])
    triangle = np.where(kind == RayKind.SHADOW, np.int32(-1), hits.triangle).astype(np.int32)
    surface = scene.optical_indices(options.ior)
    columns, new_kind = np.zeros((7, n), np.float32), np.zeros(n, np.int32)
    origin, direction = np.ascontiguousarray(rays.origin.T), np.ascontiguousarray(rays.direction.T)
    specialise(new_rays, {})(
        origin, direction, triangle, np.stack([hits.t, hits.u, hits.v]), normals, scene.vertex_normals, surface,
        scene.epsilon, options.smooth, columns, new_kind,
    )  # fmt: skip
    new_origin, new_direction = np.ascontiguousarray(columns[:3].T), np.ascontiguousarray(columns[3:6].T)
    t_max = columns[6].copy()
    if options.shadows:
        light = np.array(scene.lights_or_one[0].position, np.float32)
        specialise(shadow_rays, {})(
            rays.origin, rays.direction, triangle, hits.t, normals, surface, light, scene.epsilon, new_origin,
            new_direction, t_max, new_kind,
        )  # fmt: skip
    return Rays.unchecked(new_origin, new_direction, t_max, rays.width, rays.height), new_kind


def _generation(
    k: int, rays: Rays, kind: NDArray[np.int32], found: Found, following: Rays, new_kind: NDArray[np.int32],
    counters: Counters,
) -> Generation:  # fmt: skip
    alive = rays.t_max > 0
    pixel = np.arange(len(rays), dtype=np.int32)
    nodes, tests = int(found.nodes.sum(dtype=np.int64)), int(found.triangle_tests.sum(dtype=np.int64))
    counters.add("traversal.nodes", nodes)
    counters.add("intersection.triangle_tests", tests)
    counters.add("intersection.sphere_tests", nodes - tests)
    for name, of_kind in (("eye", RayKind.EYE), ("shadow", RayKind.SHADOW), ("reflected", RayKind.REFLECTED),
                          ("refracted", RayKind.REFRACTED)):  # fmt: skip
        counters.add(f"rays.{name}", int((alive & (kind == of_kind)).sum()))
    parent = np.where(alive & (k > 0), pixel, -1).astype(np.int32)
    per_ray = {"nodes": found.nodes, "triangle_tests": found.triangle_tests}
    return Generation(
        rays, found.hits, alive, np.where(alive, kind, 0).astype(np.int32), pixel, parent, per_ray, counters, None,
        following, new_kind,
    )  # fmt: skip
