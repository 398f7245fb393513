"""Methods by name, their options, and the two calls of the public contract: `trace` and `render`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.list_method import LIST, run_traversal_list
from refsim.options import Option, checked, choice, nearest, real, whole
from refsim.pipeline.state import DepthStencilFormat, EarlyTests
from refsim.pipeline.taps import Taps
from refsim.results import Image, Trace
from refsim.scene import Material, Rays, Scene, camera_rays, load_scene
from refsim.shading import environment_of, shade
from refsim.tree_methods import GEOMETRY_SHADER, TREE, run_fragment_grid, run_geometry_shader

MATERIALS = {kind: Material(kind, kind) for kind in ("glass", "mirror", "diffuse")}
DEPTH_FORMATS = {
    "depth32float-stencil8": DepthStencilFormat.DEPTH32FLOAT_STENCIL8,
    "depth24unorm-stencil8": DepthStencilFormat.DEPTH24UNORM_STENCIL8,
}


def _errata(value: Any) -> Any:
    from refsim.papers.hierarchical_ray_engine.errata import printed_formulas

    printed_formulas(value)
    return value


def _taps(value: Any) -> Taps | None:
    if value is not None and not isinstance(value, Taps):
        raise InputError(f"taps is {value!r}; it must be a refsim.pipeline.taps.Taps.")
    return value


GENERATIONS = whole("generations", 5, 1, 256, "Rays a path may have: the eye ray and those that follow.")
COMMON = (
    real("ior", 1.5, 0.0, 100.0, "Index of refraction of glass that names none of its own."),
    choice("facing", "both", ("both", "front"), "Which sides of a triangle are hit."),
    choice("shading", "geometric", ("geometric", "smooth"), "The normal that bends a ray."),
    choice("material", None, (None, *MATERIALS), "One surface for every triangle instead of the scene's."),
    choice("backend", "numba", ("numba", "numpy"), "The pipeline, or the plain NumPy reference: small, slow, obvious."),
    whole("threads", None, 1, 1024, "Threads; by default all processors. The result does not depend on them."),
)
TAPS = Option("taps", None, "Collects what the stages held (`refsim.pipeline.taps.Taps`).", _taps)
SHARED = (
    GENERATIONS,
    *COMMON,
    Option("errata", "corrected", "Which formulas stand as printed (the hierarchical engine has them).", _errata),
)
ENGINE = (
    choice("early_tests", "ideal", tuple(EarlyTests), "When a test may reject before the shader."),
    choice("depth_format", "depth32float-stencil8", tuple(DEPTH_FORMATS), "Format of the depth and stencil buffer."),
    TAPS,
)


@dataclass(frozen=True)
class Method:
    """A way of tracing: `run(scene, rays, options)` traces on the pipeline, `run_numpy` in the reference.

    Both return a `Trace`; `options` holds a checked value for every option of `options`, by name.
    """

    name: str
    sentence: str
    options: tuple[Option, ...]
    run: Callable[[Scene, Rays, Mapping[str, Any]], Trace]
    run_numpy: Callable[[Scene, Rays, Mapping[str, Any]], Trace]


def _engine_options(options: Mapping[str, Any], stencil: bool) -> Any:
    from refsim.papers.hierarchical_ray_engine.tracer import EngineOptions

    return EngineOptions(
        generations=options["generations"],
        ior=options["ior"],
        facing=options["facing"],
        smooth=options["shading"] == "smooth",
        early_tests=EarlyTests(options["early_tests"]),
        depth_format=DEPTH_FORMATS[options["depth_format"]],
        stencil=stencil,
        threads=options["threads"],
        taps=options["taps"],
    )


def _run_hierarchical(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    from refsim.papers.hierarchical_ray_engine.errata import printed_formulas
    from refsim.papers.hierarchical_ray_engine.tracer import trace_hierarchical

    printed = printed_formulas(options["errata"])
    shared = _engine_options(options, True)
    return trace_hierarchical(scene, rays, shared, options["tile_size"], options["submission"], printed)


def _run_ray_engine(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    from refsim.papers.hierarchical_ray_engine.tracer import trace_ray_engine

    return trace_ray_engine(scene, rays, _engine_options(options, options["stencil"]))


def _run_brute_force(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    from refsim.papers.brute_force import trace_brute_force

    smooth = options["shading"] == "smooth"
    return trace_brute_force(
        scene, rays, options["generations"], options["ior"], options["facing"], smooth, options["threads"]
    )


def _reference(name: str) -> Callable[[Scene, Rays, Mapping[str, Any]], Trace]:
    def run(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
        from refsim.reference import methods as reference

        return reference.trace(name, scene, rays, options)

    return run


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method(
            "brute_force",
            "Every ray against every triangle, without a pipeline.",
            SHARED,
            _run_brute_force,
            _reference("brute_force"),
        ),
        Method(
            "ray_engine",
            "Rays in textures, every triangle a full-screen quad (Carr, Hall and Hart 2002).",
            (*SHARED, *ENGINE, choice("stencil", False, (False, True), "Skip finished paths by stencil.")),
            _run_ray_engine,
            _reference("ray_engine"),
        ),
        Method(
            "hierarchical_ray_engine",
            "Cones around tiles of rays, culled against triangles in the vertex shader (Szécsi 2006).",
            (
                *SHARED,
                *ENGINE,
                whole("tile_size", 16, 1, 64, "Side of a tile of rays, in pixels."),
                choice("submission", "tile", ("tile", "primitive"), "Order: tile by tile, or primitive by primitive."),
            ),
            _run_hierarchical,
            _reference("hierarchical_ray_engine"),
        ),
        Method(
            "geometry_shader",
            "Rays are points: intersected in the vertex shader, spawned in the geometry shader (Ralovich and Magdics).",
            (*TREE, *COMMON, TAPS, *GEOMETRY_SHADER),
            run_geometry_shader,
            _reference("geometry_shader"),
        ),
        Method(
            "fragment_grid",
            "Rays are pixels: a viewport quad a ray generation, traced in the fragment shader (Ralovich 2007).",
            (*TREE, *COMMON, TAPS),
            run_fragment_grid,
            _reference("fragment_grid"),
        ),
        Method(
            "traversal_list",
            "Direction-sorted lists of a sphere hierarchy, walked without a stack (Toczek, Houzet and Mancini 2010).",
            (GENERATIONS, *COMMON, *LIST),
            run_traversal_list,
            _reference("traversal_list"),
        ),
    )
}


def method_named(name: str) -> Method:
    """The method, or `InputError` with the nearest name."""
    if name not in METHODS:
        raise InputError(f"there is no method {name!r}; {nearest(name, METHODS)}.")
    return METHODS[name]


def trace(method: str, scene: Scene | str, rays: Rays, **options: Any) -> Trace:
    """Shoots `rays` at `scene` with `method` and follows every path; see `METHODS` for the options.

    Returns a `refsim.results.Trace`. Raises `InputError` for an unknown method, option or value.
    """
    chosen = method_named(method)
    values = checked(method, chosen.options, options)
    scene = load_scene(scene) if not isinstance(scene, Scene) else scene
    if not isinstance(rays, Rays):
        raise InputError(f"rays must be refsim.Rays, not {type(rays).__name__}.")
    if len(rays) == 0:
        raise InputError("there are no rays to trace.")
    if values["material"] is not None:
        scene = scene.with_materials(MATERIALS[values["material"]])
    run = chosen.run if values["backend"] == "numba" else chosen.run_numpy
    return replace(run(scene, rays, values), method=method, options=values)


def render(
    method: str,
    scene: Scene | str,
    width: int,
    height: int,
    *,
    view: tuple[float, float, float] = (0.3, 0.25, 1.0),
    fov: float = 40.0,
    fill: float = 1.0,
    environment: Any = None,
    **options: Any,
) -> Image:
    """A picture of `scene`, width × height pixels: camera rays, `trace`, and what each path's last ray sees.

    `view`, `fov` (degrees), `fill` as `refsim.camera_rays`; `environment` is a name, an image file or an
    `refsim.scene.environment.Environment` (default: the scene's). Other options are the method's. Returns an `Image`:
    `rgb` f32[height, width, 3], linear light, row 0 at the top, and the `Trace`. Raises `InputError` as `trace` does,
    and for an environment where the method sees a background of one colour.
    """
    chosen = method_named(method)
    checked(method, chosen.options, options)
    scene = load_scene(scene) if not isinstance(scene, Scene) else scene
    rays = camera_rays(scene, width, height, view=view, fov=fov, fill=fill)
    if any(option.name == "background" for option in chosen.options):
        if environment is not None:
            raise InputError(f"{method} has no environment: rays that leave see its background, one colour.")
        found = trace(method, scene, rays, **options)
        assert found.image is not None
        return Image(found.image, found)
    surroundings = environment_of(scene, environment)
    found = trace(method, scene, rays, **options)
    return Image(np.ascontiguousarray(shade(found, surroundings).reshape(height, width, 3)), found)
