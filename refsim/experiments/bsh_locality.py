"""One list against several in a texture cache: "creating multiple traversal lists is expected to increase memory
reference locality" (section 2.1), and locality "is progressively lost" with more triangles (Table 2).

"Most of the proposed optimisations happen at the cost of memory access locality" (Table 1): six lists with each of them
on the bunny without its ground, and with all on the scenes with ground, as for Table 2. Counts of the model of the
GT200's texture cache and of warps of 8 × 4 pixels; eye rays, then their shadow rays."""

from __future__ import annotations

from typing import Any

from refsim.experiments import style
from refsim.experiments.bsh_runs import ENABLED, head, missing_row, run
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.experiments.runs import MISSING, mesh_state

SCENES = ("cubes", "suzanne", "bunny", "buddha_100k", "dragon")
LISTS, SIX = (1, 2, 6, 8), (6,)
MACHINES = ("GT200", "GT200_LATER")
NONE, ALL_ON, BARE = "none", "all on", "bunny"
_FRONT = {"facing": "front"}
# What is switched on, of six lists; heads at the first surviving leaf
SWITCHES: dict[str, dict[str, Any]] = {
    NONE: _FRONT, "culling": {**_FRONT, "culling": ENABLED["culling"]}, "heads": {**_FRONT, "heads": ENABLED["heads"]},
    "screen cells": {**_FRONT, "screen_cells": ENABLED["screen_cells"]}, ALL_ON: ENABLED,
}  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case a scene and kind of rays with lists alone; then what is switched on."""
    size = 48 if quick else 192
    scenes = SCENES[:3] if quick else SCENES
    told = [
        *((name, shadows, 1, NONE) for name in scenes for shadows in (0, 1)),
        *((BARE, 1, 0, switch) for switch in SWITCHES), *((name, 1, 1, ALL_ON) for name in scenes),
    ]  # fmt: skip
    return [
        {"name": name, "shadows": shadows, "ground": ground, "switches": switches, "size_px": size,
         "mesh": mesh_state(name)}
        for name, shadows, ground, switches in told
    ]  # fmt: skip


def measure(name: str, shadows: int, ground: int, switches: str, size_px: int, mesh: str) -> Rows:
    """A row a number of lists and cache; of what is switched on, six lists."""
    from refsim.papers.sphere_hierarchy import locality, texture_cache

    line: Row = {"ground": ground, "switches": switches, "rays": "eye and shadow" if shadows else "eye"}
    if mesh == MISSING:
        return [{**missing_row(name, size_px), **line}]
    # With the ground and nothing switched on, all numbers of lists; both sides of a triangle are hit
    alone = ground and switches == NONE
    options = {} if alone else SWITCHES[switches]
    found = run(name, size_px, ground=bool(ground), shadows=bool(shadows), generations=2 if shadows else 1, **options)
    machines = [texture_cache.Machine(getattr(texture_cache, cache)) for cache in MACHINES]
    rows: Rows = []
    for told in locality.measure(found, LISTS if alone else SIX, machines=machines):
        rates = told.cache.hit_rates
        rows.append(
            {
                **head(name, size_px, found),
                **line,
                "lists": told.lists,
                "cache": MACHINES[machines.index(told.machine)],
                "footprint_bytes": told.cache.footprint,
                "nodes_per_ray": round(told.account.nodes / told.account.rays, 3),
                "lane_utilisation": round(told.account.utilisation, 4),
                "lines_per_node": round(told.account.lines / told.account.nodes, 4),
                **{f"hit_percent_{kind}": round(100.0 * rate, 3) for kind, rate in rates.items()},
                "bytes_per_ray": round(told.cache.bytes_per_ray, 3),
                "bytes_per_node": round(told.bytes_per_node, 4),
            }
        )
    return rows


def lists_alone(rows: Rows) -> Rows:
    """Rows with the ground and nothing switched on: what the number of lists does."""
    return [row for row in rows if row["ground"] and row["switches"] == NONE]


def plot(rows: Rows) -> Any:
    """Left hit rates by scene; right bytes from memory a ray."""
    figure = style.new_figure(3.5)
    panels = figure.subplots(1, 3)
    shown = (("hit_percent_all", "Fetches that hit, percent"), ("bytes_per_ray", "Bytes a ray / one list's"),
             ("bytes_per_node", "Bytes a node / one list's"))  # fmt: skip
    own = [r for r in lists_alone(rows) if r.get("cache") == MACHINES[0] and r["rays"] == "eye and shadow"]
    for axes, (key, title) in zip(panels, shown, strict=True):
        for color, marker, lists in zip(style.CYCLE, style.MARKERS, LISTS, strict=False):
            line = [row for row in own if row["lists"] == lists]
            x, y = [row["triangles"] for row in line], [row[key] for row in line]
            if key != "hit_percent_all":
                single = {row["scene"]: row[key] for row in own if row["lists"] == 1}
                y = [value / single[row["scene"]] for value, row in zip(y, line, strict=True)]
            axes.plot(x, y, marker=marker, color=color, label=f"{lists} list{'s' if lists > 1 else ''}", linewidth=1.2)
        axes.set_xscale("log")
        axes.set_xlabel("triangles")
        axes.set_title(title)
        if key != "hit_percent_all":
            axes.set_yscale("log")
            style.plain_ticks(axes.yaxis)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    absent = sorted({row["scene"] for row in rows if row["triangles"] == MISSING})
    if absent:
        panels[0].text(0.05, 0.1, f"missing: {', '.join(absent)}", transform=panels[0].transAxes, color=style.FAINT)
    return figure


EXPERIMENT = Experiment(
    "bsh-locality",
    "Lists and the texture cache",
    "192² (48² and three scenes with `--quick`) eye and shadow rays, ground, no culling or heads, warps of 8 × 4 "
    "pixels on 30 multiprocessors with 32 resident warps each. The cache is a model (64 sets of 2 lines of 64 bytes, "
    "least recently used). Left: share of fetches that hit; middle and right: bytes from memory against those with one "
    "list. A structure from which less is fetched may hit a smaller share: bytes from memory are what a memory-bound "
    "program waits for. The table also has another cache, eye rays alone, and six lists with optimisations: each on "
    "the bunny without its ground, all on every scene.",
    cases,
    measure,
    plot,
    alt="Three charts over the triangles, a line for one, two, six and eight lists: the share of cached fetches, "
    "which falls, and bytes a ray and a node against one list's, more for the smallest scenes and less for larger "
    "ones.",
)
