"""Scenes and rays on which the pipeline and the recursive reference are compared."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import refsim
from refsim import Material, Rays, Scene, camera_rays, load_scene
from refsim.results import RayKind, Trace
from refsim.scene import PointLight, shapes

POINTS, PIXELS = "geometry_shader", "fragment_grid"
LAMPS = (
    PointLight((0.1, 0.85, 0.2)),
    PointLight((-0.8, 0.3, 0.7), (1.0, 0.35, 0.25), 0.6),
    PointLight((0.6, -0.7, 0.9), (0.2, 0.4, 1.0), 0.75),
)
TINTED, BLACK = (0.1, 0.12, 0.15), (0.0, 0.0, 0.0)
GLOSSY = Material("glossy", "diffuse", (0.5, 0.45, 0.4), specular=0.5, shininess=20.0, reflectivity=0.3)
DULL = Material("dull", "diffuse", (0.3, 0.5, 0.6), specular=0.2, shininess=0.0)
DENSE = Material("dense", "glass", ior=2.4, specular=0.8, shininess=60.0)
LIGHT_GLASS = Material("light glass", "glass", ior=1.2, reflectivity=0.25)
CLOUDED = Material("clouded mirror", "mirror", specular=0.3, shininess=2.5, reflectivity=0.8)
SEEN_THROUGH = Material("nothing reflected", "glass", reflectivity=0.0)
OPAQUE_GLASS = Material("all reflected", "glass", reflectivity=1.0)
MATERIALS = (GLOSSY, DULL, DENSE, LIGHT_GLASS, CLOUDED, SEEN_THROUGH, OPAQUE_GLASS)


@cache
def scene_of(name: str) -> Scene:
    """The box, or the room with its walls made glossy and spheres of glass in it."""
    if name == "cornell_box":
        return load_scene(name).replace(lights=LAMPS)
    room = load_scene("room")
    ids = (np.arange(len(room)) // 2 % 3).astype(np.int32)
    parts, materials = [room.triangles], [ids]
    for k, (centre, radius) in enumerate((((-0.3, -0.2, 0.2), 0.45), ((0.5, 0.1, -0.2), 0.35))):
        vertices, faces = shapes.sphere(6, 3)
        parts.append(vertices[faces] * radius + centre)
        materials.append(np.full(len(faces), 3 + k, np.int32))
    triangles = np.concatenate(parts).astype(np.float32)
    surfaces = (GLOSSY, DULL, CLOUDED, DENSE, LIGHT_GLASS)
    return Scene(triangles, name, surfaces, np.concatenate(materials), lights=LAMPS)


def rays_of(name: str, width: int = 18, height: int = 13) -> Rays:
    """Most of them hit, some leave."""
    return camera_rays(scene_of(name), width, height, view=(0.13, 0.17, 1.0), fill=0.6)


def both(method: str, scene: Scene, rays: Rays, **options: Any) -> tuple[Trace, Trace]:
    """The pipeline's trace and the reference's."""
    given_options = {"acceleration": "naive", **options}
    return (
        refsim.trace(method, scene, rays, **given_options),
        refsim.trace(method, scene, rays, backend="numpy", **given_options),
    )


def traced(scene: Scene, rays: Rays, **options: Any) -> Trace:
    """The reference's trace."""
    return refsim.trace(POINTS, scene, rays, **{"backend": "numpy", "acceleration": "naive", **options})


def seen(trace: Trace) -> np.ndarray:
    """Its image, float64[pixels, 3]."""
    assert trace.image is not None
    return trace.image.astype(np.float64).reshape(-1, 3)


def rays_of_kind(trace: Trace, kind: RayKind) -> int:
    return sum(int((g.alive & (g.kind == kind)).sum()) for g in trace.generations)
