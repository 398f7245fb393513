"""Claims that the paper's own numbers decide: its tables against its text and against each other.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from itertools import pairwise, product

from refsim.experiments import bsh_published as published
from refsim.experiments.bsh_claims_method import some
from refsim.experiments.bsh_table_1_statistics import SWITCHES, effects
from refsim.experiments.registry import Row, Rows
from refsim.experiments.verdicts import claim

ROUNDING = 0.05  # of a number printed with one digit behind the point
NEAR = 1.02  # times: "consistent" where numbers were rounded and averaged over frames
TEN = (8.0, 12.5)  # "10 times": within a quarter, a choice of ours
LEVEL = 0.05  # of a permutation test
# Figure 4's caption: "on average 31.36 fps for the cubes ..."
CAPTION = {"Cubes": 31.36, "Suzanne": 22.87, "Bunny": 6.01, "Happy Buddha": 3.03, "Dragon": 3.20}


def printed_rows() -> Rows:
    """Table 1 as rows of nodes a ray, printed on both sides."""
    return [
        {**settings._asdict(), "nodes_per_ray": rates.nodes_per_ray, "published_nodes_per_ray": rates.nodes_per_ray}
        for settings, rates in published.TABLE_1.items()
    ]


def as_low_by_chance(changes: list[float]) -> float:
    """Share of all choices of the pairs' signs whose mean is no higher: a switch without effect has either sign."""
    sums = [sum(sign * abs(change) for sign, change in zip(signs, changes, strict=True))
            for signs in product((-1, 1), repeat=len(changes))]  # fmt: skip
    return sum(value <= sum(changes) + 1e-9 for value in sums) / len(sums)


def text_claims() -> Rows:
    """Everything of this module."""
    return [*table_1_claims(), *table_2_claims(), *table_3_claims()]


def table_1_claims() -> Rows:
    """BSH-E4 on the printed rows."""
    rows = printed_rows()
    nodes = [row["nodes_per_ray"] for row in rows]
    spread = 100.0 * (1.0 - min(nodes) / max(nodes))
    found = [
        claim(
            "4", f"nodes a ray are impacted to as much as {published.SAID_HEAVY} percent", "Table 1, printed",
            "1 - least / most of nodes/s by rays/s rounds to it", f"{spread:.2f} percent",
            round(spread, 1) == published.SAID_HEAVY,
        )
    ]  # fmt: skip
    pairs = effects(rows)
    for switch in SWITCHES[1:]:
        own = [row["published_change_percent"] for row in pairs if row["switch"] == switch]
        up, mean, chance = sum(change > 0 for change in own), sum(own) / len(own), as_low_by_chance(own)
        found.append(
            claim(
                "4", f"our optimisations permit to reduce the average number of nodes traversed per ray: {switch}",
                "Table 1, printed", "the mean of eight pairs is below zero, and of all 256 ways to choose their signs "
                "at most 5 percent have as low a one",
                f"{up} of {len(own)} pairs go up, mean {mean:+.2f} percent, p = {chance:.3f}",
                mean < 0 and chance <= LEVEL,
            )
        )  # fmt: skip
    rates = [rates.fps for rates in published.TABLE_1.values()]
    found.append(
        claim(
            "4", "the framerate stays virtually the same", "Table 1, printed",
            "largest by least frames/s is at most 1.02",
            f"{max(rates) / min(rates):.4f}", max(rates) / min(rates) <= NEAR,
        )
    )  # fmt: skip
    return found


