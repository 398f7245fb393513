"""The traversal lists against other structures on the same rays: Thrane and Simonsen's single list with boxes, an
ordered stack on the same spheres, kd-trees with a stack, with restart and with backtracking (Foley and Sugerman 2005).

Nodes are what a ray looks at, triangle tests among them; a box is dearer to fetch and to test than a sphere."""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.bsh_runs import ENABLED, head, hierarchy_of, kept, lists_of, mean, missing_row, run, scene_of
from refsim.experiments.registry import Case, Experiment, Rows
from refsim.experiments.runs import MISSING, mesh_state
from refsim.results import RayKind, Trace

SCENES = ("suzanne", "bunny", "buddha_100k")
LISTS = {
    "one list": {"lists": 1},
    "six lists": {},
    "six lists, all on": ENABLED,
    "six lists, all on, climbing": {**ENABLED, "head_rule": "climb"},
}
OTHERS = ("boxes, one list", "ordered stack", "kd-tree, stack", "kd-tree, restart", "kd-tree, backtrack")


def cases(quick: bool) -> list[Case]:
    """A case a scene and structure."""
    size = 64 if quick else 256
    return [
        {"name": name, "structure": structure, "size_px": size, "mesh": mesh_state(name)}
        for name in (SCENES[:2] if quick else SCENES) for structure in (*LISTS, *OTHERS)
    ]  # fmt: skip


def measure(name: str, structure: str, size_px: int, mesh: str) -> Rows:
    """One row: eye rays, and the shadow rays that they send."""
    if mesh == MISSING:
        return [{**missing_row(name, size_px), "structure": structure}]
    plain = kept(name, size_px, facing="front")
    if structure in LISTS:
        found = run(name, size_px, **{"facing": "front", **LISTS[structure]})
        costs = [_of_lists(found, kind) for kind in (RayKind.EYE, RayKind.SHADOW)]
        same = _agree(found, plain)
    else:
        costs, same = _of_other(_structure(name, structure), plain)
    row = {**head(name, size_px, plain), "structure": structure, "same_hits": int(same)}
    for kind, (nodes, tests) in zip(("eye", "shadow"), costs, strict=True):
        row |= {f"{kind}_nodes_per_ray": mean(nodes), f"{kind}_tests_per_ray": mean(tests)}
    nodes, tests = (np.concatenate([cost[k] for cost in costs]) for k in (0, 1))
    return [{**row, "nodes_per_ray": mean(nodes), "tests_per_ray": mean(tests)}]


def _structure(name: str, structure: str) -> Any:
    from refsim.papers.sphere_hierarchy import boxes, kd_search, kd_tree, ordered_stack

    if structure.startswith("boxes"):
        return boxes.build_boxes(lists_of(name, True, 1))
    if structure.startswith("kd-tree"):
        return kd_search.kd_search(kd_tree.build_kd_tree(scene_of(name)), structure.split(", ")[1])
    return ordered_stack.build_stack(hierarchy_of(name))


def _of_lists(found: Trace, kind: RayKind) -> tuple[Any, Any]:
    chosen = [(g, g.alive & (g.kind == kind)) for g in found.generations]
    nodes, tests = (np.concatenate([g.per_ray[what][own] for g, own in chosen]) for what in ("nodes", "triangle_tests"))
    return nodes, tests


def _of_other(searched: Any, plain: Trace) -> tuple[list[tuple[Any, Any]], bool]:
    costs, same = [], True
    for generation, any_hit in zip(plain.generations, (False, True), strict=True):
        own = searched.search(generation.rays, any_hit=any_hit, facing="front")
        alive = generation.alive
        costs.append((own.nodes[alive], own.triangle_tests[alive]))
        theirs, ours = own.hits.triangle[alive], generation.hits.triangle[alive]
        same &= bool(((theirs >= 0) == (ours >= 0)).all() if any_hit else (theirs == ours).all())
    return costs, same


def _agree(found: Trace, plain: Trace) -> bool:
    eye = [trace.generations[0].hits.triangle for trace in (found, plain)]
    shadow = [trace.generations[1].hits.triangle >= 0 for trace in (found, plain)]
    return bool((eye[0] == eye[1]).all() and (shadow[0] == shadow[1]).all())


def plot(rows: Rows) -> Any:
    """A panel a scene: nodes as bars, tests in them darker."""
    figure = style.new_figure(3.3)
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    for axes, scene in zip(figure.subplots(1, len(scenes), sharey=True, squeeze=False)[0], scenes, strict=True):
        own = [row for row in rows if row["scene"] == scene]
        axes.set_title(scene)
        if own[0]["triangles"] == MISSING:
            axes.text(0.5, 0.5, "missing", ha="center", va="center", transform=axes.transAxes, color=style.FAINT)
            continue
        places = range(len(own))
        axes.barh(places, [row["nodes_per_ray"] for row in own], 0.72, color=style.SKY, label="nodes")
        axes.barh(places, [row["tests_per_ray"] for row in own], 0.72, color=style.BLUE, label="triangle tests of them")
        for place, row in enumerate(own):
            axes.text(row["nodes_per_ray"], place, f" {row['nodes_per_ray']:.1f}", va="center", fontsize=7.5)
        axes.set_yticks(list(places), [row["structure"] for row in own], fontsize=8)
        axes.set_xlim(0, 1.22 * max(row["nodes_per_ray"] for row in own))
        axes.grid(False, axis="y")
        axes.set_xlabel("a ray, eye and shadow rays")
        handles = axes.get_legend_handles_labels()
    axes.invert_yaxis()
    if any(row["triangles"] != MISSING for row in rows):
        figure.legend(*handles, loc="outside lower center", ncols=2)
    return figure


EXPERIMENT = Experiment(
    "bsh-compared",
    "Lists against boxes, an ordered stack and kd-trees",
    "256² (64² with `--quick`) eye rays and the shadow rays that they send, ground, fronts only; every structure "
    "finds the same hits. Nodes are all that a ray looks at (spheres, boxes, inner nodes and leaves of kd-trees, "
    "triangles); dark: the triangles among them. `all on`: safe culling, regular heads, 16 × 16 screen cells.",
    cases,
    measure,
    plot,
    alt="Bars of nodes a ray, triangle tests dark within them, for lists, boxes, an ordered stack and three walks of "
    "a kd-tree, in three scenes.",
)
