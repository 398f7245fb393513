"""How Figure 2 is drawn: a cone's cross-section in the plane of axis and direction, and cones seen from their apex."""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.construction import Vectors, telling, vector
from refsim.experiments.registry import Row, Rows
from refsim.reference.vector import dot

OLD, NEW, RAY = style.BLUE, style.GREEN, style.VERMILION
PANELS = 5


def plot_steps(above: Any, below: Any, drawn: Rows, shown: Row) -> None:
    """The step shown, before and after, and a strip of all."""
    left, right = above.subplots(1, 2)
    _before(left, shown)
    _after(right, shown)
    for axes in (left, right):
        style.no_frame(axes)
        axes.set_aspect("equal")
    some = telling(drawn, lambda row: float(row["phi_new_deg"] or 180.0) - row["phi_deg"], PANELS)
    for axes, row in zip(below.subplots(1, len(some), squeeze=False)[0], some, strict=True):
        _seen_from_apex(axes, row, drawn)


def wedge(axes: Any, apex: Any, middle: float, half: float, size: float, color: str, **look: Any) -> None:
    """A cone's cross-section: `middle` and `half` in degrees from +y, clockwise."""
    from matplotlib.patches import Wedge

    style_of = {"facecolor": color, "alpha": 0.16, "linewidth": 0, **look}
    axes.add_patch(Wedge(apex, size, 90 - middle - half, 90 - middle + half, **style_of))
    for side in (-half, half):
        end = point(middle + side, size, apex)
        axes.plot(*zip(apex, end, strict=True), color=color, linewidth=1.1, linestyle=look.get("linestyle", "-"))


def point(angle: float, size: float, apex: Any = (0.0, 0.0)) -> tuple[float, float]:
    """The point at an angle in degrees from +y, clockwise."""
    turn = np.radians(angle)
    return apex[0] + size * float(np.sin(turn)), apex[1] + size * float(np.cos(turn))


def arrow(axes: Any, start: Any, end: Any, color: str, name: str, at: Any = None, **look: Any) -> None:
    """A vector with its name beyond its tip."""
    way = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0, **look}
    axes.annotate("", end, start, arrowprops=way)
    if at is None:
        far = np.subtract(end, start)
        at = np.add(end, 0.07 * far / np.hypot(*far))
    axes.text(*at, name, color=color, ha="center", va="center", fontsize=10)


def arc(axes: Any, low: float, high: float, size: float, name: str, color: str, at: float = 0.5) -> None:
    """An angle between two directions, in degrees from +y, clockwise."""
    turn = np.linspace(low, high, 40)
    axes.plot(*np.array([point(angle, size) for angle in turn]).T, color=color, linewidth=0.9)
    axes.text(*point(low + at * (high - low), size + 0.065), name, color=color, ha="center", va="center", fontsize=9)


def _before(axes: Any, row: Row) -> None:
    phi, theta = row["phi_deg"], row["theta_deg"]
    wedge(axes, (0, 0), 0.0, phi, 1.0, OLD)
    arrow(axes, (0, 0), (0, 1), OLD, "x")
    arrow(axes, (0, 0), point(-phi, 1.0), OLD, "e")
    tip = point(theta, 1.0)
    arrow(axes, (0, 0), tip, RAY, "r")
    # From r to its projection on x
    foot = (0.0, tip[1])
    middle = (0.5 * tip[0], tip[1] + 0.05)
    arrow(axes, tip, foot, style.PURPLE, "q", middle, linestyle="-", linewidth=1.2)
    axes.plot(*foot, "s", color=style.PURPLE, markersize=3)
    arc(axes, 0.0, phi, 0.22, "φ", OLD)
    arc(axes, 0.0, theta, 0.38, "θ", RAY, 0.75)
    axes.plot(0, 0, "o", color=style.INK, markersize=4)
    axes.text(0, -0.07, "a", ha="center", va="center", fontsize=10)
    axes.set_title(f"before: φ = {phi:.1f}°, θ = {theta:.1f}°", loc="center")
    _frame(axes, row)


