"""Table 1: the bunny without its ground, sixteen combinations of order, culling, per-polygon heads and screen cells.

The paper's "back-face culling" is run by the safe rule and by the one it must have meant, which makes holes (BSH-E1);
heads by first surviving leaf and by climbing. What the printed numbers have to do with ours is for `statistics`.
Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, section 4."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import bsh_published as published
from refsim.experiments import style
from refsim.experiments.bsh_published import TABLE_1, Configuration
from refsim.experiments.bsh_runs import head, missing_row, ray_counts, run, warp_account
from refsim.experiments.bsh_table_1_statistics import effects, statistics
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING, mesh_state

SCENE = "bunny"
CULLING = ("sextant_safe", "sextant_same")
HEAD_RULES = ("leaf", "climb")
CELLS = 16
READING = "reading: "
MAIN = {"culling": CULLING[0], "head_rule": HEAD_RULES[0]}  # whose rows stand beside the paper's


def cases(quick: bool) -> list[Case]:
    """A case a row, culling rule and head rule, where these make a difference."""
    size = 64 if quick else 512
    found = []
    for settings in TABLE_1:
        for culling in CULLING if settings.culled else ("",):
            for rule in HEAD_RULES if settings.heads or settings.frustum else ("",):
                found.append(
                    {**settings._asdict(), "culling": culling, "head_rule": rule, "size_px": size,
                     "mesh": mesh_state(SCENE)}
                )  # fmt: skip
    return found


def measure(
    order: str, culled: bool, heads: bool, frustum: bool, culling: str, head_rule: str, size_px: int, mesh: str
) -> Rows:
    """One row; warps are accounted for the safe rule and the first leaf."""
    from refsim.papers.sphere_hierarchy.warps import readings

    settings = Configuration(order, culled, heads, frustum)
    line: Row = {**settings._asdict(), "culling": culling, "head_rule": head_rule}
    line |= {name: int(value) for name, value in line.items() if isinstance(value, bool)}
    if mesh == MISSING:
        return [{**line, **missing_row(SCENE, size_px)}]
    found = run(
        SCENE, size_px, ground=False, facing="front", order=order, culling=culling or None,
        heads="regular" if heads else None, screen_cells=CELLS if frustum else None, head_rule=head_rule or "leaf",
    )  # fmt: skip
    row = {**line, **head(SCENE, size_px, found), **ray_counts(found)}
    if is_main(row):
        account = warp_account(SCENE, found, False)
        row["lane_utilisation"] = round(account.utilisation, 4)
        row |= {f"{READING}{name}": round(value, 3) for name, value in readings(account).items()}
    return [row]


def is_main(row: Row) -> bool:
    """Whether the row is one of the sixteen that stand beside the paper's."""
    return all(row[name] in ("", wanted) for name, wanted in MAIN.items())


def settings_of(row: Row) -> Configuration:
    """The paper's switches of a row."""
    return Configuration(row["order"], bool(row["culled"]), bool(row["heads"]), bool(row["frustum"]))


def compared(rows: Rows) -> Rows:
    """The sixteen, each with the paper's numbers."""
    found = []
    for row in rows:
        if not is_main(row) or row["triangles"] == MISSING:
            continue
        rates = TABLE_1[settings_of(row)]
        found.append(
            {
                **{name: row[name] for name in Configuration._fields},
                "rays_per_pixel": row["rays_per_pixel"],
                "published_rays_per_pixel": round(rates.rays_per_pixel, 4),
                "nodes_per_ray": row["nodes_per_ray"],
                "published_nodes_per_ray": round(rates.nodes_per_ray, 2),
                "published_nodes_per_ray_by_32": round(rates.nodes_per_ray / published.WARP, 3),
                **{name: value for name, value in row.items() if name.startswith(READING)},
            }
        )
    return found


def fits(table: Rows) -> Rows:
    """A row a reading of the paper's counter: how far the sixteen printed numbers are from it."""
    names = [name for name in (table[0] if table else {}) if name.startswith(READING)]
    found: Rows = []
    for name in names:
        quotients = [row["published_nodes_per_ray"] / row[name] for row in table]
        found.append(
            {
                "reading": name.removeprefix(READING),
                "rows": len(quotients),
                "least_quotient": round(min(quotients), 4),
                "largest_quotient": round(max(quotients), 4),
                "worst_factor": round(max(max(q, 1.0 / q) for q in quotients), 4),
            }
        )
    return sorted(found, key=lambda row: row["worst_factor"])


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All runs; the sixteen beside the paper's; pairs with one switch turned; statistics."""
    table = compared(rows)
    found = {"bsh-table-1-runs": rows, "bsh-table-1": table or rows}
    if len(table) == len(TABLE_1):
        found |= {"bsh-table-1-pairs": effects(table), "bsh-table-1-statistics": statistics(table)}
        found["bsh-table-1-fits"] = fits(table)
    return found


