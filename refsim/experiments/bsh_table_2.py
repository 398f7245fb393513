"""Table 2: the five scenes in counts, and what the paper's counter of traversed nodes may have counted (BSH-E3).

"The performances given are those obtained with all of the aforementioned optimization enabled." Each reading of the
counter is a number that an account of warps gives; the paper's nodes/s divided by its rays/s stand beside.
Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, section 4."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from refsim.experiments import bsh_published as published
from refsim.experiments import style
from refsim.experiments.bsh_runs import (
    ENABLED,
    MESHES,
    SUBSTITUTES,
    head,
    kept,
    lists_of,
    missing_row,
    ray_counts,
    vertices_of,
    warp_account,
)
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state

NAMED = ("bytes", "nodes × width", "iterations × width", "packet × width", "nodes")


def cases(quick: bool) -> list[Case]:
    """A case a scene; `--quick` leaves out the dragon."""
    size = 96 if quick else 512
    names = [name for name in MESHES if not (quick and name == "Dragon")]
    return [{"published_scene": name, "size_px": size, "mesh": mesh_state(MESHES[name])} for name in names]


def measure(published_scene: str, size_px: int, mesh: str) -> Rows:
    """The counters, then a row a reading."""
    from refsim.papers.sphere_hierarchy.warps import readings

    name = MESHES[published_scene]
    triangles, vertices, rates = published.TABLE_2[published_scene]
    line: Row = {"part": "counters", "published_scene": published_scene}
    if mesh == MISSING:
        return [{**line, **missing_row(name, size_px)}]
    found = kept(name, size_px, **ENABLED)
    lists = lists_of(name, True, 6, "earliest_first", ENABLED["culling"])
    account = warp_account(name, found)
    rows: Rows = [
        {
            **line,
            "substitute": SUBSTITUTES.get(published_scene, ""),
            **head(name, size_px, found),
            "published_triangles": triangles,
            "vertices": vertices_of(name),
            "published_vertices": vertices,
            "longest_list_elements": max(lists.length(k) for k in range(lists.count)),
            **ray_counts(found),
            "published_rays_per_pixel": round(rates.rays_per_pixel, 4),
            "published_nodes_per_ray": round(rates.nodes_per_ray, 2),
            "lane_utilisation": round(account.utilisation, 4),
            "sphere_utilisation": round(account.sphere_utilisation, 4),
            "triangle_utilisation": round(account.triangle_utilisation, 4),
        }
    ]
    for reading, value in readings(account).items():
        rows.append(
            {
                "part": "readings",
                "published_scene": published_scene,
                "reading": reading,
                "ours": round(value, 3),
                "published": round(rates.nodes_per_ray, 2),
                "published_by_ours": round(rates.nodes_per_ray / value, 4),
            }
        )
    return rows


def of_part(rows: Rows, part: str) -> Rows:
    """`counters` or `readings`."""
    return [row for row in rows if row["part"] == part]


def fits(rows: Rows) -> Rows:
    """A row a reading: how far the paper's numbers are from it, over the scenes; substitutes left out."""
    real = [name for name in MESHES if name not in SUBSTITUTES]
    own = [row for row in of_part(rows, "readings") if row["published_scene"] in real]
    found: Rows = []
    for reading in dict.fromkeys(row["reading"] for row in own):
        quotients = [row["published_by_ours"] for row in own if row["reading"] == reading]
        logs = [math.log(quotient) for quotient in quotients]
        mean = sum(logs) / len(logs)
        found.append(
            {
                "reading": reading,
                "scenes": len(quotients),
                "least_quotient": min(quotients),
                "largest_quotient": max(quotients),
                "mean_quotient": round(math.exp(mean), 4),
                "spread": round(max(quotients) / min(quotients), 4),
                "worst_factor": round(max(max(q, 1.0 / q) for q in quotients), 4),
            }
        )
    return sorted(found, key=lambda row: row["worst_factor"])


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Counters, readings, and how each reading fits."""
    found = {"bsh-table-2": of_part(rows, "counters")}
    more = {"bsh-table-2-readings": of_part(rows, "readings"), "bsh-table-2-fits": fits(rows)}
    return found | {stem: table for stem, table in more.items() if table}


def plot(rows: Rows) -> Any:
    """Left nodes a ray; right the readings against the printed numbers."""
    figure = style.new_figure(3.9)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    counters = of_part(rows, "counters")
    known = [row for row in counters if row["triangles"] != MISSING]
    _draw_nodes(left, known)
    _draw_readings(right, of_part(rows, "readings"))
    absent = [row["scene"] for row in counters if row["triangles"] == MISSING]
    if absent:
        left.text(0.05, 0.9, f"missing: {', '.join(absent)}", transform=left.transAxes, color=style.FAINT)
    return figure


def _draw_nodes(axes: Any, rows: Rows) -> None:
    x = [row["triangles"] for row in rows]
    for key, name, color, marker in (
        ("eye_nodes_per_ray", "eye rays", style.BLUE, "o"), ("shadow_nodes_per_ray", "shadow rays", style.GREEN, "^"),
    ):  # fmt: skip
        axes.plot(x, [row[key] for row in rows], marker=marker, color=color, label=name)
    said = [published.TABLE_2[row["published_scene"]] for row in rows]
    by_32 = [rates.nodes_per_ray / published.WARP for _, _, rates in said]
    axes.plot([triangles for triangles, _, _ in said], by_32, "D--", color=style.ORANGE, label="paper / 32", lw=1)
    axes.set_xscale("log")
    axes.set_ylim(0, None)
    axes.set_xlabel("triangles")
    axes.set_ylabel("nodes a ray")
    axes.set_title("Nodes a ray, all optimisations on")
    axes.legend(loc="lower right")


def _draw_readings(axes: Any, rows: Rows) -> None:
    names = [reading for reading in NAMED if any(row["reading"] == reading for row in rows)]
    looks = zip(style.CYCLE, style.MARKERS, MESHES, strict=False)
    for k, (color, marker, scene) in enumerate(looks):
        own = {row["reading"]: row["published_by_ours"] for row in rows if row["published_scene"] == scene}
        if own:
            spots = [i + 0.1 * (k - 2) for i in range(len(names))]
            axes.plot(spots, [own[name] for name in names], marker, color=color, label=scene)
    axes.axhline(1.0, color=style.INK, linewidth=0.9)
    axes.set_yscale("log")
    style.plain_ticks(axes.yaxis)
    axes.set_xticks(range(len(names)), [name.replace(" × ", " ×\n") for name in names], fontsize=8)
    axes.grid(False, axis="x")
    axes.set_ylabel("paper's number / this reading")
    axes.set_title("What the paper's counter may have counted")
    axes.legend(loc="upper left", fontsize=7.5)


EXPERIMENT = Experiment(
    "bsh-table-2",
    "Table 2: the scenes in counts, and readings of the paper's counter",
    "512² (96² and no dragon with `--quick`), ground, safe sextant culling, regular heads, 16 × 16 screen cells; "
    "warps of 8 × 4 pixels. Left: nodes a ray; the paper's nodes/s by rays/s by 32. Right: the paper's number divided "
    "by what an account of warps of 32 gives if the counter is read so; at 1 the reading fits. The paper prints more "
    "nodes a ray than the list of the cubes has elements. All readings are in the table; `worst_factor` leaves "
    "substitutes out.",
    cases,
    measure,
    plot,
    tables,
    alt="Left, nodes a ray over the triangles, eye and shadow rays rising, the paper's level; right, the paper's "
    "number divided by readings of its counter, a mark a scene: none lies at one for all scenes.",
)
