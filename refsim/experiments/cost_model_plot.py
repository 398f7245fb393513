"""The cost model's picture: predicted against printed milliseconds, a panel a table of times."""

from __future__ import annotations

from typing import Any

from refsim.experiments import cost_model_fit as fitting
from refsim.experiments import style
from refsim.experiments.registry import Rows
from refsim.experiments.runs import MISSING


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
    lines = -(-len(subjects) // 2)
    figure = style.new_figure(0.4 + 3.4 * lines)
    panels = list(figure.subplots(lines, 2, squeeze=False).flat)
    for axes in panels:
        axes.set_visible(False)
    for axes, subject in zip(panels, subjects, strict=False):
        axes.set_visible(True)
        _draw(axes, [row for row in shown if row["subject"] == subject])
    return figure


def _draw(axes: Any, rows: Rows) -> None:
    times = [row[name] for row in rows for name in ("published_ms", "fitted_ms", "predicted_unseen_ms") if row[name]]
    low, high = 0.7 * min(times), 1.4 * max(times)
    share = fitting.LIMIT / 100.0
    ends = (low, high)
    axes.fill_between(ends, [(1 - share) * x for x in ends], [(1 + share) * x for x in ends], color="#e8e8e8", lw=0)
    axes.plot(ends, ends, color=style.FAINT, linewidth=0.9)
    scenes = list(dict.fromkeys(_scene(row["row"]) for row in rows))
    for k, scene in enumerate(scenes):
        color, marker = style.CYCLE[k % len(style.CYCLE)], style.MARKERS[k % len(style.MARKERS)]
        own = [row for row in rows if _scene(row["row"]) == scene]
        fitted = [row for row in own if row["in_the_fit"]]
        x = [row["published_ms"] for row in own]
        unseen = [row["predicted_unseen_ms"] for row in own]
        if fitted:
            for row in fitted:
                place = [row["published_ms"]] * 2
                axes.plot(place, (row["fitted_ms"], row["predicted_unseen_ms"]), color=color, linewidth=0.6)
            axes.plot(x, [row["fitted_ms"] for row in fitted], marker, color=color, label=scene)
            axes.plot(x, unseen, marker, color=color, fillstyle="none")
        else:
            axes.plot(x, unseen, "x", color=color, label=f"{scene} (not fitted)")
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
    axes.legend(loc="upper left", fontsize=7)


def _scene(label: str) -> str:
    return label.split(",")[0]
