"""Figure 2: the partitions of the directions of space, drawn on the sphere by the function that picks a ray's list; and
each list's share of directions, and of normals that its culling rules leave out (BSH-E1, E2).

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, section 2.1."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Rows

LISTS = (1, 2, 6, 8)
RULES = {6: ("sextant_opposite", "sextant_same", "sextant_safe"), 8: ("octant_opposite", "octant")}
PAIRS = 200_000
SEES = (0.62, 0.42, 0.66)  # from where the spheres are drawn
COLORS = (style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.PURPLE, style.SKY, "#999999", "#F0E442")


def cases(quick: bool) -> list[Case]:
    """A case a partition."""
    return [{"lists": lists, "directions": 4_000 if quick else 400_000} for lists in LISTS]


def evenly(count: int) -> NDArray[np.float32]:
    """Directions spread over the sphere on a spiral of golden angles, f32[n, 3]."""
    k = np.arange(count)
    z = 1.0 - (2.0 * k + 1.0) / count
    angle = k * np.pi * (3.0 - 5.0**0.5)
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1).astype(np.float32)


def measure(lists: int, directions: int) -> Rows:
    """A row a list."""
    from refsim.papers.sphere_hierarchy.culling import kept_triangles
    from refsim.papers.sphere_hierarchy.directions import list_directions, list_of_rays

    spread = evenly(directions)
    picked, usable = list_of_rays(spread, lists), np.ones(directions, np.bool_)
    rows: Rows = []
    for number, along in enumerate(list_directions(lists)):
        own = picked == number
        row = {
            "lists": lists,
            "list": number,
            "along": name_of(along),
            "directions": directions,
            "share_percent": round(100.0 * float(own.mean()), 3),
        }
        rays, draw = spread[own].astype(np.float64), np.random.default_rng(number)
        for rule in RULES.get(lists, ()):
            # What is said of the opposite sextant, said of octants: the same rule on turned normals
            normals, named = (-spread, "octant") if rule == "octant_opposite" else (spread, rule)
            culled = ~kept_triangles(normals, usable, along, named)
            safe = ~kept_triangles(spread, usable, along, "octant" if lists == 8 else "sextant_safe")
            pairs = [draw.integers(0, int(part.sum()), PAIRS) for part in (own, culled)]
            facing = (rays[pairs[0]] * spread[culled][pairs[1]]).sum(axis=1) < 0.0
            row[f"{rule}_culled_percent"] = round(100.0 * float(culled.mean()), 3)
            row[f"{rule}_pairs_facing_percent"] = round(100.0 * float(facing.mean()), 3)
            row[f"{rule}_unsafe_percent_of_culled"] = round(100.0 * float((culled & ~safe).sum() / culled.sum()), 3)
        rows.append(row)
    return rows


def name_of(along: NDArray[np.float64]) -> str:
    """`+x`, or `+x-y+z`."""
    return "".join(f"{'+' if a > 0 else '-'}{name}" for a, name in zip(along, "xyz", strict=True) if a)


def plot(rows: Rows) -> Any:
    """The four spheres, lists by colour; what is hidden has the colour of none."""
    figure = style.new_figure(2.75)
    for panel, axes, lists in zip("abcd", figure.subplots(1, 4), LISTS, strict=True):
        own = [row for row in rows if row["lists"] == lists]
        _draw(axes, lists, own)
        shares = sorted({row["share_percent"] for row in own})
        of_each = f"{shares[0]:.2f} %" if shares[-1] - shares[0] < 0.05 else f"{shares[0]:.1f} to {shares[-1]:.1f} %"
        axes.set_title(f"({panel}) {lists} list{'s' if lists > 1 else ''}")
        axes.set_xlabel("every direction" if lists == 1 else f"each {of_each} of directions", fontsize=8)
    return figure


def _draw(axes: Any, lists: int, rows: Rows) -> None:
    from matplotlib.colors import to_rgb

    from refsim.papers.sphere_hierarchy.directions import list_of_rays

    side = 400
    style.no_frame(axes)
    forward = np.array(SEES) / np.linalg.norm(SEES)
    right = np.cross((0.0, 1.0, 0.0), forward)
    right /= np.linalg.norm(right)
    up = np.cross(forward, right)
    y, x = np.mgrid[1.04 : -1.04 : side * 1j, -1.04 : 1.04 : side * 1j]
    inside = x * x + y * y <= 1.0
    z = np.sqrt(np.where(inside, 1.0 - x * x - y * y, 0.0))
    points = x[..., None] * right + y[..., None] * up + z[..., None] * forward
    picked = list_of_rays(points.reshape(-1, 3).astype(np.float32), lists).reshape(side, side)
    colors = np.array([to_rgb(color) for color in COLORS])
    image = colors[picked] * (0.72 + 0.28 * z)[..., None]
    edge = np.zeros_like(inside)
    for axis in (0, 1):
        edge |= picked != np.roll(picked, 1, axis=axis)
    image[edge & inside] = 1.0
    image[~inside] = 1.0
    axes.imshow(image, extent=(-1.04, 1.04, -1.04, 1.04))
    for row in rows:
        at = _middle(row["along"], lists)
        if at @ forward > 0.15 and lists > 1:
            text = row["along"].replace("-", "\N{MINUS SIGN}")
            axes.text(at @ right, at @ up, text, ha="center", va="center", fontsize=8, fontweight="bold")
    if lists == 1:
        axes.text(0.0, 0.0, "sorted along +x", ha="center", va="center", fontsize=8, fontweight="bold")


def _middle(along: str, lists: int) -> NDArray[np.float64]:
    """Where a list's name stands: along it; of a half-space, where it is seen."""
    at = np.zeros(3)
    for sign, axis in zip(along[::2], along[1::2], strict=True):
        at["xyz".index(axis)] = 1.0 if sign == "+" else -1.0
    if lists == 2:
        at = at * 0.9 + np.array((0.0, 0.2, 0.9))
    return at / np.linalg.norm(at)


EXPERIMENT = Experiment(
    "bsh-figure-2",
    "Figure 2: four partitions of the directions of space",
    "Each point of a sphere is a direction and has the colour of the list that a ray of that direction takes; a name "
    "says along which axis or diagonal the list is sorted. The table has each list's share of directions, and of "
    "400,000 normals (4,000 with `--quick`), spread evenly, the percentage that each culling rule leaves out; "
    "`pairs_facing` are, of 200,000 pairs of such a normal and a direction of the list (seeded), those that meet "
    "front to front; `unsafe` are culled normals that the safe rule would keep: some direction of the list faces "
    "them.",
    cases,
    measure,
    plot,
    alt="Four spheres of directions: one colour for one list, halves for two, six regions around the axes for six, "
    "octants for eight, each labelled with the direction that its list is sorted along.",
)
