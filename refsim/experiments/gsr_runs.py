"""What the experiments of Recursive Ray Tracing in Geometry Shader share: views, modes, runs, and counters as a row.

A *view* is a scene as the camera of a figure sees it. The paper lists neither scenes nor cameras; meshes stand bare
where a table names their triangles, and on a ground where a figure shows shadows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from refsim.counters import COSTS
from refsim.experiments.registry import Row
from refsim.experiments.runs import mesh_state
from refsim.methods import trace
from refsim.results import Generation, RayKind, Trace
from refsim.scene import Rays, Scene, camera_rays, load_scene
from refsim.scene.animation import knight_in_box
from refsim.scene.light import PointLight
from refsim.scene.material import Material
from refsim.scene.stages import LIGHT, METAL, STANDING, TILES, on_ground, standing_up

GEOMETRY_SHADER, FRAGMENT_GRID = "geometry_shader", "fragment_grid"
# The paper's ray casting, shadow casting, and shadow casting with single reflections; it has no refraction
MODES: dict[str, dict[str, Any]] = {
    "RC": {"passes": 1, "shadows": False, "reflections": False, "refractions": False},
    "SC": {"passes": 2, "shadows": True, "reflections": False, "refractions": False},
    "RT": {"passes": 2, "shadows": True, "reflections": True, "refractions": False},
}
PLASTER = Material("plaster", "diffuse", (0.75, 0.72, 0.66))
FLOOR = Material("floor", "diffuse", (0.5, 0.52, 0.55))
ENAMEL = Material("enamel", "diffuse", (0.7, 0.7, 0.72), specular=0.3, shininess=32.0, reflectivity=0.25)


@dataclass(frozen=True)
class View:
    """A scene, how it is staged (`as made`, `bare`, `on ground` or one material throughout), and the camera."""

    scene: str
    stage: str = "as made"
    material: Material | None = None
    direction: tuple[float, float, float] = (0.3, 0.25, 1.0)
    fill: float = 0.55
    fov: float = 40.0
    ground: Material | None = None


ABOVE = (0.2, 1.0, 0.35)
VIEWS = {
    "room": View("room"),
    "mirroring room": View("room", "one material", ENAMEL),
    "cornell box": View("cornell_box"),
    "cornell box from afar": View("cornell_box", fill=0.82),
    "knight in box": View("knight_in_box"),
    "knot": View("knot_on_ground_1026", fill=0.45),
    "knot from above": View("knot_on_ground_1024", direction=ABOVE, fill=0.25, fov=20.0),
    "small knot from above": View("knot_on_ground_258", direction=ABOVE, fill=0.25, fov=20.0),
    "dragon, shadows": View("dragon", "on ground", PLASTER, (0.35, 0.4, 1.0), 0.46, ground=FLOOR),
    "horse, specular": View("horse", "on ground", METAL, (0.35, 0.3, 1.0), 0.5),
    "coarse dragon, shadows": View("dragon_res4", "on ground", PLASTER, (0.35, 0.4, 1.0), 0.46, ground=FLOOR),
    "dragon": View("dragon", "bare", METAL),
    "buddha": View("buddha_100k", "bare", METAL),
    "horse": View("horse", "bare", METAL),
    "bunny": View("bunny", "bare", METAL),
}


def view_state(name: str) -> str:
    """`made`, `present` or `missing`: whether the view's scene is at hand."""
    scene = VIEWS[name].scene
    return mesh_state(scene)


@lru_cache(maxsize=4)
def scene_of(name: str, frame: int = 0, frames: int = 1) -> Scene:
    """The view's scene; the last few are kept. `frame` of `frames` where it is animated."""
    view = VIEWS[name]
    if view.scene == "knight_in_box":
        return knight_in_box(frame, max(frames, 1))
    scene = load_scene(view.scene)
    if view.stage == "one material":
        assert view.material is not None
        return scene.with_materials(view.material)
    if view.stage == "on ground":
        return on_ground(scene, material=view.material, ground=view.ground or TILES)
    return _bare(scene, view.material) if view.stage == "bare" else scene


def _bare(scene: Scene, material: Material | None) -> Scene:
    """The mesh alone, upright, with the light that `on_ground` gives it."""
    axis, quarters = STANDING.get(scene.name, ("y", 0))
    body = scene if (axis, quarters) == ("y", 0) else standing_up(scene, axis, quarters)
    body = body if material is None else body.with_materials(material)
    place = (body.center + body.diagonal * np.array(LIGHT)).tolist()
    return body.replace(lights=(PointLight((place[0], place[1], place[2])),))


def rays_of(name: str, size: int, scene: Scene | None = None) -> Rays:
    """Camera rays of a square picture of the view."""
    view = VIEWS[name]
    return camera_rays(scene or scene_of(name), size, size, view=view.direction, fov=view.fov, fill=view.fill)


@lru_cache(maxsize=2)
def grid_over(name: str, size: int) -> Any:
    """The view's grid, built once for all runs on it."""
    from refsim.papers.geometry_shader_rays.grid import grid
    from refsim.papers.geometry_shader_rays.setup import reach_of

    return grid(scene_of(name), None, reach_of(scene_of(name), rays_of(name, size)))


def run(method: str, name: str, size: int, **options: Any) -> Trace:
    """`refsim.trace` on the eye rays of a square picture of the view; the grid is the default structure."""
    if options.get("acceleration", "grid") == "grid" and options.get("resolution") is None:
        options["acceleration"] = grid_over(name, size)
    return trace(method, scene_of(name), rays_of(name, size), **options)


@lru_cache(maxsize=6)
def kept(method: str, name: str, size: int, mode: str = "RT", **options: Any) -> Trace:
    """`run` in one of the paper's modes, kept between measuring and drawing."""
    return run(method, name, size, **{**MODES[mode], **options})


def head(name: str, size: int, found: Trace) -> Row:
    """Which picture a row is about."""
    view = VIEWS[name]
    return {"view": name, "scene": view.scene, "triangles": len(found.scene.triangles), "size_px": size}


def ray_counts(found: Trace) -> Row:
    """Rays by kind, what they visited and tested, in all and for each ray."""
    c = found.counters
    rays = sum(c[f"rays.{kind.name.lower()}"] for kind in RayKind)
    return {
        "eye_rays": c["rays.eye"],
        "eye_rays_that_hit_percent": round(100.0 * hits_of(found.generations[0]) / c["rays.eye"], 3),
        "shadow_rays": c["rays.shadow"],
        "reflected_rays": c["rays.reflected"],
        "refracted_rays": c["rays.refracted"],
        "rays": rays,
        "box_rejections_rays": c["traversal.box_rejections"],
        "cells": c["traversal.cells"],
        "triangle_tests": c["intersection.triangle_tests"],
        "cells_per_ray": round(c["traversal.cells"] / rays, 3),
        "tests_per_ray": round(c["intersection.triangle_tests"] / rays, 3),
    }


def shader_work(found: Trace) -> Row:
    """Operations and texels fetched of each shader, those of `fragment_grid`'s lighting passes among them."""
    return {name.replace(".", "_"): found.counters[name] for name in COSTS}


def hits_of(generation: Generation, kind: RayKind | None = None) -> int:
    """Rays of a generation (of one kind) that hit something."""
    hit = generation.hits.triangle >= 0
    return int((hit if kind is None else hit & (generation.kind == kind)).sum())


def occupancies(found: Trace) -> list[int]:
    """Vertices captured by each pass."""
    return [g.occupancy.vertices if g.occupancy is not None else 0 for g in found.generations]
