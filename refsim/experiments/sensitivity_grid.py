"""The cost of the grid, over what the paper leaves open: resolution, camera, scene, materials, passes, places of the
light.

"Speed up impact of the employed uniform grid space subdivision is apparent" (Figure 1d); "moving the light source in
the scene incurs high variability" (section 6); "we suspect that the 2-3 fold worse performance is due to our using of
'fat' (64 byte) primitives" (Figure 4b of Recursive Ray Tracing in Geometry Shader). Counted in cells visited and
triangles tested, and in bytes of rays that a run moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from refsim.experiments.gsr_claims import HIGH
from refsim.experiments.gsr_claims_method import APPARENT
from refsim.experiments.gsr_moved import moved
from refsim.experiments.gsr_runs import FRAGMENT_GRID, GEOMETRY_SHADER, MODES
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING
from refsim.experiments.sensitivity_frame import (
    DIRECTIONS,
    Claim,
    Config,
    Sweep,
    camera_sweep,
    cases_of,
    lines,
    scene_name,
)
from refsim.experiments.sensitivity_plot import draw
from refsim.methods import trace
from refsim.results import RayKind, Trace
from refsim.scene import Rays, Scene, camera_rays, load_scene
from refsim.scene.animation import moving_light
from refsim.scene.material import GLASS, Material
from refsim.scene.stages import SILK, on_ground

HEADLINE = "grid cost"
FRONT = (0.3, 0.25, 1.0)
CROSSED = ("right", "above", "along z")
GRID, NAIVE = "grid", "naive"
ROOMS = ("room", "cornell_box", "knight_in_box")  # with walls and lights of their own
GAP = 0.05  # between body and ground, in diagonals: that of the library's `knot_on_ground`
MATERIALS: dict[str, Material] = {"silk": SILK, "glass": GLASS}
BASE: Config = {
    "body": "torus_knot", "triangles": 1024, "camera": "front", "fill": 0.45, "fov": 40.0, "material": "silk",
    "ior": 1.5, "shading": "geometric", "mode": "RT", "passes": 2, "resolution": 0, "acceleration": GRID,
    "method": GEOMETRY_SHADER, "light_places": 0, "light_around": 0.8, "size_px": 96,
}  # fmt: skip
QUICK: Config = {"size_px": 48, "triangles": 256}
LIT: Config = {"mode": "SC", "light_places": 12}
BODIES: dict[str, Config] = {
    **{name.replace("_", " "): {"body": name} for name in ("torus_knot", "sphere", "blob")},
    **{name.replace("_", " "): {"body": name, "triangles": 0, "fill": 0.55} for name in ROOMS},
}
MESHES: dict[str, Config] = {name: {"body": name, "triangles": 0} for name in ("suzanne", "teapot", "dragon_res4")}
MODE = Sweep("rays", {"eye": {"mode": "RC", "passes": 1}, "eye, shadow": {"mode": "SC"}, "eye, shadow, mirrored": {}},
             ("eye", "eye, shadow, mirrored"))  # fmt: skip
# "All rays are intersecting the scene" (Table 2): from so far above and so near that the ground fills the picture
FILLING: Config = {"camera": "above", "fill": 0.25, "fov": 20.0}
FILLED = Sweep("eye rays that hit", {"some": {}, "all": FILLING, "all, no mirrored rays": {**FILLING, "mode": "SC"}},
               ("some", "all, no mirrored rays"))  # fmt: skip
PASSES = Sweep("passes", {f"{n}": {"passes": n} for n in (1, 2, 3, 4)}, ("1", "2", "3"))
RESOLUTION = Sweep(
    "grid resolution",
    {"6 cells a triangle": {}, **{f"{n}": {"resolution": n} for n in (1, 2, 4, 8, 16, 32, 64, 128)}},
    ("6 cells a triangle", "1", "4", "16", "64"),
)
REFRACTIVE = (
    Sweep("index of refraction", {"no glass": {}, **{f"{ior:g}": {"material": "glass", "mode": "refracting", "ior": ior}
                                                     for ior in (1.1, 1.5, 2.0)}}),
    Sweep("normals", {"geometric": {}, "smooth": {"shading": "smooth"}}),
)  # fmt: skip
DISTANCE = Sweep("distance of the eye", {f"{fill:g}": {"fill": fill} for fill in (0.25, 0.45, 0.75, 1.2)},
                 ("0.25", "0.45", "1.2"))  # fmt: skip
CAMERA = camera_sweep(("front", "right", "above"))
PICTURE = Sweep("picture", {f"{size}²": {"size_px": size} for size in (48, 64, 96, 192)}, ("48²", "64²"))


def _sizes(numbers: tuple[int, ...], *quick: int) -> Sweep:
    return Sweep("triangles", {f"{n:,}": {"triangles": n} for n in numbers}, tuple(f"{n:,}" for n in quick))


def _bare(config: Config) -> Config:
    """What a run depends on: not on how its counters are read."""
    return {name: value for name, value in config.items() if name not in ("cell_price", "counted")}


def _with_and_without(config: Config) -> list[Config]:
    """The grid, and no grid, whose resolution is nothing."""
    bare = _bare(config)
    return [bare, {**bare, "acceleration": NAIVE, "resolution": 0}]


def _speed_up(config: Config, rows: Rows) -> float:
    """Work without the grid by work with it; a cell costs `cell_price` tests."""
    with_grid, without = (row["triangle_tests"] + config["cell_price"] * row["cells"] for row in rows)
    return float(without / with_grid)


def _one(config: Config) -> list[Config]:
    return [_bare(config)]


def _dearest_by_cheapest(config: Config, rows: Rows) -> float:
    """Cells and tests at the dearest place of the light by those at the cheapest."""
    (row,) = rows
    return float(row[f"dearest_{config['counted']}"] / row[f"cheapest_{config['counted']}"])


def _both_methods(config: Config) -> list[Config]:
    return [config, {**config, "method": FRAGMENT_GRID}]


def _bytes_quotient(config: Config, rows: Rows) -> float:
    ours, previous = (row["ray_bytes"] for row in rows)
    return float(ours / previous)


CLAIMS = (
    Claim(
        HEADLINE, "the speed-up of the grid is apparent", "the speed-up of the grid is apparent",
        f"cells and tests without the grid are at least {APPARENT:g} times those with it, an order of magnitude",
        "work without the grid ÷ with it", {**BASE, "cell_price": 1.0},
        (Sweep("scene", BODIES | MESHES, ("torus knot", "cornell box")),
         _sizes((64, 256, 1024, 4096), 64, 256, 1024), RESOLUTION, CAMERA, DISTANCE, FILLED, MODE, PASSES, *REFRACTIVE,
         PICTURE,
         Sweep("price of a cell, tests", {f"{price:g}": {"cell_price": price} for price in (0.25, 1.0, 4.0)},
               ("0.25", "1", "4"))),
        _with_and_without, _speed_up, low=APPARENT, quick=QUICK,
    ),
    Claim(
        HEADLINE, "a moving light varies the cost of shadow rays", "moving the light incurs high variability",
        f"cells and tests of eye and shadow rays at the light's dearest place are at least {HIGH:g} times those at its "
        "cheapest", "dearest ÷ cheapest place of the light", {**BASE, **LIT, "counted": "picture"},
        (Sweep("scene", BODIES | MESHES, ("torus knot", "cornell box")),
         _sizes((256, 1024, 4096, 16_384), 256, 1024), RESOLUTION, CAMERA, DISTANCE,
         Sweep("eye rays that hit", {"some": {}, "all": FILLING}), PICTURE,
         Sweep("places of the light", {f"{n}": {"light_places": n} for n in (6, 12, 24)}, ("6", "12")),
         Sweep("way of the light, half sides", {f"{around:g}": {"light_around": around} for around in (0.3, 0.8, 2.0)},
               ("0.3", "0.8", "2")),
         Sweep("rays counted", {"eye and shadow": {}, "shadow": {"counted": "shadow"}}, ("eye and shadow", "shadow"))),
        _one, _dearest_by_cheapest, low=HIGH, quick=QUICK,
    ),
    Claim(
        HEADLINE, "fat primitives move more bytes", "slower because of 'fat' (64 byte) primitives",
        "more bytes of rays go through vertex buffers than the previous method moves through render targets",
        "bytes of rays, vertex buffers ÷ render targets", BASE,
        (Sweep("scene", BODIES | MESHES, ("torus knot", "cornell box")), _sizes((64, 256, 1024, 4096), 64, 256),
         CAMERA, DISTANCE, FILLED, MODE, PASSES, *REFRACTIVE, PICTURE),
        _both_methods, _bytes_quotient, low=1.0, strict=True, quick=QUICK,
    ),
)  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case a configuration."""
    return cases_of(CLAIMS, quick, () if quick else CROSSED)


