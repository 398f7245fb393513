"""Scenes of this room, small enough to be reckoned by hand: a court, facing mirrors, soups of triangles.

The court, seen by eight rays, one a pixel of an 8 × 1 picture:

    floor   y = 0, diffuse                                          light    (4, 8, 0)
    roof    y = 4, over x < 0 alone: the floor is in its shadow where x < −4
    wall    z = −8, x from −8 to 8, y from 0 to 4; it sends on half of what it gets

    pixel   the eye sees               its light there    and in the wall
    0       floor at x = 2             lit
    1       floor at x = −6            shadowed
    2       wall at x = 2              lit                floor, lit
    3       wall at x = −7             shadowed           floor, shadowed
    4       wall at x = −3.5           shadowed           floor, lit
    5       wall at x = −2             lit                floor at x = −5, shadowed
    6       nothing
    7       wall at x = 2              lit                nothing
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

import refsim
from refsim import Material, Rays, Scene, camera_rays, load_scene
from refsim.results import Trace
from refsim.scene import PointLight

BACKGROUND = (0.1, 0.12, 0.15)
LIGHT = PointLight((4.0, 8.0, 0.0))
FLOOR = Material("floor", "diffuse", (0.5, 0.4, 0.3))
ROOF = Material("roof", "diffuse", (0.25, 0.5, 0.75))
MIRROR = Material("wall", "mirror", reflectivity=0.5)
HALF = Material("mirror", "mirror", reflectivity=0.5)
TILES = Material("wall", "diffuse", (0.2, 0.3, 0.4), reflectivity=0.5)
GLASS = Material("glass", "glass", specular=0.3, shininess=5.0)
SHINY = Material("shiny", "diffuse", (0.6, 0.5, 0.4), specular=0.5, shininess=7.0, reflectivity=0.25)
# Where the eight rays of the court meet the wall, as x, y
ON_WALL = {2: (2.0, 1.25), 3: (-7.0, 1.25), 4: (-3.5, 1.25), 5: (-2.0, 1.25), 7: (2.0, 2.75)}


def quad(*corners: Sequence[float]) -> np.ndarray:
    """Two triangles, front where the corners run counter-clockwise."""
    a, b, c, d = (np.array(corner, np.float32) for corner in corners)
    return np.array([[a, b, c], [a, c, d]], np.float32)


def assembled(name: str, parts: list[tuple[np.ndarray, Material]], *lights: PointLight) -> Scene:
    """Triangles with a material each part."""
    materials = tuple(dict.fromkeys(material for _, material in parts))
    ids = [np.full(len(triangles), materials.index(material), np.int32) for triangles, material in parts]
    triangles = np.concatenate([triangles for triangles, _ in parts])
    return Scene(triangles, name, materials, np.concatenate(ids), lights=lights)


@cache
def court(wall: Material = MIRROR, floor: Material = FLOOR, upside_down: bool = False) -> Scene:
    """The court above; `upside_down` turns the front of the floor away from the eye."""
    ground = quad((-8, 0, 8), (8, 0, 8), (8, 0, -8), (-8, 0, -8))
    roof = quad((-8, 4, 8), (0, 4, 8), (0, 4, -8), (-8, 4, -8))
    back = quad((-8, 0, -8), (8, 0, -8), (8, 4, -8), (-8, 4, -8))
    parts = [(ground[:, ::-1] if upside_down else ground, floor), (roof, ROOF), (back, wall)]
    return assembled("court", parts, LIGHT)


def court_rays(pixels: Sequence[int] = range(8)) -> Rays:
    """The rays of these pixels of the court, an image of one row."""
    down, level, up = (0.0, -0.6, -0.8), (0.0, 0.0, 1.0), (0.0, 0.6, -0.8)
    origins = [(2, 2, 0), (-6, 2, 0), (2, 2, -7), (-7, 2, -7), (-3.5, 2, -7), (-0.2, 2, -7), (0, 2, 0), (2, 2, -7)]
    directions = [(0, -1, 0), (0, -1, 0), down, down, down, (-1.44, -0.6, -0.8), level, up]
    d = np.array([directions[k] for k in pixels], np.float64)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return Rays(np.array([origins[k] for k in pixels], np.float32), d.astype(np.float32), np.inf, len(pixels), 1)


def lit_from(point: Sequence[float], normal: Sequence[float], light: PointLight = LIGHT) -> float:
    """N · L in float64."""
    towards = np.array(light.position) - np.array(point)
    return max(float(towards @ np.array(normal) / np.linalg.norm(towards)), 0.0)


def floor_points() -> dict[int, tuple[float, float, float]]:
    """Floor points that pixels see, in the wall or at once; rays that leave the wall start epsilon before it."""
    z = -8.0 + 5.0 / 3.0 + float(court().epsilon)
    return {0: (2, 0, 0), 1: (-6, 0, 0), 2: (2, 0, z), 3: (-7, 0, z), 4: (-3.5, 0, z), 5: (-5, 0, z)}


def floor_light() -> dict[int, np.ndarray]:
    """Diffuse light of these points where nothing shadows them, RGB."""
    return {k: np.array(FLOOR.color) * lit_from(point, (0, 1, 0)) for k, point in floor_points().items()}


def wall_light() -> dict[int, np.ndarray]:
    """The same for the points of a wall of tiles."""
    return {k: np.array(TILES.color) * lit_from((x, y, -8), (0, 0, 1)) for k, (x, y) in ON_WALL.items()}


@cache
def facing_mirrors(material: Material = HALF) -> Scene:
    """Two walls that face each other at z = −1 and z = 1, wide enough for a ray to stay between them."""
    near = quad((-9, -9, 1), (-9, 9, 1), (9, 9, 1), (9, -9, 1))
    far = quad((-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1))
    return assembled("facing mirrors", [(near, material), (far, material)], PointLight((0.0, 0.0, 0.5)))


def between_mirrors(width: int, height: int) -> Rays:
    """Rays from between the walls, close enough to the normal to meet 12 of them."""
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, width), np.linspace(0.15, -0.15, height))
    d = np.stack([x, y, np.full(x.shape, -1.0)], axis=-1).reshape(-1, 3)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return Rays(np.zeros((len(d), 3), np.float32), d.astype(np.float32), np.inf, width, height)


def soup(seed: int, count: int, materials: Sequence[Material], lights: int = 1) -> Scene:
    """Random triangles around the origin, large against their distances, of random materials."""
    random = np.random.default_rng(seed)
    triangles = random.normal(0.0, 1.0, (count, 1, 3)) + random.normal(0.0, 0.8, (count, 3, 3))
    ids = random.integers(0, len(materials), count).astype(np.int32)
    places = random.normal(0.0, 2.0, (lights, 3))
    return Scene(
        triangles.astype(np.float32), "soup", tuple(materials), ids,
        lights=tuple(PointLight(tuple(place.tolist())) for place in places),
    )  # fmt: skip


def enclosed(material: Material, *lights: PointLight) -> Scene:
    """A closed box around the origin whose walls face inwards: every ray that starts within hits."""
    box = [
        quad((-2, -2, 2), (2, -2, 2), (2, -2, -2), (-2, -2, -2)),
        quad((-2, 2, -2), (2, 2, -2), (2, 2, 2), (-2, 2, 2)),
        quad((-2, -2, -2), (2, -2, -2), (2, 2, -2), (-2, 2, -2)),
        quad((2, -2, 2), (-2, -2, 2), (-2, 2, 2), (2, 2, 2)),
        quad((-2, -2, 2), (-2, -2, -2), (-2, 2, -2), (-2, 2, 2)),
        quad((2, -2, -2), (2, -2, 2), (2, 2, 2), (2, 2, -2)),
    ]
    return assembled("enclosed", [(np.concatenate(box), material)], *lights)


def wild(width: int, height: int, seed: int, dead: float = 0.0) -> Rays:
    """Rays from near the origin in any direction, a share of them dead."""
    random = np.random.default_rng(seed)
    n = width * height
    d = random.normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    gone = random.random(n) < dead
    d[gone] = 0.0
    t_max = np.where(gone, 0.0, np.inf)
    origin = random.uniform(-0.3, 0.3, (n, 3))
    return Rays(origin.astype(np.float32), d.astype(np.float32), t_max.astype(np.float32), width, height)


def traced(scene: Scene, rays: Rays, **options: Any) -> Trace:
    """The method of this room, with the search that needs no structure."""
    return refsim.trace("geometry_shader", scene, rays, **{"acceleration": "naive", **options})


SECOND_LIGHT = PointLight((-0.5, 0.4, 0.8), (0.2, 0.5, 1.0), 0.8)


@cache
def cornell() -> Scene:
    """The library's box with mirror and glass in it, and a second light."""
    scene = load_scene("cornell_box")
    return scene.replace(lights=(*scene.lights, SECOND_LIGHT))


@cache
def cornell_rays(width: int = 14, height: int = 11) -> Rays:
    """Camera rays at it, most of which hit."""
    return camera_rays(cornell(), width, height, view=(0.13, 0.21, 1.0), fill=0.62)


@cache
def cornell_trace(passes: int = 4, lights: int = 2) -> Trace:
    """A run that has all kinds of ray."""
    return traced(cornell(), cornell_rays(), passes=passes, lights=lights)
