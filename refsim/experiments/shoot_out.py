"""All methods on identical rays and scenes, from the most coherent rays to random ones, from 100 to 871,414 triangles.

Steps are tests of triangles and of what encloses them (cones, cells, boxes, spheres), counted by the methods.
Every ray against every triangle is not run above `shoot_out_runs.CAP` triangles; those rows say so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from refsim.experiments import hre_claims_shoot_out, style
from refsim.experiments import shoot_out_runs as runs
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state, scene_named

TILE = 8


def cases(quick: bool) -> list[Case]:
    """A case a scene and spread: all methods shoot the rays of one process."""
    scenes, spreads = (runs.QUICK_SCENES, runs.QUICK_SPREADS) if quick else (runs.SCENES, runs.SPREADS)
    size = 32 if quick else 128
    return [
        {"scene": scene, "mesh": mesh_state(scene), "size_px": size, "spread": spread}
        for scene in scenes for spread in spreads
    ]  # fmt: skip


def measure(scene: str, mesh: str, size_px: int, spread: float) -> Rows:
    """A row a method; `same_hits` compares triangle and t, bit by bit, with the six lists'."""
    head: Row = {"scene": scene, "triangles": MISSING, "size_px": size_px, "spread": spread}
    if mesh == MISSING:
        return [{**head, "method": name} for name in runs.CONTENDERS]
    body = scene_named(scene)
    rays = runs.rays_of(scene, size_px, spread)
    head |= {"triangles": len(body), "angle_in_tile_deg": round(runs.tile_angle(rays, TILE), 3)}
    expected = runs.hits_by_pixel(runs.shoot("six lists", scene, size_px, spread), len(rays))
    head["rays_that_hit_percent"] = round(100.0 * float(np.mean(expected[0] >= 0)), 3)
    rows: Rows = []
    for name in runs.CONTENDERS:
        if runs.is_capped(name, body):
            rows.append({**head, "method": name, "capped": f"above {runs.CAP} triangles"})
            continue
        found = runs.shoot(name, scene, size_px, spread)
        same = all(np.array_equal(a, b) for a, b in zip(runs.hits_by_pixel(found, len(rays)), expected, strict=True))
        row = {**head, "method": name, "capped": "", "same_hits": int(same), **runs.work_of(found)}
        built = runs.elements_built(name, scene)
        again = round(row["steps_per_ray"] + built / len(rays), 3)
        rows.append({**row, "elements_built": built, "rebuilt_steps_per_ray": again})
    return rows


COSTS = {"kept": "steps_per_ray", "rebuilt": "rebuilt_steps_per_ray"}
SAME = "fragment shader, grid"  # the steps of the other grid


def winners(rows: Rows) -> Rows:
    """The method with the fewest steps a ray for each scene and spread, and by how much the next one has more: with
    structures that are kept, and with ones that are built anew for these rays, an element a step."""
    found: Rows = []
    present = [row for row in rows if row.get("steps_per_ray", "") != "" and row["method"] != SAME]
    for structure, cost in COSTS.items():
        for key in dict.fromkeys((row["scene"], row["spread"]) for row in present):
            own = sorted((row for row in present if (row["scene"], row["spread"]) == key), key=lambda r: r[cost])
            first, second = own[0], own[1]
            found.append({
                "structure": structure, "scene": key[0], "triangles": first["triangles"], "spread": key[1],
                "method": first["method"], "steps_per_ray": first[cost], "second": second["method"],
                "second_times_as_many": round(second[cost] / first[cost], 3),
            })  # fmt: skip
    return found


def crossings(rows: Rows) -> Rows:
    """Between which triangle counts one method overtakes another, at each spread: straight lines on log axes."""
    found: Rows = []
    pairs = (
        ("Hierarchical Ray Engine", "brute force"), ("geometry shader, grid", "Hierarchical Ray Engine"),
        ("six lists", "Hierarchical Ray Engine"), ("six lists", "geometry shader, grid"), ("six lists", "one list"),
    )  # fmt: skip
    for structure, cost in COSTS.items():
        for spread in dict.fromkeys(row["spread"] for row in rows):
            for winner, other in pairs:
                lines = [_steps(rows, name, spread, cost) for name in (winner, other)]
                shared = sorted(set(lines[0]) & set(lines[1]))
                gains = [(n, float(np.log(lines[1][n] / lines[0][n]))) for n in shared]
                head = {"structure": structure, "spread": spread, "method": winner, "against": other}
                found.append({**head, **_crossing(gains)})
    return found


def _steps(rows: Rows, method: str, spread: float, cost: str) -> dict[int, float]:
    return {
        row["triangles"]: row[cost] for row in rows
        if row["method"] == method and row["spread"] == spread and row.get(cost, "") != ""
    }  # fmt: skip


