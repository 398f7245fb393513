"""Figure 1: a hierarchy, and the list that it becomes, with escape links. Drawn from what the builder makes of nine
triangles. Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from typing import Any

from refsim.experiments import style
from refsim.experiments.bsh_small import NINE, lines_scene
from refsim.experiments.registry import Case, Experiment, Row, Rows


def cases(quick: bool) -> list[Case]:
    """One."""
    return [{"lists": 1, "order": "earliest_first"}]


def measure(lists: int, order: str) -> Rows:
    """A row an element, as it stands in the list."""
    from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
    from refsim.papers.sphere_hierarchy.lists import build_lists

    hierarchy = build_hierarchy(lines_scene(NINE))
    made = build_lists(hierarchy, lists, order)
    node_at, triangle_at = made.node_at[0].tolist(), made.triangle_at[0].tolist()
    element = {at: ("sphere", k) for k, at in enumerate(node_at)} | {
        at: ("triangle", k) for k, at in enumerate(triangle_at)
    }
    rows: Rows = []
    for at in range(len(made.escape)):
        kind, number = element[at]
        above = int(hierarchy.parent[number] if kind == "sphere" else hierarchy.owner[number])
        escape = int(made.escape[at])
        rows.append(
            {
                "element": at,
                "kind": kind,
                "number": number,
                "parent_element": node_at[above] if above >= 0 else "",
                "escape_index": escape,
                "leads_to": at + escape if escape > 0 else "end",
                "radius": round(float(hierarchy.spheres[number, 3]), 6) if kind == "sphere" else "",
            }
        )
    return rows


def plot(rows: Rows) -> Any:
    """The tree above; the array below, its escape links dotted."""
    figure = style.new_figure(5.2)
    tree, line = figure.subplots(2, 1, height_ratios=(1.25, 1.0))
    _draw_tree(tree, rows)
    _draw_list(line, rows)
    return figure


def name_of(row: Row) -> str:
    """S0, S1, … and T0, T1, …."""
    return f"{'S' if row['kind'] == 'sphere' else 'T'}{row['number']}"


def depth_of(rows: Rows, row: Row) -> int:
    """Nodes above an element."""
    return 0 if row["parent_element"] == "" else 1 + depth_of(rows, rows[int(row["parent_element"])])


def _draw_element(axes: Any, x: float, y: float, row: Row) -> None:
    sphere = row["kind"] == "sphere"
    edge, face = (style.BLUE, "#dcebf5") if sphere else (style.VERMILION, "#fbe6d9")
    axes.plot(x, y, "o" if sphere else "s", markersize=17, markeredgecolor=edge, markerfacecolor=face)
    axes.text(x, y, name_of(row), ha="center", va="center", fontsize=7.5)


def _draw_tree(axes: Any, rows: Rows) -> None:
    style.no_frame(axes)
    place: dict[int, tuple[float, float]] = {}
    depth = {row["element"]: depth_of(rows, row) for row in rows}
    leaves = [row["element"] for row in rows if row["kind"] == "triangle"]
    step = (len(rows) - 1) / max(len(leaves) - 1, 1)
    for row in reversed(rows):
        at = row["element"]
        below = [place[r["element"]][0] for r in rows if r["parent_element"] == at]
        place[at] = (sum(below) / len(below) if below else leaves.index(at) * step, -depth[at])
    for row in rows:
        if row["parent_element"] != "":
            (x, y), (to_x, to_y) = place[row["element"]], place[int(row["parent_element"])]
            axes.plot((x, to_x), (y, to_y), color=style.FAINT, linewidth=1.0, zorder=0)
    for row in rows:
        _draw_element(axes, *place[row["element"]], row)
    axes.set_xlim(-0.8, len(rows) - 0.2)
    axes.set_ylim(-max(depth.values()) - 0.5, 0.5)
    axes.set_title("(a) Hierarchy: spheres S, triangles T")


def _draw_list(axes: Any, rows: Rows) -> None:
    from matplotlib.patches import FancyArrowPatch

    style.no_frame(axes)
    for row in rows:
        at, escape = row["element"], row["escape_index"]
        _draw_element(axes, at, 0.0, row)
        axes.text(at, -0.62, f"{escape}", ha="center", va="center", fontsize=8)
        if row is not rows[-1]:
            look: Any = {"arrowstyle": "-|>", "mutation_scale": 6, "color": style.FAINT, "linewidth": 0.9}
            axes.add_patch(FancyArrowPatch((at + 0.31, 0.0), (at + 0.69, 0.0), **look))
        if row["kind"] == "sphere":
            target = row["leads_to"] if row["leads_to"] != "end" else len(rows)
            bend = f"arc3,rad={-0.9 / (target - at) ** 0.5:.3f}"
            dots: Any = {"arrowstyle": "-|>", "mutation_scale": 8, "linestyle": (0, (1, 1.6)), "linewidth": 1.3}
            axes.add_patch(
                FancyArrowPatch((at, 0.34), (target, 0.34), connectionstyle=bend, color=style.PURPLE, **dots)
            )
    axes.text(len(rows), 0.0, "end", ha="center", va="center", fontsize=8, color=style.FAINT)
    axes.text(-0.75, -0.95, "relative escape index", fontsize=8, color=style.FAINT, va="center")
    axes.set_xlim(-0.8, len(rows) + 0.5)
    axes.set_ylim(-1.1, 2.3)
    axes.set_title("(b) Traversal list, escape links of its spheres dotted")


EXPERIMENT = Experiment(
    "bsh-figure-1",
    "Figure 1: a hierarchy, and the list that it becomes",
    "Nine triangles, the builder of section 2.2, one list along +x, earliest first. (a) The hierarchy; what a sphere "
    "holds hangs below it. (b) The list in memory: each element is followed by its first child or its super-sibling; "
    "a dotted link leads where the walk goes on when a ray misses the sphere. Below each element its relative escape "
    "index as stored: 1 a triangle, 0 the last primitive, -1 an internal node with no super-sibling; such links lead "
    "to the end.",
    cases,
    measure,
    plot,
    alt="Above, a tree of spheres with triangles as leaves; below, the same as a row of elements in depth-first "
    "order, each sphere with a dotted arc to where a ray goes on that misses it, and the escape indices as "
    "stored.",
)
