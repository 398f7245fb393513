"""The text's claims, each judged by a rule in code on the rows of the other experiments and on the printed numbers.

A verdict is `holds`, `fails`, or `depends` where the rule decides differently for other scenes, views or rules.
Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.experiments import bsh_claims_locality as local
from refsim.experiments import bsh_claims_method as method
from refsim.experiments import bsh_claims_tables as of_tables
from refsim.experiments import bsh_published as published
from refsim.experiments import bsh_table_1, bsh_table_2
from refsim.experiments.bsh_claims_heads import head_claims
from refsim.experiments.bsh_claims_structures import compared_claims
from refsim.experiments.bsh_claims_text import text_claims
from refsim.experiments.bsh_runs import METHOD, body_of, rays_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING
from refsim.experiments.verdicts import claim
from refsim.scene import Rays, Scene
from refsim.scene.stages import on_ground

ERRATA, LAYERS, KNOT = ("BSH-E5", "BSH-E9"), "layers", "torus_knot_1024"
ROWS = ("triangles", "material_ids", "normals", "texcoords")  # what a scene has a row of for each triangle
# What the paper's counter of traversed nodes counts: a ray's, or all that a warp's 32 lanes have waited for
READINGS = {"as printed": 1, "by the 32 rays of a warp": published.WARP}
CONDITIONS = {
    "BSH-E5": "the sphere's exit root is the intersection parameter",
    "BSH-E9": "per-polygon heads serve every ray that leaves a polygon",
}


def cases(quick: bool) -> list[Case]:
    """A case an erratum that can stand as printed, and one of lists in a row."""
    return [{"of": of, "size_px": 48 if quick else 128} for of in (*ERRATA, LAYERS)]


def measure(of: str, size_px: int) -> Rows:
    """An erratum: how many rays find something else where the text stands as printed, on a body of glass, four
    generations. Layers: eye rays' nodes in the second of two lists, after the first and alone."""
    return _layers(size_px) if of == LAYERS else _erratum(of, size_px)


def _layers(size_px: int) -> Rows:
    """The knot as two layers of as many triangles: the second alone, and after the first with its best hit kept."""
    scene, rays = on_ground(body_of(KNOT)), rays_of(KNOT, size_px)
    half = len(scene) // 2
    rows: Rows = []
    halves = slice(half), slice(half, None)
    for name, (first, second) in (("halves", halves), ("exchanged", halves[::-1])):
        parts = [_only(scene, part) for part in (first, second)]
        own = [key for key in ROWS if getattr(scene, key) is not None]
        both = scene.replace(**{key: np.concatenate([getattr(part, key) for part in parts]) for key in own})
        together = _nodes(both, rays, layers=(len(parts[0]),))
        apart = [_nodes(part, rays) for part in parts]
        rows.append(
            {"layers": name, "size_px": size_px, "rays": len(rays), "nodes_of_the_first": apart[0],
             "nodes_of_the_second_alone": apart[1], "nodes_of_the_second_after_it": together - apart[0]}
        )  # fmt: skip
    return rows


def _only(scene: Scene, part: slice) -> Scene:
    """Some of the triangles."""
    return scene.replace(**{key: getattr(scene, key)[part] for key in ROWS if getattr(scene, key) is not None})


def _nodes(scene: Scene, rays: Rays, **options: Any) -> int:
    from refsim.methods import trace

    found = trace(METHOD, scene, rays, generations=1, facing="front", **options)
    return int(found.generations[0].per_ray["nodes"].sum())


def _erratum(erratum: str, size_px: int) -> Rows:
    """One row."""
    options = {"shadows": False, "generations": 4, "heads": "regular", "material": "glass"}
    right, printed = (_glass(KNOT, size_px, errata, **options) for errata in ("corrected", erratum))
    wrong = [
        int((a.hits.triangle != b.hits.triangle).sum())
        for a, b in zip(right.generations, printed.generations, strict=True)
    ]
    return [{"erratum": erratum, "size_px": size_px, "pixels": size_px**2, "wrong_rays": sum(wrong),
             "wrong_eye_rays": wrong[0]}]  # fmt: skip


def _glass(name: str, size: int, errata: str, **options: object):  # type: ignore[no-untyped-def]
    from refsim.methods import trace

    return trace("traversal_list", on_ground(body_of(name)), rays_of(name, size), errata=errata, **options)


def errata_claims(rows: Rows) -> Rows:
    """What stands as printed, on rays."""
    return [
        claim(
            row["erratum"], CONDITIONS[row["erratum"]], "knot of glass", "no ray of four generations finds another hit",
            f"{row['wrong_rays']} rays do, {row['wrong_eye_rays']} eye rays among them, of {row['pixels']} pixels",
            row["wrong_rays"] == 0,
        )
        for row in rows
    ]  # fmt: skip


def layer_claims(rows: Rows) -> Rows:
    """Section 5: "the parameter of the best intersection is not reseted"."""
    return [
        claim(
            "5", "a later list is traversed faster, as the best parameter is kept",
            f"knot in two layers, {row['layers']}",
            "eye rays visit fewer nodes of the second list after the first than of it alone",
            f"{row['nodes_of_the_second_after_it']} of {row['nodes_of_the_second_alone']}",
            row["nodes_of_the_second_after_it"] < row["nodes_of_the_second_alone"],
        )
        for row in rows
    ]  # fmt: skip


