"""Section 6: "moving the light source in the scene incurs high variability in rendering times".

The light goes once round each scene (`refsim.scene.animation.moving_light`). Counted at each place: what the shadow
rays of the eye's hits visit and test in the grid; eye rays stay the same. Recursive Ray Tracing in Geometry Shader.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from refsim.experiments import style
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, MODES, head, run, scene_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.image import encode_srgb
from refsim.results import RayKind, Trace
from refsim.scene.animation import moving_light

VIEWS = ("knot", "knight in box")
QUICK_VIEWS = ("knot",)


def cases(quick: bool) -> list[Case]:
    """A case a view."""
    size, steps = (64, 12) if quick else (256, 48)
    views = QUICK_VIEWS if quick else VIEWS
    return [{"view": view, "size_px": size, "steps": steps} for view in views]


@lru_cache(maxsize=8)
def lit(view: str, size: int, steps: int, step: int) -> Trace:
    """The shadow-casted picture with the light at one place of its way."""
    light = moving_light(scene_of(view), steps)[step]
    return run(GEOMETRY_SHADER, view, size, **{**MODES["SC"], "lights": (light,)})


def measure(view: str, size_px: int, steps: int) -> Rows:
    """A row a place of the light."""
    rows = []
    lights = moving_light(scene_of(view), steps)
    for step, light in enumerate(lights):
        found = lit(view, size_px, steps, step)
        eye, second = found.generations
        shadow = second.kind == RayKind.SHADOW
        number = int(shadow.sum())
        cells, tests = (int(second.per_ray[name][shadow].sum()) for name in ("cells", "triangle_tests"))
        rows.append(
            {
                **head(view, size_px, found),
                "step": step,
                "steps": steps,
                **{f"light_{axis}": round(part, 6) for axis, part in zip("xyz", light.position, strict=True)},
                "eye_cells_and_tests": int(eye.per_ray["cells"].sum() + eye.per_ray["triangle_tests"].sum()),
                "shadow_rays": number,
                "shadow_rays_that_hit_percent": round(100.0 * float((second.hits.triangle[shadow] >= 0).mean()), 3),
                "shadow_cells": cells,
                "shadow_tests": tests,
                "cells_per_shadow_ray": round(cells / number, 4),
                "tests_per_shadow_ray": round(tests / number, 4),
            }
        )
    return rows


def cost(row: Row) -> int:
    """Cells and tests of all shadow rays."""
    return int(row["shadow_cells"] + row["shadow_tests"])


def summary(rows: Rows) -> Rows:
    """The cheapest and the dearest place of each view."""
    found = []
    for view in dict.fromkeys(row["view"] for row in rows):
        own = sorted((row for row in rows if row["view"] == view), key=cost)
        low, high = own[0], own[-1]
        whole = [cost(row) + row["eye_cells_and_tests"] for row in own]
        found.append(
            {
                "view": view,
                "cheapest_step": low["step"],
                "cheapest_shadow_cells_and_tests": cost(low),
                "dearest_step": high["step"],
                "dearest_shadow_cells_and_tests": cost(high),
                "shadow_ratio": round(cost(high) / cost(low), 3),
                "picture_ratio": round(max(whole) / min(whole), 3),
            }
        )
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All places, and the extremes."""
    return {"gsr-moving-light": rows, "gsr-moving-light-summary": summary(rows)}


def plot(rows: Rows) -> Any:
    """A line a view: cost along the way, and the cheapest and the dearest picture."""
    extremes = summary(rows)
    figure = style.new_figure(2.6 * len(extremes))
    grid = figure.subplots(len(extremes), 3, squeeze=False, width_ratios=(1.8, 1, 1))
    for line, found in zip(grid, extremes, strict=True):
        own = [row for row in rows if row["view"] == found["view"]]
        _draw_way(line[0], own, found)
        for axes, which in zip(line[1:], ("cheapest", "dearest"), strict=True):
            row = own[found[f"{which}_step"]]
            style.no_frame(axes)
            image = lit(row["view"], row["size_px"], row["steps"], row["step"]).image
            assert image is not None
            axes.imshow(encode_srgb(image), interpolation="antialiased")
            axes.set_title(f"{which}: place {row['step']}")
            axes.set_xlabel(f"{cost(row) / row['shadow_rays']:.1f} cells and tests a shadow ray", fontsize=8)
    return figure


def _draw_way(axes: Any, rows: Rows, found: Row) -> None:
    steps = [row["step"] for row in rows]
    for name, color, marker in (("cells", style.ORANGE, "o"), ("tests", style.BLUE, "s")):
        values = [row[f"{name}_per_shadow_ray"] for row in rows]
        axes.plot(steps, values, color=color, marker=marker, markersize=3, label=name)
    both = [row["cells_per_shadow_ray"] + row["tests_per_shadow_ray"] for row in rows]
    axes.plot(steps, both, color=style.BLACK, label="both")
    for which in ("cheapest", "dearest"):
        step = found[f"{which}_step"]
        axes.plot(step, both[step], "o", markersize=10, fillstyle="none", color=style.VERMILION)
    axes.set_ylim(0, None)
    axes.set_xlabel("place of the light on its way round")
    axes.set_ylabel("a shadow ray")
    axes.set_title(f"{found['view']}: × {found['shadow_ratio']:.2f} (picture × {found['picture_ratio']:.2f})")
    axes.legend(loc="lower left", ncols=3, fontsize=8)


EXPERIMENT = Experiment(
    "gsr-moving-light",
    "Section 6: the cost of shadow rays as the light moves",
    "256² (64² and the knot alone with `--quick`), the default grid. The light goes once round the scene, up and down "
    "twice; grid cells that a shadow ray visits and triangles that it tests, on average. Circles mark the places whose "
    "pictures stand beside. The factors in the titles are dearest to cheapest place: of the shadow rays alone, and of "
    "eye and shadow rays together.",
    cases,
    measure,
    plot,
    tables,
    alt="For each scene curves of cells and tests a shadow ray over the places of the light on its way round, and two "
    "pictures, at the cheapest and at the dearest place.",
)
