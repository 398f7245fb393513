"""How many nodes rays visit with heads and without: screen cells for eye rays, per-polygon heads for shadow rays and
for rays that a mirror sends on; by first surviving leaf, and by climbing (BSH-E4).

A head that begins in mid-list bypasses the node whose escape would have skipped more, so some rays visit more elements.
Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, section 3."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.bsh_runs import missing_row, run
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state
from refsim.results import RayKind

SCENES = (("suzanne", False), ("bunny", False), ("bunny", True))
# Kind of rays -> the options that give them heads, and whether surfaces are mirrors
RAYS: dict[str, tuple[RayKind, dict[str, Any], bool]] = {
    "eye": (RayKind.EYE, {"screen_cells": 16}, False),
    "shadow": (RayKind.SHADOW, {"heads": "regular"}, False),
    "reflected": (RayKind.REFLECTED, {"heads": "regular"}, True),
}
EDGES = tuple(round(2 ** (k / 2)) for k in range(0, 21))  # 1 to 1024
# Of eye rays: how many cells a side; the paper does not say. The histograms are drawn with the second
CELLS = (8, 16, 32, 64)
DRAWN_CELLS = RAYS["eye"][1]["screen_cells"]
SIX, EIGHT = 6, 8  # lists


def cases(quick: bool) -> list[Case]:
    """A case a scene and kind of rays with six lists; per-polygon heads with eight as well."""
    size = 64 if quick else 384
    scenes = SCENES[:2] if quick else SCENES
    told = [(rays, SIX) for rays in RAYS] + [(rays, EIGHT) for rays in RAYS if rays != "eye"]
    return [
        {"scene": name, "ground": int(ground), "rays": rays, "lists": lists, "size_px": size,
         "mesh": mesh_state(name)}
        for name, ground in scenes for rays, lists in told
    ]  # fmt: skip


def measure(scene: str, ground: int, rays: str, lists: int, size_px: int, mesh: str) -> Rows:
    """A row a kind of heads and a head rule; of what is drawn also a row a bin."""
    line: Row = {"part": "summary", "ground": ground, "rays": rays, "lists": lists}
    if mesh == MISSING:
        return [{**line, **missing_row(scene, size_px)}]
    kind, options, mirrors = RAYS[rays]
    plain = _nodes(scene, size_px, bool(ground), kind, mirrors, lists=lists)
    rows = _bins(scene, ground, rays, "none", plain) if lists == SIX else []
    given = (
        [("heads", heads) for heads in ("simple", "regular")] if "heads" in options
        else [("screen_cells", cells) for cells in CELLS]
    )  # fmt: skip
    for option, value in given:
        for rule in ("leaf", "climb"):
            nodes = _nodes(scene, size_px, bool(ground), kind, mirrors, lists=lists, head_rule=rule, **{option: value})
            heads, cells = ("cells", value) if option == "screen_cells" else (value, "")
            rows.append({**line, "scene": scene, "triangles": "", "size_px": size_px, "heads": heads,
                         "screen_cells": cells, "head_rule": rule, **_change(plain, nodes)})  # fmt: skip
            if lists == SIX and cells in ("", DRAWN_CELLS):
                rows += _bins(scene, ground, rays, f"{heads}, {rule}", nodes)
    return rows


def _change(plain: Any, nodes: Any) -> Row:
    """Means without and with heads, and how many rays visit more and fewer nodes."""
    from refsim.papers.sphere_hierarchy.heads_statistics import head_statistics

    told = head_statistics(plain, nodes)
    return {
        "ray_count": told.rays,
        "nodes_without": round(told.without, 3),
        "nodes_with": round(told.with_heads, 3),
        "change_percent": round(100.0 * (told.with_heads / told.without - 1.0), 3),
        "more_percent": round(100.0 * told.share_more, 3),
        "fewer_percent": round(100.0 * told.fewer / told.rays, 3),
        "most_more": told.most_more,
        "no_node_percent": round(100.0 * float(np.mean(nodes == 0)), 3),
    }


def _nodes(scene: str, size: int, ground: bool, kind: RayKind, mirrors: bool, **options: Any) -> Any:
    if mirrors:
        options |= {"shadows": False, "material": "mirror"}
        found = _mirrored(scene, size, ground, **options)
    else:
        found = run(scene, size, ground=ground, **options)
    return np.concatenate([g.per_ray["nodes"][g.alive & (g.kind == kind)] for g in found.generations])


def _mirrored(scene: str, size: int, ground: bool, **options: Any) -> Any:
    from refsim.experiments.bsh_runs import rays_of, scene_of
    from refsim.methods import trace

    return trace("traversal_list", scene_of(scene, ground), rays_of(scene, size), generations=2, **options)


def _bins(scene: str, ground: int, rays: str, heads: str, nodes: Any) -> Rows:
    counts, _ = np.histogram(nodes, bins=(0, *EDGES, 1 << 30))
    return [
        {"part": "bins", "ground": ground, "rays": rays, "scene": scene, "configuration": heads,
         "nodes_from": edge, "ray_count": int(count)}
        for edge, count in zip((0, *EDGES), counts, strict=True)
    ]  # fmt: skip


def of_part(rows: Rows, part: str) -> Rows:
    """`summary` or `bins`."""
    return [row for row in rows if row["part"] == part]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """The summary, and the bins."""
    return {"bsh-histogram": of_part(rows, "summary"), "bsh-histogram-bins": of_part(rows, "bins")}


def plot(rows: Rows) -> Any:
    """Histograms of the bunny; rows of panels: with and without ground."""
    bins = of_part(rows, "bins")
    absent = [row["scene"] for row in of_part(rows, "summary") if row["triangles"] == MISSING]
    shown = bins[-1]["scene"] if bins else ""
    grounds = sorted({row["ground"] for row in bins if row["scene"] == shown})
    figure = style.new_figure(2.6 * max(len(grounds), 1) + 0.5)
    grid = figure.subplots(max(len(grounds), 1), len(RAYS), squeeze=False, sharex=True)
    for line, ground in zip(grid, grounds or [0], strict=True):
        for axes, rays in zip(line, RAYS, strict=True):
            own = [r for r in bins if (r["scene"], r["ground"], r["rays"]) == (shown, ground, rays)]
            _draw(axes, own)
            axes.set_title(f"{rays} rays, {'ground' if ground else 'no ground'}")
        line[0].set_ylabel("share of rays, percent")
    for axes in grid[-1]:
        axes.set_xlabel("nodes visited")
    handles, labels = grid[0, -1].get_legend_handles_labels()
    if handles:
        figure.legend(handles, ["no heads", "first surviving leaf", "climbing"][: len(labels)],
                      loc="outside lower center", ncols=3)  # fmt: skip
    if absent:
        grid[0, 0].text(0.5, 0.5, f"{absent[0]}: missing", transform=grid[0, 0].transAxes, ha="center")
    return figure


def _draw(axes: Any, rows: Rows) -> None:
    shown = ("none", "cells, leaf", "cells, climb", "regular, leaf", "regular, climb")
    if not rows:
        return
    names = [name for name in shown if any(row["configuration"] == name for row in rows)]
    looks = ((style.BLACK, "-"), (style.ORANGE, "--"), (style.BLUE, ":"))
    for (color, dash), name in zip(looks, names, strict=False):
        own = [row for row in rows if row["configuration"] == name]
        total = sum(row["ray_count"] for row in own)
        edges = [max(row["nodes_from"], 0.7) for row in own] + [2 * own[-1]["nodes_from"]]
        shares = [100.0 * row["ray_count"] / total for row in own]
        axes.stairs(shares, edges, color=color, linestyle=dash, linewidth=1.6, label=name)
    axes.set_xscale("log")
    style.plain_ticks(axes.xaxis)
    axes.set_xticks((1, 4, 16, 64, 256, 1024))


EXPERIMENT = Experiment(
    "bsh-histogram",
    "Nodes that rays visit, with heads and without",
    "384² (64² with `--quick`), six lists, both sides are hit. Histograms of the bunny: eye rays with heads of 16 × "
    "16 screen cells; shadow rays, and rays off the same surfaces as mirrors, with regular per-polygon heads. The "
    "last bin is open. The table also has Suzanne, simple heads, per-polygon heads with eight lists, and grids of 8 to "
    "64 cells a side: means, the share of rays that visit more nodes "
    "than without heads, and by how many at most, and of those that visit none.",
    cases,
    measure,
    plot,
    tables,
    alt="Histograms of the nodes that rays visit, in two rows without and with a ground, for eye, shadow and "
    "reflected rays: without heads, and with heads at the first surviving leaf or climbing, which lie further "
    "left for most rays and further right for some.",
)
