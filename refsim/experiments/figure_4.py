"""Figure 4: opening angles of the tiles' cones after 1, 2, 4 and 8 iterations; brighter means smaller.

The Hierarchical Ray Engine, section 7.1. Iteration 1 is the pass of the eye rays: "in the beginning of every
iteration, an enclosing cone for rays is built for every tile" (section 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.pictures import averaged, picture
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, run
from refsim.image import encode_srgb
from refsim.results import Generation, TileState

SHOWN = (1, 2, 4, 8)
SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
FILL = 0.55
LARGEST = 83.0  # degrees: a wider cone counts as unbounded


def cases(quick: bool) -> list[Case]:
    """Always 16 × 16 tiles, as in the paper."""
    size, tile = (128, 8) if quick else (256, 16)
    return [{"scene": scene, "size_px": size, "tile_px": tile, "fill": FILL, "iterations": 8} for scene in SCENES]


def measure(
    scene: str, size_px: int, tile_px: int, fill: float, iterations: int = 8, backend: str = "numba"
) -> Rows:
    """One row a tile and iteration: state, half-angle of its cone, live rays."""
    found = run(HIERARCHICAL, scene, size_px, fill, generations=iterations, tile_size=tile_px, backend=backend)
    number = len(found.scene.triangles)
    head = {"scene": scene, "triangles": number, "size_px": size_px, "tile_px": tile_px, "fill": fill}
    head["backend"] = backend
    return [
        {**head, "iteration": k, **row} for k, passed in enumerate(found.generations, 1) for row in _tiles(passed)
    ]


def _tiles(passed: Generation) -> Rows:
    cones = passed.cones
    assert cones is not None and passed.rays.width is not None
    columns, size = passed.rays.width, cones.tile_size
    pixel = np.flatnonzero(passed.alive)
    tile = pixel // columns // size * cones.width + pixel % columns // size
    live = np.bincount(tile, minlength=len(cones.state))
    rows = []
    for number, state in enumerate(cones.state):
        bounded = state == TileState.BOUNDED
        angle = round(float(np.degrees(np.float64(cones.half_angle[number]))), 2) if bounded else ""
        place = {"tile_row": number // cones.width, "tile_column": number % cones.width}
        rows.append(
            {**place, "state": TileState(state).name.lower(), "half_angle_deg": angle, "live_rays": int(live[number])}
        )
    return rows


def summary(rows: Rows) -> Rows:
    """Mean and median half-angle of bounded tiles and the share of the others, per scene and iteration."""
    groups: dict[tuple[Any, ...], Rows] = {}
    for row in rows:
        groups.setdefault((row["scene"], row["triangles"], row["fill"], row["iteration"]), []).append(row)
    return [
        {**dict(zip(("scene", "triangles", "fill", "iteration"), key, strict=True)), **_statistics(group)}
        for key, group in groups.items()
    ]


def _statistics(group: Rows) -> Row:
    angles = [row["half_angle_deg"] for row in group if row["state"] == "bounded"]

    def share(state: str) -> float:
        return round(100.0 * sum(row["state"] == state for row in group) / len(group), 2)

    return {
        "live_rays": sum(row["live_rays"] for row in group),
        "mean_half_angle_deg": round(float(np.mean(angles)), 2) if angles else "",
        "median_half_angle_deg": round(float(np.median(angles)), 2) if angles else "",
        "largest_half_angle_deg": max(angles) if angles else "",
        "bounded_tiles_percent": share("bounded"),
        "unbounded_tiles_percent": share("unbounded"),
        "empty_tiles_percent": share("empty"),
    }


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """The tiles, and their summary."""
    return {"figure-4": rows, "figure-4-summary": summary(rows)}


def plot(rows: Rows) -> Any:
    """A line of panels a scene: the picture, then a map of tiles for each iteration shown."""
    from matplotlib.colors import PowerNorm

    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure = style.new_figure(1.72 * len(scenes) + 0.95)
    grid = figure.subplots(len(scenes), 1 + len(SHOWN), squeeze=False)
    # Small angles, where most tiles are, get most of the scale
    norm = PowerNorm(0.5, 0.0, LARGEST)
    shown = None
    for line, scene in zip(grid, scenes, strict=True):
        own = [row for row in rows if row["scene"] == scene]
        _draw_picture(line[0], own[0])
        for axes, iteration in zip(line[1:], SHOWN, strict=True):
            shown = _draw_tiles(axes, [row for row in own if row["iteration"] == iteration], norm)
    for axes, iteration in zip(grid[0, 1:], SHOWN, strict=True):
        axes.set_title(f"iteration {iteration}")
    bar = figure.colorbar(shown, ax=grid[:, 1:], location="bottom", fraction=0.05, aspect=50, pad=0.015)
    bar.set_label("half opening angle of the tile's cone, degrees")
    bar.set_ticks([0, 1, 2, 5, 10, 20, 40, 60, 80])
    bar.outline.set_visible(False)
    _legend(grid[-1, 0])
    return figure


def _draw_picture(axes: Any, row: Row) -> None:
    side = 2 * row["size_px"]
    image = picture(row["scene"], side, side, row["fill"], backend=row["backend"])
    axes.imshow(encode_srgb(averaged(np.clip(image.rgb, 0.0, 1.0), 2)), interpolation="antialiased")
    style.no_frame(axes)
    axes.set_ylabel(f"{style.body_name(row['scene'])}\n{row['triangles']:,} triangles", fontsize=8.5)


def _draw_tiles(axes: Any, tiles: Rows, norm: Any) -> Any:
    from matplotlib.patches import Rectangle

    style.no_frame(axes)
    if not tiles:
        return None
    angle = np.full((1 + max(r["tile_row"] for r in tiles), 1 + max(r["tile_column"] for r in tiles)), np.nan)
    for row in tiles:
        at = row["tile_row"], row["tile_column"]
        corner = (at[1] - 0.5, at[0] - 0.5)
        if row["state"] == "bounded":
            angle[at] = row["half_angle_deg"]
        elif row["state"] == "unbounded":
            axes.add_patch(Rectangle(corner, 1, 1, facecolor=style.VERMILION, edgecolor="none"))
        else:
            axes.add_patch(Rectangle(corner, 1, 1, facecolor="#f4f4f4", edgecolor="#b5b5b5", hatch="////", linewidth=0))
    return axes.imshow(angle, cmap="viridis_r", norm=norm, interpolation="nearest")


def _legend(axes: Any) -> None:
    from matplotlib.patches import Patch

    marks = [
        Patch(facecolor=style.VERMILION, label="unbounded: culls nothing"),
        Patch(facecolor="#f4f4f4", edgecolor="#b5b5b5", hatch="////", label="empty: no ray left"),
    ]
    look = {"borderpad": 0, "handlelength": 1.2, "fontsize": 8}
    # Wider than the picture above it, which must not grow for it
    axes.legend(handles=marks, loc="upper left", bbox_to_anchor=(-0.24, -0.05), **look).set_in_layout(False)


EXPERIMENT = Experiment(
    "figure-4",
    "Cone angles after 1, 2, 4 and 8 iterations",
    "One texel is one tile; brighter is a smaller opening angle. 256² eye rays in 16 × 16 tiles (128² in 8 × 8 with "
    "`--quick`), geometric normals. The pictures on the left show the same views with interpolated normals.",
    cases,
    measure,
    plot,
    tables,
    alt="For each of three glass bodies its picture and four maps of the tiles' cones: narrow and even after the "
    "first iteration, wider after the second, later scattered, many unbounded or without a ray.",
)
