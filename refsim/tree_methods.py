"""The methods that follow a tree of rays a pixel, "geometry_shader" and "fragment_grid": their options and how to run
them. Registered in `refsim.methods`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.options import Option, choice, nearest, whole
from refsim.results import Trace
from refsim.scene import Rays, Scene
from refsim.scene.material import as_triple

BACKGROUND = (0.1, 0.12, 0.15)
LARGEST_FLOAT32 = (2 - 2.0**-23) * 2.0**127


def _accelerator(value: Any) -> Any:
    from refsim.papers.geometry_shader_rays.acceleration import Accelerator
    from refsim.papers.geometry_shader_rays.setup import ACCELERATIONS

    if isinstance(value, Accelerator) or (isinstance(value, str) and value in ACCELERATIONS):
        return value
    raise InputError(f"acceleration is {value!r}; {nearest(value, ACCELERATIONS)}, or give an Accelerator.")


def _resolution(value: Any) -> Any:
    parts = value if isinstance(value, tuple | list) else (value,)
    whole_numbers = all(isinstance(part, int | np.integer) and not isinstance(part, bool) for part in parts)
    if value is None or (whole_numbers and len(parts) in (1, 3) and all(1 <= part <= 1024 for part in parts)):
        return value
    raise InputError(f"resolution is {value!r}; it must be a whole number of cells from 1 to 1024, or three.")


def _lights(value: Any) -> Any:
    return value  # what they may be depends on the scene: `refsim.papers.geometry_shader_rays.setup.lights_of`


def _background(value: Any) -> tuple[float, float, float]:
    color = as_triple(value, "background")
    if min(color) < 0.0 or max(color) > LARGEST_FLOAT32:
        raise InputError(f"background is {value!r}; its components must be from 0 to what float32 holds.")
    return color


def _errata(value: Any) -> Any:
    from refsim.papers.geometry_shader_rays.errata import printed_text

    printed_text(value)
    return value


def _flag(name: str, sentence: str) -> Option:
    return choice(name, True, (True, False), sentence)


TREE = (
    whole("passes", None, 1, 256, "Rendering passes P: depth of the ray tree, shadow rays included (default 2)."),
    whole("generations", None, 1, 256, "Another name of passes."),
    Option("acceleration", "grid", "Where rays look for triangles: grid, naive, bvh, or an Accelerator.", _accelerator),
    Option("resolution", None, "Cells of the grid: along its longest axis, or three numbers.", _resolution),
    Option("lights", None, "Point lights, or how many of the scene's; by default all, or one above it.", _lights),
    _flag("shadows", "Whether hits send rays to the lights."),
    _flag("reflections", "Whether mirrors, glass and reflecting diffuse surfaces send on reflected rays."),
    _flag("refractions", "Whether glass sends on refracted rays."),
    Option("background", BACKGROUND, "What rays that leave the scene see, linear RGB.", _background),
    choice("color_format", "rgba32float", ("rgba32float", "rgba8unorm"), "Format of the render targets."),
)
GEOMETRY_SHADER = (
    Option("errata", "corrected", "What stands as printed in the listings and Eq. 1.", _errata),
    whole("capacity", None, 1, 2**28, "Records a vertex buffer holds; by default S_VB."),
    choice("emission_order", "listed", ("listed", "reflected_first", "reversed"), "Order of what a hit emits."),
    choice("stages", "vertex", ("vertex", "vertex_only", "geometry"), "Where rays are intersected; _only: no GS."),
    choice("primary", "rays", ("rays", "raster"), "Eye rays are shot, or their triangles rasterised first."),
)


def _start(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> tuple[Any, Any]:
    """The shared options and what the scene becomes; `InputError` where two options contradict each other."""
    from refsim.papers.geometry_shader_rays.setup import options_of, prepared

    passes, generations = options["passes"], options["generations"]
    if passes is not None and generations is not None and passes != generations:
        raise InputError(f"passes is {passes} and generations {generations}: two names of one number; give one.")
    shared = options_of(scene, options)
    return shared, prepared(scene, rays, options, shared)


def image_size(rays: Rays) -> tuple[int, int]:
    """Width and height of the image that the rays' rows are; without one, the squarest that holds them."""
    if rays.width is not None and rays.height is not None:
        return rays.width, rays.height
    width = max(int(np.ceil(np.sqrt(len(rays)))), 1)
    return width, max(-(-len(rays) // width), 1)


def run_geometry_shader(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    """The tracer of "Recursive Ray Tracing in Geometry Shader"."""
    from refsim.papers.geometry_shader_rays.errata import printed_text
    from refsim.papers.geometry_shader_rays.results import trace_of
    from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer, Setting

    shared, scene_data = _start(scene, rays, options)
    setting = Setting(
        printed_text(options["errata"]),
        options["capacity"],
        options["emission_order"],
        options["stages"],
        options["primary"],
    )
    return trace_of(GeometryShaderTracer(scene_data, *image_size(rays), shared, setting), rays)


def run_fragment_grid(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    """The previous work that it is compared with."""
    from refsim.papers.geometry_shader_rays.fragment_grid import FragmentGridTracer
    from refsim.papers.geometry_shader_rays.fragment_grid_results import trace_of

    shared, scene_data = _start(scene, rays, options)
    return trace_of(FragmentGridTracer(scene_data, *image_size(rays), shared), rays)
