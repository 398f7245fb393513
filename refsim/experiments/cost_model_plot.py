"""The cost model's picture: predicted against printed milliseconds, a panel a table of times."""

from __future__ import annotations

from typing import Any

from refsim.experiments import cost_model_fit as fitting
from refsim.experiments import style
from refsim.experiments.registry import Rows
from refsim.experiments.runs import MISSING

WAYS = (("full", "fitted to all scenes"), ("none", "predicted, its scene left out;\nalone: in no fit"))


def plot(rows: Rows) -> Any:
    """A panel a subject."""
    shown = [row for row in rows if row["mesh"] != MISSING]
    subjects = list(dict.fromkeys(row["subject"] for row in shown))
    if not subjects:
        figure = style.new_figure(1.5)
        axes = figure.subplots()
        style.no_frame(axes)
        axes.text(0.5, 0.5, "too few scenes: meshes are missing", ha="center", va="center", color=style.FAINT)
        return figure
    # One panel more than subjects: what the marks mean is said once
    lines = len(subjects) // 2 + 1
    figure = style.new_figure(0.4 + 3.4 * lines)
    panels = list(figure.subplots(lines, 2, squeeze=False).flat)
    scenes = list(dict.fromkeys(_scene(row["row"]) for row in shown))
    looks = {
        name: (style.CYCLE[k % len(style.CYCLE)], style.MARKERS[k % len(style.MARKERS)])
        for k, name in enumerate(scenes)
    }
    for axes, subject in zip(panels, subjects, strict=False):
        _draw(axes, [row for row in shown if row["subject"] == subject], looks)
    _legend(panels[len(subjects)], looks)
    for axes in panels[len(subjects) + 1 :]:
        axes.set_visible(False)
    return figure


def _legend(axes: Any, looks: dict[str, tuple[str, str]]) -> None:
    """Scenes, and the two ways a mark is drawn."""
    style.no_frame(axes)
    marks = [axes.plot([], [], marker, color=color, label=name)[0] for name, (color, marker) in looks.items()]
    ways = [axes.plot([], [], "o", color=style.INK, fillstyle=fill, label=label)[0] for fill, label in WAYS]
    # Two columns of names in the width of a panel
    first = axes.legend(
        handles=marks, loc="upper left", fontsize=7.5, ncols=2, columnspacing=1.0, handletextpad=0.4, title="scene",
        alignment="left",
    )  # fmt: skip
    axes.add_artist(first)
    axes.legend(handles=ways, loc="lower left", fontsize=8.5, title="mark", alignment="left")


def _draw(axes: Any, rows: Rows, looks: dict[str, tuple[str, str]]) -> None:
    times = [row[name] for row in rows for name in ("published_ms", "fitted_ms", "predicted_unseen_ms") if row[name]]
    low, high = 0.7 * min(times), 1.4 * max(times)
    share = fitting.LIMIT / 100.0
    ends = (low, high)
    axes.fill_between(ends, [(1 - share) * x for x in ends], [(1 + share) * x for x in ends], color="#e8e8e8", lw=0)
    axes.plot(ends, ends, color=style.FAINT, linewidth=0.9)
    for row in rows:
        color, marker = looks[_scene(row["row"])]
        x, unseen = row["published_ms"], row["predicted_unseen_ms"]
        if row["in_the_fit"]:
            axes.plot((x, x), (row["fitted_ms"], unseen), color=color, linewidth=0.6)
            axes.plot(x, row["fitted_ms"], marker, color=color)
        axes.plot(x, unseen, marker, color=color, fillstyle="none")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    style.plain_ticks(axes.xaxis)
    style.plain_ticks(axes.yaxis)
    axes.set_xlabel("printed milliseconds")
    axes.set_ylabel("predicted milliseconds")
    axes.set_title(f"{rows[0]['device']}: {rows[0]['subject']}")
    axes.text(0.98, 0.02, rows[0]["model"].replace("_", " "), transform=axes.transAxes, ha="right", fontsize=7.5)


def _scene(label: str) -> str:
    return label.split(",")[0]
