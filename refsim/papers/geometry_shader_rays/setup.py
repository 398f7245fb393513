"""What a run is made of before anything is drawn: options, lights, the scene's textures, its structure.

Both methods of this room, the geometry shader's and the fragment shader's, start from the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.papers.geometry_shader_rays.acceleration import Accelerator
from refsim.papers.geometry_shader_rays.naive import naive
from refsim.papers.geometry_shader_rays.triangle_textures import TriangleTextures, triangle_textures
from refsim.scene.light import PointLight
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

ACCELERATIONS = ("grid", "naive", "bvh")
DEFAULT_PASSES = 2
MOST_LIGHTS = 64  # each has an entry of the geometry shader and a target: so many take a minute to compile


@dataclass(frozen=True)
class Options:
    """What both methods share; names and values as the methods' options."""

    passes: int
    lights: tuple[PointLight, ...]
    shadows: bool
    reflections: bool
    refractions: bool
    background: tuple[float, float, float]
    color_format: str
    front_only: bool
    smooth: bool
    threads: int | None
    taps: Any


@dataclass(frozen=True)
class Prepared:
    """The scene as textures, the structure over it, and what its materials allow.

    `branching` is the number of rays that a hit may send on (2 with glass that refracts), `goes_on` whether any does.
    """

    scene: Scene
    textures: TriangleTextures
    accelerator: Accelerator
    branching: int
    goes_on: bool


def lights_of(scene: Scene, choice: Any) -> tuple[PointLight, ...]:
    """The lights asked for: the scene's, or one if it has none (None); the first n; or point lights of one's own."""
    known = scene.lights_or_one
    if choice is None:
        chosen = known
    elif isinstance(choice, bool):
        raise InputError(f"lights must be a whole number or point lights, not {choice!r}.")
    elif isinstance(choice, int | np.integer):
        if not 0 <= choice <= len(known):
            lights = "1 light" if len(known) == 1 else f"{len(known)} lights"
            raise InputError(f"lights is {choice}; scene {scene.name!r} has {lights}.")
        chosen = known[: int(choice)]
    else:
        chosen = tuple(choice) if isinstance(choice, Sequence) else (choice,)
        for light in chosen:
            if not isinstance(light, PointLight):
                raise InputError(f"lights holds {light!r}; it must hold refsim.scene.PointLight.")
    for light in chosen:
        with np.errstate(over="ignore"):
            numbers = np.array([light.position, light.radiance], np.float32)
        if not np.isfinite(numbers).all():
            raise InputError(f"{light} is too far off or too bright for float32.")
    if len(chosen) > MOST_LIGHTS:
        raise InputError(f"{len(chosen)} lights are more than the {MOST_LIGHTS} that have render targets of their own.")
    return chosen


def accelerator_of(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Accelerator:
    """The structure asked for by name, built for origins as far off as the rays'; or the one given."""
    choice = options["acceleration"]
    if isinstance(choice, Accelerator):
        return choice
    if options["resolution"] is not None and choice != "grid":
        raise InputError(f"resolution is the grid's; acceleration {choice!r} has none.")
    if choice == "grid":
        from refsim.papers.geometry_shader_rays.grid import grid

        return grid(scene, options["resolution"], reach_of(scene, rays))
    if choice == "bvh":
        from refsim.papers.geometry_shader_rays.bvh import bvh

        return bvh(scene, reach_of(scene, rays))
    return naive(scene, reach_of(scene, rays))


def reach_of(scene: Scene, rays: Rays) -> float:
    """The largest distance from the centre of the scene's box to a live ray's origin."""
    live = rays.t_max > 0
    origins = rays.origin if live.all() else rays.origin[live]
    if not len(origins):
        return 0.0
    square = 0.0
    for axis, middle in enumerate(scene.center):  # a column at a time is quicker than rows
        low, high = float(origins[:, axis].min()), float(origins[:, axis].max())
        square += max(abs(low - middle), abs(high - middle)) ** 2
    return float(np.sqrt(square))


def prepared(scene: Scene, rays: Rays, options: Mapping[str, Any], shared: Options) -> Prepared:
    """Textures and structure. Secondary rays start within the scene, so only eye rays reach beyond it."""
    used = [scene.materials[k] for k in np.unique(scene.material_ids)]
    refracts = shared.refractions and any(material.tau > 0 for material in used)
    reflects = shared.reflections and any(material.rho > 0 or material.tau > 0 for material in used)
    return Prepared(
        scene,
        triangle_textures(scene, options["ior"]),
        accelerator_of(scene, rays, options),
        2 if refracts else 1,
        refracts or reflects,
    )


def options_of(scene: Scene, options: Mapping[str, Any]) -> Options:
    """The shared options out of all of a method's."""
    passes = options["passes"] if options["passes"] is not None else options["generations"]
    return Options(
        passes=DEFAULT_PASSES if passes is None else passes,
        lights=lights_of(scene, options["lights"]),
        shadows=options["shadows"],
        reflections=options["reflections"],
        refractions=options["refractions"],
        background=options["background"],
        color_format=options["color_format"],
        front_only=options["facing"] == "front",
        smooth=options["shading"] == "smooth",
        threads=options["threads"],
        taps=options.get("taps"),
    )
