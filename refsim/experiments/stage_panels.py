"""The picture of one small draw: a panel a stage, from the rows of `refsim.experiments.draw_stages` alone.

Framebuffer coordinates throughout: pixels, origin top-left, y down. A colour stands for a run of the geometry shader
and all that came of it, until the fragment shader gives colours of its own.
"""

from __future__ import annotations

from typing import Any

from refsim.experiments import style
from refsim.experiments.registry import Row, Rows

RUN = (style.BLUE, style.PURPLE, style.VERMILION, style.GREEN)  # by input vertex and geometry invocation
FATE = {  # colour of the cell, sign on it
    "written": (style.SKY, ""),
    "discarded": ("#ffffff", "·"),
    "stencil failed": (style.ORANGE, "–"),
    "depth failed": ("#4a4a4a", "×"),
}
GRID = "#e4e4e4"
# Inches: left border, width of a panel and height in widths, between panels; tops of the rows, and the whole height
LEFT, PANEL, RATIO, GAP = 0.27, 3.6, 2 / 3, 0.36
TOPS, FULL = (0.45, 3.53, 6.61, 9.87), 12.5


def plot(rows: Rows) -> Any:
    """Eight panels in pipeline order, two a row."""
    stages: dict[str, Rows] = {}
    for row in rows:
        stages.setdefault(row["stage"], []).append(row)
    figure = style.new_figure(FULL, layout="none")
    panels = (
        ("Vertex shader", "clip position (x, y, z, w), and where it falls on the screen", vertices),
        ("Geometry shader", "up to four vertices a run, joined to strips of triangles", geometry),
        ("Stream output", "whole triangles into a buffer, as long as there is room", records),
        ("Rasteriser", "corners on the 1/256 pixel grid, bounds, centres inside", rasteriser),
        ("Fragment shader", "heat, interpolated, as colour", fragments),
        ("Discard, stencil, depth", "what becomes of each fragment", fates),
        ("Framebuffer before", "a wall that is near, a post that the stencil protects", before),
        ("Framebuffer after", "written fragments blended in order, rounded to 8 bits", after),
    )
    for number, (title, subtitle, draw) in enumerate(panels):
        line, column = divmod(number, 2)
        left, bottom = LEFT + column * (PANEL + GAP), FULL - TOPS[line] - PANEL * RATIO
        axes = figure.add_axes((left / style.WIDTH, bottom / FULL, PANEL / style.WIDTH, PANEL * RATIO / FULL))
        axes.set_title(f"{number + 1}   {title}", pad=16)
        axes.text(0, 1.02, subtitle, transform=axes.transAxes, fontsize=8, color=style.FAINT, va="bottom")
        draw(axes, stages)
    return figure


def screen(axes: Any, pixels: Rows, grid: bool = True) -> None:
    """An axes of framebuffer coordinates with the pixel grid."""
    width, height = pixels[-1]["x_px"] + 1, pixels[-1]["y_px"] + 1
    axes.set_xlim(0, width)
    axes.set_ylim(height, 0)
    style.no_frame(axes)
    axes.set_xticks(range(0, width + 1, 4), [*map(str, range(0, width, 4)), f"{width} px"])
    axes.set_yticks(range(0, height, 4))
    axes.tick_params(length=0, labelsize=7, colors=style.FAINT, pad=2)
    if grid:
        axes.vlines(range(width + 1), 0, height, color=GRID, linewidth=0.5, zorder=0)
        axes.hlines(range(height + 1), 0, width, color=GRID, linewidth=0.5, zorder=0)
    border = [0, width, width, 0, 0], [0, 0, height, height, 0]
    axes.plot(*border, color=style.FAINT, linewidth=0.9, zorder=1, clip_on=False)


def decimal(value: float) -> str:
    """Two places, with a true minus sign."""
    return f"{value:.2f}".replace("-", "−")


def vertices(axes: Any, stages: dict[str, Rows]) -> None:
    """Points with their clip positions."""
    screen(axes, stages["pixels"])
    for row in stages["vertices"]:
        x, y, color = row["screen_x_px"], row["screen_y_px"], RUN[row["vertex"]]
        axes.plot(x, y, "o", color=color, markersize=9)
        axes.text(x, y, str(row["vertex"]), color="white", fontsize=7, ha="center", va="center_baseline", weight="bold")
        clip = ", ".join(decimal(row[f"clip_{part}"]) for part in "xyzw")
        axes.text(
            x, y + 0.75, f"({clip})", color=color, fontsize=7, ha="center", va="top",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85},
        )  # fmt: skip


def triangle(axes: Any, corners: list[tuple[float, float]], **look: Any) -> None:
    """A filled triangle."""
    from matplotlib.patches import Polygon

    axes.add_patch(Polygon(corners, closed=True, **look))


