"""How Figure 3 is drawn: cross-sections in the plane of axis and origin, and outlines of cones from the side."""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.construction import Vectors, telling, vector
from refsim.experiments.figure_2_plot import NEW, OLD, PANELS, RAY, arrow, wedge
from refsim.experiments.registry import Row, Rows

PRINTED = style.VERMILION
POINT = style.INK


def plot_steps(above: Any, below: Any, drawn: Rows) -> None:
    """The step that shows best, before and after, and a strip of all."""
    shown = max(drawn, key=_shows)
    left, right = above.subplots(1, 2)
    plane = _plane(shown)
    frame = _frame(shown, plane)
    _before(left, shown, plane, frame[2])
    _after(right, shown, plane, frame[2])
    for axes in (left, right):
        style.no_frame(axes)
        axes.set_aspect("equal")
        axes.set_xlim(*frame[0])
        axes.set_ylim(*frame[1])
    left.set_title(f"ray {shown['step']}, before: φ = {shown['phi_deg']:.1f}°", loc="center")
    right.set_title("after: corrected, and as printed (dashed)", loc="center")
    some = telling(drawn, lambda row: abs(row["t"]), PANELS)
    side = _side(drawn[-1], shown)
    everything = _outline_frame(drawn, side)
    for axes, row in zip(below.subplots(1, len(some), squeeze=False)[0], some, strict=True):
        _from_the_side(axes, row, drawn, side, everything)


def _shows(row: Row) -> float:
    """How well a step can be drawn: the half-angle and what p is outside by, whichever is less, in degrees."""
    c, x = vector(row, "c"), vector(row, "x")
    angle = float(np.degrees(np.arctan2(np.linalg.norm(np.cross(x, c)), x @ c)))
    return min(row["phi_deg"], angle - row["phi_deg"], 90.0 - angle)


def _plane(row: Row) -> Vectors:
    """Two directions: across, on the side of p, and along the axis; p and the apices lie in that plane about a."""
    return np.stack([-vector(row, "q"), vector(row, "x")])


def _flat(row: Row, name: str, plane: Vectors) -> Vectors:
    """A point of the row, from a."""
    return np.asarray(plane @ (vector(row, name) - vector(row, "a")))


def _frame(row: Row, plane: Vectors) -> tuple[tuple[float, float], tuple[float, float], float]:
    """Limits of both axes, the same for both panels, and the length of a unit vector."""
    points = np.array([(0.0, 0.0), *(_flat(row, name, plane) for name in ("p", "a_new", "a_printed"))])
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(max(np.ptp(points, axis=0)))
    middle = 0.5 * (low[0] + high[0])
    bottom, top = low[1] - 0.2 * size, high[1] + 0.55 * size
    half = 0.68 * (top - bottom)
    return (middle - half, middle + half), (bottom, top), 0.45 * size


def _dot(
    axes: Any, at: Vectors, name: str, size: float, color: str = POINT, marker: str = "o", left: bool = False
) -> None:
    axes.plot(*at, marker, color=color, markersize=5, zorder=5)
    beside = at[0] + (-0.1 if left else 0.1) * size
    side = "right" if left else "left"
    axes.text(beside, at[1] - 0.16 * size, name, color=color, ha=side, va="center", fontsize=10)


def _before(axes: Any, row: Row, plane: Vectors, unit: float) -> None:
    phi = row["phi_deg"]
    a, p = np.zeros(2), _flat(row, "p", plane)
    n, e = (plane @ vector(row, name) for name in ("n", "e"))
    wedge(axes, (0, 0), 0.0, phi, 20.0 * unit, OLD)
    arrow(axes, a, plane @ vector(row, "x") * unit, OLD, "")
    arrow(axes, a, n * unit, OLD, "")
    arrow(axes, a, e * unit, OLD, "")
    for name, way in (("x", (0.0, 1.22)), ("n", (n[0] + 0.16, n[1])), ("e", (e[0] - 0.16, e[1]))):
        axes.text(way[0] * unit, way[1] * unit, name, color=OLD, ha="center", va="center", fontsize=10)
    foot = n * float(n @ (plane @ vector(row, "c")))
    axes.plot(*np.stack([a, foot]).T, ":", color=OLD, linewidth=1.2)
    arrow(axes, a, p, POINT, "c", 0.6 * p + np.array([0.06, -0.1]) * unit, linewidth=1.1)
    arrow(axes, foot, p, style.PURPLE, "g", 0.5 * (foot + p) + np.array([0.05, 0.14]) * unit, linewidth=1.8)
    _dot(axes, a, "a", unit, left=True)
    _dot(axes, p, "p", unit)


