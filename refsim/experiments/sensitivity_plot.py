"""Dot plots of settings: a panel a claim, a row a parameter, a labelled dot a setting, the region of the claim shaded.

Narrower and with larger letters than other pictures, so that a telephone still shows them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from refsim.experiments import style
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.sensitivity_frame import HOLDS, RATIO, Claim

WIDTH = 5.6  # inches
ROW = 0.39
LABEL = 7.5
REGION = "#e3efe8"
# Where a label may stand, in points from its dot: above, below, then further off
LANES = (5.0, -11.5)
GAP = 3.0


def draw(found: Rows, claims: Sequence[Claim]) -> Any:
    """The figure of all claims that have lines."""
    shown = [(claim, own) for claim in claims if (own := _of(found, claim))]
    counts = [len({line["parameter"] for line in own}) for _, own in shown]
    figure = style.new_figure(ROW * sum(counts) + 0.95 * len(counts), WIDTH)
    if not shown:
        return figure
    heights = [count + 0.6 for count in counts]
    panels = figure.subplots(len(shown), 1, squeeze=False, height_ratios=heights)[:, 0]
    drawn = [(axes, claim, own) for axes, (claim, own) in zip(panels, shown, strict=True)]
    for axes, claim, own in drawn:
        _panel(axes, claim, own)
    # Labels are placed where the layout has put the dots
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes, _, own in drawn:
        _labels(axes, own)
    return figure


def _of(found: Rows, claim: Claim) -> Rows:
    return [line for line in found if (line["headline"], line["claim"]) == (claim.headline, claim.claim)]


def _panel(axes: Any, claim: Claim, own: Rows) -> None:
    known = [line for line in own if line["holds"] != MISSING]
    names = list(dict.fromkeys(line["parameter"] for line in own))
    _scale(axes, claim, known)
    low, high = axes.get_xlim()
    axes.axvspan(max(low, claim.low), min(high, claim.high), color=REGION, zorder=0, linewidth=0)
    base = next(line["value"] for line in known if line["baseline"] == HOLDS)
    axes.axvline(base, color=style.INK, linewidth=0.9, linestyle=":", zorder=1)
    for line in known:
        place = names.index(line["parameter"])
        axes.plot(line["value"], place, **_look(line))
    for place, name in enumerate(names):
        cameras = [line for line in known if line["parameter"] == name]
        ends = [min(line["least_of_cameras"] for line in cameras), max(line["most_of_cameras"] for line in cameras)]
        axes.plot(ends, (place, place), color="#c4c4c4", linewidth=2.2, solid_capstyle="butt", zorder=1)
        absent = [line["setting"] for line in own if line["parameter"] == name and line["holds"] == MISSING]
        if absent:
            axes.text(1.0, place + 0.42, f"missing: {', '.join(absent)}", fontsize=6, color=style.FAINT, ha="right",
                      transform=axes.get_yaxis_transform())  # fmt: skip
    axes.set_yticks(range(len(names)), [_broken(name) for name in names], fontsize=8.5)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel(claim.unit)
    axes.set_title(f"Said: {claim.said}", loc="left", x=-0.02)


def _scale(axes: Any, claim: Claim, known: Rows) -> None:
    """Logarithmic for ratios. The limit of the claim is in view, and labels have room at both ends."""
    ends = [end for line in known for end in (line["least_of_cameras"], line["most_of_cameras"])]
    ends += [limit for limit in (claim.low, claim.high) if math.isfinite(limit)]
    if claim.spread == RATIO:
        axes.set_xscale("log")
        room = (max(ends) / min(ends)) ** 0.12
        axes.set_xlim(min(ends) / room, max(ends) * room)
        if max(ends) / min(ends) > 3:
            style.plain_ticks(axes.xaxis)
        else:
            _linear_ticks(axes)
    else:
        room = 0.07 * (max(ends) - min(ends))
        axes.set_xlim(min(ends) - room, max(ends) + room)


def _linear_ticks(axes: Any) -> None:
    """A logarithmic axis of less than half a decade: ticks as on a linear one."""
    from matplotlib.ticker import FormatStrFormatter, MaxNLocator, NullLocator

    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))


def _look(line: Row) -> dict[str, Any]:
    good = line["holds"] == HOLDS
    look = {"marker": "o" if good else "D", "color": style.BLUE if good else style.VERMILION, "linestyle": "none"}
    return look | {"markersize": 5.0 if good else 4.5, "fillstyle": "full" if good else "none", "zorder": 3}


def _broken(name: str) -> str:
    """A name in two lines where it is long."""
    words, lines = name.split(" "), [""]
    for word in words:
        if len(lines[-1]) + len(word) > 15 and lines[-1]:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)


def _labels(axes: Any, own: Rows) -> None:
    """Names of settings above or below their dots, where there is room; the two ends of a row are named first."""
    names = list(dict.fromkeys(line["parameter"] for line in own))
    for place, name in enumerate(names):
        row = [line for line in own if line["parameter"] == name and line["holds"] != MISSING]
        row.sort(key=lambda line: line["value"])
        ends = [row[0], row[-1]] if len(row) > 1 else row
        taken: dict[float, list[tuple[float, float]]] = {lane: [] for lane in LANES}
        for line in (*ends, *(line for line in row if line not in ends)):
            _label(axes, line, place, taken)


def _label(axes: Any, line: Row, place: int, taken: dict[float, list[tuple[float, float]]]) -> None:
    """In the first lane that is free there; no label where none is."""
    points = 72.0 / axes.figure.dpi
    dot = axes.transData.transform((line["value"], place))[0] * points
    half = 0.5 * _width(axes, line["setting"])
    # Nothing is cut at the picture's right edge
    middle = min(dot, 72.0 * axes.figure.get_figwidth() - half - GAP)
    for lane, spans in taken.items():
        left, right = middle - half, middle + half
        if all(right + GAP < start or end + GAP < left for start, end in spans):
            spans.append((left, right))
            axes.annotate(line["setting"], (line["value"], place), xytext=(middle - dot, lane),
                          textcoords="offset points", ha="center", fontsize=LABEL, color=style.INK,
                          annotation_clip=False, zorder=4, path_effects=_halo())  # fmt: skip
            return


def _halo() -> list[Any]:
    """White around letters that stand on a line."""
    from matplotlib.patheffects import Normal, Stroke

    return [Stroke(linewidth=2.2, foreground="white", alpha=0.85), Normal()]


def _width(axes: Any, text: str) -> float:
    """Of a label, in points."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    box = TextPath((0, 0), text, size=LABEL, prop=FontProperties(family="DejaVu Sans")).get_extents()
    return float(box.width)