def geometry(axes: Any, stages: dict[str, Rows]) -> None:
    """Emitted vertices, numbered in order, and where they come from; the triangles that they make."""
    screen(axes, stages["pixels"])
    emitted = {row["emitted"]: (row["screen_x_px"], row["screen_y_px"]) for row in stages["emitted"]}
    for row in stages["triangles"]:
        corners = [emitted[row[f"emitted_{k}"]] for k in range(3)]
        color = RUN[row["invocation"]]
        triangle(axes, corners, facecolor=color, edgecolor=color, alpha=0.16, linewidth=0)
        triangle(axes, corners, facecolor="none", edgecolor=color, linewidth=1.0)
    for row in stages["vertices"]:
        x, y, color = row["screen_x_px"], row["screen_y_px"], RUN[row["vertex"]]
        for vertex in (row_ for row_ in stages["emitted"] if row_["vertex"] == row["vertex"]):
            end = emitted[vertex["emitted"]]
            axes.plot([x, end[0]], [y, end[1]], ":", color=color, linewidth=0.8)
        axes.plot(x, y, "o", color="white", markeredgecolor=color, markeredgewidth=1.2, markersize=6, zorder=3)
        if not any(vertex["vertex"] == row["vertex"] for vertex in stages["emitted"]):
            axes.text(x, y + 0.6, "emits nothing", color=color, fontsize=7, ha="center", va="top")
    for row in stages["emitted"]:
        x, y = emitted[row["emitted"]]
        axes.plot(x, y, "o", color=RUN[row["invocation"]], markersize=8.5, zorder=4)
        axes.text(
            x, y, str(row["emitted"]), color="white", fontsize=6.5, ha="center", va="center_baseline", weight="bold",
            zorder=5,
        )  # fmt: skip


def records(axes: Any, stages: dict[str, Rows]) -> None:
    """The buffer as a table, and what had no room."""
    style.no_frame(axes)
    counts = {row["counter"]: row["count"] for row in stages[""]}
    columns = {
        "record": 0.11, "byte": 0.22, "x": 0.36, "y": 0.47, "z": 0.58, "w": 0.69, "heat": 0.82, "triangle": 0.98,
    }  # fmt: skip
    cell = {"fontsize": 7, "ha": "right", "va": "center"}
    rows = stages["records"]
    lines = len(rows) + 2
    axes.set_xlim(0, 1)
    axes.set_ylim(lines, 0)
    for name, x in columns.items():
        axes.text(x, 0.5, name, **cell, color=style.FAINT)
    for k, row in enumerate(rows):
        y = k + 1.5
        if "primitive" not in row:
            free = {"record": row["record"], "byte": row["offset_bytes"], "w": "free: no room for a triangle"}
            for name, text in free.items():
                axes.text(columns[name], y, str(text), **cell, color=style.FAINT)
            continue
        color = RUN[row["invocation"]]
        axes.axhspan(k + 1, k + 2, xmin=0, xmax=1, color=color, alpha=0.13, linewidth=0)
        line = {"record": str(row["record"]), "byte": str(row["offset_bytes"]), "heat": decimal(row["heat"])}
        for name, text in (line | {part: decimal(row[part]) for part in "xyzw"}).items():
            axes.text(columns[name], y, text, **cell)
        if k % 3 == 1:
            number = str(row["primitive"])
            axes.text(columns["triangle"], y, number, **cell | {"color": color, "weight": "bold", "fontsize": 8})
    written, lost = counts["stream_output.primitives"], counts["stream_output.overflowed"]
    axes.text(
        0, lines - 0.4, f"{written + lost} triangles generated, {written} written, {lost} overflowed",
        fontsize=7.5, color=style.INK, va="center", weight="bold",
    )  # fmt: skip


def rasteriser(axes: Any, stages: dict[str, Rows]) -> None:
    """Snapped corners, edges, bounding boxes; a dot at each centre that is covered."""
    from matplotlib.patches import Rectangle

    screen(axes, stages["pixels"])
    for row in stages["triangles"]:
        color = RUN[row["invocation"]]
        x0, y0, x1, y1 = (row[f"box_{name}_px"] for name in ("x0", "y0", "x1", "y1"))
        dashed: Any = {"facecolor": "none", "edgecolor": color, "linewidth": 0.8, "linestyle": (0, (3, 2))}
        axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, **dashed))
        corners = [(row[f"corner_{k}_x_256ths_px"] / 256, row[f"corner_{k}_y_256ths_px"] / 256) for k in range(3)]
        triangle(axes, corners, facecolor=color, alpha=0.10, linewidth=0)
        triangle(axes, corners, facecolor="none", edgecolor=color, linewidth=1.1)
        axes.plot(*zip(*corners, strict=True), "s", color=color, markersize=3.5)
    for row in stages["fragments"]:
        axes.plot(row["x_px"] + 0.5, row["y_px"] + 0.5, ".", color=RUN[row["invocation"]], markersize=2.6)


