"""Table 3: every scene whose mesh is at hand, in counts: ray casting, shadow casting, and single reflections.

Our method and the previous one, `geometry_shader` and `fragment_grid`, on the same grid. The paper's milliseconds stand
beside the counts, not among them. Recursive Ray Tracing in Geometry Shader, section 5.
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
    VIEWS,
    head,
    ray_counts,
    run,
    scene_of,
    view_state,
)
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING

# The paper's scene, our view of it, and what our scene is
SAME, STAND_IN = "the paper's mesh", "a stand-in, not the paper's mesh"
SCENES = {
    "Cornell Box": ("cornell box", "as many triangles, made here"),
    "Cornell Knot": ("knot from above", "as many triangles, made here"),
    "Dragon": ("dragon", SAME),
    "Fairy Forest": ("", MISSING),
    "Happy Buddha": ("buddha", STAND_IN),
    "Horse": ("horse", SAME),
    "Stanford Bunny": ("bunny", SAME),
}
METHODS = {GEOMETRY_SHADER: True, FRAGMENT_GRID: False}


def cases(quick: bool) -> list[Case]:
    """A case a scene, mode and method; the scene of which there is no mesh has one too."""
    size = 64 if quick else published.SIDE
    found = []
    for scene, (view, _) in SCENES.items():
        state = view_state(view) if view else MISSING
        frame = {"published_scene": scene, "view": view, "mesh": state, "size_px": size}
        if state == MISSING:
            found.append({**frame, "mode": "RC", "method": GEOMETRY_SHADER})
            continue
        found += [{**frame, "mode": mode, "method": method} for mode in MODES for method in METHODS]
    return found


def measure(published_scene: str, view: str, mesh: str, size_px: int, mode: str, method: str) -> Rows:
    """One row; a scene without mesh reads `missing`."""
    said = published.TABLE_3[published_scene][0]
    first = {"published_scene": published_scene, "published_triangles": said}
    if mesh == MISSING:
        scene = VIEWS[view].scene if view else ""
        line = {"mesh": MISSING, "view": view, "scene": scene, "triangles": MISSING, "size_px": size_px}
        return [{**first, **line}]
    found = run(method, view, size_px, **MODES[mode])
    return [
        {
            **first,
            "mesh": SCENES[published_scene][1],
            **head(view, size_px, found),
            "mode": mode,
            "method": method,
            **ray_counts(found),
            **moved(found, size_px * size_px, len(scene_of(view).lights)),
            "published_ms": published.milliseconds(published_scene, mode, METHODS[method]),
        }
    ]


def steps(row: Row) -> int:
    """Cells visited and triangles tested."""
    return int(row["cells"] + row["triangle_tests"])


def ratios(rows: Rows) -> Rows:
    """A row a scene and mode: both methods against each other, and each mode against ray casting."""
    found = []
    for scene in dict.fromkeys(row["published_scene"] for row in rows if row["triangles"] != MISSING):
        own = {(row["mode"], row["method"]): row for row in rows if row["published_scene"] == scene}
        for mode in MODES:
            ours, other, first = own[mode, GEOMETRY_SHADER], own[mode, FRAGMENT_GRID], own["RC", GEOMETRY_SHADER]
            found.append(
                {
                    "published_scene": scene,
                    "mesh": ours["mesh"],
                    "mode": mode,
                    "published_ms_ratio_of_methods": round(ours["published_ms"] / other["published_ms"], 3),
                    "steps_ratio_of_methods": round(steps(ours) / steps(other), 3),
                    "published_ms_ratio_to_rc": round(ours["published_ms"] / first["published_ms"], 3),
                    "steps_ratio_to_rc": round(steps(ours) / steps(first), 3),
                    "rays_ratio_to_rc": round(ours["rays"] / first["rays"], 3),
                }
            )
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Counts, and their quotients beside the published ones."""
    return {"gsr-table-3": rows, "gsr-table-3-ratios": ratios(rows)}


