"""All headlines of the three papers: at which settings each claim holds, and what moves it most.

The settings are measured by the four experiments `sensitivity-hierarchy`, `-nodes`, `-grid` and `-lists`; here they
stand in one table, with a summary a claim, which the ledger reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import (
    sensitivity_grid,
    sensitivity_hierarchy,
    sensitivity_lists,
    sensitivity_nodes,
    style,
)
from refsim.experiments.registry import Case, Experiment, Rows, Tables
from refsim.experiments.sensitivity_frame import HOLDS, summary

PARTS = (sensitivity_hierarchy, sensitivity_nodes, sensitivity_grid, sensitivity_lists)
CLAIMS = tuple(claim for part in PARTS for claim in part.CLAIMS)
WIDTH = 5.6  # inches, as the dot plots


def cases(quick: bool) -> list[Case]:
    """None: all is measured by the experiments of the headlines."""
    return []


def measure() -> Rows:
    """Nothing of its own."""
    return []


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All settings of all headlines, and a line a claim."""
    found = [
        line for part in PARTS
        for stem_lines in part.tables(others[part.EXPERIMENT.id], {}).values() for line in stem_lines
    ]  # fmt: skip
    return {"sensitivity": found, "sensitivity-summary": summary(found, CLAIMS)}


def plot(found: Rows) -> Any:
    """A bar a claim: the share of the settings at which it holds; a mark where all cameras are counted."""
    headlines = list(dict.fromkeys(row["headline"] for row in found))
    figure = style.new_figure(0.62 * len(found) + 1.2, WIDTH)
    axes = figure.subplots()
    for place, row in enumerate(found):
        _draw_claim(axes, place, row, style.CYCLE[headlines.index(row["headline"])])
    axes.set_xlim(0, 100)
    axes.set_ylim(len(found) - 0.45, -0.7)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.grid(False, axis="y")
    axes.set_xlabel("percent of the settings at which the claim holds")
    axes.set_title("One factor at a time", loc="left")
    marks = axes.plot([], [], "D", color=style.INK, markersize=5, fillstyle="none", label="settings × cameras")
    figure.legend(handles=marks, loc="outside lower right")
    return figure


def _draw_claim(axes: Any, place: int, row: Any, color: str) -> None:
    """The claim above its bar, the numbers on the right of it."""
    share = 100.0 * row["holds"] / row["settings"]
    axes.barh(place + 0.12, 100.0, 0.26, color="#eeeeee")
    axes.barh(place + 0.12, share, 0.26, color=color)
    axes.plot(100.0 * row["with_cameras_holds"] / row["with_cameras"], place + 0.12, "D", color=style.INK,
              fillstyle="none", markersize=5, zorder=4, clip_on=False)  # fmt: skip
    base = "" if row["baseline_holds"] == HOLDS else ", not at the baseline"
    axes.text(0, place - 0.08, f"{row['headline']}: {row['claim']}", fontsize=8.5, va="bottom")
    axes.text(100, place + 0.3, f"{row['holds']} of {row['settings']}{base}; moved most by {row['moved_most_by']}",
              fontsize=7.5, va="top", ha="right", color="#555555")  # fmt: skip


EXPERIMENT = Experiment(
    "sensitivity",
    "At how many settings each headline holds",
    "Each headline's claims, one factor at a time from a stated baseline: cameras, normals, index of refraction, "
    "thresholds, resolution of grids and meshes, and what else each paper leaves open. Bars: the share of the settings "
    "at which a claim holds by the paper's own numbers; diamonds: the same with every setting seen by several cameras. "
    "The first table holds all settings, the other what each value lies between, what moves it most, and the one "
    "setting where a claim holds at one alone. A setting whose mesh is not at hand reads `missing` and is not counted.",
    cases,
    measure,
    plot,
    tables,
    needs=tuple(part.EXPERIMENT.id for part in PARTS),
    dpi=214,
    alt="Bars, one for each claim of the four headlines: the share of settings at which it holds, with a diamond for "
    "the share of all settings and cameras, the counts written beside.",
    drawn="sensitivity-summary",
)
