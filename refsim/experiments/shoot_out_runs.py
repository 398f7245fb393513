"""What the shoot-out's runs share: scenes, one set of rays for all methods, and how each method shoots it.

Rays go from those of a camera (spread 0) to random lines through the scene (spread 1): each origin moves towards a
random point of the sphere that the eye is on, and each point aimed at towards a random one in the box, by the spread.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from refsim.experiments.registry import Row
from refsim.experiments.runs import scene_named
from refsim.methods import trace
from refsim.results import Trace
from refsim.scene import Rays, Scene, camera_rays

SEED = 2010
# The last is the paper's dragon; the others are made here
SCENES = ("blob_100", "blob_1000", "blob_10000", "blob_100000", "dragon")
QUICK_SCENES = SCENES[:3]
SPREADS = (0.0, 0.01, 0.1, 0.3, 1.0)
QUICK_SPREADS = (0.0, 0.1, 1.0)
FILL = 0.55
CAP = 20_000  # triangles above which every ray against every triangle is not run

# Name -> method, options, whether it has a cap
CONTENDERS: dict[str, tuple[str, dict[str, Any], bool]] = {
    "brute force": ("brute_force", {"generations": 1}, True),
    "Ray Engine": ("ray_engine", {"generations": 1}, True),
    "Hierarchical Ray Engine": ("hierarchical_ray_engine", {"generations": 1, "tile_size": 8}, True),
    "geometry shader, grid": ("geometry_shader", {"passes": 1, "acceleration": "grid"}, False),
    "fragment shader, grid": ("fragment_grid", {"passes": 1, "acceleration": "grid"}, False),
    "geometry shader, boxes": ("geometry_shader", {"passes": 1, "acceleration": "bvh"}, False),
    "one list": ("traversal_list", {"generations": 1, "lists": 1}, False),
    "six lists": ("traversal_list", {"generations": 1, "lists": 6}, False),
}


@lru_cache(maxsize=8)
def rays_of(name: str, size: int, spread: float) -> Rays:
    """size² rays in unit directions, all live."""
    scene = scene_named(name)
    camera = camera_rays(scene, size, size, fill=FILL)
    eye = camera.origin.astype(np.float64)
    middle = scene.center.astype(np.float64)
    rng = np.random.default_rng(SEED)
    points = rng.normal(size=eye.shape)
    radius = np.linalg.norm(eye[0] - middle)
    anywhere = middle + radius * points / np.linalg.norm(points, axis=1, keepdims=True)
    aim = eye + radius * camera.direction.astype(np.float64)
    inside = scene.lower + rng.random(eye.shape) * (scene.upper - scene.lower)
    origin = (1 - spread) * eye + spread * anywhere
    direction = (1 - spread) * aim + spread * inside - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Rays(origin, direction, width=size, height=size)


def tile_angle(rays: Rays, tile: int) -> float:
    """Median over tiles of the largest angle, in degrees, between a ray's direction and the mean of its tile's."""
    assert rays.width is not None and rays.height is not None
    shape = rays.height // tile, tile, rays.width // tile, tile, 3
    tiles = rays.direction.astype(np.float64).reshape(shape).swapaxes(1, 2).reshape(-1, tile * tile, 3)
    mean = tiles.mean(axis=1, keepdims=True)
    mean /= np.maximum(np.linalg.norm(mean, axis=2, keepdims=True), 1e-30)
    cosine = np.clip(np.sum(tiles * mean, axis=2), -1.0, 1.0)
    return float(np.degrees(np.median(np.arccos(cosine.min(axis=1)))))


@lru_cache(maxsize=4)
def structure_of(name: str, kind: str) -> Any:
    """The scene's grid or hierarchy of boxes, built once for all rays."""
    from refsim.papers.geometry_shader_rays.bvh import bvh
    from refsim.papers.geometry_shader_rays.grid import grid

    return grid(scene_named(name)) if kind == "grid" else bvh(scene_named(name))


@lru_cache(maxsize=4)
def lists_of(name: str, lists: int) -> Any:
    """The scene's traversal lists."""
    from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
    from refsim.papers.sphere_hierarchy.lists import build_lists

    return build_lists(build_hierarchy(scene_named(name)), lists)


def elements_built(contender: str, name: str) -> int:
    """What a new structure writes: spheres, cells and references, boxes and their triangles, elements of lists."""
    method, options, _ = CONTENDERS[contender]
    triangles = len(scene_named(name))
    if method == "traversal_list":
        return len(lists_of(name, options["lists"]).escape)
    if "acceleration" in options:
        built = structure_of(name, options["acceleration"]).structure
        if options["acceleration"] == "grid":
            return len(built.texels) + int(built.texels[:, 2].sum())
        return int(built.nodes) + triangles
    return triangles if method == "hierarchical_ray_engine" else 0


def shoot(contender: str, name: str, size: int, spread: float, build: bool = False) -> Trace:
    """The contender's trace of the rays: eye rays alone, without shading; `build` makes its structure anew."""
    method, options, _ = CONTENDERS[contender]
    kind = options.get("acceleration")
    kept = {} if build or kind is None else {"acceleration": structure_of(name, kind)}
    return trace(method, scene_named(name), rays_of(name, size, spread), **{**options, **kept})


def is_capped(contender: str, scene: Scene) -> bool:
    """Whether it is left out for the scene's size."""
    return CONTENDERS[contender][2] and len(scene) > CAP


def hits_by_pixel(found: Trace, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangle and t (as bits) of each ray, whatever order the method shoots them in."""
    generation = found.generations[0]
    live = generation.alive
    triangle, t = np.full(count, -1, np.int32), np.full(count, np.inf, np.float32)
    triangle[generation.pixel[live]] = generation.hits.triangle[live]
    t[generation.pixel[live]] = generation.hits.t[live]
    return triangle, t.view(np.uint32)


def work_of(found: Trace) -> Row:
    """Tests of triangles, and of what encloses them: cones, cells, boxes or spheres; both a ray."""
    c = found.counters
    tests = c["intersection.triangle_tests"]
    # A list's elements are spheres and triangles; the triangles are in the tests already
    enclosing = c["cone.sphere_tests"] + c["traversal.cells"] + c["intersection.sphere_tests"]
    rays = c["rays.eye"]
    return {
        "triangle_tests_per_ray": round(tests / rays, 3),
        "other_tests_per_ray": round(enclosing / rays, 3),
        "steps_per_ray": round((tests + enclosing) / rays, 3),
    }