def plot(rows: Rows) -> Any:
    """Left: published milliseconds over our counts. Right: quotients of the two methods."""
    figure = style.new_figure(4.3)
    left, right = figure.subplots(1, 2, width_ratios=(1.05, 1.0))
    _draw_counts(left, [row for row in rows if row.get("method") == GEOMETRY_SHADER])
    _draw_ratios(right, ratios(rows))
    absent = [row["published_scene"] for row in rows if row["triangles"] == MISSING]
    figure.supxlabel(f"missing: {', '.join(absent)}" if absent else "", fontsize=8, color="#555555")
    return figure


def _draw_counts(axes: Any, rows: Rows) -> None:
    scenes = list(dict.fromkeys(row["published_scene"] for row in rows))
    for k, scene in enumerate(scenes):
        own = [row for row in rows if row["published_scene"] == scene]
        look = {"color": style.CYCLE[k], "marker": style.MARKERS[k], "label": scene}
        if own[0]["mesh"] == STAND_IN:
            look |= {"fillstyle": "none", "label": f"{scene} (stand-in)"}
        axes.plot([steps(row) / 1e6 for row in own], [row["published_ms"] for row in own], **look)
        first = steps(own[0]) / 1e6, own[0]["published_ms"]
        axes.annotate("RC", first, (0, -10), textcoords="offset points", fontsize=6.5)
    axes.set_xscale("log")
    axes.set_yscale("log")
    style.plain_ticks(axes.yaxis)
    style.plain_ticks(axes.xaxis)
    axes.set_xlabel("millions of cells visited + triangles tested, counted here")
    axes.set_ylabel("milliseconds, the paper's (GeForce 8600)")
    axes.set_title("Our method: RC, SC, RT")
    axes.legend(fontsize=7.5, loc="lower right")


def _draw_ratios(axes: Any, found: Rows) -> None:
    scenes = list(dict.fromkeys(row["published_scene"] for row in found))
    for k, mode in enumerate(MODES):
        own = [row for row in found if row["mode"] == mode]
        places = [i + (k - 1) * 0.26 for i in range(len(scenes))]
        heights = [row["published_ms_ratio_of_methods"] for row in own]
        axes.bar(places, heights, 0.24, color=style.CYCLE[k], label=f"{mode}, published ms")
        counted = [row["steps_ratio_of_methods"] for row in own]
        label = "cells + tests, counted here" if k == 0 else None
        axes.plot(places, counted, "_", color=style.BLACK, markersize=9, markeredgewidth=1.8, label=label)
    axes.set_xticks(range(len(scenes)), [scene.replace(" ", "\n") for scene in scenes], fontsize=8)
    axes.grid(False, axis="x")
    axes.set_ylim(0, 1.35 * max(row["published_ms_ratio_of_methods"] for row in found))
    axes.set_ylabel("geometry shader ÷ fragment shader")
    axes.set_title("Both methods")
    axes.legend(fontsize=7.5, loc="upper right")


EXPERIMENT = Experiment(
    "gsr-table-3",
    "Table 3: all scenes, in counts beside the paper's milliseconds",
    "512² (64² with `--quick`), one light, default grid, no refraction; RC: ray casting, SC: shadow casting, RT: with "
    "single reflections. Bare meshes of a mirroring metal; the paper gives neither cameras nor lights, so counts of "
    "one scene can be compared with each other, not times with counts. The Happy Buddha here has 100,000 triangles and "
    "is not the paper's mesh; scenes without a mesh read `missing`. Left: each scene's RC, SC, RT. Right: bars are "
    "quotients of the paper's times, black dashes those of our counts: both methods search the same grid with the same "
    "rays.",
    cases,
    measure,
    plot,
    tables,
    alt="Left, published milliseconds against cells and tests counted here, a line a scene through ray casting, "
    "shadow casting and reflections; right, bars of published times of both methods, all longer than the dashes "
    "of our counts, which are equal.",
)
