"""Claims of section 3: what heads of polygons and of screen cells save, judged on the histograms' means.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from refsim.experiments.bsh_claims_method import present, some
from refsim.experiments.bsh_histogram import CELLS, EIGHT, SIX
from refsim.experiments.registry import Row, Rows
from refsim.experiments.verdicts import claim

RULES = ("leaf", "climb")
SLIGHT = 10.0  # percent of the nodes that simple heads leave: a choice of ours


def body_of(row: Row) -> str:
    """`bunny, ground`."""
    return f"{row['scene']}{', ground' if row['ground'] else ''}"


def head_claims(rows: Rows) -> Rows:
    """All of section 3."""
    own = present([row for row in rows if row["part"] == "summary"])
    six = [row for row in own if row["lists"] == SIX]
    if not own:
        return []
    found: Rows = []
    for rule in RULES:
        found += [*_cells_against_polygons(six, rule), *_polygons(six, rule)]
    return [*found, *_planes(six), *_octants(own), *_bare_parts(six)]


def _bare_parts(rows: Rows) -> Rows:
    """Parts of the screen whose rays all miss: their head is the end of the list, and they visit no node."""
    return [
        claim(
            "3", "eye rays of some part of the screen may all miss all primitives",
            f"{body_of(row)}, {row['screen_cells']} × {row['screen_cells']} cells", "rays of some cells visit no node",
            f"{row['no_node_percent']:g} percent of the rays", row["no_node_percent"] > 0,
        )
        for row in rows if (row["heads"], row["head_rule"]) == ("cells", "leaf")
    ]  # fmt: skip


def changes(rows: Rows, rule: str, heads: str, cells: int | str = "") -> dict[str, dict[str, float]]:
    """Percent by which nodes a ray change with these heads, by body and kind of rays."""
    found: dict[str, dict[str, float]] = {}
    for row in rows:
        if (row["head_rule"], row["heads"], row["screen_cells"]) == (rule, heads, cells):
            found.setdefault(body_of(row), {})[row["rays"]] = row["change_percent"]
    return found


def _cells_against_polygons(rows: Rows, rule: str) -> Rows:
    secondary = changes(rows, rule, "regular")
    found = []
    for cells in CELLS:
        eye = changes(rows, rule, "cells", cells)
        pairs = {body: (eye[body]["eye"], min(secondary[body].values())) for body in eye}
        found.append(
            claim(
                "3.2", "frustum culling works much better than what is done for secondary rays",
                f"heads by {rule}, {cells} × {cells} cells",
                "eye rays save a larger share of their nodes than shadow and reflected rays, in every scene",
                "; ".join(f"{body}: eye {a:+.1f}, secondary {b:+.1f} percent" for body, (a, b) in pairs.items()),
                some([a < b for a, b in pairs.values()]),
            )
        )  # fmt: skip
    return found


def _polygons(rows: Rows, rule: str) -> Rows:
    found = [
        claim(
            "3.1", "per-polygon heads speed up secondary rays", f"heads by {rule}, {body}",
            "shadow and reflected rays visit fewer nodes on average",
            ", ".join(f"{kind} {change:+.1f} percent" for kind, change in table.items()), max(table.values()) < 0,
        )
        for body, table in changes(rows, rule, "regular").items()
    ]  # fmt: skip
    own = [row for row in rows if row["head_rule"] == rule]
    found.append(
        claim(
            "BSH-E4", "a head helps every ray", f"heads by {rule}", "no ray visits more nodes than without",
            f"up to {max(row['more_percent'] for row in own):g} percent of the rays visit up to "
            f"{max(row['most_more'] for row in own)} more", all(row["more_percent"] == 0 for row in own),
        )
    )  # fmt: skip
    return found


def _planes(rows: Rows) -> Rows:
    """What the further planes save of the nodes that skipping what is behind the polygon leaves."""
    left: dict[tuple[str, ...], dict[str, float]] = {}
    for row in rows:
        left.setdefault((body_of(row), row["rays"], row["head_rule"]), {})[row["heads"]] = row["nodes_with"]
    found = []
    for (body, rays, rule), nodes in left.items():
        if "simple" in nodes:
            saved = 100.0 * (1.0 - nodes["regular"] / nodes["simple"])
            found.append(
                claim(
                    "3.1", "additional planes slightly improve the efficiency", f"{body}, {rays} rays, heads by {rule}",
                    f"regular heads save up to {SLIGHT:g} percent of the nodes that simple ones leave; depends where "
                    "they save more", f"{nodes['simple']:g} to {nodes['regular']:g} nodes a ray, {saved:.1f} percent",
                    False if saved <= 0 else True if saved <= SLIGHT else None,
                )
            )  # fmt: skip
    return found


def _octants(rows: Rows) -> Rows:
    found = []
    for rule in RULES:
        six, eight = (
            changes([row for row in rows if row["lists"] == lists], rule, "regular") for lists in (SIX, EIGHT)
        )
        found += [
            claim(
                "2.1", "the optimisations of section 3.1 work better with eight lists than with six",
                f"{body}, {rays} rays, heads by {rule}", "a larger share of the nodes is saved with eight",
                f"{six[body][rays]:+.1f} percent with six, {eight[body][rays]:+.1f} with eight",
                eight[body][rays] < six[body][rays],
            )
            for body in eight for rays in eight[body]
        ]  # fmt: skip
    return found
