"""The saving of the hierarchy of rays, over what the paper does not vary: camera, material, mesh, tiles, resolution.

"Already at a triangle count of 100, the new algorithm runs twice as fast" and "a relative speedup of 15" (The
Hierarchical Ray Engine, sections 7.1 and 8), counted as ray–triangle tests of the Ray Engine by those of the
hierarchical one. The Ray Engine need not be run: without a stencil it tests every pixel of every generation against
every triangle, with one the pixels whose ray hit in the generation before.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import published
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, MISSING, scene_named
from refsim.experiments.sensitivity_frame import (
    DIRECTIONS,
    RULED_OUT,
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
from refsim.scene import camera_rays

HEADLINE = "hierarchy saving"
AT_FEW = "2 at 100 triangles"
UNIT = "ratio of ray–triangle tests"
FRONT = (0.3, 0.25, 1.0)
CROSSED = ("right", "above", "along z")
FEW, MANY, QUICK_MANY = 100, 5000, 1000
# The paper's picture, tiles and paths; a body that covers every pixel, as its refractive surface did
BASE: Config = {
    "body": "blob", "triangles": MANY, "camera": "front", "fill": 0.55, "material": "glass", "ior": 1.5,
    "shading": "geometric", "generations": 5, "size_px": 256, "tile_px": 16, "stencil": "off",
}  # fmt: skip
QUICK: Config = {"size_px": 64, "tile_px": 4}
# The same for both claims
SHARED = (
    camera_sweep(("front", "right", "above", "along z")),
    Sweep("distance of the eye", {f"{fill:g}": {"fill": fill} for fill in (0.4, 0.55, 0.75, 1.0, 1.5)},
          ("0.4", "0.55", "1")),
    Sweep("normals", {"geometric": {}, "smooth": {"shading": "smooth"}}),
    Sweep("index of refraction", {f"{ior:g}": {"ior": ior} for ior in (1.0, 1.1, 1.33, 1.5, 2.0, 2.4)},
          ("1", "1.1", "1.5", "2")),
    Sweep("material", {name: {"material": name} for name in ("glass", "mirror", "diffuse")}, ("glass", "mirror")),
    Sweep("rays a path", {f"{n}": {"generations": n} for n in (1, 2, 3, 5, 8)}, ("1", "2", "5")),
    Sweep("tile, pixels", {f"{tile}²": {"tile_px": tile} for tile in (4, 8, 16, 32, 64)}, ("4²", "8²")),
    Sweep("picture, 16 × 16 tiles", {f"{16 * tile}²": {"size_px": 16 * tile, "tile_px": tile} for tile in (4, 8, 16)},
          ("64²", "128²")),
    Sweep("the Ray Engine's stencil", {"off": {}, "on": {"stencil": "on"}}, ("off", "on")),
)  # fmt: skip
# What the paper itself rules out: a material or an index that bends nothing, paths that end where they enter
EXCLUDED = {("material", "diffuse"), ("index of refraction", "1"), ("rays a path", "1")}
BODIES: dict[str, Config] = {name.replace("_", " "): {"body": name} for name in ("blob", "sphere", "torus_knot")}
MESHES: dict[str, Config] = {name: {"body": name, "triangles": 0} for name in ("suzanne", "dragon_res4", "teapot")}


def _with_stencil(bodies: Mapping[str, Config]) -> Sweep:
    """Each body against the Ray Engine with its stencil: no run that the bodies alone do not need."""
    settings = {"blob, without": {}, **{f"{name}, with": {**over, "stencil": "on"} for name, over in bodies.items()}}
    return Sweep("body, and the Ray Engine's stencil", settings, ("blob, without", "blob, with", "torus knot, with"))


def _sizes(numbers: tuple[int, ...], *quick: int) -> Sweep:
    return Sweep("triangles", {f"{n:,}": {"triangles": n} for n in numbers}, tuple(f"{n:,}" for n in quick))


def _runs(config: Config) -> list[Config]:
    """The hierarchical engine alone; its counters say what the Ray Engine does with or without a stencil."""
    return [{**config, "stencil": "off"}]


def _saving(config: Config, rows: Rows) -> float:
    (row,) = rows
    return float(row[f"ray_engine_tests_stencil_{config['stencil']}"] / row["triangle_tests"])


CLAIMS = (
    Claim(
        HEADLINE, AT_FEW, "at 100 triangles twice as fast",
        f"at least {published.SAID_AT_100:g} times fewer tests, at {FEW} triangles", UNIT, {**BASE, "triangles": FEW},
        (Sweep("body", BODIES, ("blob", "torus knot")), _sizes((20, 50, 100, 200, 500), 20, 100),
         *SHARED, _with_stencil(BODIES)), _runs, _saving, low=published.SAID_AT_100, quick=QUICK,
    ),
    Claim(
        HEADLINE, "15", "a relative speed-up of 15",
        f"at least {published.SAID_SPEEDUP:g} times fewer tests, at {MANY:,} triangles ({QUICK_MANY:,} with --quick) "
        "unless the number of triangles is what varies", UNIT, BASE,
        (Sweep("body", BODIES | MESHES, ("blob", "torus knot")), _sizes((500, 1000, 2000, 5000, 20_000), 500, 1000),
         *SHARED, _with_stencil(BODIES | MESHES)), _runs, _saving, low=published.SAID_SPEEDUP,
        quick={**QUICK, "triangles": QUICK_MANY},
    ),
)  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case a configuration of the engine."""
    return cases_of(CLAIMS, quick, () if quick else CROSSED)


