"""The text's claims, each judged by a rule in code on the rows of the other experiments and on the printed numbers.

A verdict is `holds`, `fails`, or `depends` where the rule decides differently for other scenes, views or rules.
Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from collections.abc import Mapping

from refsim.experiments import bsh_claims_method as method
from refsim.experiments import bsh_claims_tables as of_tables
from refsim.experiments import bsh_published as published
from refsim.experiments.bsh_claims_text import text_claims
from refsim.experiments.bsh_runs import body_of, rays_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.verdicts import claim
from refsim.scene.stages import on_ground

ERRATA = ("BSH-E5", "BSH-E9")
CONDITIONS = {
    "BSH-E5": "the sphere's exit root is the intersection parameter",
    "BSH-E9": "per-polygon heads serve every ray that leaves a polygon",
}


def cases(quick: bool) -> list[Case]:
    """A case an erratum that can stand as printed."""
    return [{"erratum": erratum, "size_px": 48 if quick else 128} for erratum in ERRATA]


def measure(erratum: str, size_px: int) -> Rows:
    """How many rays find something else where the text stands as printed, on a body of glass, four generations."""
    options = {"shadows": False, "generations": 4, "heads": "regular", "material": "glass"}
    right, printed = (_glass("torus_knot_1024", size_px, errata, **options) for errata in ("corrected", erratum))
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


def compared_claims(rows: Rows) -> Rows:
    """Structures on the same rays."""
    own = method.present(rows)
    if not own:
        return []
    found: list[Row] = [
        claim(
            "2.1", "all structures find the same hits", "same rays",
            "triangles are equal, shadow rays hit or miss alike",
            f"{sum(row['same_hits'] for row in own)} of {len(own)} runs", all(row["same_hits"] for row in own),
        )
    ]  # fmt: skip
    for other in ("boxes, one list", "ordered stack", "kd-tree, restart", "kd-tree, backtrack"):
        pairs = {
            scene: [row["nodes_per_ray"] for name in ("six lists", other) for row in own
                    if (row["scene"], row["structure"]) == (scene, name)]
            for scene in dict.fromkeys(row["scene"] for row in own)
        }  # fmt: skip
        found.append(
            claim(
                "6", "among the best", f"six lists against: {other}", "fewer nodes a ray, in every scene",
                "; ".join(f"{scene} {a:g} against {b:g}" for scene, (a, b) in pairs.items()),
                method.some([a < b for a, b in pairs.values()]),
            )
        )  # fmt: skip
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """The verdicts, the errata's counts, and all numbers of the paper's text."""
    verdicts = [
        *text_claims(),
        *method.partition_claims(others["bsh-figure-2"]),
        *method.hole_claims(others["bsh-holes"]),
        *of_tables.set_up_claims(others["bsh-figure-4"]),
        *of_tables.table_1_claims(others["bsh-table-1"]),
        *of_tables.reading_claims(others["bsh-table-2"], others["bsh-table-1"]),
        *of_tables.copy_claims(others["bsh-table-3"]),
        *method.head_claims(others["bsh-histogram"]),
        *method.gain_claims(others["bsh-lists"]),
        *method.growth_claims(others["bsh-growth"]),
        *method.locality_claims(others["bsh-locality"]),
        *threshold_claims(others["bsh-threshold"]),
        *compared_claims(others["bsh-compared"]),
        *errata_claims(rows),
    ]
    return {"claims-bsh": verdicts, "claims-bsh-errata": rows, "claims-bsh-published": published.published_rows()}


EXPERIMENT = Experiment(
    "claims-bsh",
    "The paper's claims, and whether they hold here",
    "Each verdict is computed by the rule that stands beside it, from the tables above, from the paper's own numbers, "
    "and for BSH-E5 and E9 from small runs of its own (128², a knot of glass, four generations). Counts decide "
    "nothing about time. The other tables hold those runs, and the numbers of the paper's text, each with its place.",
    cases,
    measure,
    None,
    tables,
    needs=(
        "bsh-figure-2", "bsh-figure-4", "bsh-table-1", "bsh-table-2", "bsh-table-3", "bsh-growth", "bsh-histogram",
        "bsh-threshold", "bsh-holes", "bsh-lists", "bsh-locality", "bsh-compared",
    ),
)  # fmt: skip
