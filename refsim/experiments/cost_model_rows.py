"""What the cost model is fitted to: the papers' times beside the counters of other experiments' rows.

A *subject* is a table of one paper on one card: its rows, the counters that may explain them, and rows that are
predicted but never fitted: a stand-in's, or those of another table of the same card. Counts of a smaller picture are
brought to the paper's size by its number of pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from refsim.experiments import bsh_published, bsh_table_2, bsh_table_3, gsr_published, gsr_table_2, gsr_table_3
from refsim.experiments.bsh_locality import ALL_ON
from refsim.experiments.bsh_runs import MESHES, SUBSTITUTES
from refsim.experiments.cost_model_fit import Observation
from refsim.experiments.gsr_runs import FRAGMENT_GRID, GEOMETRY_SHADER
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import MISSING

SAME, STAND_IN = "the paper's mesh", "a stand-in, not the paper's mesh"
# What a copy takes depends on how many triangles and vertices there are, not on where: our cubes have the printed 222
# and 124. What a frame takes depends on both
AS_MANY = "as many triangles and vertices: as much to copy"
OTHER_TABLE = "another table, not fitted"


@dataclass(frozen=True)
class Subject:
    """Printed times of one card, and what may explain them.

    device   a key of `cost_model_devices.DEVICES`
    names    counters that a model may be made of
    rows     fitted, each in turn left out with its group
    further  predicted by the fit to all `rows`
    meshes   by label: what our mesh is
    missing  labels of printed rows for which there are no counters
    """

    id: str
    device: str
    names: tuple[str, ...]
    rows: tuple[Observation, ...]
    further: tuple[Observation, ...]
    meshes: Mapping[str, str]
    missing: tuple[str, ...]


GSR_NAMES = ("cells", "triangle_tests", "rays", "secondary_rays", "ray_bytes", "frames")
BSH_NAMES = ("nodes", "lane_steps", "rays", "memory_bytes", "frames")
LINK_NAMES = ("copied_bytes", "frames")
TABLE_2 = {GEOMETRY_SHADER: gsr_table_2.PASS_THROUGH, FRAGMENT_GRID: gsr_table_2.FRAGMENT}
CACHE = "GT200"


def _gsr_counters(row: Row) -> dict[str, float]:
    scale = (gsr_published.SIDE / row["size_px"]) ** 2
    counted = {
        "cells": row["cells"],
        "triangle_tests": row["triangle_tests"],
        "rays": row["rays"],
        "secondary_rays": row["rays"] - row["eye_rays"],
        "ray_bytes": row["ray_bytes_read"] + row["ray_bytes_written"],
    }
    return {"frames": 1.0, **{name: scale * count for name, count in counted.items()}}


def gsr_subject(method: str, table_2: Rows, table_3: Rows) -> Subject:
    """Table 3's times of one method, a group a scene; Table 2's as a further row."""
    rows: list[Observation] = []
    further: list[Observation] = []
    missing: list[str] = []
    meshes: dict[str, str] = {}
    for row in table_3:
        if row["triangles"] == MISSING:
            missing += [f"{row['published_scene']}, {mode}" for mode in gsr_published.MODES]
            continue
        if row["method"] != method:
            continue
        label = f"{row['published_scene']}, {row['mode']}"
        seen = Observation(label, row["published_scene"], float(row["published_ms"]), _gsr_counters(row))
        meshes[label] = row["mesh"]
        (further if row["mesh"] == gsr_table_3.STAND_IN else rows).append(seen)
    wanted = TABLE_2[method]
    for row in gsr_table_2.of_part(table_2, "counters"):
        if row["configuration"] == wanted and row["published_ms"] != "":
            label = f"Table 2, {wanted}"
            further.append(Observation(label, label, float(row["published_ms"]), _gsr_counters(row)))
            meshes[label] = OTHER_TABLE
    name = "gsr Table 3, " + ("our method" if method == GEOMETRY_SHADER else "previous")
    return Subject(name, "gsr", GSR_NAMES, tuple(rows), tuple(further), meshes, tuple(missing))


def _mesh_of(scene: str) -> str:
    return STAND_IN if scene in SUBSTITUTES else SAME


def bsh_subject(table_2: Rows, locality: Rows) -> Subject:
    """Table 2's frame times: counters of `bsh-table-2`, bytes a ray past the cache of `bsh-locality`.

    Both with all optimisations on, the counters at 512², the bytes at 192²: a smaller picture's rays lie further apart.
    """
    past = {
        row["scene"]: row["bytes_per_ray"] for row in locality
        if row.get("cache") == CACHE and row.get("ground") and row.get("switches") == ALL_ON
    }  # fmt: skip
    readings: dict[tuple[str, str], float] = {
        (row["published_scene"], row["reading"]): row["ours"] for row in bsh_table_2.of_part(table_2, "readings")
    }
    known = {row["published_scene"]: row for row in bsh_table_2.of_part(table_2, "counters")}
    rows: list[Observation] = []
    further: list[Observation] = []
    missing: list[str] = []
    for scene, name in MESHES.items():
        row = known.get(scene, {"triangles": MISSING})
        if row["triangles"] == MISSING or name not in past:
            missing.append(scene)
            continue
        rays = row["rays_per_pixel"] * bsh_published.SIDE**2
        counters = {
            "frames": 1.0, "rays": rays, "nodes": rays * row["nodes_per_ray"],
            "lane_steps": rays * readings[scene, "iterations × width"], "memory_bytes": rays * past[name],
        }  # fmt: skip
        seen = Observation(scene, scene, 1e3 / bsh_published.TABLE_2[scene][2].fps, counters)
        (further if _mesh_of(scene) == STAND_IN else rows).append(seen)
    meshes = {scene: _mesh_of(scene) for scene in MESHES}
    return Subject("bsh Table 2, a frame", "bsh", BSH_NAMES, tuple(rows), tuple(further), meshes, tuple(missing))


def copy_subject(table_3: Rows) -> Subject:
    """Table 3's copies: bytes of lists and vertices over the link."""
    rows: list[Observation] = []
    further: list[Observation] = []
    missing: list[str] = []
    known = {row["published_scene"]: row for row in table_3}
    for scene in MESHES:
        row = known.get(scene, {"triangles": MISSING})
        if row["triangles"] == MISSING:
            missing.append(scene)
            continue
        counters = {"frames": 1.0, "copied_bytes": float(row["bytes"])}
        seen = Observation(scene, scene, bsh_published.TABLE_3[scene][0], counters)
        (rows if row in bsh_table_3.known(table_3) else further).append(seen)
    meshes = {scene: _mesh_of(scene) for scene in MESHES} | {"Cubes": AS_MANY}
    return Subject("bsh Table 3, a copy", "bsh", LINK_NAMES, tuple(rows), tuple(further), meshes, tuple(missing))


def subjects(others: Mapping[str, Rows]) -> list[Subject]:
    """All that have rows to fit."""
    return [
        *(gsr_subject(method, others["gsr-table-2"], others["gsr-table-3"]) for method in TABLE_2),
        bsh_subject(others["bsh-table-2"], others["bsh-locality"]),
        copy_subject(others["bsh-table-3"]),
    ]
