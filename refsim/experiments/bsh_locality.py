"""One list against several in a texture cache: "creating multiple traversal lists is expected to increase memory
reference locality" (section 2.1), and locality "is progressively lost" with more triangles (Table 2).

Counts of the model of the GT200's texture cache and of warps of 8 × 4 pixels; eye rays, then their shadow rays."""

from __future__ import annotations

from typing import Any

from refsim.experiments import style
from refsim.experiments.bsh_runs import head, missing_row, run
from refsim.experiments.registry import Case, Experiment, Rows
from refsim.experiments.runs import MISSING, mesh_state

SCENES = ("cubes", "suzanne", "bunny", "buddha_100k", "dragon")
LISTS = (1, 2, 6, 8)
MACHINES = ("GT200", "GT200_LATER")


def cases(quick: bool) -> list[Case]:
    """A case a scene and kind of rays."""
    size = 48 if quick else 192
    return [
        {"name": name, "shadows": shadows, "size_px": size, "mesh": mesh_state(name)}
        for name in (SCENES[:3] if quick else SCENES) for shadows in (0, 1)
    ]  # fmt: skip


def measure(name: str, shadows: int, size_px: int, mesh: str) -> Rows:
    """A row a number of lists and cache."""
    from refsim.papers.sphere_hierarchy import locality, texture_cache

    if mesh == MISSING:
        return [{**missing_row(name, size_px), "rays": "eye and shadow" if shadows else "eye"}]
    found = run(name, size_px, shadows=bool(shadows), generations=2 if shadows else 1)
    machines = [texture_cache.Machine(getattr(texture_cache, cache)) for cache in MACHINES]
    rows: Rows = []
    for told in locality.measure(found, LISTS, machines=machines):
        rates = told.cache.hit_rates
        rows.append(
            {
                **head(name, size_px, found),
                "rays": "eye and shadow" if shadows else "eye",
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


def plot(rows: Rows) -> Any:
    """Left hit rates by scene; right bytes from memory a ray."""
    figure = style.new_figure(3.5)
    panels = figure.subplots(1, 3)
    shown = (("hit_percent_all", "Fetches that hit, percent"), ("bytes_per_ray", "Bytes a ray / one list's"),
             ("bytes_per_node", "Bytes a node / one list's"))  # fmt: skip
    own = [row for row in rows if row.get("cache") == MACHINES[0] and row["rays"] == "eye and shadow"]
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
    "least recently used); another one, and eye rays alone, are in the table. Left: share of fetches that hit; middle "
    "and right: bytes from memory against those with one list. A structure from which less is fetched may hit a "
    "smaller share: bytes from memory are what a memory-bound program waits for.",
    cases,
    measure,
    plot,
    alt="Three charts over the triangles, a line for one, two, six and eight lists: the share of cached fetches, "
    "which falls, and bytes a ray and a node against one list's, more for the smallest scenes and less for larger "
    "ones.",
)
