"""Figure 2: a cone is extended to a ray's direction. Drawn from a tile of a run, as its construction goes on.

The Hierarchical Ray Engine, section 4, step 2(a). "This method computes the cone of minimum opening angle necessary to
hold the given infinite semi-line and the cone": e and r are φ + θ apart, so no half-angle below (φ + θ) / 2 will do.
"""

from __future__ import annotations

from typing import Any

from refsim.experiments import construction, style
from refsim.experiments.construction import about, columns, degrees, digits
from refsim.experiments.figure_2_plot import plot_steps
from refsim.experiments.registry import Experiment, Row, Rows
from refsim.reference.cone import BOUNDED, Cones, half_angle
from refsim.reference.cone_steps import Step, extension
from refsim.reference.vector import angle

TURN = 1e-7  # radians: what float64 leaves of an angle that is had from a sine and a cosine


def measure(
    scene: str, size_px: int, tile_px: int, fill: float, generation: int, backend: str = "numba"
) -> Rows:
    """A row for each step that widens the cone of the drawn tile, and one that counts over all tiles."""
    found = construction.bundles(scene, size_px, tile_px, fill, generation, backend)
    taken, drawn = construction.followed(found)
    head = construction.head(scene, size_px, tile_px, fill, generation)
    rows = [
        {**head, **construction.place(found, drawn), **_row(number, step, drawn)}
        for number, step in enumerate(taken)
        if step.extended[drawn]
    ]
    return [*rows, {**head, "tiles": len(found.tile), "rays": int(found.live.sum()), **_counts(taken)}]


def _row(number: int, step: Step, k: int) -> Row:
    old, r = _row_of(step.before, k), step.r[k : k + 1]
    way, new = extension(old, r), step.wider
    bounded = new.state[k] == BOUNDED
    return {
        "step": number,
        **columns(x=old.axis[0], r=r[0], q=way.q[0], e=way.e[0]),
        "phi_deg": degrees(half_angle(old)[0]),
        "theta_deg": degrees(way.theta[0]),
        "cos_phi": digits(float(old.cos[0])),
        "sin_phi": digits(float(old.sin[0])),
        **columns(x_new=new.axis[k]),
        "phi_new_deg": degrees(half_angle(new)[k]) if bounded else "",
        "state": "bounded" if bounded else "unbounded",
    }


def _row_of(cones: Cones, k: int) -> Cones:
    return Cones(*(part[k : k + 1] for part in cones))


def _counts(taken: list[Step]) -> Row:
    wider, forgotten, outside, unbounded = [], [], [], []
    for step in taken:
        old, new = step.before, step.wider
        theta = extension(old, step.r).theta
        held = step.extended & (new.state == BOUNDED)
        phi, phi_new = half_angle(old), half_angle(new)
        turn = angle(new.axis, old.axis)
        to_ray = angle(new.axis, step.r)
        wider.append(held & (phi_new > 0.5 * (phi + theta) + TURN))
        forgotten.append(held & (turn + phi > phi_new + TURN))
        outside.append(held & (to_ray > phi_new + TURN))
        unbounded.append(step.extended & (new.state != BOUNDED))
    return {
        "extensions": construction.total([step.extended for step in taken]),
        "made_unbounded": construction.total(unbounded),
        "ray_outside": construction.total(outside),
        "old_cone_outside": construction.total(forgotten),
        "wider_than_needed": construction.total(wider),
    }


def plot(rows: Rows) -> Any:
    """Above, the step that shows best; below, the tile's directions and cones as the construction goes on."""
    drawn = construction.drawn_steps(rows)
    figure = style.new_figure(5.6)
    above, below = figure.subfigures(2, 1, height_ratios=(1.7, 1.0))
    shown = max(drawn, key=lambda row: min(row["phi_deg"], row["theta_deg"] - row["phi_deg"], 90.0 - row["theta_deg"]))
    plot_steps(above, below, drawn, shown)
    above.suptitle(f"Ray {shown['step']} of the {about(shown)}", fontsize=9, color="#444444")
    figure.supxlabel(sentence([row for row in rows if "step" not in row]), fontsize=8, color="#444444")
    return figure


def sentence(counts: Rows) -> str:
    """The counts of all cases, in words."""
    def of(name: str) -> int:
        return sum(row[name] for row in counts)

    return (
        f"All tiles of all runs: {of('extensions'):,} extensions, {of('made_unbounded'):,} of them to an unbounded "
        f"cone; of the others\n{of('ray_outside'):,} leave the ray outside, {of('old_cone_outside'):,} a part of the "
        f"old cone, and {of('wider_than_needed'):,} are wider than (φ + θ) / 2."
    )


EXPERIMENT = Experiment(
    "figure-2",
    "Figure 2: extending the cone, on a real tile",
    "A tile of refracted rays (256² rays, tiles of 16 × 16; 64² and 8 × 8 with `--quick`), its construction stopped at "
    "the step that shows best. Left: before, in the plane of the axis x and the new direction r; e is the generator "
    "opposite to r, and q points from r to the axis. Right: after, the new axis half-way between e and r. Below: the "
    "cones after some of the steps, as seen from their apex: distance from the middle is the angle from the last "
    "axis, dots are directions that made the cone grow. The CSV holds every such step; figure-2-counts, all tiles.",
    construction.cases,
    measure,
    plot,
    construction.split("figure-2"),
    alt="Two wedges side by side: a narrow cone with a ray's direction outside of it, and the wider cone whose axis "
    "lies half-way between that direction and the opposite generator. Below, circles that grow from panel to panel "
    "until they hold all dots.",
)