def measure(cameras: list[str], mesh: str, **config: Any) -> Rows:
    """A row a camera."""
    return [{**config, "camera": name, "mesh": mesh, **_counts(config, name, mesh)} for name in cameras]


def _counts(config: Config, camera: str, mesh: str) -> Row:
    if mesh == MISSING:
        return {"triangle_tests": MISSING}
    size = config["size_px"]
    scene = _scene(scene_name(config), config["body"], config["material"])
    rays = camera_rays(scene, size, size, view=DIRECTIONS.get(camera, FRONT), fov=config["fov"], fill=config["fill"])
    if config["light_places"]:
        return _moving(config, scene, rays)
    found = _traced(config, scene, rays)
    bytes_of = moved(found, size * size, len(scene.lights))
    return {
        "scene_triangles": len(scene.triangles),
        "rays": sum(found.counters[f"rays.{kind.name.lower()}"] for kind in RayKind),
        "cells": found.counters["traversal.cells"],
        "triangle_tests": found.counters["intersection.triangle_tests"],
        "ray_bytes": bytes_of["ray_bytes_read"] + bytes_of["ray_bytes_written"],
    }


@lru_cache(maxsize=4)
def _scene(name: str, body: str, material: str) -> Scene:
    """A room as it is made; any other body on a ground of its own, of one material."""
    scene = load_scene(name)
    return scene if body in ROOMS else on_ground(scene, material=MATERIALS[material], gap=GAP)


