"""refsim: a software GPU with glass walls, and the ray tracers that three papers built on one.

    scene = refsim.load_scene("torus_knot_1024")
    rays = refsim.camera_rays(scene, 256, 256)
    trace = refsim.trace("hierarchical_ray_engine", scene, rays)
    image = refsim.render("hierarchical_ray_engine", scene, 256, 256)

    scene ─▶ rays ─▶ buffers ─▶ draw … draw ─▶ framebuffer ─▶ hits, image, counters ─▶ figures

Names are looked up when first used, so that importing refsim stays quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from refsim.counters import REGISTRY, Counters
    from refsim.errors import InputError
    from refsim.jit import func
    from refsim.methods import METHODS, render
    from refsim.results import Cones, Generation, Image, Trace
    from refsim.scene import Hits, Material, PointLight, Rays, Scene, camera_rays, load_scene, scene_names

__version__ = "0.1.0"

_HOMES = {
    "refsim.counters": ("REGISTRY", "Counters"),
    "refsim.errors": ("InputError",),
    "refsim.jit": ("func",),
    "refsim.methods": ("METHODS", "render"),
    "refsim.scene": ("Hits", "Material", "PointLight", "Rays", "Scene", "camera_rays", "load_scene", "scene_names"),
    "refsim.results": ("Cones", "Generation", "Image", "Trace"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "METHODS",
    "REGISTRY",
    "Cones",
    "Counters",
    "Generation",
    "Hits",
    "Image",
    "InputError",
    "Material",
    "PointLight",
    "Rays",
    "Scene",
    "Trace",
    "camera_rays",
    "func",
    "load_scene",
    "render",
    "scene_names",
    "trace",
]


def trace(method: str, scene: Any, rays: Any, **options: Any) -> Any:
    """Shoots `rays` at `scene` (a `Scene` or a name) with `method` and follows every path; returns a `Trace`.

    `rays` is a `Rays` of at least one ray; rows of the trace's arrays are these rays, or with methods that follow trees
    the rays of each generation in the order of their buffer.

    `refsim.METHODS[method].options` lists the options, each with its default and a sentence. Raises `InputError` for
    an unknown method, option or value.
    """
    from refsim.methods import trace as run

    return run(method, scene, rays, **options)


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'refsim' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted((*__all__, "__version__"))
