"""The shoot-out by the clock: milliseconds of the methods as they run here, on the rays of `shoot_out`.

What a software pipeline takes says nothing of a GPU; the ratios say what this package is quick at. Each time is the
median of several, after one run that is not timed; building a grid, boxes or lists is in it, as a call builds them.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from statistics import median
from typing import Any

from refsim.experiments import shoot_out, style
from refsim.experiments import shoot_out_runs as runs
from refsim.experiments.registry import Case, Experiment, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state, scene_named

REPEATS = 3


def cases(quick: bool) -> list[Case]:
    """Camera rays and random ones."""
    scenes = runs.QUICK_SCENES if quick else runs.SCENES
    size = 64 if quick else 256
    return [
        {"scene": scene, "mesh": mesh_state(scene), "size_px": size, "spread": spread}
        for scene in scenes for spread in (0.0, 1.0)
    ]  # fmt: skip


def measure(scene: str, mesh: str, size_px: int, spread: float) -> Rows:
    """A row a method."""
    head = {"scene": scene, "triangles": MISSING, "size_px": size_px, "spread": spread}
    if mesh == MISSING:
        return [{**head, "method": name} for name in runs.CONTENDERS]
    body = scene_named(scene)
    rows: Rows = []
    for name in runs.CONTENDERS:
        row = {**head, "triangles": len(body), "method": name}
        if runs.is_capped(name, body):
            rows.append({**row, "capped": f"above {runs.CAP} triangles"})
            continue
        seconds = []
        for _ in range(1 + REPEATS):
            started = time.perf_counter()
            runs.shoot(name, scene, size_px, spread, build=True)
            seconds.append(time.perf_counter() - started)
        rows.append({**row, "capped": "", "milliseconds": round(1000 * median(seconds[1:]), 3),
                     "million_rays_per_second": round(size_px**2 / median(seconds[1:]) / 1e6, 4)})  # fmt: skip
    return rows


def winners(rows: Rows) -> Rows:
    """The quickest method for each scene and spread, and by how much the next one takes longer."""
    found: Rows = []
    present = [row for row in rows if row.get("milliseconds", "") != ""]
    for key in dict.fromkeys((row["scene"], row["spread"]) for row in present):
        own = sorted((row for row in present if (row["scene"], row["spread"]) == key), key=lambda r: r["milliseconds"])
        first, second = own[0], own[1]
        found.append({
            "scene": key[0], "triangles": first["triangles"], "spread": key[1], "method": first["method"],
            "milliseconds": first["milliseconds"], "second": second["method"],
            "second_times_as_many": round(second["milliseconds"] / first["milliseconds"], 3),
        })  # fmt: skip
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All times; the quickest."""
    return {"shoot-out-speed": rows, "shoot-out-speed-winners": winners(rows)}


def plot(rows: Rows) -> Any:
    """Milliseconds over triangles, and the map of the quickest."""
    figure = style.new_figure(5.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.8, 1))
    first: Any = None
    for k, spread in enumerate(dict.fromkeys(row["spread"] for row in rows)):
        axes = figure.add_subplot(grid[0, k], sharey=first)
        first = first or axes
        for name in runs.CONTENDERS:
            own = [r for r in rows if r["method"] == name and r["spread"] == spread and r.get("milliseconds", "") != ""]
            axes.loglog([r["triangles"] for r in own], [r["milliseconds"] for r in own], label=name, linewidth=1.3,
                        color=shoot_out.COLORS[name], marker=shoot_out.SIGNS[name])  # fmt: skip
        axes.set_title("camera rays" if spread == 0 else "random rays")
        axes.set_xlabel("triangles")
        style.count_ticks(axes.xaxis)
    first.set_ylabel("milliseconds, building included")
    figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    shoot_out.winner_map(figure.add_subplot(grid[1, :]), winners(rows), "milliseconds of the quickest; × the next one")
    return figure


EXPERIMENT = Experiment(
    "shoot-out-speed",
    "The same rays by the clock of this machine",
    "Milliseconds of a call of `refsim.trace`, building included, on the threads of this machine: the median of "
    f"{REPEATS}. A software pipeline is slow where it simulates most; nothing here is a GPU's time.",
    cases,
    measure,
    plot,
    tables,
    alt="Two charts of milliseconds over the number of triangles, on logarithmic axes, a line a method, for camera "
    "rays and for random rays; below, a map whose cells name the quickest method for each number of triangles.",
    timed=True,
)