def table_2_claims() -> Rows:
    """Rates that belong together, and what the text says of them."""
    table = {scene: rates for scene, (_, _, rates) in published.TABLE_2.items()}
    pixels = {scene: rates.rays_per_pixel for scene, rates in table.items()}
    bare = [rates.rays_per_pixel for rates in published.TABLE_1.values()]
    fastest, slowest = max(r.fps for r in table.values()), min(r.fps for r in table.values())
    small = [table[scene].fps for scene in ("Cubes", "Suzanne")]
    large = [table[scene].fps for scene in ("Happy Buddha", "Dragon")]
    quotient = (sum(small) / len(small)) / (sum(large) / len(large))
    nodes = [rates.nodes_per_ray for rates in table.values()]
    return [
        claim(
            "BSH-E7", "frames/s, rays/s and 1024² pixels belong together", "Table 2, printed",
            "between one and two rays a pixel, as eye rays and one shadow ray at most make, in every scene",
            "; ".join(f"{scene} {value:.3f}" for scene, value in pixels.items()),
            all(1.0 <= value <= 2.0 for value in pixels.values()),
        ),
        claim(
            "BSH-E7", "frames/s, rays/s and 1024² pixels belong together", "Table 1, printed",
            "the same, and all sixteen rows have as many rays a pixel to 0.5 percent",
            f"{min(bare):.4f} to {max(bare):.4f}",
            all(1.0 <= value <= 2.0 for value in bare) and max(bare) / min(bare) <= 1.005,
        ),
        claim(
            "4", f"small scenes offer {published.SAID_SMALL_SCENES} times higher framerates", "Table 2, printed",
            "mean of cubes and Suzanne by mean of Happy Buddha and dragon is 8 to 12.5",
            f"x {quotient:.2f}; extremes x {fastest / slowest:.2f}", TEN[0] <= quotient <= TEN[1],
        ),
        claim(
            "4", "as polygon count increases, a lesser node traversal rate", "Table 2, printed",
            "nodes/s fall from scene to scene as triangles grow; depends where at some steps",
            "; ".join(f"{scene} {rates.gnodes:g}" for scene, rates in table.items()),
            some([a.gnodes > b.gnodes for a, b in pairwise(table.values())]),
        ),
        claim(
            "BSH-E3", "a ray traverses nodes/s by rays/s nodes", "Table 2, printed",
            "no more than twice the triangles of the scene, which a list cannot have, in every scene",
            f"{min(nodes):.0f} to {max(nodes):.0f} nodes a ray, cubes of {published.TABLE_2['Cubes'][0]} triangles",
            all(rates.nodes_per_ray <= 2 * triangles for triangles, _, rates in published.TABLE_2.values()),
        ),
        claim(
            "4", "ray shooting performance is a logarithmic function of the triangle count", "Table 2, printed",
            "printed nodes a ray grow from each scene to the next larger one",
            "; ".join(f"{rates.nodes_per_ray:.0f}" for rates in table.values()),
            all(a < b for a, b in pairwise(nodes)),
        ),
        claim(
            "4", "Figure 4's frames/s are those of Table 2", "Figure 4, Table 2, printed", "equal in every scene",
            "; ".join(f"{scene} {fps:g} and {table[scene].fps:g}" for scene, fps in CAPTION.items()),
            all(fps == table[scene].fps for scene, fps in CAPTION.items()),
        ),
    ]  # fmt: skip


def table_3_claims() -> Rows:
    """Table 3's arithmetic, and its frames against Table 2's."""
    found: list[Row] = []
    for scene, (copy, frame, ratio) in published.TABLE_3.items():
        own, from_fps = 100.0 * copy / frame, 1e3 / published.TABLE_2[scene][2].fps
        low = 100.0 * (copy - ROUNDING) / (frame + ROUNDING) - ROUNDING
        high = 100.0 * (copy + ROUNDING) / (frame - ROUNDING) + ROUNDING
        found += [
            claim(
                "5", f"ratio {ratio} percent", f"Table 3, {scene}", "copy / frame can round to it",
                f"{own:.2f} percent", low <= ratio <= high,
            ),
            claim(
                "5", f"frame of {frame} ms", f"Tables 2 and 3, {scene}", "1000 / (frames/s) is within 2 percent",
                f"{from_fps:.2f} ms", 1.0 / NEAR <= from_fps / frame <= NEAR,
            ),
        ]  # fmt: skip
    shares = [ratio for _, _, ratio in published.TABLE_3.values()]
    longer = [copy - frame for copy, frame, _ in published.TABLE_3.values()]
    found.append(
        claim(
            "1", "transfers are completely hidden by rendering", "Table 3's times",
            "a copy beside the kernel ends before it, in every scene",
            f"the longest ends {-max(longer):.1f} ms before it", max(longer) <= 0.0,
        )
    )  # fmt: skip
    found.append(
        claim(
            "5", "transferring the geometry information takes less time than rendering", "Table 3, printed",
            "every ratio is below 100 percent", f"{min(shares)} to {max(shares)} percent", max(shares) < 100.0,
        )
    )  # fmt: skip
    return found
