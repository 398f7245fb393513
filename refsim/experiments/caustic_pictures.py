"""Pictures of glass over a floor with its caustic: eye rays and light rays both through the engine.

The floor's light is what the lamp throws there straight (inverse square, cosine, shadow rays from the lamp to the
floor's texels, traced by the engine as one picture) plus the caustic's light map.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.pictures import averaged
from refsim.experiments.runs import HIERARCHICAL
from refsim.image import encode_srgb
from refsim.methods import trace
from refsim.papers.hierarchical_ray_engine.caustics import Caustic, PointLight, Receiver, caustic, with_receiver
from refsim.papers.hierarchical_ray_engine.non_ideal import trace_non_ideal
from refsim.scene import Material, Rays, Scene, camera_rays, load_scene
from refsim.shading import environment_of

TINTS = {"torus_knot": (1.0, 0.93, 0.78), "blob": (0.86, 0.95, 1.0)}
LAMP = (-4.5, 5.5, 1.5)
FLOOR_GAP, FLOOR_HALF = 0.35, 5.5
ALBEDO = np.array((0.62, 0.6, 0.57))
AMBIENT = 0.06


@dataclass(frozen=True, eq=False)
class LitScene:
    """A glass body, the floor under it, the lamp, and the floor's light f32[h, w, 3]: caustic and all."""

    body: Scene
    floor: Receiver
    caustic: Caustic
    light: NDArray[np.float64]


@lru_cache(maxsize=4)
def lit_scene(body: str, photons_across: int, map_px: int) -> LitScene:
    """The light on the floor."""
    tint = TINTS[body.rpartition("_")[0]]
    scene = load_scene(body).with_materials(Material("tinted glass", "glass", tint))
    low = float(scene.lower[1]) - FLOOR_GAP
    # A little to the right: that is where the light goes
    floor = Receiver((0.8 - FLOOR_HALF, low, FLOOR_HALF), (2 * FLOOR_HALF, 0, 0), (0, 0, -2 * FLOOR_HALF))
    square = float(np.sum(np.square(LAMP)))
    lamp = PointLight(LAMP, intensity=1.5 * square)
    found = caustic(
        scene, lamp, floor, photons_across=photons_across, resolution=(map_px, map_px), shading="smooth", generations=8
    )
    straight = _straight(scene, floor, lamp, map_px)
    return LitScene(scene, floor, found, straight + found.irradiance.astype(np.float64))


def _straight(scene: Scene, floor: Receiver, lamp: PointLight, map_px: int) -> NDArray[np.float64]:
    """What the lamp throws on each texel where nothing is in between."""
    part = (np.arange(map_px) + 0.5) / map_px
    corner, along, up = (np.array(value) for value in (floor.corner, floor.along, floor.up))
    place = corner + part[None, :, None] * along + part[:, None, None] * up
    away = (place - np.array(lamp.position)).reshape(-1, 3)
    distance = np.linalg.norm(away, axis=1)
    direction = away / distance[:, None]
    origin = np.tile(np.array(lamp.position, np.float32), (len(away), 1))
    rays = Rays(origin, direction.astype(np.float32), distance.astype(np.float32), map_px, map_px)
    hidden = trace(HIERARCHICAL, scene, rays, generations=1, shading="smooth").hits.hit
    cosine = np.abs(direction[:, 1])
    bright = np.where(hidden, 0.0, cosine / distance**2)[:, None] * np.array(lamp.radiance)
    return bright.reshape(map_px, map_px, 3)


@lru_cache(maxsize=4)
def picture(body: str, photons_across: int, map_px: int, size_px: int, samples: int) -> NDArray[np.uint8]:
    """What an eye above sees, `size_px` high and 4 : 3: the floor through and beside the glass, else the sky."""
    lit = lit_scene(body, photons_across, map_px)
    stage = with_receiver(lit.body, lit.floor)
    width, height = size_px * samples * 4 // 3, size_px * samples
    rays = camera_rays(stage, width, height, view=(0.1, 1.0, 0.85), fov=30.0, fill=0.3)
    seen = trace_non_ideal(stage, rays, generations=8, shading="smooth")
    rgb = environment_of(stage, "sky").lookup(seen.exit_rays.direction).astype(np.float64)
    tint = np.ones_like(rgb)
    color = np.array(lit.body.materials[0].color)
    for generation in seen.generations:
        triangle = generation.hits.triangle
        place = np.flatnonzero(triangle >= len(lit.body))
        if len(place):
            at = generation.rays.origin[place] + generation.hits.t[place, None] * generation.rays.direction[place]
            rgb[place] = (_sampled(lit, at.astype(np.float64)) + AMBIENT) * ALBEDO
        tint[(triangle >= 0) & (triangle < len(lit.body))] *= color
    shown = averaged((rgb * tint).reshape(height, width, 3), samples)
    return encode_srgb(1.0 - np.exp(-1.1 * shown))


def _sampled(lit: LitScene, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The floor's light at points, bilinear between texel centres."""
    along, up = lit.floor.coordinates()
    size = lit.light.shape[0]
    away = points - np.array(lit.floor.corner)
    x, y = (np.clip(away @ axis * size - 0.5, 0.0, size - 1.0) for axis in (along, up))
    x0, y0 = (np.minimum(part.astype(int), size - 2) for part in (x, y))
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    a, b = lit.light[y0, x0], lit.light[y0, x0 + 1]
    c, d = lit.light[y0 + 1, x0], lit.light[y0 + 1, x0 + 1]
    return (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy
