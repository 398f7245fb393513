"""Figure 4: (a) what the two vertex buffers hold after each pass, against S_VB; (b) both methods side by side.

(a) S_VB = w · h · (G + G') · 64 bytes is allocated for P passes; every pass is measured: rays passed on to be shaded,
and rays emitted to be shot in the next pass. (b) The paper's picture is of milliseconds (those of its Table 3); counted
here are cells, triangle tests, shader runs, and bytes moved. Recursive Ray Tracing in Geometry Shader, sections 4, 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import gsr_published as published
from refsim.experiments import style
from refsim.experiments.gsr_moved import moved
from refsim.experiments.gsr_runs import (
    FRAGMENT_GRID,
    GEOMETRY_SHADER,
    MODES,
    head,
    ray_counts,
    run,
    scene_of,
    shader_work,
)
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables

VIEWS = ("mirroring room", "knot", "cornell box")
COMPARED = {"knot from above": "Cornell Knot", "cornell box": "Cornell Box"}  # ours, Table 3's
MOST_PASSES = 4
KINDS = ("passed_eye", "passed_shadow", "passed_reflected", "spawned_shadow", "spawned_reflected")
LOOKS = {
    "passed_eye": (style.BLUE, "eye rays, shaded"),
    "passed_shadow": (style.BLACK, "shadow rays, shaded"),
    "passed_reflected": (style.GREEN, "reflected rays, shaded"),
    "spawned_shadow": ("#9a9a9a", "shadow rays, to be shot"),
    "spawned_reflected": ("#8fd3bd", "reflected rays, to be shot"),
}


def cases(quick: bool) -> list[Case]:
    """Part a: a case a view and P. Part b: a case a view, mode and method."""
    size = 64 if quick else published.SIDE
    a = [
        {"part": "a", "view": view, "size_px": size, "passes": passes}
        for view in VIEWS for passes in range(1, MOST_PASSES + 1)
    ]  # fmt: skip
    b = [
        {"part": "b", "view": view, "size_px": size, "mode": mode, "method": method}
        for view in COMPARED for mode in MODES for method in (GEOMETRY_SHADER, FRAGMENT_GRID)
    ]  # fmt: skip
    return a + b


def measure(
    part: str, view: str, size_px: int, passes: int = 2, mode: str = "RT", method: str = GEOMETRY_SHADER
) -> Rows:
    """Part a: a row a pass. Part b: one row."""
    return _occupancy(view, size_px, passes) if part == "a" else [_compared(view, size_px, mode, method)]


def _occupancy(view: str, size: int, passes: int) -> Rows:
    found = run(GEOMETRY_SHADER, view, size, passes=passes, refractions=False)
    largest = max(g.occupancy.vertices for g in found.generations if g.occupancy is not None)
    rows = []
    for k, generation in enumerate(found.generations):
        c, held = generation.counters, generation.occupancy
        assert held is not None
        rows.append(
            {
                "part": "a",
                **head(view, size, found),
                "passes": passes,
                "pass": k,
                "vertices_in": c["vertex.invocations"],
                "vertices_in_finished": c["geometry.in_finished"],
                **{f"{kind}_vertices": c[f"geometry.{kind}"] for kind in KINDS},
                "vertices_out": held.vertices,
                "bytes_out": held.bytes,
                "capacity_vertices": held.capacity,
                "capacity_bytes": held.capacity_bytes,
                "largest_occupancy_vertices": largest,
                "over_allocation": round(held.capacity / largest, 4),
            }
        )
    return rows


def _compared(view: str, size: int, mode: str, method: str) -> Row:
    found = run(method, view, size, **MODES[mode])
    return {
        "part": "b",
        **head(view, size, found),
        "mode": mode,
        "method": method,
        **ray_counts(found),
        **moved(found, size * size, len(scene_of(view).lights)),
        **shader_work(found),
        "published_scene": COMPARED[view],
        "published_ms": published.milliseconds(COMPARED[view], mode, method == GEOMETRY_SHADER),
    }


def of_part(rows: Rows, part: str) -> Rows:
    """The rows of (a) or (b)."""
    return [row for row in rows if row["part"] == part]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Occupancy, and comparison."""
    return {
        "gsr-figure-4": of_part(rows, "a"),
        "gsr-figure-4-compared": of_part(rows, "b"),
    }


def plot(rows: Rows) -> Any:
    """Above: records a pixel after each pass, and what was allocated. Below: both methods."""
    figure = style.new_figure(6.9)
    above, below = figure.subfigures(2, 1, height_ratios=(1.12, 1.0))
    a, b = of_part(rows, "a"), of_part(rows, "b")
    views = list(dict.fromkeys(row["view"] for row in a))
    for axes, view in zip(above.subplots(1, len(views), sharey=True, squeeze=False)[0], views, strict=True):
        _draw_occupancy(axes, [row for row in a if row["view"] == view])
        if view == views[0]:
            axes.set_ylabel("records a pixel, 64 bytes each")
    above.legend(handles=_marks(), loc="outside lower center", ncols=3)
    _draw_compared(below, b)
    return figure


