"""Figure 3: what heads skip of a list of five primitives, for rays off a triangle and those of a screen cell.

The heads are those of the library, on triangles that a view along z shows as lines; areas are the half-spaces at z = 0.
Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, section 3."""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.bsh_small import FIVE, lines_scene, looking_along_x
from refsim.experiments.registry import Case, Experiment, Row, Rows

LIST = 0  # along +x
POLYGON, SIDE, CELLS, CELL = 1, 55, 5, 17
DARK, LIGHT = "#8c8c8c", "#d2d2d2"
FRAME = (-2.25, 4.0, -2.1, 1.9)


def cases(quick: bool) -> list[Case]:
    """A triangle, and a cell."""
    return [{"part": "triangle"}, {"part": "cell"}]


def measure(part: str) -> Rows:
    """The half-spaces, and every element with what becomes of it."""
    from refsim.papers.sphere_hierarchy import cell_heads, polygon_heads
    from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
    from refsim.papers.sphere_hierarchy.lists import build_lists

    scene = lines_scene(FIVE)
    lists = build_lists(build_hierarchy(scene), 6)
    if part == "triangle":
        heads = polygon_heads.polygon_heads(lists, None, "regular")
        planes = polygon_heads.polygon_planes(heads, POLYGON, LIST)
        skipped = polygon_heads.skipped_by_polygon(heads, lists, POLYGON, LIST)
        origin: list[float] = []
    else:
        rays = looking_along_x(scene, SIDE)
        planes = cell_heads.cell_planes(lists, rays, CELLS, CELL, LIST)
        skipped = cell_heads.skipped_by_cell(lists, rays, CELLS, CELL, LIST)
        origin = rays.origin[0].tolist()
    rows: Rows = [
        {"part": part, "what": "half-space", "number": k, **dict(zip(("a", "b", "c", "d"), plane[:4].tolist(),
                                                                   strict=True))}
        for k, plane in enumerate(planes)
    ]  # fmt: skip
    if origin:
        rows.append({"part": part, "what": "eye", "number": 0, "a": origin[0], "b": origin[1], "c": origin[2]})
    return [{**row, **{k: round(row[k], 6) for k in "abcd" if k in row}} for row in rows] + [
        {"part": part, **row, "rejected": int(skipped.out[row["element"]]),
         "before_head": int(row["element"] < skipped.head)} for row in _elements(lists)
    ]  # fmt: skip


def _elements(lists: Any) -> Rows:
    rows: Rows = []
    for k, sphere in enumerate(lists.hierarchy.spheres):
        x, y, _, r = sphere.tolist()
        rows.append({"what": "sphere", "number": k, "element": int(lists.node_at[LIST, k]), "a": x, "b": y, "c": r})
    for k, triangle in enumerate(lists.hierarchy.triangles):
        # The two vertices on the near side are the line's ends
        (ax, ay), (bx, by) = triangle[triangle[:, 2] < 0][:, :2].tolist()
        element = int(lists.triangle_at[LIST, k])
        rows.append({"what": "triangle", "number": k, "element": element, "a": ax, "b": ay, "c": bx, "d": by})
    for row in rows:
        row |= {name: round(row[name], 6) for name in "abcd" if name in row}
    return sorted(rows, key=lambda row: row["element"])


def plot(rows: Rows) -> Any:
    """(a) the triangle, (b) the cell; below each its list."""
    figure = style.new_figure(4.0)
    above, below = figure.subplots(2, 2, height_ratios=(1.0, 0.25))
    for k, part in enumerate(("triangle", "cell")):
        own = [row for row in rows if row["part"] == part]
        _draw_areas(above[k], own, part)
        _draw_list(below[k], own)
    above[0].set_title(f"(a) Rays that leave triangle ({POLYGON + 1}), mainly along +x")
    above[1].set_title("(b) Rays of one screen cell")
    return figure


def _of(rows: Rows, what: str) -> Rows:
    return [row for row in rows if row["what"] == what]


