"""What a path sees: the environment in the direction of its last ray, or the diffuse surface where it ended.

Ideal surfaces tint what is seen through or in them by their colour; there is no Fresnel term, as in the papers.
Diffuse surfaces are lit by the scene's point lights without shadows (Lambert, plus a little ambient light). Where
paths end in shadow rays, one light shines: the one they are sent to, unless something hides it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.results import Generation, RayKind, Trace
from refsim.scene import PointLight
from refsim.scene.environment import CHECKER, Environment, load_environment
from refsim.scene.mesh import Scene

AMBIENT = 0.2


def environment_of(scene: Scene, choice: Any = None) -> Environment:
    """The environment asked for (a name, an image file, or an object), else the scene's, else the checker."""
    if isinstance(choice, Environment):
        return choice
    if choice is not None:
        return load_environment(choice)
    return scene.environment or CHECKER


def shade(trace: Trace, environment: Environment) -> NDArray[np.float32]:
    """Linear RGB f32[n, 3], a row a pixel."""
    rgb = environment.lookup(trace.exit_rays.direction)
    colors = np.array([material.color for material in trace.scene.materials], np.float32)
    tint = np.ones_like(rgb)
    lights = trace.scene.lights_or_one[:1] if trace.options.get("shadows") else trace.scene.lights
    for k, generation in enumerate(trace.generations):
        hit = np.flatnonzero((generation.hits.triangle >= 0) & (generation.kind != RayKind.SHADOW))
        following = generation.next_rays
        if not len(hit) or following is None:
            continue
        material = trace.scene.material_ids[generation.hits.triangle[hit]]
        goes_on = (following.t_max[hit] > 0) & (_next_kind(generation)[hit] != RayKind.SHADOW)
        ends = hit[~goes_on]
        light = _lambert(trace.scene, lights, generation, ends, _in_shadow(trace.generations, k)[ends])
        rgb[ends] = colors[material[~goes_on]] * light[:, None]
        tint[hit[goes_on]] *= colors[material[goes_on]]
    return rgb * tint


def _next_kind(generation: Generation) -> NDArray[np.int32]:
    return generation.kind if generation.next_kind is None else generation.next_kind


def _in_shadow(generations: Sequence[Generation], k: int) -> NDArray[np.bool_]:
    """bool[n]: the hit of generation k sent a shadow ray, which was shot and hit something."""
    if k + 1 == len(generations):
        return np.zeros(len(generations[k].rays), np.bool_)
    following = generations[k + 1]
    return (following.kind == RayKind.SHADOW) & (following.hits.triangle >= 0)


def _lambert(
    scene: Scene,
    lights: Sequence[PointLight],
    generation: Generation,
    rows: NDArray[np.intp],
    in_shadow: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Irradiance factor at the hits of `rows`: ambient, plus the cosine to every light on the side that was hit, where
    nothing hides it."""
    rays, hits = generation.rays, generation.hits
    corners = scene.triangles[hits.triangle[rows]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    facing = np.sign(np.einsum("ij,ij->i", normal, rays.direction[rows]))
    point = rays.origin[rows] + hits.t[rows, None] * rays.direction[rows]
    light = np.full(len(rows), AMBIENT)
    for source in lights:
        towards = np.asarray(source.position) - point
        towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-30)
        cosine = np.einsum("ij,ij->i", -facing[:, None] * normal, towards)
        light += source.intensity * np.where(in_shadow, 0.0, np.maximum(cosine, 0.0))
    return light.astype(np.float32)
