"""Nodes a ray against the number of triangles: "ray shooting performance is supposed to be approximately a logarithmic
function of the triangle count" (section 4). Bodies of the library in growing sizes, and meshes.

Two laws are fitted by least squares: a + b log2 n, and c n^p (on logarithms, compared in nodes)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import curve_fit

from refsim.experiments import style
from refsim.experiments.bsh_runs import head, missing_row, ray_counts, run
from refsim.experiments.registry import Case, Experiment, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state

BODIES = ("torus_knot", "sphere", "blob")
SIZES = (100, 400, 1_600, 6_400, 25_600, 102_400, 409_600)
MESHES = ("suzanne", "dragon_res4", "dragon_res3", "bunny", "buddha_100k", "dragon")


def cases(quick: bool) -> list[Case]:
    """A case a body and size."""
    size = 64 if quick else 256
    made = [(body, f"{body}_{n}") for body in BODIES for n in (SIZES[:4] if quick else SIZES)]
    meshes = [("meshes", name) for name in (MESHES[:3] if quick else MESHES)]
    return [
        {"family": family, "name": name, "size_px": size, "mesh": mesh_state(name)} for family, name in made + meshes
    ]


def measure(family: str, name: str, size_px: int, mesh: str) -> Rows:
    """One row: the body without a ground, six lists, nothing else."""
    if mesh == MISSING:
        return [{"family": family, **missing_row(name, size_px)}]
    found = run(name, size_px, ground=False)
    return [{"family": family, **head(name, size_px, found), **ray_counts(found)}]


def laws(rows: Rows) -> Rows:
    """A row a family: both laws, and how far they are off."""
    found: Rows = []
    for family in dict.fromkeys(row["family"] for row in rows):
        own = [row for row in rows if row["family"] == family and row["triangles"] != MISSING]
        if len(own) < 3:
            continue
        n = np.array([row["triangles"] for row in own], np.float64)
        nodes = np.array([row["nodes_per_ray"] for row in own])
        (a, b), _ = curve_fit(_log_law, n, nodes)
        (c, p), _ = curve_fit(_power_law, n, nodes, p0=(nodes[0], 0.2))
        errors = [float(np.sqrt(np.mean((law - nodes) ** 2))) for law in (_log_law(n, a, b), _power_law(n, c, p))]
        found.append(
            {
                "family": family,
                "points": len(own),
                "log_a": round(float(a), 4),
                "log_b": round(float(b), 4),
                "log_rms_nodes": round(errors[0], 4),
                "power_c": round(float(c), 4),
                "power_p": round(float(p), 4),
                "power_rms_nodes": round(errors[1], 4),
                "better": "log" if errors[0] < errors[1] else "power",
                "times_the_triangles": round(float(n.max() / n.min()), 1),
                "times_the_nodes": round(float(nodes[n.argmax()] / nodes[n.argmin()]), 3),
            }
        )
    return found


def _log_law(n: Any, a: float, b: float) -> Any:
    return a + b * np.log2(n)


def _power_law(n: Any, c: float, p: float) -> Any:
    return c * n**p


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Counts, and laws."""
    return {"bsh-growth": rows, "bsh-growth-laws": laws(rows)}


def plot(rows: Rows) -> Any:
    """A panel a family group: points, the log law solid, the power law dotted."""
    figure = style.new_figure(3.6)
    left, right = figure.subplots(1, 2)
    fitted = {law["family"]: law for law in laws(rows)}
    families = list(dict.fromkeys(row["family"] for row in rows))
    for color, marker, family in zip(style.CYCLE, style.MARKERS, families, strict=False):
        axes = right if family == "meshes" else left
        own = [row for row in rows if row["family"] == family and row["triangles"] != MISSING]
        x = [row["triangles"] for row in own]
        axes.plot(x, [row["nodes_per_ray"] for row in own], marker, color=color, label=family.replace("_", " "))
        if family in fitted:
            _draw_laws(axes, fitted[family], x, color)
        if family == "meshes":
            for row in own:
                shift = (-5, 6) if row["scene"] not in ("bunny", "suzanne") else (6, -10)
                axes.annotate(row["scene"], (row["triangles"], row["nodes_per_ray"]), xytext=shift, fontsize=7.5,
                              textcoords="offset points", ha="right" if shift[0] < 0 else "left")  # fmt: skip
    absent = [row["scene"] for row in rows if row["triangles"] == MISSING]
    for axes, title in ((left, "Bodies of the library"), (right, "Meshes")):
        axes.set_xscale("log")
        axes.set_ylim(0, None)
        axes.set_xlabel("triangles")
        axes.set_ylabel("nodes a ray")
        axes.set_title(title)
    left.legend(loc="upper left")
    if absent:
        right.text(0.95, 0.06, f"missing: {', '.join(absent)}", transform=right.transAxes, ha="right", fontsize=7.5,
                   color=style.FAINT)  # fmt: skip
    return figure


def _draw_laws(axes: Any, law: Any, x: list[int], color: str) -> None:
    n = np.geomspace(min(x), max(x), 100)
    axes.plot(n, law["log_a"] + law["log_b"] * np.log2(n), color=color, linewidth=1.1)
    axes.plot(n, law["power_c"] * n ** law["power_p"], ":", color=color, linewidth=1.3)


EXPERIMENT = Experiment(
    "bsh-growth",
    "Nodes a ray against triangles",
    "256² eye rays (64² and fewer sizes with `--quick`) and their shadow rays, no ground, six lists, no further "
    "optimisation; the camera sees each body from the same side and as large. Solid: a + b log2 n; dotted: c n^p; "
    "both fitted by least squares. The table has both laws and how far they are off (root mean square, nodes). A mesh "
    "that is not at hand reads `missing`.",
    cases,
    measure,
    plot,
    tables,
    alt="Nodes a ray over the number of triangles on a logarithmic axis, for bodies of the library and for meshes; a "
    "straight and a dotted line fitted to each family.",
)
