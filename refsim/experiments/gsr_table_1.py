"""Table 1: how executed instructions are distributed between the shaders, with naive intersection.

"The presented data is the % of executed instructions distributed between shaders" (section 5). Here operations and
texture fetches are counted on the shaders' own sources, an instruction each; the paper's percentages stand beside.
Three scenes: a room of 12 triangles, the Cornell box of 36, and an animated knight of 646, over whose frames the grid
is built anew each time, for comparison. Recursive Ray Tracing in Geometry Shader.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.experiments import gsr_published as published
from refsim.experiments import style
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, MODES, head, rays_of, scene_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.methods import trace
from refsim.papers.geometry_shader_rays.costs import SHADERS, Prices, shares
from refsim.results import Trace
from refsim.scene.animation import FRAMES

VIEWS = ("room", "cornell box", "knight in box")
ANIMATED = "knight in box"
# What a texture fetch may cost in operations, beside Table 1's instruction each
DEAR_FETCH = 8.0


def cases(quick: bool) -> list[Case]:
    """A case a still and mode; a case a frame of the animation."""
    still, moving = (48, 32) if quick else (published.SIDE, 128)
    stills = [{"view": view, "size_px": still, "mode": mode} for view in VIEWS[:2] for mode in MODES]
    steps = range(0, FRAMES, FRAMES // 3 if quick else 1)
    frames = [{"view": ANIMATED, "size_px": moving, "frame": frame} for frame in steps]
    return stills + frames


def measure(view: str, size_px: int, mode: str = "", frame: int = 0) -> Rows:
    """A row; of a frame a row a mode, with the grid of that frame beside."""
    if mode:
        return [_naive(view, size_px, mode, 0)]
    built = _grid(view, size_px, frame)
    return [{**_naive(view, size_px, each, frame), **(built if each == "SC" else {})} for each in MODES]


def _run(view: str, size: int, mode: str, frame: int, acceleration: str) -> Trace:
    scene = scene_of(view, frame, FRAMES)
    rays = rays_of(view, size, scene_of(view, 0, FRAMES))
    return trace(GEOMETRY_SHADER, scene, rays, acceleration=acceleration, **MODES[mode])


def _naive(view: str, size: int, mode: str, frame: int) -> Row:
    found = _run(view, size, mode, frame, "naive")
    c = found.counters
    return {
        **head(view, size, found),
        "frame": frame if view == ANIMATED else "",
        "mode": mode,
        "eye_rays_that_hit_percent": round(100.0 * float((found.generations[0].hits.triangle >= 0).mean()), 3),
        "triangle_tests": c["intersection.triangle_tests"],
        **{f"{name}_shader_runs": _runs(found, name) for name in SHADERS},
        **{f"{name}_{what}": c[f"{name}.{what}"] for name in SHADERS for what in ("arithmetic", "fetches")},
    }


def _runs(found: Trace, shader: str) -> int:
    """Invocations in the tracing passes; those of the blending passes are left out, as their operations are."""
    return sum(generation.counters[f"{shader}.invocations"] for generation in found.generations)


def _grid(view: str, size: int, frame: int) -> Row:
    """The grid of a frame, and what it leaves of the tests."""
    from refsim.papers.geometry_shader_rays.grid import grid

    structure = grid(scene_of(view, frame, FRAMES)).structure
    found = _run(view, size, "SC", frame, "grid")
    return {
        "grid_cells": int(np.prod(structure.cells.shape[:3])),
        "grid_references": int(structure.cells[..., 2].sum(dtype=np.int64)),
        "grid_cells_visited": found.counters["traversal.cells"],
        "grid_triangle_tests": found.counters["intersection.triangle_tests"],
    }


def distribution(rows: Rows) -> Rows:
    """A row a scene and mode: percent of operations of each shader, summed over frames, and the paper's."""
    found = []
    for view in dict.fromkeys(row["view"] for row in rows):
        for mode in MODES:
            own = [row for row in rows if (row["view"], row["mode"]) == (view, mode)]
            found.append(_shares(view, mode, own))
    return found


def _shares(view: str, mode: str, rows: Rows) -> Row:
    names = [f"{name}.{what}" for name in SHADERS for what in ("arithmetic", "fetches")]
    counters = {name: sum(row[name.replace(".", "_")] for row in rows) for name in names}
    equal, dear = shares(counters), shares(counters, Prices(fetch=DEAR_FETCH))
    said = {name: published.share(rows[0]["scene"], name, mode) for name in SHADERS}
    return {
        "view": view,
        "scene": rows[0]["scene"],
        "triangles": rows[0]["triangles"],
        "size_px": rows[0]["size_px"],
        "frames": len(rows),
        "mode": mode,
        "operations": sum(counters.values()),
        **{f"{name}_percent": round(equal[name], 3) for name in SHADERS},
        **{f"published_{name}_percent": "NA" if said[name] is None else said[name] for name in SHADERS},
        **{f"{name}_percent_fetch_{DEAR_FETCH:g}": round(dear[name], 3) for name in SHADERS},
        "vertex_arithmetic_per_fetch": round(counters["vertex.arithmetic"] / max(counters["vertex.fetches"], 1), 3),
    }