def _draw_areas(axes: Any, rows: Rows, part: str) -> None:
    from matplotlib.colors import to_rgb

    style.no_frame(axes)
    left, right, low, high = FRAME
    y, x = np.mgrid[high:low:600j, left:right:938j]
    image = np.ones((*x.shape, 3))
    planes = _of(rows, "half-space")
    for number, plane in reversed(list(enumerate(planes))):
        outside = plane["a"] * x + plane["b"] * y < plane["d"]
        image[outside] = to_rgb(DARK if part == "triangle" and number == 0 else LIGHT)
    axes.imshow(image, extent=FRAME, interpolation="antialiased")
    if part == "cell":
        (eye,) = _of(rows, "eye")
        axes.plot(eye["a"], eye["b"], "o", color=style.INK, markersize=6)
        axes.text(eye["a"] - 0.06, eye["b"] + 0.2, "eye", ha="center", fontsize=8)
    for row in _of(rows, "sphere"):
        ring = np.linspace(0.0, 2.0 * np.pi, 200)
        color = style.INK if row["rejected"] else style.BLUE
        circle = row["a"] + row["c"] * np.cos(ring), row["b"] + row["c"] * np.sin(ring)
        width, dash = (0.7, "--") if row["rejected"] else (1.2, "-")
        axes.plot(*circle, color=color, linewidth=width, linestyle=dash)
    for row in _of(rows, "triangle"):
        look = {"color": style.INK if row["rejected"] else style.VERMILION, "linewidth": 2.6}
        axes.plot((row["a"], row["c"]), (row["b"], row["d"]), solid_capstyle="round", **look)
        at = 0.5 * (row["a"] + row["c"]), 0.5 * (row["b"] + row["d"])
        normal = np.array((row["d"] - row["b"], row["a"] - row["c"]))
        normal = normal / np.linalg.norm(normal) * (0.24 if normal[0] < 0 else -0.24)
        axes.text(at[0] + normal[0], at[1] + normal[1], f"({row['number'] + 1})", ha="center", va="center", fontsize=8)
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)


def _draw_list(axes: Any, rows: Rows) -> None:
    style.no_frame(axes)
    elements = sorted(_of(rows, "sphere") + _of(rows, "triangle"), key=lambda row: row["element"])
    for row in elements:
        _draw_cell(axes, row)
    axes.set_xlim(-0.6, len(elements) - 0.4)
    axes.set_ylim(-0.9, 0.8)
    head = sum(row["before_head"] for row in elements)
    last = head == len(elements)
    told = "no element is left" if last else f"the head is element {head} of {len(elements)}"
    axes.set_xlabel(told, fontsize=8)


def _draw_cell(axes: Any, row: Row) -> None:
    name = f"({row['number'] + 1})" if row["what"] == "triangle" else f"S{row['number']}"
    color = style.FAINT if row["before_head"] else style.BLUE if row["what"] == "sphere" else style.VERMILION
    box = {"boxstyle": "square,pad=0.45" if row["what"] == "triangle" else "circle,pad=0.3", "edgecolor": color}
    face = LIGHT if row["before_head"] else "white"
    axes.text(row["element"], 0, name, ha="center", va="center", fontsize=7.5, bbox={**box, "facecolor": face})
    if row["rejected"]:
        axes.text(row["element"], -0.72, "out", ha="center", va="center", fontsize=7.5, color=style.FAINT)


EXPERIMENT = Experiment(
    "bsh-figure-3",
    "Figure 3: list elements that heads skip",
    "Five triangles seen as lines, the list along +x of six, with the library's own heads (`regular`, `leaf`). (a) "
    "Dark grey lies behind the triangle that the rays leave, light grey behind one of the further planes. (b) Light "
    "grey lies outside the planes around the cell's rays. Dashed spheres and black lines are rejected by at least one "
    "plane, the others are not. Below, the list: `out` is rejected; grey elements come before the head and are "
    "skipped. An element that is out but stands behind the head is still visited.",
    cases,
    measure,
    plot,
    alt="Two drawings of five triangles in spheres, cut by planes around the rays that leave one triangle and around "
    "those of a screen cell; below each the list, in grey the elements that stand before the head and are "
    "skipped.",
)
