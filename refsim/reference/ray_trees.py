"""What the methods that follow a tree of rays a pixel share: their options as `whitted` takes them, and the result.

The recursion shoots a node's rays all at once; `point_rays` and `pixel_rays` put them into the order of their method's
passes, and work out from them what the pipeline counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.reference.grid_search import GridSearch, box_of, reach_of
from refsim.reference.searches import AllTriangles, Found, Search
from refsim.reference.surfaces import Surfaces
from refsim.reference.whitted import Bundle, Shading, Shot, Whitted
from refsim.results import Generation, Trace, summed_per_ray
from refsim.scene.light import PointLight
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

MOST_LIGHTS = 64
MOST_NODES = 2**24


def lights_of(scene: Scene, choice: Any) -> tuple[PointLight, ...]:
    """What the option `lights` means: the scene's, or one if it has none (None), the first n, or those given."""
    if choice is None:
        chosen = scene.lights_or_one
    elif isinstance(choice, int | np.integer) and not isinstance(choice, bool):
        known = scene.lights_or_one
        if not 0 <= choice <= len(known):
            lights = "1 light" if len(known) == 1 else f"{len(known)} lights"
            raise InputError(f"lights is {choice}; scene {scene.name!r} has {lights}.")
        chosen = known[: int(choice)]
    else:
        chosen = tuple(choice) if isinstance(choice, Sequence) else (choice,)
    if not all(isinstance(light, PointLight) for light in chosen):
        raise InputError(f"lights is {choice!r}; it must be a whole number or refsim.scene.PointLight.")
    if len(chosen) > MOST_LIGHTS:
        raise InputError(f"{len(chosen)} lights are more than the {MOST_LIGHTS} that have render targets of their own.")
    return chosen


def refuse(options: Mapping[str, Any]) -> None:
    """`InputError` for what only the pipeline can do, and for options that contradict each other."""
    if options.get("errata", "corrected") not in ("corrected", (), []):
        raise InputError("backend='numpy' is the corrected tracer; errata need backend='numba'.")
    if options.get("primary", "rays") != "rays":
        raise InputError("backend='numpy' rasterises nothing; primary='raster' needs backend='numba'.")
    passes, generations = options["passes"], options["generations"]
    if None not in (passes, generations) and passes != generations:
        raise InputError(f"passes is {passes} and generations {generations}: two names of one number; give one.")
    if options["resolution"] is not None and options["acceleration"] != "grid":
        raise InputError(f"resolution is the grid's; acceleration {options['acceleration']!r} has none.")


@dataclass(frozen=True)
class Tree:
    """A traced picture, and what a pixel's ray tree may be: its nodes, whether any hit goes on, rays of each depth."""

    whitted: Whitted
    width: int
    height: int
    nodes: int
    goes_on: bool
    most: tuple[int, ...]

    @property
    def image(self) -> np.ndarray:
        """f32[h, w, 3]."""
        return self.whitted.picture().reshape(self.height, self.width, 3)

    def shots(self, depth: int) -> list[Shot]:
        """What was shot in one pass."""
        return [shot for shot in self.whitted.shots if shot.depth == depth]


def search_of(scene: Scene, rays: Rays, surfaces: Surfaces, options: Mapping[str, Any]) -> Search:
    """What the option `acceleration` means."""
    choice = options["acceleration"]
    if choice == "naive":
        return AllTriangles(surfaces, box_of(scene, reach_of(scene, rays)))
    if choice == "grid":
        return GridSearch.of(scene, reach_of(scene, rays), options["resolution"], surfaces.front_only)
    raise InputError("backend='numpy' has acceleration='naive' and 'grid'; other structures need backend='numba'.")


def traced(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Tree:
    """The eye rays' trees under the options that both methods share; `InputError` for what only the pipeline can do."""
    refuse(options)
    passes = options["passes"] or options["generations"] or 2
    lights, used = lights_of(scene, options["lights"]), [scene.materials[k] for k in np.unique(scene.material_ids)]
    refracts = options["refractions"] and any(material.tau > 0 for material in used)
    reflects = options["reflections"] and any(material.rho > 0 or material.tau > 0 for material in used)
    branching = 2 if refracts else 1
    nodes = passes if branching == 1 else 2**passes - 1
    if nodes > MOST_NODES:
        raise InputError(f"{passes} passes make a tree of {nodes} rays a pixel, more than the {MOST_NODES} possible.")
    width, height = image_size(rays)
    surfaces = Surfaces.of(scene, options)
    whitted = Whitted(
        surfaces,
        Shading.of(scene),
        search_of(scene, rays, surfaces, options),
        width * height,
        passes,
        lights,
        options["shadows"],
        options["reflections"],
        options["refractions"],
        branching,
        np.array(options["background"], np.float32),
        options["color_format"] == "rgba8unorm",
    )
    live = np.flatnonzero(rays.t_max > 0)
    weight = np.ones(len(live), np.float32)
    whitted.trace(Bundle(0, -1, live, rays.origin[live], rays.direction[live], rays.t_max[live], weight))
    goes_on = refracts or reflects
    per_depth = [1, *(branching**k if goes_on else 0 for k in range(1, passes))]
    shadow_rays = len(lights) if options["shadows"] else 0
    most = tuple(per_depth[k] + (shadow_rays * per_depth[k - 1] if k else 0) for k in range(passes))
    return Tree(whitted, width, height, nodes, goes_on, most)


def image_size(rays: Rays) -> tuple[int, int]:
    """Width and height; rays without them fill the squarest image that holds them."""
    if rays.width is not None and rays.height is not None:
        return rays.width, rays.height
    width = max(int(np.ceil(np.sqrt(len(rays)))), 1)
    return width, max(-(-len(rays) // width), 1)


def fragment_counts(primitives: int, fragments: int, discarded: int) -> dict[str, int]:
    """A draw without depth or stencil whose primitives all lie in the picture."""
    count = {"raster.clipped": 0, "raster.empty": 0, "raster.drawn": primitives} if primitives else {}
    count |= {f"{stage}.failed{early}": 0 for stage in ("stencil", "depth") for early in ("", "_early")}
    count |= {"raster.primitives": primitives, "raster.fragments": fragments}
    written = fragments - discarded
    return count | {
        "fragment.invocations": fragments,
        "fragment.discarded": discarded,
        "fragment.written": written,
        "blend.fragments": written,
    }


def costs_of(found: Found) -> dict[str, np.ndarray]:
    """`results.Generation.per_ray`."""
    return {"cells": found.cells, "triangle_tests": found.tests, "box_rejections": found.rejected}


def cost_counts(found: Found) -> dict[str, int]:
    """What the searches of a pass count."""
    totals = (int(column.sum(dtype=np.int64)) for column in (found.cells, found.tests, found.rejected))
    return dict(
        zip(("traversal.cells", "intersection.triangle_tests", "traversal.box_rejections"), totals, strict=True)
    )


def trace_of(name: str, scene: Scene, tree: Tree, generations: list[Generation], counters: Counters) -> Trace:
    """The result; `counters` are those of all draws."""
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    counters.check()
    per_ray = summed_per_ray(generations, len(generations[0].rays))
    return Trace(name, scene, {}, tuple(generations), counters, per_ray, tree.image)
