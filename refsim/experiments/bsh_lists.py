"""One, two, six and eight lists, both orders, from several cameras: what ordering the lists gains.

"We have ... compared our 6-traversal-list based implementation with the simpler 1-traversal-list case [9], improved
with each of the optimizations mentioned earlier still working in that context. The gains of our approach range from 5%
to 15% on our test scenes, the more complex a scene the higher the gain" (section 4)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import style
from refsim.experiments.bsh_runs import CAMERAS, ENABLED, head, missing_row, ray_counts, rays_of, run
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state

SCENES = ("cubes", "suzanne", "bunny", "buddha_100k", "dragon")
LISTS = (1, 2, 6, 8)
SEEN = ("front", "above", "right", "back", "left", "close")
ORDERS = ("earliest_first", "latest_last")
# What works with that many lists: culling needs six or eight; a single list's heads have no further planes
STILL_WORKING: dict[int, dict[str, Any]] = {
    1: {**ENABLED, "culling": None}, 2: {**ENABLED, "culling": None}, 6: ENABLED, 8: {**ENABLED, "culling": "octant"},
}  # fmt: skip
PARTS = ("plain", "all on", "all on, climbing")


def cases(quick: bool) -> list[Case]:
    """A case a scene and part."""
    return [
        {"name": name, "part": part, "cameras": 2 if quick else len(SEEN), "size_px": 48 if quick else 160,
         "mesh": mesh_state(name)}
        for name in (SCENES[:3] if quick else SCENES) for part in PARTS
    ]  # fmt: skip


def measure(name: str, part: str, cameras: int, size_px: int, mesh: str) -> Rows:
    """A row an order, number of lists and camera; optimisations are run from the front alone."""
    if mesh == MISSING:
        return [{**missing_row(name, size_px), "part": part}]
    rows: Rows = []
    for order in ORDERS if part == "plain" else ORDERS[:1]:
        for lists in LISTS:
            options = {} if part == "plain" else dict(STILL_WORKING[lists])
            if part.endswith("climbing"):
                options["head_rule"] = "climb"
            for camera in SEEN[: cameras if part == "plain" else 1]:
                rays = rays_of(name, size_px, *CAMERAS[camera])
                found = run(name, size_px, rays=rays, lists=lists, order=order, **options)
                rows.append(
                    {**head(name, size_px, found), "camera": camera, "part": part, "order": order, "lists": lists,
                     **ray_counts(found)}
                )  # fmt: skip
    return rows


def gains(rows: Rows) -> Rows:
    """Percent fewer nodes a ray than one list of the same part, order and camera."""
    found: Rows = []
    for row in rows:
        if row["triangles"] == MISSING or row["lists"] == 1:
            continue
        (one,) = [other for other in rows if other.get("lists") == 1 and _view(other) == _view(row)]
        found.append(
            {
                **{key: row[key] for key in ("scene", "triangles", "camera", "part", "order", "lists")},
                **{
                    f"{kind}gain_percent": round(
                        100.0 * (1.0 - row[f"{kind}nodes_per_ray"] / one[f"{kind}nodes_per_ray"]), 3
                    )
                    for kind in ("", "eye_", "shadow_")
                },
            }
        )
    return found


def _view(row: Row) -> tuple[str, ...]:
    return tuple(str(row.get(key)) for key in ("scene", "camera", "part", "order"))


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Counts, and gains."""
    return {"bsh-lists": rows, "bsh-lists-gains": gains(rows) or rows}


def plot(rows: Rows) -> Any:
    """Gains of six lists by scene; left plain, a dot a camera; right the front camera, part by part."""
    figure = style.new_figure(3.8)
    left, right = figure.subplots(1, 2, sharey=True)
    table = gains(rows)
    scenes = list(dict.fromkeys(row["scene"] for row in table))
    looks = list(zip(style.CYCLE, style.MARKERS, SEEN, strict=False))
    for k, (color, marker, camera) in enumerate(looks):
        own = {r["scene"]: r["gain_percent"] for r in table if (r["camera"], r["lists"], r["part"], r["order"])
               == (camera, 6, "plain", ORDERS[0])}  # fmt: skip
        if own:
            spots = [scenes.index(name) + 0.11 * (k - 2.5) for name in own]
            left.plot(spots, list(own.values()), marker, color=color, label=camera)
    for k, (color, marker, part) in enumerate(zip(style.CYCLE, style.MARKERS, PARTS, strict=False)):
        own = {r["scene"]: r["gain_percent"] for r in table if (r["camera"], r["lists"], r["part"], r["order"])
               == ("front", 6, part, ORDERS[0])}  # fmt: skip
        right.plot([scenes.index(name) + 0.15 * (k - 1) for name in own], list(own.values()), marker, color=color,
                   label=part)  # fmt: skip
    for axes, title in ((left, "Six lists against one, by camera"), (right, "The front camera, with optimisations")):
        axes.axhspan(5.0, 15.0, color="#eeeeee", zorder=0)
        axes.axhline(0.0, color=style.INK, linewidth=0.9)
        axes.set_xticks(range(len(scenes)), scenes, fontsize=8)
        axes.set_xlim(-0.5, len(scenes) - 0.5)
        axes.grid(False, axis="x")
        axes.set_title(title)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3)
    left.set_ylabel("fewer nodes a ray, percent")
    absent = sorted({row["scene"] for row in rows if row["triangles"] == MISSING})
    if absent:
        left.text(0.05, 0.9, f"missing: {', '.join(absent)}", transform=left.transAxes, color=style.FAINT)
    return figure


EXPERIMENT = Experiment(
    "bsh-lists",
    "One, two, six or eight lists",
    "160² (48² and three scenes with `--quick`) eye and shadow rays, ground, earliest first. Percent fewer nodes a "
    "ray with six lists than with one; grey: the paper's 5 to 15 percent. Left: lists alone, six cameras. Right: the "
    "front camera, lists alone and with all optimisations that work with that many lists, heads at the first "
    "surviving leaf or climbing. Tables: 1, 2, 6, 8 lists, both orders, eye and shadow rays apart.",
    cases,
    measure,
    plot,
    tables,
    alt="Left, how many percent fewer nodes six lists visit than one, a mark for each of six cameras and scenes, "
    "within the paper's grey band, above it and below; right, the same for the front camera with lists alone and "
    "with all optimisations.",
)