def _crossing(gains: list[tuple[int, float]]) -> Row:
    if not gains:
        return {"wins": "", "from_triangles": ""}
    up = [(a, b) for a, b in pairwise(gains) if (a[1] > 0) != (b[1] > 0)]
    wins = "always" if all(g > 0 for _, g in gains) else "never" if all(g <= 0 for _, g in gains) else "beyond"
    if wins != "beyond":
        return {"wins": wins, "from_triangles": ""}
    (n0, g0), (n1, g1) = up[-1]
    at = math.exp(math.log(n0) + (math.log(n1) - math.log(n0)) * g0 / (g0 - g1))
    return {"wins": "beyond" if g1 > 0 else "below", "from_triangles": round(at)}


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All runs; who wins where; where one overtakes another; what a paper says of that."""
    found = {"shoot-out": rows, "shoot-out-winners": winners(rows), "shoot-out-crossings": crossings(rows)}
    return {**found, "shoot-out-hre": hre_claims_shoot_out.claims(rows)}


COLORS = dict(zip(runs.CONTENDERS, (style.BLACK, style.FAINT, style.VERMILION, style.BLUE, style.SKY, style.PURPLE,
                                    style.ORANGE, style.GREEN), strict=True))  # fmt: skip
# What fits a cell of a map
SHORT = {
    "Hierarchical Ray Engine": "Hierarchical", "geometry shader, grid": "grid (geometry)",
    "fragment shader, grid": "grid (fragment)", "geometry shader, boxes": "boxes",
}  # fmt: skip
SIGNS = dict(zip(runs.CONTENDERS, ("o", "P", "s", "^", "v", "D", "<", ">"), strict=True))


def plot(rows: Rows) -> Any:
    """Steps a ray over triangles for three spreads, and below them the map of winners."""
    figure = style.new_figure(8.6)
    spreads = list(dict.fromkeys(row["spread"] for row in rows))
    shown = [spreads[0], spreads[len(spreads) // 2], spreads[-1]]
    grid = figure.add_gridspec(3, 3, height_ratios=(1.25, 1, 1))
    first: Any = None
    for k, spread in enumerate(shown):
        axes = figure.add_subplot(grid[0, k], sharey=first)
        first = first or axes
        _curves(axes, [row for row in rows if row["spread"] == spread], spread)
    first.set_ylabel("steps a ray")
    figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    table = winners(rows)
    for k, (structure, title) in enumerate((("kept", "Fewest steps, structures kept"),
                                            ("rebuilt", "Fewest steps, structures built anew for these rays"))):
        axes = figure.add_subplot(grid[1 + k, :])
        axes.set_title(title)
        winner_map(axes, [row for row in table if row["structure"] == structure], "steps a ray of the best; the next")
    return figure


def _curves(axes: Any, rows: Rows, spread: float) -> None:
    for name in runs.CONTENDERS:
        own = [row for row in rows if row["method"] == name and row.get("steps_per_ray", "") != ""]
        # Both grids take the same steps: the later one is drawn on top, smaller
        size = 4.0 if name == "fragment shader, grid" else 5.5
        axes.loglog([row["triangles"] for row in own], [row["steps_per_ray"] for row in own], color=COLORS[name],
                    marker=SIGNS[name], markersize=size, linewidth=1.3, label=name)  # fmt: skip
    angle = next((row["angle_in_tile_deg"] for row in rows if "angle_in_tile_deg" in row), 0.0)
    axes.set_title(f"spread {spread:g}\n({angle:.{0 if angle >= 10 else 1}f}° in a tile)")
    axes.set_xlabel("triangles")
    style.count_ticks(axes.xaxis)


def winner_map(axes: Any, table: Rows, label: str) -> None:
    """A cell a scene and spread: coloured and named by its winner."""
    from matplotlib.patches import Rectangle

    triangles = sorted({row["triangles"] for row in table})
    spreads = sorted({row["spread"] for row in table})
    for row in table:
        x, y = triangles.index(row["triangles"]), spreads.index(row["spread"])
        axes.add_patch(Rectangle((x, y), 1, 1, facecolor=COLORS[row["method"]], alpha=0.28, edgecolor="white"))
        best, second = (SHORT.get(row[name], row[name]) for name in ("method", "second"))
        axes.text(x + 0.5, y + 0.62, best, ha="center", va="center", fontsize=7.5, fontweight="bold")
        value = next(v for k, v in row.items() if k.endswith("_per_ray") or k == "milliseconds")
        text = f"{value:.3g}; {second} × {row['second_times_as_many']:.2f}"
        axes.text(x + 0.5, y + 0.28, text, ha="center", va="center", fontsize=6.8)
    axes.set_xlim(0, len(triangles))
    axes.set_ylim(0, len(spreads))
    axes.set_xticks([k + 0.5 for k in range(len(triangles))], [f"{n:,}" for n in triangles])
    axes.set_yticks([k + 0.5 for k in range(len(spreads))], [f"{s:g}" for s in spreads])
    axes.set_xlabel(f"triangles ({label})")
    axes.set_ylabel("spread")
    axes.grid(False)


EXPERIMENT = Experiment(
    "shoot-out",
    "All methods on the same rays: who needs the fewest steps, and where that changes",
    "Steps are tests of triangles and of what encloses them. Spread 0 are a camera's rays, 1 random lines through the "
    f"scene. Methods that test every triangle against rays or tiles are run up to {runs.CAP:,} triangles. Both grids "
    "take the same steps and are one in the maps. Building counts an element written (cell, reference, box, sphere, "
    "list element) as a step; the Ray Engine builds nothing, the hierarchical one a sphere a triangle.",
    cases,
    measure,
    plot,
    tables,
    alt="Above, three charts of the steps a ray over the number of triangles, on logarithmic axes, a line a method, "
    "for camera rays, mixed rays and random rays; below, two maps whose cells name the method with the fewest steps "
    "for each number of triangles and each spread of the rays: with structures kept, and with structures built anew.",
)
