"""The method "traversal_list" in plain NumPy: lists, generations, shadow rays (Efficient Stackless Ray Traversal).

Twin of `refsim.papers.sphere_hierarchy.tracer`: the same rays, hits and counts, to the bit. `packet`, `threads` and
`stage` say where and in which order the same steps are taken, so they change no ray here; what a stage's draws would
count is known without them.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.reference import engines
from refsim.reference.list_heads import PolygonHeads, cell_starts
from refsim.reference.list_search import Walked, walk
from refsim.reference.sphere_tree import sphere_tree
from refsim.reference.surfaces import Following, Surfaces, following_rays
from refsim.reference.traversal_lists import Lists, traversal_lists
from refsim.reference.vector import dot, length
from refsim.results import Generation, RayKind, Trace, summed_per_ray
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays


def traversal_list(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    """All generations. Raises `InputError` for a culling rule, layers or errata that do not fit."""
    check_options(scene, options)
    cuts = (0, *options["layers"], len(scene))
    layers = []
    for begin, end in pairwise(cuts):
        tree = sphere_tree(scene.triangles[begin:end], options["threshold"])
        layers.append(traversal_lists(tree, options["lists"], options["order"], options["culling"]))
    surfaces = Surfaces.of(scene, options)
    heads = polygon_heads(scene, surfaces, layers, options)
    light = np.array(scene.lights_or_one[0].position, np.float32) if options["shadows"] else None
    kind, left = np.zeros(len(rays), np.int32), np.full(len(rays), -1, np.int32)
    generations: list[Generation] = []
    for k in range(options["generations"]):
        starts = starts_of(layers, heads, rays, k, left, options)
        found = shoot(layers, rays, kind == RayKind.SHADOW, starts, options)
        new = next_rays(surfaces, rays, kind, found, light)
        generations.append(generation_of(k, rays, kind, found, new))
        count_draws(generations[-1], options["stage"], len(layers))
        following = generations[-1].next_rays
        assert following is not None
        rays, kind, left = following, new.kind, found.triangle
    counters = Counters()
    for generation in generations:
        counters.merge(generation.counters)
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    per_ray = summed_per_ray(generations, len(rays))
    return Trace("traversal_list", scene, {}, tuple(generations), counters, per_ray)


def check_options(scene: Scene, options: Mapping[str, Any]) -> None:
    """What the options cannot say one by one."""
    culling, lists = options["culling"], options["lists"]
    needed = 8 if culling == "octant" else 6
    if culling is not None and lists != needed:
        raise InputError(f"culling={culling!r} needs lists={needed}, not lists={lists}.")
    if culling is not None and options["facing"] != "front":
        raise InputError(f"culling={culling!r} needs facing='front': the back of a triangle may be hit by any ray.")
    for before, row in pairwise((0, *options["layers"])):
        if not before < row < len(scene):
            last = len(scene) - 1
            raise InputError(f"layers name row {row}: rows must ascend from 1 to {last}, so that no layer is empty.")


def printed(options: Mapping[str, Any], erratum: str) -> bool:
    """Whether an erratum ("E5", "E9") stands as printed."""
    errata = options["errata"]
    several = errata.split(",") if isinstance(errata, str) else list(errata)
    names = [str(name).strip().upper().removeprefix("BSH-") for name in several]
    return errata == "as_printed" or erratum in names


def polygon_heads(
    scene: Scene, surfaces: Surfaces, layers: list[Lists], options: Mapping[str, Any]
) -> list[PolygonHeads]:
    """Heads of every polygon in each layer's lists; none where the option is None."""
    epsilon = float(scene.epsilon)
    if options["heads"] is None or not epsilon > 0.0:
        return []
    regular, climbs = options["heads"] == "regular", options["head_rule"] == "climb"
    return [PolygonHeads(lists, scene.triangles, surfaces.n, epsilon, regular, climbs) for lists in layers]


def starts_of(
    layers: list[Lists], heads: list[PolygonHeads], rays: Rays, k: int, left: np.ndarray, options: Mapping[str, Any]
) -> list[np.ndarray | None]:
    """Per layer the element of its list at which each ray begins: its screen cell's head, or that of the polygon which
    it left (`left` i32[n])."""
    if k == 0 and options["screen_cells"] is not None:
        climbs = options["head_rule"] == "climb"
        return [cell_starts(lists, rays, options["screen_cells"], climbs) for lists in layers]
    if k > 0 and heads:
        return [each.starts(rays.origin, rays.direction, left, printed(options, "E9")) for each in heads]
    return [None] * len(layers)


