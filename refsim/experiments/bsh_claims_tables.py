"""Claims on the paper's tables, judged on counts of the same configurations, scenes and copies.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from refsim.experiments import bsh_published as published
from refsim.experiments import bsh_table_1, bsh_table_2, bsh_table_3
from refsim.experiments.bsh_claims_method import present, some
from refsim.experiments.bsh_table_1_statistics import SWITCHES, effects, statistics
from refsim.experiments.registry import Row, Rows
from refsim.experiments.verdicts import claim

LEVEL = 0.05  # of a permutation test
FIT = 1.25  # times: a reading that fits is within it on every scene
READING_TIMES, COPY_FIT = 2.0, 5.0  # percent


def table_1_claims(rows: Rows) -> Rows:
    """Section 4 on our sixteen rows, and BSH-E4."""
    table = bsh_table_1.compared(rows)
    if len(table) < len(published.TABLE_1):
        return []
    found, pairs = [], effects(table)
    for switch in SWITCHES[1:]:
        own = [row["change_percent"] for row in pairs if row["switch"] == switch]
        found.append(
            claim(
                "4", f"our optimisations permit to reduce the average number of nodes traversed per ray: {switch}",
                "bunny without ground, ours", "each of eight pairs has fewer nodes a ray with it",
                f"{sum(change > 0 for change in own)} of {len(own)} pairs go up, "
                f"mean {sum(own) / len(own):+.2f} percent",
                some([change < 0 for change in own]),
            )
        )  # fmt: skip
    orders = [row["change_percent"] for row in pairs if row["switch"] == "order"]
    found.append(
        claim(
            "4", "the effects of the node ordering are difficult to assess", "bunny without ground, ours",
            "earliest first saves nodes in some of eight pairs and costs in others",
            f"{sum(change > 0 for change in orders)} of {len(orders)} pairs cost, {min(orders):+.2f} to "
            f"{max(orders):+.2f} percent", len({change > 0 for change in orders}) == 2,
        )
    )  # fmt: skip
    told = {row["statistic"]: row for row in statistics(table)}
    for name, text in (
        ("rank correlation", "Table 1 ranks the combinations as our counts do"),
        ("rank correlation, best relabelling", "Table 1 with switches renamed ranks them as our counts do"),
        ("additive share, printed", "the switches have effects of their own in Table 1"),
        ("additive share, ours", "the switches have effects of their own in our counts"),
    ):
        row = told[name]
        found.append(
            claim(
                "BSH-E4", text, "sixteen rows", "chance does as well in at most 5 percent of seeded permutations",
                f"{row['observed']}, chance {row['chance_mean']} on average, p = {row['p_value']}",
                row["p_value"] <= LEVEL,
            )
        )  # fmt: skip
    return found


def set_up_claims(rows: Rows) -> Rows:
    """BSH-E6 and E7 on Figure 4's scenes."""
    own = present(rows)
    if not own:
        return []
    equal = {row["published_scene"]: row["triangles"] == row["published_triangles"] for row in own}
    near = {
        row["published_scene"]: row["rays_per_pixel"] / published.TABLE_2[row["published_scene"]][2].rays_per_pixel
        for row in own
    }
    return [
        claim(
            "BSH-E6", "the printed triangles are those of the mesh and of a ground of two", "scenes here",
            "triangles are equal; depends where some are",
            "; ".join(f"{row['published_scene']} {row['triangles']} of {row['published_triangles']}" for row in own),
            some(list(equal.values())),
        ),
        claim(
            "BSH-E7", "the printed rays a pixel are eye rays and shadow rays towards lit sides",
            "one camera and ground, chosen for it",
            f"ours are within {READING_TIMES:g} percent for every scene; depends where for some",
            "; ".join(f"{scene} x {value:.4f}" for scene, value in near.items()),
            some([abs(value - 1.0) <= READING_TIMES / 100.0 for value in near.values()]),
        ),
    ]  # fmt: skip


def reading_claims(rows: Rows, combinations: Rows) -> Rows:
    """BSH-E3, E4: what the paper's counter may be, on the rows of Table 2 and on those of Table 1."""
    sixteen = {row["reading"]: row for row in bsh_table_1.fits(bsh_table_1.compared(combinations))}
    found = []
    for row in bsh_table_2.fits(rows):
        told = [(f"Table 2, {row['scenes']} scenes", row)]
        if row["reading"] in sixteen:
            told.append(("Table 1", sixteen[row["reading"]]))
        found.append(
            claim(
                "BSH-E3", f"the counter counts: {row['reading']}", "Tables 1 and 2",
                f"within a factor of {FIT:g} on every row that is the paper's; depends where in one table. Twenty "
                "readings are tried, so one may fit by chance",
                "; ".join(f"{name}: x {each['least_quotient']:g} to x {each['largest_quotient']:g}"
                          for name, each in told),
                some([each["worst_factor"] <= FIT for _, each in told]),
            )
        )  # fmt: skip
    counters = present(bsh_table_2.of_part(rows, "counters"))
    if not counters:
        return []
    return [
        claim(
            "BSH-E3", "a ray visits as many elements as printed", f"{len(counters)} scenes",
            "the printed number is no larger than the longest list, in every scene; depends where in some",
            "; ".join(f"{row['published_scene']} {row['longest_list_elements']}" for row in counters),
            some([row["published_nodes_per_ray"] <= row["longest_list_elements"] for row in counters]),
        ),
        *found,
    ]  # fmt: skip


def copy_claims(rows: Rows) -> Rows:
    """Section 2.1's redundancy, Table 3's copies."""
    own = present(rows)
    if not own:
        return []
    redundancy = [row["redundancy_of_elements"] for row in own]
    found: list[Row] = [
        claim(
            "2.1", f"node redundancy is more like {published.SAID_REDUNDANCY} than 6", "scenes here, safe culling",
            "elements of six lists by those of one are nearer to 5 than to 6, in every scene",
            f"{min(redundancy):.3f} to {max(redundancy):.3f}", some([value < 5.5 for value in redundancy]),
        )
    ]  # fmt: skip
    if len(bsh_table_3.known(rows)) > 2:
        for link in bsh_table_3.links(rows):
            found.append(
                claim(
                    "5", f"copies take a fixed time and a rate: {link['content']}", f"{link['scenes']} scenes",
                    f"one link is within {COPY_FIT:g} percent of every printed copy",
                    f"{link['fixed_ms']:g} ms + bytes / {link['rate_mb_per_s']:g} MB/s; off by "
                    f"{link['largest_residual_percent']:g} percent at most",
                    link["largest_residual_percent"] <= COPY_FIT,
                )
            )  # fmt: skip
    return found
