"""Plan: the verdicts on the geometry-shader paper's claims follow from rows and change with them.

- Every claim has a verdict, a rule and what was measured, at any size.
- The paper's own numbers: rates are rays by times, S_VB is 48 MiB, quotients of Table 3's times; shares add up to 100.
- Each verdict turns where its rule says, on rows that are altered.
"""

from __future__ import annotations

from typing import Any

import pytest

from refsim.experiments import experiments_of, gsr_claims, gsr_claims_method, gsr_table_2
from refsim.experiments import gsr_published as published
from refsim.experiments.gsr_runs import FRAGMENT_GRID, GEOMETRY_SHADER
from tests.experiments.gsr_tiny import rows_of

CLAIMS = experiments_of("gsr")["claims-gsr"]


def altered(rows: list[dict], change: dict[str, Any], **wanted: Any) -> list[dict]:
    """Rows of which those that have the wanted values are changed."""
    return [{**row, **change} if all(row.get(k) == v for k, v in wanted.items()) else row for row in rows]


def verdicts(rows: list[dict]) -> list[str]:
    return [row["verdict"] for row in rows]


def test_every_claim_has_a_verdict() -> None:
    table = CLAIMS.tables_of([], {name: rows_of(name) for name in CLAIMS.needs})["claims-gsr"]
    assert len(table) > 30
    assert {row["verdict"] for row in table} == {"holds", "fails", "depends"}
    assert all(row["section"] and row["rule"] and row["measured"] for row in table)
    assert len({(row["section"], row["claim"], row["body"]) for row in table}) == len(table)


def test_the_papers_own_numbers() -> None:
    assert published.buffer_bytes() == 48 * 2**20
    for rate, time in published.TABLE_2.values():
        # The rates have six digits behind the point, cut or rounded
        assert abs(published.rate_of(time) - rate) < 1e-6
    for _, shares in published.TABLE_1.values():
        for column in zip(*shares.values(), strict=True):
            if None not in column:
                # Three numbers of two digits, by another program than ours: the worst is off by 0.08
                assert abs(sum(column) - 100.0) < 0.09
    quotients = {
        (scene, mode): published.milliseconds(scene, mode, True) / published.milliseconds(scene, mode, False)
        for scene in published.TABLE_3
        for mode in published.MODES
    }
    assert min(quotients, key=quotients.__getitem__) == ("Happy Buddha", "RT")
    assert max(quotients, key=quotients.__getitem__) == ("Cornell Knot", "SC")
    assert all(quotient > 1 for quotient in quotients.values())


def test_published_table_holds_every_number_of_the_text() -> None:
    rows = published.published_rows()
    assert len(rows) == 2 + 27 + 9 + 42
    assert len({(row["place"], row["quantity"]) for row in rows}) == len(rows)
    assert {row["unit"] for row in rows} == {"MiB", "percent", "million/s", "ms"}
    assert sum(row["value"] == "NA" for row in rows) == 3


@pytest.mark.parametrize(
    ("answers", "verdict"), [([True, True], True), ([True, False], None), ([False, False], False)]
)
def test_some_is_neither_all_nor_none(answers: list[bool], verdict: bool | None) -> None:
    assert gsr_claims_method.all_or_some(answers) is verdict


@pytest.mark.parametrize(
    ("change", "where", "claim"),
    [
        ({"capacity_vertices": 1}, {"view": "knot", "passes": 2}, 0),
        ({"over_allocation": 0.99}, {"view": "knot", "passes": 2}, 1),
        ({"vertices_in": 1}, {"view": "knot", "passes": 2, "pass": 1}, 3),
        ({"spawned_shadow_vertices": 1}, {"view": "knot", "passes": 2, "pass": 1}, 4),
    ],
)
def test_a_buffer_that_breaks_a_rule_is_seen(change, where, claim: int) -> None:
    rows = rows_of("gsr-figure-4")
    expected = ["holds", "holds", "depends", "holds", "holds"]
    assert verdicts(gsr_claims_method.buffer_claims(rows)) == expected
    expected[claim] = "fails"
    assert verdicts(gsr_claims_method.buffer_claims(altered(rows, change, **where))) == expected


