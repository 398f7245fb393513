"""Figure 1: "images generated at interactive rates", and the cost of finding the intersection for each ray.

(a) the Dragon with shadows, (b) the Horse with specular materials, (c) the Torus Knot with reflections and shadows of
one light; (d) is the cost of picture (c): grid cells visited and triangles tested, summed over the rays of each pixel,
with the grid and without it. Recursive Ray Tracing in Geometry Shader.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, VIEWS, head, kept, ray_counts, view_state
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.experiments.runs import MISSING
from refsim.image import encode_srgb
from refsim.results import Trace

NAMES = {
    "dragon, shadows": "Dragon: shadows",
    "coarse dragon, shadows": "Dragon (res4): shadows",
    "horse, specular": "Horse: specular",
    "knot": "Torus knot: both",
}
GRID, NAIVE = "grid", "naive"


def cases(quick: bool) -> list[Case]:
    """Panels a, b and c, and c again without the grid."""
    dragon = "coarse dragon, shadows" if quick else "dragon, shadows"
    runs = (("a", dragon, "SC", GRID), ("b", "horse, specular", "RT", GRID), ("c", "knot", "RT", GRID))
    return [
        {"panel": panel, "view": view, "mode": mode, "acceleration": structure, "mesh": view_state(view),
         "size_px": 96 if quick else 512}
        for panel, view, mode, structure in (*runs, ("d", "knot", "RT", NAIVE))
    ]  # fmt: skip


def measure(panel: str, view: str, mode: str, acceleration: str, mesh: str, size_px: int) -> Rows:
    """One row: the counters of one picture. A real mesh that is not at hand reads `missing`."""
    if mesh == MISSING:
        line = {"view": view, "scene": VIEWS[view].scene, "triangles": MISSING, "size_px": size_px}
        return [{"panel": panel, **line, "mode": mode, "acceleration": acceleration}]
    found = kept(GEOMETRY_SHADER, view, size_px, mode, acceleration=acceleration)
    cost = pixel_cost(found)
    return [
        {
            "panel": panel,
            **head(view, size_px, found),
            "mode": mode,
            "acceleration": acceleration,
            **ray_counts(found),
            "cells_and_tests_median_pixel": round(float(np.median(cost)), 1),
            "cells_and_tests_largest_pixel": int(cost.max()),
        }
    ]


def pixel_cost(found: Trace) -> Any:
    """Cells and tests of all rays of each pixel, float64[pixels]."""
    return (found.per_ray["cells"] + found.per_ray["triangle_tests"]).astype(np.float64)


def plot(rows: Rows) -> Any:
    """The three pictures; below them the cost of the third, without the grid and with it, and what each view cost."""
    figure = style.new_figure(6.75)
    grid = figure.subplots(2, 3)
    for axes, row in zip(grid[0], rows[:3], strict=True):
        _picture(axes, row)
    _maps(figure, grid[1], rows[2], rows[3])
    _bars(grid[1, 2], rows)
    return figure


def _found(row: Row) -> Trace:
    return kept(GEOMETRY_SHADER, row["view"], row["size_px"], row["mode"], acceleration=row["acceleration"])


def _picture(axes: Any, row: Row) -> None:
    style.no_frame(axes)
    axes.set_title(f"({row['panel']}) {NAMES[row['view']]}")
    if row["triangles"] == MISSING:
        axes.text(0.5, 0.5, f"{row['scene']}:\nmissing", ha="center", va="center", color=style.FAINT)
        return
    image = _found(row).image
    assert image is not None
    axes.imshow(encode_srgb(image), interpolation="lanczos")
    cost = f"{row['cells_per_ray']:.1f} cells, {row['tests_per_ray']:.1f} tests a ray"
    axes.set_xlabel(f"{row['triangles']:,} triangles, {row['rays']:,} rays\n{cost}", fontsize=8)


def _maps(figure: Any, line: Any, with_grid: Row, without: Row) -> None:
    from matplotlib.colors import LogNorm

    size = with_grid["size_px"]
    costs = [pixel_cost(_found(row)).reshape(size, size) for row in (without, with_grid)]
    norm = LogNorm(1.0, max(cost.max() for cost in costs))
    for axes, cost, name in zip(line[:2], costs, ("without the grid", "with the grid"), strict=True):
        style.no_frame(axes)
        shown = axes.imshow(np.maximum(cost, 1.0), cmap="magma", norm=norm, interpolation="nearest")
        axes.set_title(f"(d) {name}")
        axes.set_xlabel(f"median pixel {np.median(cost):,.0f}, largest {cost.max():,.0f}", fontsize=8)
    bar = figure.colorbar(shown, ax=line[:2], location="bottom", fraction=0.05, aspect=45, pad=0.01)
    bar.set_label("cells visited + triangles tested, all rays of a pixel", fontsize=8)
    bar.outline.set_visible(False)


def _bars(axes: Any, rows: Rows) -> None:
    """Cells and tests a ray of each picture; without the grid a ray that meets the scene's box tests everything."""
    shown = [row for row in rows if row["triangles"] != MISSING]
    names = [f"({row['panel']}) {row['acceleration']}" for row in shown]
    places = range(len(shown))
    axes.barh(places, [row["tests_per_ray"] for row in shown], 0.36, color=style.BLUE, label="tests")
    cells = [row["cells_per_ray"] for row in shown]
    axes.barh([place + 0.38 for place in places], cells, 0.36, color=style.ORANGE, label="cells")
    axes.set_yticks([place + 0.19 for place in places], names)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.grid(False, axis="y")
    axes.set_title("A ray's mean cost")
    axes.set_xlabel("cells or tests a ray")
    axes.set_xlim(5, 3000)
    axes.legend(loc="upper right")


EXPERIMENT = Experiment(
    "gsr-figure-1",
    "Figure 1: three pictures, and the cost of each ray",
    "512² (96² with `--quick`, and the Dragon's coarsest version), the default grid, one point light, the paper's "
    "scenes rebuilt: the Dragon (a, no reflections) and the Horse (b) stand on a ground of two triangles. (d) shows "
    "what finding the intersections of picture (c) cost, pixel by pixel and on one logarithmic scale: cells of the "
    "grid visited plus triangles tested by the pixel's eye, shadow and reflected rays. A mesh that is not at hand "
    "reads `missing`.",
    cases,
    measure,
    plot,
    alt="Dragon, horse and torus knot on a ground with shadows and reflections; two maps of what each pixel's rays "
    "cost without the grid and with it, bright against dark; bars of the mean cost of a ray.",
)