def cells(axes: Any, rows: Rows, look: Any) -> None:
    """Fragments as cells of the pixel grid: `look(row)` -> colour, sign. Several at a pixel share it in columns."""
    from matplotlib.patches import Rectangle

    stacked: dict[tuple[int, int], Rows] = {}
    for row in rows:
        stacked.setdefault((row["x_px"], row["y_px"]), []).append(row)
    for (x, y), layers in stacked.items():
        width = 1 / len(layers)
        for k, row in enumerate(layers):
            color, sign, edge = look(row)
            left = x + k * width
            axes.add_patch(Rectangle((left, y), width, 1, facecolor=color, edgecolor=edge, linewidth=0.5, zorder=2))
            if sign:
                ink = "white" if color == FATE["depth failed"][0] else style.INK
                axes.text(left + width / 2, y + 0.5, sign, fontsize=7, ha="center", va="center", color=ink, zorder=3)


def color_of(row: Row, prefix: str = "", scale: float = 1.0) -> tuple[float, ...]:
    """The colour that a row holds, without alpha."""
    return tuple(row[f"{prefix}{part}"] / scale for part in ("red", "green", "blue"))


def fragments(axes: Any, stages: dict[str, Rows]) -> None:
    """The shader's colours, and below all of them by heat."""
    rows = stages["fragments"]
    screen(axes, stages["pixels"])
    cells(axes, rows, lambda row: (color_of(row), "", "white"))
    ramp = axes.inset_axes((0.31, -0.125, 0.38, 0.04))
    style.no_frame(ramp)
    ordered = sorted(rows, key=lambda row: row["heat"])
    heats = [row["heat"] for row in ordered]
    for row, start, end in zip(ordered, heats, heats[1:], strict=False):
        ramp.axvspan(start, end, color=color_of(row), linewidth=0)
    ramp.set_xlim(heats[0], heats[-1])
    ramp.text(-0.02, 0.5, f"heat {decimal(heats[0])}", transform=ramp.transAxes, fontsize=7, ha="right", va="center")
    ramp.text(1.02, 0.5, decimal(heats[-1]), transform=ramp.transAxes, fontsize=7, ha="left", va="center")


def fates(axes: Any, stages: dict[str, Rows]) -> None:
    """Which fragments were written, and what ended the others."""
    from matplotlib.patches import Patch

    screen(axes, stages["pixels"])
    cells(axes, stages["fragments"], lambda row: (*FATE[row["fate"]], "#9a9a9a"))
    ended = [row["fate"] for row in stages["fragments"]]
    handles = [
        Patch(facecolor=color, edgecolor="#9a9a9a", linewidth=0.6, label=f"{sign} {name} {ended.count(name)}".strip())
        for name, (color, sign) in FATE.items()
    ]
    axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0, -0.085), ncols=4, fontsize=7, handlelength=0.9,
        handletextpad=0.4, columnspacing=0.75, borderpad=0, borderaxespad=0,
    )  # fmt: skip


def image(axes: Any, pixels: Rows, state: str) -> None:
    """The colour target."""
    screen(axes, pixels, grid=False)
    width, height = pixels[-1]["x_px"] + 1, pixels[-1]["y_px"] + 1
    picture = [[color_of(pixels[y * width + x], f"{state}_", 255) for x in range(width)] for y in range(height)]
    axes.imshow(picture, extent=(0, width, height, 0), interpolation="nearest", zorder=0)


def before(axes: Any, stages: dict[str, Rows]) -> None:
    """The target, the depth and the stencil value of what stands there."""
    pixels = stages["pixels"]
    image(axes, pixels, "before")
    plain = (pixels[0]["before_depth"], pixels[0]["before_stencil"])
    areas: dict[tuple[float, int], Rows] = {}
    for row in pixels:
        areas.setdefault((row["before_depth"], row["before_stencil"]), []).append(row)
    for (depth, stencil), rows in areas.items():
        x, y = (sum(row[part] for row in rows) / len(rows) + 0.5 for part in ("x_px", "y_px"))
        if (depth, stencil) == plain:
            x, y = 2.5, 1.5
        axes.text(x, y, f"depth {depth:g}\nstencil {stencil}", fontsize=7, ha="center", va="center")


def after(axes: Any, stages: dict[str, Rows]) -> None:
    """The target when the draw is done."""
    image(axes, stages["pixels"], "after")