@pytest.mark.parametrize(("factor", "verdict"), [(0.4, "fails"), (1.0, "depends"), (3.0, "holds")])
def test_fat_vertices_are_judged_by_bytes(factor: float, verdict: str) -> None:
    moved = ("ray_bytes_read", "ray_bytes_written")
    rows = [
        {**row, **{name: factor * row[name] for name in moved}} if row.get("method") == GEOMETRY_SHADER else row
        for row in rows_of("gsr-figure-4")
    ]
    *_, fat = gsr_claims_method.work_claims(rows_of("gsr-figure-1"), rows, rows_of("gsr-table-3"))
    assert fat["verdict"] == verdict


def test_more_cells_in_one_method_break_the_premise() -> None:
    rows = rows_of("gsr-table-3")
    more = altered(rows, {"cells": 10**9}, method=FRAGMENT_GRID, mode="SC", view="cornell box")
    for given, verdict in ((rows, "holds"), (more, "fails")):
        _, same, _ = gsr_claims_method.work_claims(rows_of("gsr-figure-1"), rows_of("gsr-figure-4"), given)
        assert same["verdict"] == verdict


def test_grid_speed_up_is_judged_where_it_was_measured() -> None:
    rows = rows_of("gsr-figure-1")
    others = rows_of("gsr-figure-4"), rows_of("gsr-table-3")
    assert verdicts(gsr_claims_method.work_claims(rows, *others))[0] == "holds"
    slow = altered(rows, {"triangle_tests": 10**9}, panel="c")
    assert verdicts(gsr_claims_method.work_claims(slow, *others))[0] == "fails"
    assert len(gsr_claims_method.work_claims(rows[:3], *others)) == 2


@pytest.mark.parametrize(("vertex", "verdict"), [(None, "holds"), (1, "depends")])
def test_vertex_shader_must_dominate_everywhere(vertex: int | None, verdict: str) -> None:
    rows = rows_of("gsr-table-1")
    if vertex is not None:
        rows = altered(rows, {"vertex_arithmetic": vertex, "vertex_fetches": vertex}, view="room", mode="RC")
    counted, printed, *_ = gsr_claims_method.share_claims(rows)
    assert (counted["verdict"], printed["verdict"]) == (verdict, "depends")


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, "fails"), (1.005, "fails"), (1.02, "holds")])
def test_divergence_counts_from_one_percent(factor: float, verdict: str) -> None:
    key = "issued_before_shading_lane_steps"
    rows = [
        {**row, key: row[key] * factor} if key in row and row["configuration"] == gsr_table_2.INSIDE else row
        for row in rows_of("gsr-table-2")
    ]
    assert gsr_table_2.claims(rows)[0]["verdict"] == verdict


@pytest.mark.parametrize(("dearest", "verdict"), [(1.1, "fails"), (1.3, "depends"), (2.5, "holds")])
def test_high_variability_is_twice(dearest: float, verdict: str) -> None:
    row = {"view": "v", "eye_cells_and_tests": 0, "shadow_tests": 0, "shadow_rays": 1}
    rows = [{**row, "step": 0, "shadow_cells": 1000}, {**row, "step": 1, "shadow_cells": int(1000 * dearest)}]
    assert verdicts(gsr_claims.light_claims(rows)) == [verdict]


def test_orders_and_targets_are_judged() -> None:
    rows = rows_of("gsr-order")
    assert verdicts(gsr_claims.order_claims(rows)) == ["holds", "holds", "holds", "fails"]
    equal = altered(rows, {"pixels_changed": 0, "pixels_visibly_changed": 0})
    assert verdicts(gsr_claims.order_claims(equal)) == ["holds", "fails", "fails", "fails"]
    other = altered(rows, {"pixels_changed": 1}, passes=2)
    assert verdicts(gsr_claims.order_claims(other)) == ["fails", "holds", "fails", "holds"]


def test_errata_are_judged() -> None:
    rows = rows_of("gsr-errata")
    assert verdicts(gsr_claims.errata_claims(rows)) == ["fails", "fails", "fails", "fails", "holds", "holds"]
    wrong = altered(rows, {"pixels_changed": 3}, errata="GSR-E6")
    assert verdicts(gsr_claims.errata_claims(wrong))[-1] == "fails"