def threshold_claims(rows: Rows) -> Rows:
    """BSH-E8."""
    own = method.present(rows)
    found: list[Row] = []
    for scene in dict.fromkeys(row["scene"] for row in own):
        table = {row["threshold"]: row["nodes_per_ray"] for row in own if row["scene"] == scene}
        best = min(table, key=table.__getitem__)
        ratio = max(table.values()) / min(table.values())
        found.append(
            claim(
                "BSH-E8", "what is big enough compared to the node need not be said", scene,
                "nodes a ray differ by less than 10 percent over thresholds from 0.1 to 1",
                f"x {ratio:.3f} from the best, {best:g}, to the worst", ratio < 1.1,
            )
        )  # fmt: skip
    return found


def nodes_rows(table_1: Rows, table_2: Rows) -> Rows:
    """Nodes a ray beside what is printed, in two readings of its counter, for both tables alike (BSH-E3)."""
    lines: list[tuple[Row, Row, float]] = []
    for row in bsh_table_1.compared(table_1):
        switches = [name for name in ("culled", "heads", "frustum") if row[name]]
        label = ", ".join([row["order"].replace("_", " "), *switches])
        lines.append(({"table": "Table 1", "row": label}, row, row["published_nodes_per_ray"]))
    for row in bsh_table_2.of_part(table_2, "counters"):
        line = {"table": "Table 2", "row": row["published_scene"], "substitute": row.get("substitute", "")}
        lines.append((line, row, published.TABLE_2[row["published_scene"]][2].nodes_per_ray))
    return [
        {**line, "reading": reading, "nodes_per_ray": row.get("nodes_per_ray", MISSING),
         "published_nodes_per_ray": round(said / by, 3)}
        for line, row, said in lines for reading, by in READINGS.items()
    ]  # fmt: skip


def spread_rows(table_1: Rows) -> Rows:
    """By how much the sixteen combinations of Table 1 change nodes a ray: 1 - least / most."""
    table = bsh_table_1.compared(table_1)
    if len(table) < len(published.TABLE_1):
        return [{"of": "bunny without ground, ours", "spread_percent": MISSING}]
    return [
        {"of": name, "spread_percent": round(100.0 * (1.0 - min(nodes) / max(nodes)), 3)}
        for name, nodes in (
            ("bunny without ground, ours", [row["nodes_per_ray"] for row in table]),
            ("Table 1, printed", [row["published_nodes_per_ray"] for row in table]),
        )
    ]  # fmt: skip


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """The verdicts, the errata's counts, and all numbers of the paper's text."""
    errata, layers = ([row for row in rows if key in row] for key in ("erratum", "layers"))
    verdicts = [
        *text_claims(),
        *method.partition_claims(others["bsh-figure-2"]),
        *method.hole_claims(others["bsh-holes"]),
        *of_tables.set_up_claims(others["bsh-figure-4"]),
        *of_tables.table_1_claims(others["bsh-table-1"]),
        *of_tables.reading_claims(others["bsh-table-2"], others["bsh-table-1"]),
        *of_tables.copy_claims(others["bsh-table-3"]),
        *head_claims(others["bsh-histogram"]),
        *method.gain_claims(others["bsh-lists"]),
        *method.optimised_claims(others["bsh-lists"]),
        *method.growth_claims(others["bsh-growth"]),
        *local.locality_claims(others["bsh-locality"]),
        *local.cache_claims(others["bsh-locality"]),
        *threshold_claims(others["bsh-threshold"]),
        *compared_claims(others["bsh-compared"]),
        *errata_claims(errata),
        *layer_claims(layers),
    ]
    return {
        "claims-bsh": verdicts, "claims-bsh-errata": errata, "claims-bsh-layers": layers,
        "claims-bsh-published": published.published_rows(),
        "claims-bsh-nodes": nodes_rows(others["bsh-table-1"], others["bsh-table-2"]),
        "claims-bsh-spread": spread_rows(others["bsh-table-1"]),
    }  # fmt: skip


EXPERIMENT = Experiment(
    "claims-bsh",
    "The paper's claims, and whether they hold here",
    "Each verdict is computed by the rule that stands beside it, from the tables above, from the paper's own numbers, "
    "and from small runs of its own (128²): BSH-E5 and E9 on a knot of glass, four generations, two lists in a row. "
    "Counts decide nothing about time. The other tables hold those runs, nodes a ray in two readings of the paper's "
    "counter, and the numbers of the paper's text, each with its place.",
    cases,
    measure,
    None,
    tables,
    needs=(
        "bsh-figure-2", "bsh-figure-4", "bsh-table-1", "bsh-table-2", "bsh-table-3", "bsh-growth", "bsh-histogram",
        "bsh-threshold", "bsh-holes", "bsh-lists", "bsh-locality", "bsh-compared",
    ),
)  # fmt: skip