def _draw_occupancy(axes: Any, rows: Rows) -> None:
    pixels = rows[0]["size_px"] ** 2
    place, places, labels = 0.0, [], []
    for passes in sorted({row["passes"] for row in rows}):
        own = [row for row in rows if row["passes"] == passes]
        first = place
        for row in own:
            bottom = 0.0
            for kind in KINDS:
                height = row[f"{kind}_vertices"] / pixels
                axes.bar(place, height, 0.85, bottom=bottom, color=LOOKS[kind][0])
                bottom += height
            places.append(place)
            labels.append(str(row["pass"] + 1))
            place += 1.0
        room = own[0]["capacity_vertices"] / pixels
        axes.plot([first - 0.5, place - 0.5], [room, room], color=style.VERMILION, linewidth=1.6)
        said = f"P = {passes}\n× {own[0]['over_allocation']:.2f}"
        axes.text((first + place - 1) / 2, room + 0.06, said, ha="center", va="bottom", fontsize=7.5)
        place += 0.8
    axes.set_ylim(0, 5.1)
    axes.set_xticks(places, labels, fontsize=7.5)
    axes.grid(False, axis="x")
    axes.set_xlabel("pass")
    axes.set_title(f"(a) {rows[0]['view']}")


def _marks() -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    bars = [Patch(facecolor=color, label=name) for color, name in LOOKS.values()]
    return [*bars, Line2D([], [], color=style.VERMILION, linewidth=1.6, label="allocated: S_VB")]


def _draw_compared(figure: Any, rows: Rows) -> None:
    """Ratios of ours to fragment_grid, of counts and of the published times."""
    views = list(dict.fromkeys(row["view"] for row in rows))
    quantities = {
        "published ms": lambda row: row["published_ms"],
        "cells": lambda row: row["cells"],
        "triangle tests": lambda row: row["triangle_tests"],
        "shader runs": lambda row: sum(row[f"{name}_shader_runs"] for name in published.SHADERS),
        "bytes of rays": lambda row: row["ray_bytes_read"] + row["ray_bytes_written"],
        "bytes of rays, colours": lambda row: row["ray_bytes_read"] + row["ray_bytes_written"] + row["color_bytes"],
    }
    colors = (style.VERMILION, style.BLUE, style.SKY, style.GREEN, style.ORANGE, style.PURPLE)
    for axes, view in zip(figure.subplots(1, len(views), sharey=True, squeeze=False)[0], views, strict=True):
        for k, (name, quantity) in enumerate(quantities.items()):
            heights = []
            for mode in MODES:
                own = {row["method"]: row for row in rows if (row["view"], row["mode"]) == (view, mode)}
                heights.append(quantity(own[GEOMETRY_SHADER]) / quantity(own[FRAGMENT_GRID]))
            axes.bar([i + (k - 2.5) * 0.14 for i in range(len(MODES))], heights, 0.13, color=colors[k], label=name)
        axes.axhline(1.0, color=style.INK, linewidth=0.8)
        axes.set_xticks(range(len(MODES)), list(MODES))
        axes.grid(False, axis="x")
        axes.set_title(f"(b) {view}")
        if view == views[0]:
            axes.set_ylabel("geometry shader ÷ fragment shader")
            handles = axes.get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=6, fontsize=8, columnspacing=1.2, handlelength=1.2)


EXPERIMENT = Experiment(
    "gsr-figure-4",
    "Figure 4: what the vertex buffers hold, and both methods in counts",
    "512² (64² with `--quick`), one light, no refraction. (a) Records that each pass captured, by kind, for P passes; "
    "the red line is what S_VB allocates for that P, the factor above it how much more that is than the fullest pass "
    "needed. In the mirroring room every ray hits and every hit reflects: two passes fill all 48 MiB of the paper's "
    "example. (b) Counts of the method `geometry_shader` divided by those of `fragment_grid`, same grid, same rays; "
    "beside them the same quotient of the paper's milliseconds for its own scene of that name (Table 3). Bytes follow "
    "from the formats: 64 bytes a vertex, 16 a texel.",
    cases,
    measure,
    plot,
    tables,
    alt="Above, stacked bars of the records in the vertex buffer pass by pass for up to four passes and three scenes, "
    "with lines for what is allocated; below, bars of counts and published milliseconds of the geometry shader by "
    "those of the fragment shader.",
)
