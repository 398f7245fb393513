"""The text's claims about buffers, times, work and shares, each judged by a rule in code on rows of other experiments.

Used by `gsr_claims`, which says what a verdict is. Recursive Ray Tracing in Geometry Shader, sections 3 to 6.
"""

from __future__ import annotations

from refsim.experiments import gsr_figure_4, gsr_table_1
from refsim.experiments import gsr_published as published
from refsim.experiments.gsr_claims_print import all_or_some, span
from refsim.experiments.gsr_runs import FRAGMENT_GRID, GEOMETRY_SHADER, MODES
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.verdicts import claim

APPARENT = 10.0  # a speed-up that a picture shows: an order of magnitude
CLOSE = 5.0  # percentage points: a choice
# Operations that a texel may cost and still be covered, low and high guess: between the arithmetic that a card of 2008
# does while it filters one 4-byte texel, and while it fetches one of 16 bytes
COVERED = (6.0, 25.0)


def buffer_claims(rows: Rows) -> Rows:
    """Sections 3 and 4 and Figure 4a, on the occupancy of the passes."""
    own = gsr_figure_4.of_part(rows, "a")
    views = ", ".join(dict.fromkeys(row["view"] for row in own))
    passes = sorted({row["passes"] for row in own})
    fullest = {k: min(row["over_allocation"] for row in own if row["passes"] == k) for k in passes}
    said = {k: f"P = {k}: {100 / factor:.3g} percent of it" for k, factor in fullest.items()}
    shown = published.LARGEST_GENERATIONS[0]  # Figure 4a: G = 2 rays of a depth, and as many passes
    deeper = [k for k in passes if k > shown]
    return [
        claim(
            "4a", "a buffer must accommodate S_VB at most", views, "no pass captures more than S_VB",
            "; ".join(said.values()), min(fullest.values()) >= 1.0,
        ),
        claim(
            "4a", "a buffer must accommodate as much as S_VB", f"{views}; P = {shown}",
            "a pass of some scene fills it", said[shown], fullest[shown] == 1.0,
        ),
        claim(
            "4a", "a buffer must accommodate as much as S_VB", f"{views}; more passes",
            "for each P a pass of some scene fills it; depends where for some",
            "; ".join(said[k] for k in deeper), all_or_some([fullest[k] == 1.0 for k in deeper]),
        ),
        one_to_one(own, views),
    ]  # fmt: skip


def one_to_one(rows: Rows, views: str) -> Row:
    """The abstract and section 3: a point a ray, and what is drawn besides."""
    drawn: dict[tuple[str, int], list[int]] = {}
    apart = 0
    for row, before in zip(rows, [None, *rows], strict=False):
        # Rays shot, counted where they were emitted: a pixel each in the first pass, then what the pass before spawned
        shot = row["size_px"] ** 2
        finished = 0
        if row["pass"] and before is not None:
            shot = sum(before[f"{kind}_vertices"] for kind in gsr_figure_4.KINDS if kind.startswith("spawned"))
            finished = before["vertices_out"] - shot
        apart += row["vertices_in"] != shot + finished
        points = drawn.setdefault((row["view"], row["passes"]), [0, 0])
        points[0] += row["vertices_in"]
        points[1] += shot
    factors: dict[int, list[float]] = {}
    for (_, passes), (points_drawn, rays) in drawn.items():
        factors.setdefault(passes, []).append(points_drawn / rays)
    good = [all(factor == 1.0 for factor in own) for own in factors.values()]
    return claim(
        "abstract", "rays correspond one to one to point primitives", views,
        "points drawn are rays shot and rays finished in the pass before, and for each P as many points are drawn as "
        "rays are shot; depends where for some P only",
        f"{apart} passes in which points are not rays shot and finished; points a ray "
        + "; ".join(f"P = {k}: x {span(own)}" for k, own in factors.items()),
        False if apart else all_or_some(good),
    )  # fmt: skip


def work_claims(figure_1: Rows, figure_4: Rows) -> Rows:
    """Figures 1d and 4b."""
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
    shares = [row["vertex_percent"] for row in table]
    found = [
        claim(
            "5", "with naive intersection computation is limited by the vertex shader", "counted here",
            "more than half of the operations are the vertex shader's in every scene and mode; depends where in some",
            f"{span(shares)} percent", all_or_some([share > 50.0 for share in shares]),
        )
    ]  # fmt: skip
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
