"""Figure 3: near and far generators, and the cone moved to an origin. Drawn from a tile of a run, as it is built.

The Hierarchical Ray Engine, section 4, step 2(b). The printed apex a − e·t (HRE-E1) stands beside the corrected one.
"Translated by a minimum amount": along e by g / sin 2φ. Moving by g itself is less, and as good once φ ≥ 45°, where
−g points into the cone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from refsim.experiments import construction, style
from refsim.experiments.construction import ROUNDING, about, columns, degrees, digits
from refsim.experiments.figure_3_plot import plot_steps
from refsim.experiments.registry import Experiment, Row, Rows
from refsim.reference.cone import Cones, half_angle, mirrored
from refsim.reference.cone_steps import Step, Translation, gap, translation
from refsim.reference.vector import cross, dot, length

NEARER = 1e-9  # a shorter way is one that is shorter by more than rounding


class Moved(NamedTuple):
    """One step 2(b) of every bundle: the cones as they are moved (HRE-E5 may have opened them first), the vectors, and
    which kind of step it is: bool each, none of two kinds."""

    cones: Cones
    way: Translation
    along: np.ndarray
    mirrored: np.ndarray
    opened: np.ndarray


def moved(step: Step) -> Moved:
    """The step's translation."""
    cones = step.wider._replace(cos=step.after.cos, sin=step.after.sin)
    way = translation(cones, step.p)
    stays = (step.after.apex == cones.apex).all(axis=1)
    z, w = dot(cones.axis, way.c), length(cross(cones.axis, way.c))
    behind = step.moved & ~stays & mirrored(z, w, cones.cos, cones.sin)
    return Moved(cones, way, step.moved & ~stays & ~behind, behind, step.moved & stays)


def measure(
    scene: str, size_px: int, tile_px: int, fill: float, generation: int, backend: str = "numba"
) -> Rows:
    """A row for each step that moves the cone of the drawn tile along e, and one that counts over all tiles."""
    found = construction.bundles(scene, size_px, tile_px, fill, generation, backend)
    taken, drawn = construction.followed(found)
    head = construction.head(scene, size_px, tile_px, fill, generation)
    every = [moved(step) for step in taken]
    rows = [
        {**head, **construction.place(found, drawn), **_row(number, step, one, drawn)}
        for number, (step, one) in enumerate(zip(taken, every, strict=True))
        if one.along[drawn]
    ]
    return [*rows, {**head, "tiles": len(found.tile), "rays": int(found.live.sum()), **_counts(taken, every)}]


def _row(number: int, step: Step, one: Moved, k: int) -> Row:
    cones, way = one.cones, one.way
    out = {
        name: int(_outside(cones, apex, step.p, length(way.c))[k])
        for name, apex in (("printed", way.a_printed), ("corrected", way.a_new))
    }
    return {
        "step": number,
        **columns(a=cones.apex[k], x=cones.axis[k]),
        "phi_deg": degrees(half_angle(cones)[k]),
        **columns(p=step.p[k], c=way.c[k], q=way.q[k], e=way.e[k], n=way.n[k], g=way.g[k]),
        "t": digits(float(way.t[k])),
        **columns(a_new=way.a_new[k], a_printed=way.a_printed[k]),
        "printed_outside": out["printed"],
        "corrected_outside": out["corrected"],
    }


def _outside(cones: Cones, apex: np.ndarray, points: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Whether the cones, moved to these apices, leave the points outside by more than rounding; NaN is outside."""
    return np.asarray(~(gap(cones._replace(apex=apex), points) <= ROUNDING * scale))


def _counts(taken: list[Step], every: list[Moved]) -> Row:
    found: dict[str, list[np.ndarray]] = {}
    most = 0.0
    for step, one in zip(taken, every, strict=True):
        cones, way, along, size = one.cones, one.way, one.along, length(one.way.c)
        product = translation(cones, step.p, product_norm=True)
        least = shortest(cones, way)
        longer = along & (np.abs(way.t) > least * (1.0 + NEARER))
        most = max([most, *(np.abs(way.t)[longer] / least[longer])])
        for name, mask in (
            ("translations", along),
            ("printed_outside", along & _outside(cones, way.a_printed, step.p, size)),
            ("corrected_outside", along & _outside(cones, way.a_new, step.p, size)),
            ("printed_old_apex_outside", along & _outside(cones, way.a_printed, cones.apex, size)),
            ("corrected_old_apex_outside", along & _outside(cones, way.a_new, cones.apex, size)),
            ("printed_q_outside", along & _outside(cones, product.a_new, step.p, size)),
            ("longer_than_needed", longer),
            ("wider_than_45_deg", along & (cones.sin > cones.cos)),
            ("moved_to_origin", one.mirrored),
            ("opened_only", one.opened),
        ):
            found.setdefault(name, []).append(mask)
    return {**{name: construction.total(masks) for name, masks in found.items()}, "longest_ratio": round(most, 4)}


def shortest(cones: Cones, way: Translation) -> np.ndarray:
    """The least distance that the apex must move so that the cone holds the old one and p, for p that neither the cone
    nor its mirror holds: |g| / sin 2φ, or |g| where φ is 45 degrees or more."""
    t = np.abs(way.t)
    with np.errstate(invalid="ignore"):
        return np.where(cones.sin > cones.cos, 2.0 * cones.sin * cones.cos * t, t)


def plot(rows: Rows) -> Any:
    """Above, the step that shows best; below, the tile's origins and cones as the construction goes on."""
    drawn = construction.drawn_steps(rows)
    figure = style.new_figure(6.1)
    above, below = figure.subfigures(2, 1, height_ratios=(1.75, 1.0))
    plot_steps(above, below, drawn)
    text = f"Drawn: {about(drawn[0])}.\n" + sentence([row for row in rows if "step" not in row])
    figure.supxlabel(text, fontsize=8, color="#444444")
    return figure


def sentence(counts: Rows) -> str:
    """The counts of all cases, in words."""
    def of(name: str) -> int:
        return sum(row[name] for row in counts)

    return (
        f"All tiles of all runs: {of('translations'):,} translations along e. The printed apex leaves p outside in "
        f"{of('printed_outside'):,}, the corrected one in {of('corrected_outside'):,}.\n"
        f"{of('wider_than_45_deg'):,} are of cones wider than 45°: there a shorter way would do. "
        f"{of('moved_to_origin'):,} more origins lie in the mirrored cone: the apex goes there."
    )


EXPERIMENT = Experiment(
    "figure-3",
    "Figure 3: translating the cone, on a real tile",
    "The same tile as in Figure 2, stopped at the step whose translation shows best, in the plane of the axis x and of "
    "c = p − a. Left: n and e, the nearest and farthest generator, and g from n to the origin p. Right: the cone moved "
    "along e until n touches p; dashed, in another colour, the apex as printed, a − e·t with t < 0, which moves the "
    "other way and leaves p outside. Below: outlines of the cone from the side after some of the steps, dots the "
    "origins that moved it. The CSV holds every such step; figure-3-counts, all tiles.",
    construction.cases,
    measure,
    plot,
    construction.split("figure-3"),
    alt="Two cross-sections of a cone: left, a point outside of it with the generators nearest to and farthest from "
    "it; right, the cone moved back so that the point lies on its edge, and a dashed cone moved forward that leaves "
    "the point outside. Below, a wedge that grows from panel to panel until it holds all dots.",
)
