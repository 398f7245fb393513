"""Nodes a ray: how they grow, how many they are and whether the optimisations reduce them, over what the paper leaves
open.

"Ray shooting performance is supposed to be approximately a logarithmic function of the triangle count"; Table 2's nodes
a second by its rays a second, which by 32 lanes of a warp are nearly one number for all scenes; "our optimisations
permit to reduce the average number of nodes traversed per ray" (Efficient Stackless Ray Traversal for Bounding Sphere
Hierarchies with CUDA, section 4)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import bsh_published as published
from refsim.experiments import sensitivity_list_runs as runs
from refsim.experiments.bsh_growth import laws
from refsim.experiments.registry import Case, Experiment, Rows, Tables
from refsim.experiments.sensitivity_frame import DIFFERENCE, Claim, Config, Sweep, cases_of, lines
from refsim.experiments.sensitivity_list_runs import in_sizes, nodes_per_ray
from refsim.experiments.sensitivity_plot import draw

HEADLINE = "nodes per ray"
SIZES = (100, 400, 1600, 6400, 25_600, 102_400)
RANGES = {"100 to 6,400": SIZES[:4], "100 to 25,600": SIZES[:5], "100 to 102,400": SIZES, "400 to 25,600": SIZES[1:5]}
# In the order of their triangles: 968, 6,320, 11,102, 47,794, 69,451
GROWTH_MESHES = ("suzanne", "teapot", "dragon_res4", "dragon_res3", "bunny")
PRINTED = [rates.nodes_per_ray / published.WARP for _, _, rates in published.TABLE_2.values()]
LISTS = Sweep("lists", {f"{n}": {"lists": n} for n in (1, 2, 6, 8)}, ("1", "6"))
# Culling by sextants is for six lists; eight have their own rule
LISTS_CULLED = Sweep("lists", {"6": {}, "8": {"lists": 8, "culling": "octant"}})
HEAD_RULE = Sweep("head rule", {"first leaf": {}, "climbing": {"head_rule": "climb"}}, ("first leaf", "climbing"))
ALONE = Sweep(
    "switched on",
    {"all": {}, "culling": {"heads": runs.NONE, "screen_cells": 0}, "heads": {"culling": runs.NONE, "screen_cells": 0},
     "screen cells": {"culling": runs.NONE, "heads": runs.NONE},
     "all but heads": {"heads": runs.NONE}},
    ("all", "culling", "heads", "screen cells"),
)  # fmt: skip
SHARED = (*runs.VIEWS, runs.THRESHOLD, runs.ORDER, *runs.SURROUNDINGS, *runs.SURFACES, runs.PICTURE)
ENABLED: Config = {**runs.BASE, **runs.ALL_ON}


def _only(config: Config) -> list[Config]:
    return [config]


def _nodes(config: Config, rows: Rows) -> float:
    (row,) = rows
    return nodes_per_ray(row)


def _series(config: Config) -> list[Config]:
    """The sizes of a fit; `range` names them, and the quick baseline has fewer."""
    bare = {name: value for name, value in config.items() if name != "range"}
    return in_sizes(bare, RANGES[config["range"]], GROWTH_MESHES)


def _logarithm_by_power(config: Config, rows: Rows) -> float:
    """How far a + b log2 n is off, by how far c n^p is; both fitted to nodes a ray."""
    points = [
        {"family": "", "triangles": row["scene_triangles"], "nodes_per_ray": nodes_per_ray(row)} for row in rows
    ]  # fmt: skip
    (law,) = laws(points)
    return float(law["log_rms_nodes"] / law["power_rms_nodes"])


def _on_and_off(config: Config) -> list[Config]:
    return [config, {**config, **runs.ALL_OFF}]


def _reduction(config: Config, rows: Rows) -> float:
    """Percent fewer nodes a ray than without optimisations."""
    on, off = rows
    return 100.0 * (1.0 - nodes_per_ray(on) / nodes_per_ray(off))


CLAIMS = (
    Claim(
        HEADLINE, "logarithmic in the triangles", "a logarithmic function of the triangle count",
        "a + b log2 n is nearer to nodes a ray than c n^p, both fitted by least squares to sizes from 100 to 25,600, "
        "each four times the last (to 6,400 with --quick)",
        "error of the logarithm ÷ error of the power law", {**runs.BASE, "range": "100 to 25,600"},
        (Sweep("body", runs.BODIES | {"meshes": {"body": "meshes"}}, ("torus knot", "blob")),
         Sweep("triangles", {name: {"range": name} for name in RANGES}), LISTS,
         Sweep("optimisations", {"none": {}, "all": runs.ALL_ON}, ("none", "all")), *SHARED),
        _series, _logarithm_by_power, high=1.0, strict=True, quick={**runs.QUICK, "range": "100 to 6,400"},
    ),
    Claim(
        HEADLINE, "34 to 36 after / 32", "34 to 36 nodes a ray in every scene (Table 2 by 32)",
        "between the least and the largest printed nodes a ray by 32, all optimisations on", "nodes a ray", ENABLED,
        (Sweep("body", runs.BODIES | runs.MESHES, ("torus knot", "blob")),
         runs.sizes(SIZES, 400, 1600), LISTS_CULLED, HEAD_RULE,
         Sweep("optimisations", {"none": runs.ALL_OFF, "all": {}}, ("none", "all")), *SHARED),
        _only, _nodes, low=min(PRINTED), high=max(PRINTED), quick=runs.QUICK,
    ),
    Claim(
        HEADLINE, "optimisations reduce nodes", "our optimisations reduce the nodes traversed per ray",
        "fewer nodes a ray with the optimisations (culling by the safe rule, per-polygon heads, screen cells) than "
        "without, six lists and fronts only in both", "percent fewer nodes a ray", ENABLED,
        (Sweep("body", runs.BODIES | runs.MESHES, ("torus knot", "blob")),
         runs.sizes(SIZES, 400, 1600), LISTS_CULLED, HEAD_RULE, ALONE, *SHARED),
        _on_and_off, _reduction, low=0.0, strict=True, quick=runs.QUICK, spread=DIFFERENCE,
    ),
)  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case a configuration of the lists."""
    return cases_of(CLAIMS, quick, () if quick else runs.CROSSED)


