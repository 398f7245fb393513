"""What the experiments of the sphere hierarchy's paper share: scenes on a stage, a camera, kept lists, runs.

The paper gives neither cameras nor lights, but rays a second and frames a second, hence rays a pixel: 1.18 for the bare
bunny, 1.79 to 1.88 with a ground. `VIEW`, `FILL` and `HALF` are such that this one set-up gives nearly the same for all
five scenes (Table 2). Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from refsim.experiments.registry import Row
from refsim.experiments.runs import MISSING
from refsim.methods import METHODS
from refsim.options import checked
from refsim.results import RayKind, Trace
from refsim.scene import Rays, Scene, camera_rays, load_scene
from refsim.scene.material import Material
from refsim.scene.stages import on_ground

METHOD = "traversal_list"
# The paper's scenes and the bodies here
MESHES = {"Cubes": "cubes", "Suzanne": "suzanne", "Bunny": "bunny", "Happy Buddha": "buddha_100k", "Dragon": "dragon"}
SUBSTITUTES = {"Happy Buddha": "decimated to 100,000 triangles", "Cubes": "another scene of as many triangles"}
# Scenes of the library that come with a ground of two triangles of their own, which makes way for the stage's
GROUNDED = ("cubes",)
VIEW, FILL, HALF = (0.35, 0.5, 1.0), 1.05, 3.0
# Another camera, where one does not do: name -> direction, distance
CAMERAS: dict[str, tuple[tuple[float, float, float], float]] = {
    "front": (VIEW, FILL), "right": ((1.0, 0.4, 0.3), FILL), "back": ((-0.35, 0.5, -1.0), FILL),
    "left": ((-1.0, 0.4, -0.3), FILL), "above": ((0.2, 1.0, 0.35), FILL), "close": (VIEW, 0.5),
    "diagonal": ((1.0, 0.9, 0.9), 0.6),
}  # fmt: skip
PLASTER = Material("plaster", "diffuse", (0.75, 0.72, 0.66))
FLOOR = Material("floor", "diffuse", (0.5, 0.52, 0.55))
# "with all of the aforementioned optimization enabled" (section 4), the rules that lose no hit
ENABLED: dict[str, Any] = {
    "culling": "sextant_safe", "heads": "regular", "screen_cells": 16, "facing": "front",
}  # fmt: skip



def without_last(scene: Scene, count: int) -> Scene:
    """The scene less its last triangles."""
    normals = None if scene.normals is None else scene.normals[:-count]
    return scene.replace(
        triangles=scene.triangles[:-count], material_ids=scene.material_ids[:-count], normals=normals,
        texcoords=scene.texcoords[:-count],
    )  # fmt: skip


@lru_cache(maxsize=4)
def body_of(name: str) -> Scene:
    """The body alone."""
    scene = load_scene(name)
    return without_last(scene, 2) if name in GROUNDED else scene


@lru_cache(maxsize=4)
def scene_of(name: str, ground: bool = True) -> Scene:
    """The body of plaster with the one light, on the ground or without it: all else is the same."""
    staged = on_ground(body_of(name), material=PLASTER, ground=FLOOR, half=HALF)
    return staged if ground else without_last(staged, 2)


def rays_of(name: str, size: int, view: tuple[float, float, float] = VIEW, fill: float = FILL) -> Rays:
    """Camera rays of a square picture; the camera looks at the body, with or without a ground."""
    return camera_rays(scene_of(name, False), size, size, view=view, fill=fill)


@lru_cache(maxsize=3)
def hierarchy_of(name: str, ground: bool = True, threshold: float = 0.5) -> Any:
    """The scene's hierarchy."""
    from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy

    return build_hierarchy(scene_of(name, ground), threshold)


@lru_cache(maxsize=8)
def lists_of(
    name: str, ground: bool = True, lists: int = 6, order: str = "earliest_first", culling: str | None = None,
    threshold: float = 0.5,
) -> Any:  # fmt: skip
    """The scene's traversal lists; the last few are kept."""
    from refsim.papers.sphere_hierarchy.lists import build_lists

    return build_lists(hierarchy_of(name, ground, threshold), lists, order, culling)


@lru_cache(maxsize=2)
def heads_of(name: str, ground: bool, kind: str, rule: str, *structure: Any) -> Any:
    """Heads of every polygon in lists of `structure`: lists, order, culling, threshold."""
    from refsim.papers.sphere_hierarchy.polygon_heads import polygon_heads

    scene = scene_of(name, ground)
    return polygon_heads(lists_of(name, ground, *structure), scene.triangles, kind, rule, None, scene.epsilon)