@lru_cache(maxsize=2)
def _structure(scene: Scene, resolution: int, reach: float) -> Any:
    """The grid, built once for all places of the light."""
    from refsim.papers.geometry_shader_rays.grid import grid

    return grid(scene, resolution or None, reach)


def _traced(config: Config, scene: Scene, rays: Rays, **lit: Any) -> Trace:
    from refsim.papers.geometry_shader_rays.setup import reach_of

    refracting = config["mode"] == "refracting"
    options = {**MODES["RT" if refracting else config["mode"]], "passes": config["passes"], "refractions": refracting}
    structure: Any = NAIVE
    if config["acceleration"] == GRID:
        structure = _structure(scene, config["resolution"], reach_of(scene, rays))
    return trace(
        config["method"], scene, rays, acceleration=structure, ior=config["ior"], shading=config["shading"],
        **options, **lit,
    )  # fmt: skip


def _moving(config: Config, scene: Scene, rays: Rays) -> Row:
    """Cells and tests, of the picture and of its shadow rays, where the light makes them dearest and cheapest."""
    costs: dict[str, list[int]] = {"picture": [], "shadow": []}
    for light in moving_light(scene, config["light_places"], around=config["light_around"]):
        found = _traced(config, scene, rays, lights=(light,))
        for name, cost in _costs(found).items():
            costs[name].append(cost)
    ends = {f"{end}_{name}": pick(values) for name, values in costs.items()
            for end, pick in (("cheapest", min), ("dearest", max))}  # fmt: skip
    return {"scene_triangles": len(scene.triangles), **ends}


def _costs(found: Trace) -> dict[str, int]:
    cells_and_tests = [g.per_ray["cells"] + g.per_ray["triangle_tests"] for g in found.generations]
    shadow = sum(
        int(cost[g.kind == RayKind.SHADOW].sum()) for cost, g in zip(cells_and_tests, found.generations, strict=True)
    )  # fmt: skip
    return {"picture": sum(int(cost.sum()) for cost in cells_and_tests), "shadow": shadow}


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """A line a setting."""
    return {"sensitivity-grid": lines(rows, CLAIMS, CROSSED)}


def plot(found: Rows) -> Any:
    """A panel a claim."""
    return draw(found, CLAIMS)


EXPERIMENT = Experiment(
    "sensitivity-grid",
    "How far what is said of the grid's cost reaches",
    "One factor at a time from a baseline (dotted line): a reflecting torus knot of 1,024 triangles on a ground, 96² "
    "pixels, two passes with one light, 6 grid cells a triangle (`--quick`: 256 triangles, 48² and fewer settings). "
    "Above: cells visited and triangles tested, without the grid by with it. In the middle: the same of eye and shadow "
    "rays, at the dearest of 12 places of the light by the cheapest. Below: bytes of rays through vertex buffers by "
    "those through the previous method's render targets. Shaded: where what is said holds, by the rules of "
    "claims-gsr; filled circles lie there, open diamonds do not. The grey line of a row is the range of the same "
    "settings over four cameras. Where there is no room a dot goes unnamed: the CSV names all.",
    cases,
    measure,
    plot,
    tables,
    dpi=214,
    alt="Three dot plots, a row for each parameter and a dot for each setting: the speed-up by the grid with the "
    "region from 10 shaded, the cost at the light's dearest place by that at its cheapest with the region from 2, and "
    "the quotient of bytes of rays of both methods with the region above 1 shaded.",
    drawn="sensitivity-grid",
)
