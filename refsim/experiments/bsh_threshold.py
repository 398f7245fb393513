"""What "big enough compared to the node's dimensions" does (BSH-E8): the threshold from which a triangle stays at its
node, against nodes, tests, list length and bytes. Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies,
section 2.2, which names no number."""

from __future__ import annotations

from typing import Any

from refsim.experiments import style
from refsim.experiments.bsh_runs import head, hierarchy_of, lists_of, missing_row, ray_counts, run
from refsim.experiments.registry import Case, Experiment, Rows
from refsim.experiments.runs import MISSING, mesh_state

SCENES = ("cubes", "suzanne", "bunny", "dragon_res3")
THRESHOLDS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def cases(quick: bool) -> list[Case]:
    """A case a scene and threshold."""
    size, scenes = (64, SCENES[:3]) if quick else (256, SCENES)
    thresholds = THRESHOLDS[1::4] if quick else THRESHOLDS
    return [
        {"name": name, "threshold": threshold, "size_px": size, "mesh": mesh_state(name)}
        for name in scenes for threshold in thresholds
    ]  # fmt: skip


def measure(name: str, threshold: float, size_px: int, mesh: str) -> Rows:
    """One row."""
    from refsim.papers.sphere_hierarchy.byte_layout import bytes_of

    if mesh == MISSING:
        return [{**missing_row(name, size_px), "threshold": threshold}]
    found = run(name, size_px, threshold=threshold)
    lists = lists_of(name, True, 6, "earliest_first", None, threshold)
    return [
        {
            **head(name, size_px, found),
            "threshold": threshold,
            "spheres": len(hierarchy_of(name, True, threshold)),
            "elements_a_list": lists.length(0),
            "bytes": bytes_of(lists).total,
            **ray_counts(found),
        }
    ]


def plot(rows: Rows) -> Any:
    """Nodes, tests and length, each against its value at 0.5."""
    figure = style.new_figure(3.3)
    shown = (("nodes_per_ray", "Nodes a ray"), ("tests_per_ray", "Triangle tests a ray"),
             ("elements_a_list", "Elements of a list"))  # fmt: skip
    panels = figure.subplots(1, 3)
    present = [row for row in rows if row["triangles"] != MISSING]
    absent = sorted({row["scene"] for row in rows if row["triangles"] == MISSING})
    for axes, (key, title) in zip(panels, shown, strict=True):
        for color, marker, scene in zip(style.CYCLE, style.MARKERS, SCENES, strict=False):
            own = [row for row in present if row["scene"] == scene]
            if own:
                least = min(row[key] for row in own)
                y = [row[key] / least for row in own]
                axes.plot([row["threshold"] for row in own], y, marker=marker, color=color, label=scene, markersize=4)
        axes.set_title(title)
        axes.set_xlabel("threshold")
    panels[0].set_ylabel("against the least of its scene")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    if absent:
        panels[0].text(0.05, 0.9, f"missing: {', '.join(absent)}", transform=panels[0].transAxes, color=style.FAINT)
    return figure


EXPERIMENT = Experiment(
    "bsh-threshold",
    "The threshold from which a triangle stays at its node",
    "256² (64² with `--quick`) eye rays and their shadow rays, ground, six lists. A triangle stays at a node where "
    "its own sphere would have a radius of at least the threshold times the node's. The lower it is, the fewer "
    "spheres, and the more triangles a ray tests. Bytes are in the table.",
    cases,
    measure,
    plot,
    alt="Three charts over the threshold, a line a scene: nodes a ray and tests a ray, high at the lowest threshold "
    "and flat in the middle, and the elements of a list, which grow.",
)