def measure(cameras: list[str], mesh: str, backend: str = "numba", **config: Any) -> Rows:
    """A row a camera."""
    return [{**config, "camera": name, "mesh": mesh, **_counts(config, name, mesh, backend)} for name in cameras]


def _counts(config: Config, camera: str, mesh: str, backend: str) -> Row:
    if mesh == MISSING:
        return {"triangle_tests": MISSING}
    scene, size = scene_named(scene_name(config)), config["size_px"]
    rays = camera_rays(scene, size, size, view=DIRECTIONS.get(camera, FRONT), fill=config["fill"])
    options = {name: config[name] for name in ("material", "ior", "shading", "generations")}
    found = trace(HIERARCHICAL, scene, rays, tile_size=config["tile_px"], backend=backend, **options)
    hits = [int((g.hits.triangle >= 0).sum()) for g in found.generations]
    pixels, count = size * size, len(scene.triangles)
    return {
        "scene_triangles": count,
        "eye_rays_that_hit_percent": round(100.0 * hits[0] / pixels, 3),
        "triangle_tests": found.counters["intersection.triangle_tests"],
        "cone_tests": found.counters["cone.sphere_tests"],
        "ray_engine_tests_stencil_off": pixels * count * config["generations"],
        "ray_engine_tests_stencil_on": count * (pixels + sum(hits[:-1])),
    }


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """A line a setting; one that the claim itself rules out is shown, and not counted."""
    found = lines(rows, CLAIMS, CROSSED)
    return {"sensitivity-hierarchy": [line | {"counted": RULED_OUT} if ruled_out(line) else line for line in found]}


def ruled_out(line: Row) -> bool:
    """Whether the paper's words exclude the setting: those of `EXCLUDED`, and others than 100 triangles."""
    other = line["claim"] == AT_FEW and line["parameter"] == "triangles" and line["setting"] != f"{FEW:,}"
    return other or (line["parameter"], line["setting"]) in EXCLUDED


def plot(found: Rows) -> Any:
    """A panel a claim."""
    return draw(found, CLAIMS)


EXPERIMENT = Experiment(
    "sensitivity-hierarchy",
    "How far the saving of the ray hierarchy reaches",
    "Tests of the Ray Engine by tests of the hierarchical one; one factor at a time from a baseline (dotted line): a "
    "glass blob that covers every pixel, 256² pixels in 16 × 16 tiles, paths of 5 rays, index 1.5, geometric normals, "
    "the Ray Engine without a stencil (`--quick`: 64² and fewer settings, and 1,000 triangles in the place of 5,000). "
    "Shaded: where the paper's claim holds; filled circles lie there, open diamonds do not. The grey line of a row is "
    "the range of the same settings over four cameras. Settings that the paper's words rule out (other "
    "numbers of triangles where it says 100, nothing that refracts, paths of one ray) are shown and not counted. "
    "Where there is no room a dot goes unnamed: the CSV names all.",
    cases,
    measure,
    plot,
    tables,
    dpi=214,
    alt="Dot plots of how many times fewer ray-triangle tests the hierarchy makes, a row for each parameter and a dot "
    "for each setting, above for 100 and below for 5,000 triangles, with the region in which the paper's numbers, 2 "
    "and 15, are reached shaded.",
    drawn="sensitivity-hierarchy",
)
