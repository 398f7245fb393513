"""The text's claims about buffers, times, work and shares, each judged by a rule in code on rows of other experiments.

Used by `gsr_claims`, which says what a verdict is. Recursive Ray Tracing in Geometry Shader, sections 3 to 6.
"""

from __future__ import annotations

from itertools import pairwise

from refsim.experiments import gsr_figure_4, gsr_table_1, gsr_table_3
from refsim.experiments import gsr_published as published
from refsim.experiments.gsr_runs import FRAGMENT_GRID, GEOMETRY_SHADER, MODES
from refsim.experiments.registry import Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.verdicts import claim

APPARENT = 10.0  # a speed-up that a picture shows: an order of magnitude
# Operations that a texel may cost and still be covered, low and high guess: between the arithmetic that a card of 2008
# does while it filters one 4-byte texel, and while it fetches one of 16 bytes
CLOSE = 5.0  # percentage points: a choice
COVERED = (6.0, 25.0)


def all_or_some(answers: list[bool]) -> bool | None:
    """Whether all hold; None where some do."""
    return True if all(answers) else None if any(answers) else False


def span(values: list[float]) -> str:
    """The least and the largest."""
    return f"{min(values):.3g} to {max(values):.3g}"


def buffer_claims(rows: Rows) -> Rows:
    """Sections 3 and 4 and Figure 4a, on the occupancy of the passes."""
    own = gsr_figure_4.of_part(rows, "a")
    views = ", ".join(dict.fromkeys(row["view"] for row in own))
    passes = sorted({row["passes"] for row in own})
    a_pixel = {k: {row["capacity_vertices"] / row["size_px"] ** 2 for row in own if row["passes"] == k} for k in passes}
    fullest = {k: min(row["over_allocation"] for row in own if row["passes"] == k) for k in passes}
    followed = [(row, after) for row, after in pairwise(own) if after["pass"] == row["pass"] + 1]
    kinds = [kind for kind in gsr_figure_4.KINDS if kind.startswith("spawned")]
    spawned = {row["pass"] + 1 == row["passes"]: 0 for row in own}
    for row in own:
        spawned[row["pass"] + 1 == row["passes"]] += sum(row[f"{kind}_vertices"] for kind in kinds)
    return [
        claim(
            "4", "S_VB does not depend on the number of triangles", views,
            "records allocated a pixel are one number for each P, whatever the scene",
            "; ".join(f"P = {k}: {', '.join(f'{n:g}' for n in sorted(found))}" for k, found in a_pixel.items()),
            all(len(found) == 1 for found in a_pixel.values()),
        ),
        claim(
            "4a", "a buffer must accommodate S_VB at most", views, "no pass captures more than S_VB",
            "; ".join(f"P = {k}: {100 / factor:.3g} percent of it" for k, factor in fullest.items()),
            min(fullest.values()) >= 1.0,
        ),
        claim(
            "4a", "a buffer must accommodate as much as S_VB", views,
            "for each P a pass of some scene fills it (over-allocation 1); depends where that is so for some P",
            "; ".join(f"P = {k}: x {factor:g}" for k, factor in fullest.items()),
            all_or_some([factor == 1.0 for factor in fullest.values()]),
        ),
        claim(
            "3", "rays correspond one to one to point primitives", views,
            "each pass draws as many vertices as the pass before captured", f"{len(followed)} pairs of passes",
            all(row["vertices_out"] == after["vertices_in"] for row, after in followed),
        ),
        claim(
            "4.3", "the number of passes equals the depth of the recursion", views,
            "the last of P passes emits no new ray, those before do",
            f"last passes {spawned[True]}, passes before {spawned[False]} rays",
            spawned[True] == 0 < spawned[False],
        ),
    ]  # fmt: skip


def text_claims() -> Rows:
    """What the text's own numbers say of each other."""
    computed = published.buffer_bytes() / 2**20
    found = [
        claim(
            "4a", f"S_VB = 512 * 512 * (2 + 1) * 64 bytes = {published.SAID_BUFFER_MBYTES} Mbytes", "text",
            "the product is that many MiB", f"{computed:g} MiB", computed == published.SAID_BUFFER_MBYTES,
        )
    ]  # fmt: skip
    for name, (rate, time) in published.TABLE_2.items():
        shot = published.rate_of(time)
        found.append(
            claim(
                "Table 2", f"{rate:g} million rays a second, {name}", "text",
                "512 * 512 rays in the milliseconds printed beside, to the last digit of the time",
                f"{shot:.6f} million/s", abs(shot / rate - 1.0) <= 0.05 / time,
            )
        )  # fmt: skip
    least, most = published.SAID_SLOWER
    fragment = published.TABLE_2["fragment shader"][1]
    alone = published.TABLE_2["no geometry shader"][1] / fragment
    found.append(
        claim(
            "6", "the vertex shader even without a geometry shader performs 2-3 times worse", "text",
            f"the quotient of Table 2's times is within {least} and {most}", f"{alone:.2f}", least <= alone <= most,
        )
    )  # fmt: skip
    quotients = [
        published.milliseconds(scene, mode, True) / published.milliseconds(scene, mode, False)
        for scene in published.TABLE_3 for mode in published.MODES
    ]  # fmt: skip
    within = [least <= round(q) <= most for q in quotients]
    found.append(
        claim(
            "4b", "2-3 fold worse performance than the previous work", "text",
            f"every quotient of Table 3's times rounds to {least} or {most}; depends where some do",
            f"{span(quotients)}; {sum(within)} of {len(within)} do", all_or_some(within),
        )
    )  # fmt: skip
    return found


