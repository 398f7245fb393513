"""The method "traversal_list" in plain NumPy: lists, generations, shadow rays (Efficient Stackless Ray Traversal).

Twin of `refsim.papers.sphere_hierarchy.tracer`: the same rays, hits and counts, to the bit. `packet`, `threads` and
`stage` say where and in which order the same steps are taken, so they change nothing here; without a pipeline there are
no counts of one.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
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
    light = np.array(scene.lights_or_one[0].position, np.float32) if options["shadows"] else None
    kind, left = np.zeros(len(rays), np.int32), np.full(len(rays), -1, np.int32)
    generations: list[Generation] = []
    for k in range(options["generations"]):
        starts = [starts_of(scene, lists, rays, k, left, options) for lists in layers]
        found = shoot(layers, rays, kind == RayKind.SHADOW, starts, options)
        new = next_rays(surfaces, rays, kind, found, light)
        generations.append(generation_of(k, rays, kind, found, new))
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
    if culling is not None and lists != (8 if culling == "octant" else 6):
        raise InputError(f"culling={culling!r} does not go with lists={lists}.")
    if culling is not None and options["facing"] != "front":
        raise InputError(f"culling={culling!r} needs facing='front': the back of a triangle may be hit by any ray.")
    cuts = (0, *options["layers"], len(scene))
    if any(begin >= end for begin, end in pairwise(cuts)):
        raise InputError(f"layers begin at rows {options['layers']}; they must ascend within {len(scene)} triangles.")


def printed(options: Mapping[str, Any], erratum: str) -> bool:
    """Whether an erratum ("E5", "E9") stands as printed."""
    errata = options["errata"]
    several = errata.split(",") if isinstance(errata, str) else list(errata)
    names = [str(name).strip().upper().removeprefix("BSH-") for name in several]
    return errata == "as_printed" or erratum in names


def starts_of(
    scene: Scene, lists: Lists, rays: Rays, k: int, left: np.ndarray, options: Mapping[str, Any]
) -> np.ndarray | None:
    """The element of its list at which each ray begins: its screen cell's head, or that of the polygon it left."""
    return None


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
