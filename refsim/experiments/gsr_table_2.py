"""Table 2: where rays are intersected: four configurations of the pipeline, in counts, and what warps lose in each.

Pure ray casting of a torus knot of 1,024 triangles that every ray hits: the vertex shader intersects and the geometry
shader passes on; no geometry shader; the previous work's fragment shader; and intersection inside the geometry shader,
which section 4.1 rejects: "shorter shaders result in lower branching divergence behavior". For that reason the first
and the last are also run with shadows and reflections, where the geometry shader has work of its own.

A SIMT account (`papers.geometry_shader_rays.simt`) says how many lane-steps warps of several widths issue, of which
only a part does work. Recursive Ray Tracing in Geometry Shader, sections 4.1 and 6.
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
    head,
    hits_of,
    ray_counts,
    run,
    scene_of,
    shader_work,
)
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.verdicts import claim
from refsim.papers.geometry_shader_rays.simt import WIDTHS
from refsim.results import Trace

VIEW, QUICK_VIEW = "knot from above", "small knot from above"
PASS_THROUGH, ALONE, FRAGMENT, INSIDE = (
    "pass-through geometry shader", "no geometry shader", "fragment shader", "intersection in the geometry shader",
)  # fmt: skip
CONFIGURATIONS: dict[str, tuple[str, dict[str, Any]]] = {
    PASS_THROUGH: (GEOMETRY_SHADER, {"stages": "vertex"}),
    ALONE: (GEOMETRY_SHADER, {"stages": "vertex_only"}),
    FRAGMENT: (FRAGMENT_GRID, {}),
    INSIDE: (GEOMETRY_SHADER, {"stages": "geometry"}),
}
RECONVERGE = {"after each branch": True, "at the shader's end": False}
COMPARED_WIDTH = 32
# What counts as another number of lane-steps: a hundredth
NOTICEABLE = 0.01


def cases(quick: bool) -> list[Case]:
    """The four configurations casting rays; the two whose geometry shaders differ with secondary rays."""
    frame: Case = {"view": QUICK_VIEW, "size_px": 64} if quick else {"view": VIEW, "size_px": published.SIDE}
    cast = [{**frame, "configuration": name, "mode": "RC"} for name in CONFIGURATIONS]
    further = {**frame, "size_px": frame["size_px"] // 2}
    return cast + [{**further, "configuration": name, "mode": "RT"} for name in (PASS_THROUGH, INSIDE)]


def measure(view: str, size_px: int, configuration: str, mode: str) -> Rows:
    """A row of counters, and one a warp width and point of reconvergence."""
    method, options = CONFIGURATIONS[configuration]
    found = run(method, view, size_px, **MODES[mode], **options)
    if hits_of(found.generations[0]) != size_px * size_px:
        raise AssertionError(f"{view}: Table 2 wants every eye ray to hit, and some do not")
    first = {**head(view, size_px, found), "configuration": configuration, "mode": mode}
    said = published.TABLE_2.get(configuration) if mode == "RC" else None
    rate, time = said or ("", "")
    counters = {
        "part": "counters",
        **first,
        **ray_counts(found),
        **moved(found, size_px * size_px, len(scene_of(view).lights)),
        **shader_work(found),
        "published_million_rays_per_second": rate,
        "published_ms": time,
    }
    warps = [
        {"part": "warps", **first, "warp_lanes": width, "paths_meet": name, **_warps(found, width, meets)}
        for width in WIDTHS for name, meets in RECONVERGE.items()
    ]  # fmt: skip
    return [counters, *warps]


def _warps(found: Trace, width: int, reconverge: bool) -> Row:
    """Lane-steps of all shaders of a configuration, and the share in which lanes worked, shader by shader."""
    from refsim.papers.geometry_shader_rays.simt_lanes import accounts

    all_of = accounts(found, width, reconverge, quads=True)
    # `together` is what vertex and geometry shader would be as one: only where they are one it is drawn
    drawn = {name: each for name, each in all_of.items() if name != "together" or "vertex" not in all_of}
    searching = [each for name, each in drawn.items() if name != "fragment" or len(drawn) == 1]
    row: Row = {
        "issued_lane_steps": sum(each.issued for each in drawn.values()),
        "working_lane_steps": sum(each.active for each in drawn.values()),
        "issued_before_shading_lane_steps": sum(each.issued for each in searching),
        "working_before_shading_lane_steps": sum(each.active for each in searching),
    }
    for name in ("vertex", "geometry", "together", "fragment"):
        row[f"{name}_working_percent"] = round(100.0 * drawn[name].utilisation, 3) if name in drawn else ""
    return {**row, "paths_per_warp": round(max(each.paths_per_warp for each in searching), 4)}


def of_part(rows: Rows, part: str) -> Rows:
    """`counters` or `warps`."""
    return [row for row in rows if row["part"] == part]


def one(rows: Rows, configuration: str, mode: str, width: int, meets: str) -> Row:
    """The one row of an account."""
    wanted = (configuration, mode, width, meets)
    (row,) = [
        row for row in of_part(rows, "warps")
        if (row["configuration"], row["mode"], row["warp_lanes"], row["paths_meet"]) == wanted
    ]  # fmt: skip
    return row


def losses(rows: Rows, meets: str) -> dict[tuple[str, int], float]:
    """Lane-steps issued with intersection in the geometry shader ÷ with two shaders, by mode and warp width."""
    key = "issued_before_shading_lane_steps"
    return {
        (mode, width): one(rows, INSIDE, mode, width, meets)[key] / one(rows, PASS_THROUGH, mode, width, meets)[key]
        for mode in ("RC", "RT") for width in WIDTHS
    }  # fmt: skip


def claims(rows: Rows) -> Rows:
    """Section 4.1's reason, and how much of Table 2 divergence explains."""
    found = []
    for meets, paths_meet in RECONVERGE.items():
        quotients = losses(rows, meets)
        more = [value > 1.0 + NOTICEABLE for value in quotients.values()]
        found.append(
            claim(
                "4.1", "shorter shaders result in lower branching divergence", f"paths meet {meets}",
                "with intersection in the geometry shader warps issue more lane-steps than with two shaders (by more "
                "than 1 percent), for every warp width, RC and RT; depends where for some"
                + ("; where paths meet both issue the same blocks for the same lanes" if paths_meet else ""),
                "; ".join(f"{mode} {width}: x {value:.3f}" for (mode, width), value in quotients.items()),
                True if all(more) else None if any(more) else False,
            )
        )  # fmt: skip
    key, meets = "issued_before_shading_lane_steps", next(iter(RECONVERGE))
    more_in_rows = {
        width: one(rows, ALONE, "RC", width, meets)[key] / one(rows, FRAGMENT, "RC", width, meets)[key]
        for width in WIDTHS
    }
    said = published.TABLE_2[ALONE][1] / published.TABLE_2[FRAGMENT][1]
    matters = [value > 1.0 + NOTICEABLE for value in more_in_rows.values()]
    found.append(
        claim(
            "6", "it matters which type of shader executes the same computations", "knot, RC",
            "warps of vertices, in rows, issue more lane-steps than warps of pixels, in tiles (by more than 1 "
            "percent), for every width; depends where for some",
            "; ".join(f"{width}: x {value:.3f}" for width, value in more_in_rows.items())
            + f"; the paper's times say x {said:.2f}",
            True if all(matters) else None if any(matters) else False,
        )
    )  # fmt: skip
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Counters, and the account of warps."""
    return {"gsr-table-2": of_part(rows, "counters"), "gsr-table-2-warps": of_part(rows, "warps")}


# Colour, marker, and width: lines that coincide are drawn one upon the other
LOOKS = {PASS_THROUGH: (style.BLUE, "o", 6.0), ALONE: (style.GREEN, "s", 3.6), FRAGMENT: (style.ORANGE, "^", 1.8),
         INSIDE: (style.VERMILION, "D", 1.4)}  # fmt: skip


def plot(rows: Rows) -> Any:
    """Left: published times and what the warps issue. Middle and right: the share of lane-steps that work."""
    figure = style.new_figure(4.1)
    left, *others = figure.subplots(1, 3, width_ratios=(1.1, 1, 1))
    _draw_quotients(left, rows)
    for axes, mode in zip(others, ("RC", "RT"), strict=True):
        _draw_working(axes, rows, mode)
    others[0].set_ylabel("lane-steps in which a lane works, percent")
    handles = others[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=2, fontsize=8)
    return figure


def _draw_quotients(axes: Any, rows: Rows) -> None:
    """Each configuration against the fragment shader."""
    own = {row["configuration"]: row for row in of_part(rows, "counters") if row["mode"] == "RC"}
    meets = next(iter(RECONVERGE))
    issued = {name: one(rows, name, "RC", COMPARED_WIDTH, meets)["issued_before_shading_lane_steps"] for name in own}
    bars = {
        "published ms": {name: row["published_ms"] for name, row in own.items() if row["published_ms"] != ""},
        f"lane-steps, warps of {COMPARED_WIDTH}": issued,
        "bytes of rays": {name: row["ray_bytes_read"] + row["ray_bytes_written"] for name, row in own.items()},
    }
    for k, (label, values) in enumerate(bars.items()):
        names = list(values)
        places = [list(own).index(name) + (k - 1) * 0.27 for name in names]
        heights = [values[name] / values[FRAGMENT] for name in names]
        axes.bar(places, heights, 0.25, color=(style.VERMILION, style.BLUE, style.ORANGE)[k], label=label)
    axes.axhline(1.0, color=style.INK, linewidth=0.8)
    short = ("pass-\nthrough", "no GS", "fragment\nshader", "in GS")
    axes.set_xticks(range(len(own)), short, fontsize=7.5)
    axes.grid(False, axis="x")
    axes.set_ylabel("÷ fragment shader")
    axes.set_ylim(0, 4.4)
    axes.set_yticks(range(5))
    axes.set_title("Ray casting")
    axes.legend(fontsize=7, loc="upper right")


def _draw_working(axes: Any, rows: Rows, mode: str) -> None:
    for name in CONFIGURATIONS:
        if not any((row["configuration"], row["mode"]) == (name, mode) for row in of_part(rows, "warps")):
            continue
        for meets, line in zip(RECONVERGE, ("-", ":"), strict=True):
            own = [one(rows, name, mode, width, meets) for width in WIDTHS]
            key = "before_shading_lane_steps"
            shares = [100.0 * row[f"working_{key}"] / row[f"issued_{key}"] for row in own]
            color, marker, width = LOOKS[name]
            look = {"color": color, "marker": marker, "markersize": width + 3, "linewidth": width}
            axes.plot(WIDTHS, shares, line, label=name if line == "-" else None, **look)
    axes.set_xscale("log", base=2)
    axes.set_xticks(WIDTHS, [str(width) for width in WIDTHS])
    axes.minorticks_off()
    axes.set_ylim(0, 100)
    axes.set_xlabel("lanes of a warp")
    axes.set_title(f"{mode}: before shading")


EXPERIMENT = Experiment(
    "gsr-table-2",
    "Table 2: where rays are intersected, and what warps lose",
    "512² rays, all of which hit the torus knot or its ground, 1,024 triangles, default grid (64² and 258 triangles "
    "with `--quick`). Left: each configuration against the fragment shader: the paper's milliseconds, and what is "
    "counted here. Lane-steps are operations and fetches times the lanes of a warp; a warp issues what any of its "
    "lanes needs. Middle and right (RT at half the size): share of the lane-steps before shading in which a lane "
    "works; solid where paths meet after each branch, dotted where they do not before the shader's end. Neighbours "
    "share a warp: vertices in rows, pixels of the fragment shader in tiles. A ray's tests count as one loop over all "
    "its cells, so what warps lose is a lower bound. In the tables each point's fragment fills a quad of its own.",
    cases,
    measure,
    plot,
    tables,
    alt="Bars of four configurations against the fragment shader in published milliseconds, lane-steps and bytes; two "
    "charts of the share of lane-steps in which a lane works, falling as warps grow wider.",
)