def plot(rows: Rows) -> Any:
    """Both columns of nodes a ray as bars; right, what turning one switch changes."""
    figure = style.new_figure(5.4)
    table = compared(rows)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.05))
    if len(table) < len(TABLE_1):
        for axes in (left, right):
            style.no_frame(axes)
        left.text(0.5, 0.5, f"{SCENE}: missing", ha="center", va="center", color=style.FAINT)
        return figure
    _draw_rows(left, table)
    _draw_pairs(right, effects(table))
    return figure


def label_of(row: Row) -> str:
    """`earliest, CHF`: culling, heads, frustum."""
    marks = "".join(mark if row[name] else "\N{MIDDLE DOT}" for mark, name in zip("CHF", SWITCHES, strict=True))
    return f"{row['order'].split('_')[0]} {marks}"


SWITCHES = ("culled", "heads", "frustum")
LETTERS = "C: culling, H: per-polygon heads, F: screen cells; \N{MIDDLE DOT}: off"


def _draw_rows(axes: Any, table: Rows) -> None:
    places = range(len(table))
    ours = [row["nodes_per_ray"] for row in table]
    said = [row["published_nodes_per_ray_by_32"] for row in table]
    axes.plot(ours, places, "o", color=style.BLUE, label="ours")
    axes.plot(said, places, "D", color=style.ORANGE, label="paper / 32")
    for place, pair in enumerate(zip(ours, said, strict=True)):
        axes.plot(pair, (place, place), color="#cccccc", linewidth=1.0, zorder=0)
    axes.set_yticks(list(places), [label_of(row) for row in table], fontfamily="DejaVu Sans Mono", fontsize=7.5)
    axes.invert_yaxis()
    axes.set_xlabel("nodes a ray, eye and shadow rays")
    axes.set_title("The sixteen rows of Table 1")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, title=LETTERS, title_fontsize=8)


def _draw_pairs(axes: Any, pairs: Rows) -> None:
    names = ("order", *SWITCHES)
    told = {"order": "earliest first\ninstead of\nlatest last", "culled": "culling", "heads": "per-polygon\nheads",
            "frustum": "screen cells"}  # fmt: skip
    for k, name in enumerate(names):
        own = [pair for pair in pairs if pair["switch"] == name]
        for side, key, color, marker in (
            (-0.15, "change_percent", style.BLUE, "o"), (0.15, "published_change_percent", style.ORANGE, "D"),
        ):  # fmt: skip
            heights = [pair[key] for pair in own]
            spots = [k + side + 0.02 * (i - 3.5) for i in range(len(heights))]
            axes.plot(spots, heights, marker, color=color, markersize=4.5, alpha=0.85)
    axes.axhline(0.0, color=style.INK, linewidth=0.9)
    axes.set_xticks(range(len(names)), [told[name] for name in names], fontsize=8)
    axes.grid(False, axis="x")
    axes.set_ylabel("change of nodes a ray, percent")
    axes.set_title("What turning one switch changes")


EXPERIMENT = Experiment(
    "bsh-table-1",
    "Table 1: sixteen combinations on the bunny without ground",
    "512² (64² with `--quick`), eye and shadow rays, fronts only. C: culling (safe rule), H: regular per-polygon "
    "heads, F: 16 × 16 screen cells, heads at the first surviving leaf. Left: our nodes a ray, and the paper's "
    "nodes/s divided by its rays/s and by 32. Right: each dot is a pair of rows that differ in one switch; below zero "
    "the switch saves nodes. Tables: all runs, with the culling rule the paper must have meant and with climbing "
    "heads among them; pairs; rank correlations and permutation tests (seeded).",
    cases,
    measure,
    plot,
    tables,
    alt="Left, the sixteen rows of the table with a dot for our nodes a ray and one for the paper's by thirty-two, "
    "which follow no common order; right, what turning each switch changes: ours lie together, the paper's "
    "scatter on both sides of zero.",
)
