"""The text's claims about passes, shaders' places and the grid, judged by a rule in code on rows of other experiments.

`quotients` holds numbers of ours beside the paper's. Used by `gsr_claims`, which says what a verdict is. Recursive Ray
Tracing in Geometry Shader, sections 3, 4.1, 4.3, 5 and 6.
"""

from __future__ import annotations

from typing import Any

from refsim.experiments import gsr_paper_case, gsr_table_2
from refsim.experiments.gsr_claims_print import CITED, FIXED_ORDER, all_or_some, span, table_2_time
from refsim.experiments.gsr_runs import GEOMETRY_SHADER
from refsim.experiments.gsr_table_2 import ALONE, COMPARED_WIDTH, FRAGMENT, INSIDE, PASS_THROUGH, RECONVERGE
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.verdicts import claim
from refsim.papers.geometry_shader_rays.simt import WIDTHS

MEETS = next(iter(RECONVERGE))


def passes_claims(rows: Rows) -> Rows:
    """Section 4.3, against a recursive ray tracer."""
    pictures = gsr_paper_case.of_part(rows, "passes")
    as_deep = [row for row in pictures if row["as_deep"]]
    shallower = [row for row in pictures if row["depth_of_recursion"] < row["passes"]]
    shadowed = [row for row in pictures if row["deepest_hits_shadowed"]]
    return [
        claim(
            "4.3", "the number of passes equals the depth of the recursion", "cornell box, all surfaces mirror",
            "P passes make the picture of a recursion of depth P, bit for bit, and not that of depth P - 1, for each P",
            f"P = {', '.join(str(row['passes']) for row in as_deep)}: "
            f"{', '.join(str(row['pixels_changed']) for row in as_deep)} pixels differ; from depth P - 1: "
            f"{', '.join(str(row['pixels_changed']) for row in shallower)}",
            all(row["pixels_changed"] == 0 for row in as_deep)
            and all(row["pixels_changed"] > 0 for row in shallower),
        ),
        claim(
            "4.3", "two passes make the picture of one bounce whose hits are shadowed too", "cornell box",
            "the same bits", f"{sum(row['pixels_changed'] for row in shadowed)} pixels differ",
            all(row["pixels_changed"] == 0 for row in shadowed),
        ),
    ]  # fmt: skip


def stage_claims(table_1: Rows, table_2: Rows, table_3: Rows) -> Rows:
    """Sections 3 and 4.1."""
    return [*_paths(table_2), _in_the_geometry_shader(table_2), _small_scenes(table_1, table_3)]


def _paths(table_2: Rows) -> Rows:
    """ "Shorter shaders result in lower branching divergence": distinct ways through a shader that a warp takes."""
    found = []
    for mode, body in (("RT", "with shadows and reflections"), ("RC", "ray casting")):
        paths = {
            name: [gsr_table_2.one(table_2, name, mode, width, MEETS)["paths_per_warp"] for width in WIDTHS]
            for name in (INSIDE, PASS_THROUGH)
        }
        found.append(
            claim(
                "4.1", "shorter shaders: a warp takes fewer distinct paths", body,
                "in the one shader that does all a warp takes more paths than in the two, for every warp width",
                f"one shader {span(paths[INSIDE])}, two {span(paths[PASS_THROUGH])}",
                all(a > b for a, b in zip(paths[INSIDE], paths[PASS_THROUGH], strict=True)),
            )
        )  # fmt: skip
    return found


def _counters(table_2: Rows) -> dict[tuple[str, str], Row]:
    return {(row["configuration"], row["mode"]): row for row in gsr_table_2.of_part(table_2, "counters")}