def _after(axes: Any, row: Row, plane: Vectors, unit: float) -> None:
    phi = row["phi_deg"]
    p, new, printed = (_flat(row, name, plane) for name in ("p", "a_new", "a_printed"))
    wedge(axes, new, 0.0, phi, 20.0 * unit, NEW)
    wedge(axes, (0, 0), 0.0, phi, 20.0 * unit, OLD, alpha=0.1)
    wedge(axes, printed, 0.0, phi, 20.0 * unit, PRINTED, linestyle="--", alpha=0.0)
    arrow(axes, np.zeros(2), new, NEW, "", linewidth=1.6)
    arrow(axes, np.zeros(2), printed, PRINTED, "", linewidth=1.6, linestyle="--")
    _dot(axes, np.zeros(2), "a", unit, left=True)
    _dot(axes, p, "p", unit)
    _dot(axes, new, "a + e·t", unit, NEW, "s")
    _dot(axes, printed, "a − e·t (printed)", unit, PRINTED, "X", left=True)


def _side(last: Row, shown: Row) -> Vectors:
    """Across and along, seen from the side: along the last axis, across towards the shown step's p."""
    along = vector(last, "x")
    across = -vector(shown, "q")
    across = across - along * (across @ along)
    return np.stack([across / np.linalg.norm(across), along])


def _outline(row: Row, side: Vectors) -> tuple[Vectors, float, float]:
    """A cone from the side, without perspective: its apex, and its outline's middle and half-angle in degrees.

    Where the axis is tilted by beta out of the drawing, the outline's half-angle has the sine sin φ / cos beta.
    """
    x, y = side @ vector(row, "x")
    sine = np.sin(np.radians(row["phi_deg"])) / np.hypot(x, y)
    half = float(np.degrees(np.arcsin(min(1.0, sine))))
    return side @ vector(row, "a_new"), float(np.degrees(np.arctan2(x, y))), half


def _outline_frame(drawn: Rows, side: Vectors) -> tuple[Vectors, float]:
    """The middle and half the side of a square that holds all origins and the last apex."""
    points = np.array([*(side @ vector(row, "p") for row in drawn), side @ vector(drawn[-1], "a_new")])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return middle, 0.62 * float(np.ptp(points, axis=0).max())


def _from_the_side(axes: Any, row: Row, drawn: Rows, side: Vectors, everything: tuple[Vectors, float]) -> None:
    middle, half = everything
    apex, turn, opening = _outline(row, side)
    wedge(axes, apex, turn, opening, 20.0 * half, NEW)
    earlier = np.array([side @ vector(r, "p") for r in drawn if r["step"] < row["step"]]).reshape(-1, 2)
    axes.plot(*earlier.T, ".", color=style.FAINT, markersize=3.5)
    axes.plot(*(side @ vector(row, "a")), "o", color=OLD, markersize=4)
    axes.plot(*apex, "s", color=NEW, markersize=5)
    axes.plot(*(side @ vector(row, "p")), "D", color=RAY, markersize=4)
    axes.set_aspect("equal")
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.tick_params(labelsize=7)
    axes.locator_params(nbins=4)
    axes.set_title(f"ray {row['step']}: φ = {row['phi_deg']:.1f}°", fontsize=7.5, loc="center")
    if row is drawn[0]:
        axes.set_ylabel("scene units", fontsize=8)
