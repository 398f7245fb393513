"""The picture of `depth_24`: wrong hits over the range of depth, and how far behind the nearest they are."""

from __future__ import annotations

from typing import Any

from refsim.experiments import style
from refsim.experiments.registry import Row, Rows

MILLION = 1e6


def label(row: Row) -> str:
    """How the picture names a scene."""
    ground = f", ground {2 * row['ground_half']:g} wide" if row["ground_half"] else ""
    body = row["triangles"] - (2 if row["ground_half"] else 0)
    return f"{style.body_name(row['scene'])}, {body:,}{ground}"


def plot(rows: Rows) -> Any:
    """Wrong hits per million, and the worst gap, over the factor of the range."""
    lines = [row for row in rows if "range_factor" in row]
    figure = style.new_figure(4.2)
    left, right = figure.subplots(1, 2)
    for k, (name, own) in enumerate(_scenes(lines).items()):
        look: dict[str, Any] = {"color": style.CYCLE[k % 7], "marker": style.MARKERS[k % 6], "label": name}
        factors = sorted({row["range_factor"] for row in own})
        share = [_per_million([row for row in own if row["range_factor"] == factor]) for factor in factors]
        left.plot(factors, share, **look)
        gaps = [max(row["worst_gap_steps"] for row in own if row["range_factor"] == factor) for factor in factors]
        some = [(factor, gap) for factor, gap in zip(factors, gaps, strict=True) if gap > 0]
        right.plot([f for f, _ in some], [g for _, g in some], linestyle="none", **{**look, "label": None})
    # None is drawn at the foot of a scale that is linear below one
    left.set_yscale("symlog", linthresh=1.0)
    left.set_ylim(bottom=-0.1)
    left.set_ylabel("wrong hits per million")
    left.set_title("Wrong hits")
    right.axhline(1.0, color=style.FAINT, linewidth=1)
    right.text(1.0, 1.02, "one step", fontsize=8, color="#555555", va="bottom")
    right.set_ylim(0.0, 1.15)
    right.set_ylabel("worst gap, depth steps")
    right.set_title("How far behind the nearest")
    for axes in (left, right):
        axes.set_xscale("log", base=16)
        axes.set_xlim(0.7, 1.4 * max(row["range_factor"] for row in lines))
        axes.set_xlabel("range of depth, times the scene's own")
        axes.set_xticks(factors, [f"{factor:,}" for factor in factors])
        axes.minorticks_off()
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _scenes(lines: Rows) -> dict[str, Rows]:
    found: dict[str, Rows] = {}
    for row in lines:
        found.setdefault(label(row), []).append(row)
    return found


def _per_million(rows: Rows) -> float:
    hits = sum(row["hits"] for row in rows)
    return MILLION * sum(row["wrong_hits"] for row in rows) / hits if hits else 0.0
