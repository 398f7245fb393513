"""Runs through the traversal lists for the table of sensitivities: a configuration, its cameras, what a ray costs.

A configuration's body stands on the ground of the sphere hierarchy's experiments (`bsh_runs`), or without it; glass and
mirrors are the body's, never the ground's. Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from refsim.experiments.bsh_runs import (
    ENABLED,
    FLOOR,
    HALF,
    METHOD,
    PLASTER,
    VIEW,
    body_of,
    prepared_for,
    rays_of,
    without_last,
)
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.sensitivity_frame import DIRECTIONS, Config, Sweep, camera_sweep, scene_name
from refsim.results import Trace
from refsim.scene import Scene
from refsim.scene.material import GLASS, MIRROR
from refsim.scene.stages import on_ground

NONE = "none"
MATERIALS = {"plaster": PLASTER, "mirror": MIRROR, "glass": GLASS}
BASE: Config = {
    "body": "torus_knot", "triangles": 6400, "camera": "front", "fill": 1.05, "ground": "on", "material": "plaster",
    "ior": 1.5, "shading": "geometric", "generations": 2, "shadows": "on", "lists": 6, "order": "earliest_first",
    "threshold": 0.5, "culling": NONE, "heads": NONE, "screen_cells": 0, "head_rule": "leaf", "facing": "both",
    "size_px": 96,
}  # fmt: skip
QUICK: Config = {"size_px": 48, "triangles": 1600}
ALL_ON: Config = {name: ENABLED[name] for name in ("culling", "heads", "screen_cells", "facing")}
ALL_OFF: Config = {"culling": NONE, "heads": NONE, "screen_cells": 0, "facing": "front"}
CROSSED = tuple(DIRECTIONS)
BODIES: dict[str, Config] = {name.replace("_", " "): {"body": name} for name in ("torus_knot", "sphere", "blob")}
MESHES: dict[str, Config] = {
    name: {"body": name, "triangles": 0}
    for name in ("cubes", "suzanne", "teapot", "dragon_res4", "dragon_res3", "bunny")
}
# What several claims vary
VIEWS = (
    camera_sweep(("front", "right", "above")),
    Sweep("distance of the eye", {f"{fill:g}": {"fill": fill} for fill in (0.5, 0.75, 1.05, 1.5)}, ("0.5", "1.05")),
)
PICTURE = Sweep("picture", {f"{size}²": {"size_px": size} for size in (48, 64, 96, 128, 256)}, ("48²", "96²"))
THRESHOLD = Sweep("threshold", {f"{t:g}": {"threshold": t} for t in (0.1, 0.25, 0.5, 0.75, 1.0)}, ("0.1", "0.5", "1"))
ORDER = Sweep("order", {"earliest first": {}, "latest last": {"order": "latest_last"}},
              ("earliest first", "latest last"))  # fmt: skip
SURROUNDINGS = (
    Sweep("shadow rays", {"on": {}, "off": {"shadows": "off", "generations": 1}}, ("on", "off")),
    Sweep("ground", {"on": {}, "off": {"ground": "off"}}, ("on", "off")),
)
# Four rays a path, so that what enters glass can leave it and throw its shadow
GLASSY: Config = {"material": "glass", "generations": 4}
SURFACES = (
    Sweep("surface", {"plaster": {}, "mirror": {"material": "mirror", "generations": 3}, "glass": GLASSY}),
    Sweep("index of refraction, of glass",
          {"no glass": {}, **{f"{ior:g}": {**GLASSY, "ior": ior} for ior in (1.1, 1.33, 1.5, 2.0)}}),
    Sweep("normals, of glass",
          {"no glass": {}, **{shading: {**GLASSY, "shading": shading} for shading in ("geometric", "smooth")}}),
)  # fmt: skip


def sizes(numbers: tuple[int, ...], *quick: int) -> Sweep:
    """Triangles of the body, the ground not counted."""
    return Sweep("triangles", {f"{n:,}": {"triangles": n} for n in numbers}, tuple(f"{n:,}" for n in quick))


def measured(cameras: list[str], mesh: str, config: Config) -> Rows:
    """A row a camera."""
    rows: Rows = []
    for name in cameras:
        row: Row = {**config, "camera": name, "mesh": mesh}
        rows.append(row | ({"nodes": MISSING} if mesh == MISSING else _counts(_traced(config, name))))
    return rows


def _counts(found: Trace) -> Row:
    rays = sum(int(passed.alive.sum()) for passed in found.generations)
    counters = found.counters
    return {
        "scene_triangles": len(found.scene.triangles),
        "rays": rays,
        "shadow_rays": counters["rays.shadow"],
        "nodes": counters["traversal.nodes"],
        "triangle_tests": counters["intersection.triangle_tests"],
    }


def _traced(config: Config, camera: str) -> Trace:
    from refsim.papers.sphere_hierarchy.tracer import trace_prepared

    name, ground = scene_name(config), config["ground"] == "on"
    options = {key: None if config[key] in (NONE, 0) else config[key] for key in ("culling", "heads", "screen_cells")}
    options |= {key: config[key] for key in
                ("lists", "order", "threshold", "head_rule", "facing", "generations", "ior", "shading")}  # fmt: skip
    prepared, values = prepared_for(name, ground, shadows=config["shadows"] == "on", **options)
    if config["material"] != "plaster":
        prepared = replace(prepared, scene=_surfaced(name, ground, config["material"]))
    rays = rays_of(name, config["size_px"], DIRECTIONS.get(camera, VIEW), config["fill"])
    return replace(trace_prepared(prepared, rays), method=METHOD, options=values)


@lru_cache(maxsize=2)
def _surfaced(name: str, ground: bool, material: str) -> Scene:
    """The stage of `bsh_runs.scene_of` with a body of another material: the same triangles, hence the same lists."""
    staged = on_ground(body_of(name), material=MATERIALS[material], ground=FLOOR, half=HALF)
    return staged if ground else without_last(staged, 2)


def nodes_per_ray(row: Row) -> float:
    """Of all rays that were shot, whatever their kind."""
    return float(np.float64(row["nodes"]) / row["rays"])


def in_sizes(config: Config, numbers: tuple[int, ...], meshes: tuple[str, ...]) -> list[Config]:
    """The same in several sizes; for the body `meshes`, mesh after mesh in the order of their triangles."""
    if config["body"] == "meshes":
        return [{**config, "body": name, "triangles": 0} for name in meshes]
    return [{**config, "triangles": number} for number in numbers]