def _in_the_geometry_shader(table_2: Rows) -> Row:
    rows, same = _counters(table_2), ("rays", "cells", "triangle_tests", "ray_bytes_written")
    modes = [mode for name, mode in rows if name == INSIDE]
    return claim(
        "4.1", "the vertex shader's work may be done in the geometry shader", "knot",
        f"the same {', '.join(name.replace('_', ' ') for name in same)}",
        "; ".join(f"{mode}: {rows[INSIDE, mode]['cells']} and {rows[PASS_THROUGH, mode]['cells']} cells, "
                  f"{rows[INSIDE, mode]['triangle_tests']} and {rows[PASS_THROUGH, mode]['triangle_tests']} tests"
                  for mode in modes),
        all(rows[INSIDE, mode][name] == rows[PASS_THROUGH, mode][name] for mode in modes for name in same),
    )  # fmt: skip


def _small_scenes(table_1: Rows, table_3: Rows) -> Row:
    """Cells and tests a pixel with the grid against tests without it, in the scenes of Table 1."""
    saved: dict[int, float] = {}
    grid = {row["triangles"]: row for row in table_3
            if row["triangles"] != MISSING and (row["mode"], row["method"]) == ("RC", GEOMETRY_SHADER)}  # fmt: skip
    for row in table_1:
        frame, naive = row["triangles"], row["triangle_tests"] / row["size_px"] ** 2
        if row["mode"] == "RC" and frame in grid:
            with_grid = grid[frame]
            cost = (with_grid["cells"] + with_grid["triangle_tests"]) / with_grid["size_px"] ** 2
            saved[frame] = naive / cost
        if row.get("grid_cells_visited") not in ("", None) and frame not in saved:
            saved[frame] = row["triangle_tests"] / (row["grid_cells_visited"] + row["grid_triangle_tests"])
    return claim(
        "3", "the uniform grid is effective", "scenes of Table 1",
        "fewer cells and tests than tests without it, in every scene; depends where in some",
        "; ".join(f"{frame} triangles: x {factor:.3g}" for frame, factor in sorted(saved.items())),
        all_or_some([factor > 1.0 for factor in saved.values()]),
    )  # fmt: skip


def quotients(table_1: Rows, table_2: Rows) -> Rows:
    """Numbers of ours, and the paper's beside them."""
    rows, key = _counters(table_2), "issued_before_shading_lane_steps"
    slower = table_2_time(ALONE) / table_2_time(FRAGMENT)
    lanes = {
        width: gsr_table_2.one(table_2, ALONE, "RC", width, MEETS)[key]
        / gsr_table_2.one(table_2, FRAGMENT, "RC", width, MEETS)[key]
        for width in WIDTHS
    }
    found = [
        _quotient("vertices in rows ÷ pixels in tiles, lane-steps", f"warps of {width}", factor, slower)
        for width, factor in lanes.items()
    ]
    overhead = table_2_time(PASS_THROUGH) / table_2_time(ALONE)
    work = [f"{name}_{what}" for name in ("vertex", "geometry") for what in ("arithmetic", "fetches")]
    moved = ("ray_bytes_read", "ray_bytes_written")
    for body, columns in (("operations before shading", work), ("bytes of rays", moved)):
        with_it, without = (sum(rows[name, "RC"][column] for column in columns) for name in (PASS_THROUGH, ALONE))
        found.append(_quotient("with a geometry shader ÷ without", body, with_it / without, overhead))
    for place, own in (("Table 1", table_1), ("Table 2", list(rows.values()))):
        found.append(_quotient("eye rays that hit, percent", place, min(_hits(own)), 100.0))
    return [*found, _quotient("section that fixes the order of emission", "text", FIXED_ORDER, CITED)]


def _hits(rows: Rows) -> list[float]:
    return [row["eye_rays_that_hit_percent"] for row in rows]


def _quotient(quantity: str, body: str, measured: float, printed: float) -> dict[str, Any]:
    chosen = COMPARED_WIDTH if body == f"warps of {COMPARED_WIDTH}" else ""
    return {"quantity": quantity, "body": body, "measured": round(measured, 4), "printed": round(printed, 4),
            "lanes_of_its_card": chosen}  # fmt: skip