def measure(cameras: list[str], mesh: str, **config: Any) -> Rows:
    """A row a camera."""
    return runs.measured(cameras, mesh, config)


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """A line a setting."""
    return {"sensitivity-nodes": lines(rows, CLAIMS, runs.CROSSED)}


def plot(found: Rows) -> Any:
    """A panel a claim."""
    return draw(found, CLAIMS)


EXPERIMENT = Experiment(
    "sensitivity-nodes",
    "How far what is said of nodes a ray reaches",
    "One factor at a time from a baseline (dotted line): a torus knot of 6,400 triangles on a ground, 96² pixels, six "
    "lists, earliest first, threshold 0.5, eye and shadow rays; above without further optimisations and in sizes from "
    "100 to 25,600 triangles, in the middle and below with culling (safe rule), per-polygon heads and 16 × 16 screen "
    "cells (`--quick`: 1,600 triangles, 48² and fewer settings). Shaded: where what is said holds; filled circles lie "
    "there, open diamonds do not. The grey line of a row is the range of the same settings over eight cameras. "
    "Where there is no room a dot goes unnamed: the CSV names all.",
    cases,
    measure,
    plot,
    tables,
    dpi=214,
    alt="Three dot plots, a row for each parameter and a dot for each setting: whether a logarithm or a power law fits "
    "the growth of nodes a ray, nodes a ray with the printed 34 to 36 shaded, and the percentage of nodes that the "
    "optimisations save, with the region above zero shaded.",
    drawn="sensitivity-nodes",
)