def work_claims(figure_1: Rows, figure_4: Rows, table_3: Rows) -> Rows:
    """Figures 1d and 4b, Table 3."""
    found = []
    cost = {row["panel"]: row["cells"] + row["triangle_tests"] for row in figure_1 if row["triangles"] != MISSING}
    if {"c", "d"} <= set(cost):
        found.append(
            claim(
                "1d", "the speed-up impact of the grid is apparent", "knot",
                f"cells and tests without the grid are at least {APPARENT:g} times those with it",
                f"x {cost['d'] / cost['c']:.1f}", cost["d"] >= APPARENT * cost["c"],
            )
        )  # fmt: skip
    said = [row["published_ms_ratio_of_methods"] for row in gsr_table_3.ratios(table_3)]
    steps = [row["steps_ratio_of_methods"] for row in gsr_table_3.ratios(table_3)]
    found.append(
        claim(
            "6", "both shaders do the same, so that 'the performance should stay constant'; the times say it does not",
            "all scenes", "the premise: cells and tests of both methods are equal in every scene and mode",
            f"quotient {span(steps)}; of the paper's times {span(said)}", all(step == 1.0 for step in steps),
        )
    )  # fmt: skip
    bytes_of = {}
    for row in gsr_figure_4.of_part(figure_4, "b"):
        bytes_of[row["view"], row["mode"], row["method"]] = row["ray_bytes_read"] + row["ray_bytes_written"]
    quotients = [
        bytes_of[view, mode, GEOMETRY_SHADER] / bytes_of[view, mode, FRAGMENT_GRID]
        for view, mode, method in bytes_of if method == GEOMETRY_SHADER
    ]  # fmt: skip
    found.append(
        claim(
            "4b", "it is slower because of 'fat' (64 byte) primitives", "knot from above, cornell box",
            "more bytes go through vertex buffers than fragment_grid moves through render targets for the same rays "
            "(its rays are three texels of 16 bytes, read and written for every pixel and pass); depends where some do",
            f"quotient {span(quotients)}", all_or_some([q > 1.0 for q in quotients]),
        )
    )  # fmt: skip
    return found


def share_claims(rows: Rows) -> Rows:
    """Section 5 and Table 1."""
    table = gsr_table_1.distribution(rows)
    found = []
    printed = [
        published.share(scene, "vertex", mode) for scene in published.TABLE_1 for mode in published.MODES
    ]
    for body, shares in (
        ("counted here", [row["vertex_percent"] for row in table]),
        ("the paper's numbers", [share for share in printed if share is not None]),
    ):
        found.append(
            claim(
                "5", "with naive intersection computation is limited by the vertex shader", body,
                "more than half of the operations are the vertex shader's in every scene and mode; depends where in "
                "some",
                f"{span(shares)} percent", all_or_some([share > 50.0 for share in shares]),
            )
        )  # fmt: skip
    by_mode = {mode: [row["vertex_percent"] for row in table if row["mode"] == mode] for mode in MODES}
    found.append(
        claim(
            "Table 1", "the vertex shader's share grows with the number of triangles", "all scenes",
            "in each mode, from scene to scene in the order of triangles",
            "; ".join(f"{mode}: {', '.join(f'{share:.1f}' for share in shares)}" for mode, shares in by_mode.items()),
            all(shares == sorted(shares) for shares in by_mode.values()),
        )
    )  # fmt: skip
    off = [
        abs(row[f"{shader}_percent"] - row[f"published_{shader}_percent"])
        for row in table
        for shader in ("vertex", "geometry", "fragment")
        if isinstance(row[f"published_{shader}_percent"], float)
    ]
    found.append(
        claim(
            "Table 1", "the shares of the three shaders", "all scenes",
            f"every share counted here, an operation or fetch an instruction, is within {CLOSE:g} percentage points of "
            "the published one (instructions of a compiler for another machine); depends where some are",
            f"{sum(each <= CLOSE for each in off)} of {len(off)} are; off by {span(off)}",
            all_or_some([each <= CLOSE for each in off]),
        )
    )  # fmt: skip
    a_fetch = [row["vertex_arithmetic_per_fetch"] for row in table]
    covered = [True if value >= COVERED[1] else None if value >= COVERED[0] else False for value in a_fetch]
    found.append(
        claim(
            "5", "the pipeline is compute bound; more texture reads may be covered", "naive intersection",
            f"the vertex shader does at least {COVERED[1]:g} arithmetic operations a fetch; depends down to "
            f"{COVERED[0]:g} (assumed prices of a texel of 16 and of 4 bytes)",
            f"{span(a_fetch)} operations a fetch",
            True if all(covered) else False if False in covered else None,
        )
    )  # fmt: skip
    return found
