"""What a throw-away prototype counted before this code was written, as claims to be judged on the figures' rows.

It ran 256² rays, tiles of 16 × 16 and 5 iterations. Its camera, and which normals bent its rays, were not recorded, and
the counts depend on both: agreement is asked for within 15 percent only, and a statement that some views here bear out
and others do not, or one of two iterations it may speak of, is neither right nor wrong.
"""

from __future__ import annotations

from refsim.experiments import figure_7
from refsim.experiments.registry import Row, Rows

WITHIN = 0.15  # the camera is not recorded: between the two views of the sphere the ratios differ by far more
NEAR = 0.05  # triangle counts this close are compared: here a ratio grows less than the count does
ITERATIONS = 5

# Body, triangles, Ray Engine fragments without stencil ÷ hierarchical fragments that pass it
RATIOS = (
    ("torus_knot", 100, (3.2, 3.2)),
    ("torus_knot", 500, (4.0, 4.0)),
    ("torus_knot", 1024, (5.1, 5.1)),
    ("torus_knot", 5000, (5.1, 5.4)),
    ("sphere", 192, (5.6, 5.6)),
    ("sphere", 896, (8.0, 8.0)),
    ("sphere", 1760, (10.0, 10.0)),
    ("sphere", 9600, (15.2, 15.2)),
)
# Body, iterations it may speak of, mean half-angle in degrees. On the sphere "3-4, then 13-18" names none: the third
# iteration is that of the knot's second number, the first one may be the eye rays' or the one after
ANGLES = (
    ("torus_knot", (1,), (2.1, 2.1)),
    ("torus_knot", (3,), (35.0, 50.0)),
    ("sphere", (1, 2), (3.0, 4.0)),
    ("sphere", (3,), (13.0, 18.0)),
)
# Body, last iteration, the most unbounded tiles in percent
UNBOUNDED = (("torus_knot", 3, (14.0, 14.0)), ("sphere", ITERATIONS, (0.0, 0.0)))

Range = tuple[float, float]


def claims(ratios: Rows, cones: Rows) -> Rows:
    """A line a statement, on the ratios of figure 7 and the summary of figure 4; bodies that neither has are left out.

    Columns as in `verdicts.claim`.
    """
    found = []
    for body, triangles, said in RATIOS:
        near = [row for row in ratios if row["body"] == body and abs(row["triangles"] / triangles - 1.0) <= NEAR]
        views = [
            (f"{figure_7.label((body, row['fill'], row['shading']))}, {row['triangles']}",
             row["ratio_to_ray_engine_without_stencil"])
            for row in near
        ]  # fmt: skip
        found += _judged(
            f"Ray Engine / hierarchical tests at {triangles} triangles is {_text(said)}", body, said, views,
            f"views, at a triangle count within {100 * NEAR:g} percent of it",
        )  # fmt: skip
    for body, iterations, said in ANGLES:
        own = {row["iteration"]: row["mean_half_angle_deg"] for row in cones if _body(row) == body}
        means = [(f"{k}", own[k]) for k in iterations if own.get(k, "") != ""]
        named = " or ".join(map(str, iterations))
        text = f"the mean half-angle of bounded tiles in iteration {named} is {_text(said)} deg"
        found += _judged(text, body, said, means, f"iterations ({named}) that it may speak of")
    for body, last, said in UNBOUNDED:
        shares = [row["unbounded_tiles_percent"] for row in cones if _body(row) == body and row["iteration"] <= last]
        most = [(f"1 to {last}", max(shares))] if shares else []
        text = f"the largest share of unbounded tiles up to iteration {last} is {_text(said)} percent"
        found += _judged(text, body, said, most, "iterations, taken together")
    return found


def _judged(text: str, body: str, said: Range, here: list[tuple[str, float]], of: str) -> Rows:
    """The line, or none where nothing was measured that it speaks of."""
    if not here:
        return []
    low, high = (1.0 - WITHIN) * said[0], (1.0 + WITHIN) * said[1]
    agree = [low <= value <= high for _, value in here]
    line: Row = {
        "section": "prototype",
        "claim": text,
        "body": body.replace("_", " "),
        "rule": f"within {100 * WITHIN:g} percent, as the prototype's camera is not recorded, in all {of}; depends "
        "where in some",
        "measured": "; ".join(f"{name}: {value:g}" for name, value in here),
        "verdict": "holds" if all(agree) else "depends" if any(agree) else "fails",
    }
    return [line]


def _body(row: Row) -> str:
    return str(row["scene"]).rpartition("_")[0]


def _text(said: Range) -> str:
    return f"{said[0]:g}" if said[0] == said[1] else f"{said[0]:g}-{said[1]:g}"