def _after(axes: Any, row: Row) -> None:
    phi, theta = row["phi_deg"], row["theta_deg"]
    # In the plane of x and r: how far the new axis is from the old one, on the side of r
    away, x_new = vector(row, "q"), vector(row, "x_new")
    turn = float(np.degrees(np.arctan2(-dot(away, x_new), dot(vector(row, "x"), x_new))))
    half = row["phi_new_deg"] if row["phi_new_deg"] != "" else 180.0
    wedge(axes, (0, 0), turn, half, 1.0, NEW)
    wedge(axes, (0, 0), 0.0, phi, 1.0, OLD, linestyle="--", alpha=0.1)
    arrow(axes, (0, 0), point(turn, 1.0), NEW, "$x_{new}$")
    arrow(axes, (0, 0), point(-phi, 1.0), OLD, "e")
    arrow(axes, (0, 0), point(theta, 1.0), RAY, "r")
    arc(axes, turn, turn + half, 0.42, "$φ_{new}$", NEW, 0.75)
    axes.plot(0, 0, "o", color=style.INK, markersize=4)
    axes.text(0, -0.07, "a", ha="center", va="center", fontsize=10)
    axes.set_title(f"after: new half-angle {half:.1f}° = (φ + θ) / 2", loc="center")
    _frame(axes, row)


def _frame(axes: Any, row: Row) -> None:
    side = 1.18 * max(0.35, float(np.sin(np.radians(min(90.0, max(row["phi_deg"], row["theta_deg"]))))))
    axes.set_xlim(-side, side)
    axes.set_ylim(-0.14, 1.16)


def _polar(directions: Vectors, axis: Vectors) -> Vectors:
    """Directions [n, 3] around an axis: angle in degrees and where it points, as points of a plane."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    right = np.cross(helper, axis)
    right /= np.linalg.norm(right)
    up = np.cross(axis, right)
    x, y, z = directions @ right, directions @ up, directions @ axis
    size = np.hypot(x, y)
    angle = np.degrees(np.arctan2(size, z))
    return np.stack([x, y], axis=-1) * (angle / np.where(size > 0, size, 1.0))[..., None]


def _rim(axis: Vectors, half: float) -> Vectors:
    """Directions on the rim of a cone."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    side = np.cross(axis, helper)
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)[:, None]
    around = side * np.cos(turn) + other * np.sin(turn)
    return np.asarray(axis * np.cos(np.radians(half)) + around * np.sin(np.radians(half)))


def _seen_from_apex(axes: Any, row: Row, drawn: Rows) -> None:
    last = next(r for r in reversed(drawn) if r["phi_new_deg"] != "")
    middle = vector(last, "x_new")
    axes.plot(*_polar(_rim(vector(row, "x"), row["phi_deg"]), middle).T, "--", color=OLD, linewidth=1.1)
    if row["phi_new_deg"] != "":
        axes.fill(*_polar(_rim(vector(row, "x_new"), row["phi_new_deg"]), middle).T, facecolor=NEW, alpha=0.16)
        axes.plot(*_polar(_rim(vector(row, "x_new"), row["phi_new_deg"]), middle).T, color=NEW, linewidth=1.4)
    earlier = np.array([vector(r, "r") for r in drawn if r["step"] < row["step"]]).reshape(-1, 3)
    axes.plot(*_polar(earlier, middle).T, ".", color=style.FAINT, markersize=3.5)
    axes.plot(*_polar(vector(row, "r"), middle), "D", color=RAY, markersize=4.5)
    reach = 1.25 * last["phi_new_deg"]
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.tick_params(labelsize=7)
    grows = f"{row['phi_deg']:.1f}° → {row['phi_new_deg'] or 180:.1f}°"
    axes.set_title(f"ray {row['step']}: {grows}", fontsize=7.5, loc="center")
    if row is drawn[0]:
        axes.set_ylabel("degrees from the last axis", fontsize=8)