def shoot(
    layers: list[Lists], rays: Rays, shadow: np.ndarray, starts: list[np.ndarray | None], options: Mapping[str, Any]
) -> Walked:
    """Through all layers, the best hit carried on; shadow rays end at their first."""
    found = Walked.nothing(len(rays))
    front_only, exit_root = options["facing"] == "front", printed(options, "E5")
    for any_hit in (False, True):
        offset = 0
        t_max = np.where(shadow == any_hit, rays.t_max, np.float32(0))
        for lists, begin in zip(layers, starts, strict=True):
            walk(
                lists, rays.origin, rays.direction, t_max, found, starts=begin, offset=offset, any_hit=any_hit,
                front_only=front_only, exit_root=exit_root,
            )  # fmt: skip
            offset += len(lists.tree.triangles)
    return found


def next_rays(surfaces: Surfaces, rays: Rays, kind: np.ndarray, found: Walked, light: np.ndarray | None) -> Following:
    """What leaves the hits; with a light f32[3] a diffuse hit sends a shadow ray, which ends its path."""
    triangle = np.where(kind == RayKind.SHADOW, np.int32(-1), found.triangle)
    new = following_rays(surfaces, rays.origin, rays.direction, triangle, found.t, found.u, found.v)
    if light is None:
        return new
    rows = np.flatnonzero((triangle >= 0) & (surfaces.index[triangle] < 0))
    o, d, normal = rays.origin[rows], rays.direction[rows], surfaces.n[triangle[rows]]
    with np.errstate(all="ignore"):
        side = np.where(dot(d, normal) < 0, surfaces.epsilon, -surfaces.epsilon)
        origin = (o + d * found.t[rows, None]) + normal * side[:, None]
        towards = light - origin
        distance = length(towards)
        sent = (dot(towards, normal) * side > 0) & (distance > 0) & (distance < np.inf)
        direction = towards / distance[:, None]
    new.origin[rows[sent]], new.direction[rows[sent]] = origin[sent], direction[sent]
    new.t_max[rows[sent]], new.kind[rows[sent]] = distance[sent], RayKind.SHADOW
    return new


def generation_of(k: int, rays: Rays, kind: np.ndarray, found: Walked, new: Following) -> Generation:
    """Rows are pixels; counted are elements visited, what they were, and rays by kind."""
    alive = rays.t_max > 0
    pixel = np.arange(len(rays), dtype=np.int32)
    nodes, tests = int(found.nodes.sum(dtype=np.int64)), int(found.tests.sum(dtype=np.int64))
    counters = Counters()
    counters.add("traversal.nodes", nodes)
    counters.add("intersection.triangle_tests", tests)
    counters.add("intersection.sphere_tests", nodes - tests)
    for of_kind in RayKind:
        counters.add(f"rays.{of_kind.name.lower()}", int((alive & (kind == of_kind)).sum()))
    following = Rays.unchecked(new.origin, new.direction, new.t_max, rays.width, rays.height)
    return Generation(
        rays, Hits(found.triangle, found.t, found.u, found.v), alive, np.where(alive, kind, 0).astype(np.int32), pixel,
        np.where(alive & (k > 0), pixel, -1).astype(np.int32), {"nodes": found.nodes, "triangle_tests": found.tests},
        counters, None, following, new.kind,
    )  # fmt: skip


def count_draws(generation: Generation, stage: str | None, layers: int) -> None:
    """Draws of the pipeline: one a layer, and as many again where shadow rays are searched beside others. "fragment":
    a quad over the rays' image; "vertex": a point a ray, captured."""
    shadow = generation.kind == RayKind.SHADOW
    searches = 2 if shadow.any() and (generation.alive & ~shadow).any() else 1
    rays, counters = generation.rays, generation.counters
    for _ in range(searches * layers if stage is not None else 0):
        if stage == "fragment":
            engines.count_quads(counters, 1)
            for name in ("raster.fragments", "fragment.invocations", "fragment.written"):
                counters.add(name, len(engines.Image.of(rays)))
            for name in ("stencil.failed_early", "depth.failed_early", "fragment.discarded", "stencil.failed",
                         "depth.failed"):  # fmt: skip
                counters.add(name, 0)
        else:
            counters.add("draw.calls", 1)
            for name in ("vertex.invocations", "assembly.primitives", "stream_output.generated",
                         "stream_output.primitives"):  # fmt: skip
                counters.add(name, len(rays))
            counters.add("stream_output.overflowed", 0)