def frames_of(rows: Rows) -> Rows:
    """The grids of the animation, a row a frame."""
    wanted = ("frame", "size_px", "triangle_tests", "eye_rays_that_hit_percent")
    return [
        {name: row[name] for name in (*wanted, *(name for name in row if name.startswith("grid_")))}
        for row in rows if "grid_cells" in row and row["grid_cells"] != ""
    ]  # fmt: skip


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All runs, the distribution, and the frames' grids."""
    return {
        "gsr-table-1-runs": rows,
        "gsr-table-1": distribution(rows),
        "gsr-table-1-frames": frames_of(rows),
    }


def plot(rows: Rows) -> Any:
    """Shares, ours beside the paper's; below the animation's grid, frame by frame."""
    figure = style.new_figure(6.5)
    above, below = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
    found = distribution(rows)
    views = list(dict.fromkeys(row["view"] for row in found))
    for axes, view in zip(above.subplots(1, len(views), sharey=True, squeeze=False)[0], views, strict=True):
        own = [row for row in found if row["view"] == view]
        _draw_shares(axes, own)
        if view == views[0]:
            axes.set_ylabel("percent of operations")
            handles = axes.get_legend_handles_labels()
    above.legend(*handles, loc="outside lower center", ncols=3)
    _draw_frames(below, frames_of(rows))
    return figure


def _draw_shares(axes: Any, rows: Rows) -> None:
    for k, row in enumerate(rows):
        for side, prefix in ((-0.21, ""), (0.21, "published_")):
            bottom = 0.0
            for name, color in zip(SHADERS, (style.BLUE, style.ORANGE, style.GREEN), strict=True):
                height = row[f"{prefix}{name}_percent"]
                if height == "NA":
                    axes.text(k + side, 3, "NA", ha="center", fontsize=7.5, color=style.FAINT)
                    break
                look = {"hatch": "////", "alpha": 0.55, "edgecolor": "white"} if prefix else {}
                label = f"{name}{', published' if prefix else ''}" if k == 0 else None
                axes.bar(k + side, height, 0.38, bottom=bottom, color=color, label=label, linewidth=0, **look)
                bottom += height
    axes.set_xticks(range(len(rows)), [row["mode"] for row in rows])
    axes.grid(False, axis="x")
    axes.set_ylim(0, 101)
    axes.set_xlim(-0.55, len(rows) - 0.45)
    axes.set_title(f"{rows[0]['view']}, {rows[0]['triangles']} triangles")


def _draw_frames(figure: Any, rows: Rows) -> None:
    left, right = figure.subplots(1, 2)
    frames = [row["frame"] for row in rows]
    left.plot(frames, [row["grid_references"] for row in rows], color=style.BLUE, label="references")
    left.plot(frames, [row["grid_cells"] for row in rows], color=style.ORANGE, label="cells")
    left.set_title("Knight: the grid, built anew every frame")
    left.set_ylabel("in the grid")
    left.set_ylim(0, 1.15 * max(row["grid_cells"] for row in rows))
    style.count_ticks(left.yaxis)
    for name, label, color in (
        ("triangle_tests", "tests, naive", style.BLACK),
        ("grid_triangle_tests", "tests, grid", style.BLUE),
        ("grid_cells_visited", "cells visited, grid", style.ORANGE),
    ):
        pixels = rows[0]["size_px"] ** 2
        right.plot(frames, [row[name] / pixels for row in rows], color=color, label=label)
    right.set_yscale("log")
    style.plain_ticks(right.yaxis)
    right.set_title("Knight: shadow casting, naive and grid")
    right.set_ylabel("a pixel")
    for axes in (left, right):
        axes.set_xlabel("frame")
        axes.legend(fontsize=8)


EXPERIMENT = Experiment(
    "gsr-table-1",
    "Table 1: operations of each shader",
    "Naive intersection, every eye ray hits. Operations (arithmetic and texture fetches, one instruction each) are "
    "counted on the sources of the shaders and multiplied by how often each part ran; hatched: the paper's "
    "percentages. Stills at 512² (48² with `--quick`), the animation at 128², all 198 frames (32² and every 66th with "
    "`--quick`), its grid built anew for every frame. What a fixed-function stage does, and attributes read and "
    "written, are not operations.",
    cases,
    measure,
    plot,
    tables,
    alt="Stacked bars of the shares of vertex, geometry and fragment shader, counted here and, hatched, published, "
    "for three scenes; below, curves over the frames of an animation: the grid that is built, and the cost of a "
    "pixel with the grid and without.",
)