def prepared_for(name: str, ground: bool = True, **options: Any) -> tuple[Any, dict[str, Any]]:
    """What the method's tracer needs, from lists that are kept between runs, and all option values."""
    from refsim.papers.sphere_hierarchy.setup import ListOptions, Prepared

    values = checked(METHOD, METHODS[METHOD].options, {"shadows": True, "generations": 2, **options})
    chosen = ListOptions.of(values)
    structure = chosen.lists, chosen.order, chosen.culling, chosen.threshold
    heads = None
    if chosen.heads is not None:
        heads = (heads_of(name, ground, chosen.heads, chosen.head_rule, *structure),)
    return Prepared(scene_of(name, ground), chosen, (lists_of(name, ground, *structure),), heads), values


def run(name: str, size: int, *, ground: bool = True, rays: Rays | None = None, **options: Any) -> Trace:
    """`refsim.trace` with the paper's shading: eye rays, then shadow rays."""
    from refsim.papers.sphere_hierarchy.tracer import trace_prepared

    prepared, values = prepared_for(name, ground, **options)
    return replace(trace_prepared(prepared, rays or rays_of(name, size)), method=METHOD, options=values)


def warp_account(name: str, found: Trace, ground: bool = True) -> Any:
    """The account of warps of 8 × 4 pixels for the rays of a run."""
    from refsim.papers.sphere_hierarchy import locality, warps

    given = {key: value for key, value in found.options.items() if key not in ("backend", "material", "threads")}
    prepared, _ = prepared_for(name, ground, **given)
    shots = locality.shots_of(prepared, found)
    return warps.account(shots, locality.order_of(found.generations[0].rays, locality.TILE, prepared.options.lists))


@lru_cache(maxsize=6)
def kept(name: str, size: int, ground: bool = True, **options: Any) -> Trace:
    """`run`, kept between measuring and drawing."""
    return run(name, size, ground=ground, **options)


def missing_row(name: str, size: int) -> Row:
    """The line of a mesh that is not at hand."""
    return {"scene": name, "triangles": MISSING, "size_px": size}


def head(name: str, size: int, found: Trace) -> Row:
    """Which picture a row is about."""
    return {"scene": name, "triangles": len(found.scene), "size_px": size}


def ray_counts(found: Trace) -> Row:
    """Rays, and what a ray costs: eye rays, shadow rays, all of them."""
    eye, shadow = found.counters["rays.eye"], found.counters["rays.shadow"]
    row: Row = {"eye_rays": eye, "shadow_rays": shadow, "rays_per_pixel": round((eye + shadow) / eye, 4)}
    for kind, name in ((RayKind.EYE, "eye"), (RayKind.SHADOW, "shadow")):
        nodes, tests = nodes_of(found, kind), tests_of(found, kind)
        row[f"{name}_nodes_per_ray"] = mean(nodes)
        row[f"{name}_tests_per_ray"] = mean(tests)
    counters = found.counters
    row["nodes"] = counters["traversal.nodes"]
    row["triangle_tests"] = counters["intersection.triangle_tests"]
    row["nodes_per_ray"] = round(row["nodes"] / (eye + shadow), 3)
    row["tests_per_ray"] = round(row["triangle_tests"] / (eye + shadow), 3)
    return row


def nodes_of(found: Trace, kind: RayKind) -> Any:
    """Nodes of each ray of a kind that was shot, i32[n]."""
    return _of_kind(found, kind, "nodes")


def tests_of(found: Trace, kind: RayKind) -> Any:
    """Triangle tests of each ray of a kind that was shot, i32[n]."""
    return _of_kind(found, kind, "triangle_tests")


def _of_kind(found: Trace, kind: RayKind, what: str) -> Any:
    parts = [g.per_ray[what][g.alive & (g.kind == kind)] for g in found.generations]
    return np.concatenate(parts)


def mean(values: Any) -> float:
    """Three digits; 0 of nothing."""
    return round(float(np.mean(values)), 3) if len(values) else 0.0


def vertices_of(name: str, ground: bool = True) -> int:
    """Vertices that share one position counted once, as the lists store them."""
    from refsim.papers.sphere_hierarchy.shared_vertices import SharedVertices

    return len(SharedVertices.of(scene_of(name, ground).triangles).positions)
