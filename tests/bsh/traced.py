"""Scenes, rays and traces that the tests of the method share."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import refsim
from refsim import Rays, Scene
from refsim.results import Trace
from refsim.scene import Material, PointLight
from refsim.scene.stages import on_ground

METHOD = "traversal_list"
GLASS, MIRROR, DIFFUSE = Material("glass", "glass"), Material("mirror", "mirror"), Material("clay", "diffuse")
COLUMNS = ("triangle", "t", "u", "v")


@cache
def mixed(name: str = "torus_knot_100") -> Scene:
    """A body above a ground; glass, mirrors and diffuse triangles by turns, half the ground a mirror; one light."""
    body = on_ground(refsim.load_scene(name))
    ids = (np.arange(len(body)) // 4 % 3).astype(np.int32)
    ids[-2:] = 2, 1
    return Scene(body.triangles, "mixed", (GLASS, MIRROR, DIFFUSE), ids, lights=body.lights)


@cache
def eye_rays(name: str = "torus_knot_100", width: int = 32, height: int = 26) -> Rays:
    """The camera's rays on the mixed scene of that name."""
    return refsim.camera_rays(mixed(name), width, height, fill=0.5)


def wild_rays(scene: Scene, count: int, seed: int) -> Rays:
    """Incoherent rays: from a box twice the scene's towards places in it, one in eight dead, some with an end."""
    rng = np.random.default_rng(seed)
    origin = scene.center + scene.diagonal * rng.uniform(-1.0, 1.0, (count, 3))
    direction = rng.uniform(scene.lower, scene.upper, (count, 3)) - origin
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    dead = rng.random(count) < 0.125
    direction[dead] = 0.0
    t_max = np.where(rng.random(count) < 0.3, rng.uniform(0.0, 2.0, count) * scene.diagonal, np.inf)
    return Rays(origin, direction, np.where(dead, 0.0, t_max))


def traced(scene: Scene, rays: Rays, **options: Any) -> Trace:
    """`refsim.trace` by the method, four rays a path unless told otherwise."""
    return refsim.trace(METHOD, scene, rays, **{"generations": 4, **options})


def bits(trace: Trace) -> list[bytes]:
    """Rays, kinds and hits of all generations; of shadow rays hit or miss alone."""
    parts = []
    for generation in trace.generations:
        hits, shadow = generation.hits, generation.kind == refsim.results.RayKind.SHADOW
        parts += [generation.rays.origin.tobytes(), generation.rays.direction.tobytes(), generation.kind.tobytes()]
        parts.append(np.where(shadow, np.minimum(hits.triangle, 0), hits.triangle).tobytes())
        parts += [np.where(shadow, 0, getattr(hits, name)).tobytes() for name in COLUMNS[1:]]
    return parts


def light_above(scene: Scene) -> PointLight:
    """A light above the middle of a scene."""
    x, y, z = (scene.center + scene.diagonal * np.array([0.1, 1.0, 0.2])).tolist()
    return PointLight((x, y, z))
