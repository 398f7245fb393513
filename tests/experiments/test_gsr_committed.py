"""Plan: the committed figures of the geometry-shader paper are those that the code makes.

- Each full case has its rows in a committed table.
- A part of each table is computed again by the pipeline and equals the committed rows.
- Tables that follow from others, verdicts among them, are, byte for byte, what the code makes of the committed ones.
- Real meshes were at hand when the figures were made; the scene of which there is no mesh reads `missing`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest

from refsim.experiments import experiments_of, gsr_errata, gsr_figure_4, gsr_moving_light, gsr_table_1, gsr_table_3
from refsim.experiments import gsr_published as published
from refsim.experiments.files import csv_text, read_csv
from refsim.experiments.registry import Rows

FIGURES = Path(__file__).resolve().parents[2] / "figures"
EXPERIMENTS = experiments_of("gsr")
# The tables that hold an experiment's rows
TABLES = {
    "gsr-figure-4": ("gsr-figure-4", "gsr-figure-4-compared"),
    "gsr-table-1": ("gsr-table-1-runs",),
    "gsr-table-2": ("gsr-table-2", "gsr-table-2-warps"),
    "gsr-order": ("gsr-order", "gsr-order-emission"),
    "gsr-paper-case": ("gsr-paper-case", "gsr-paper-case-passes"),
    "gsr-stages": ("gsr-stages", "gsr-stages-passes"),
    "gsr-set-up": ("gsr-set-up", "gsr-set-up-room"),
}
# Where a table calls a case's parameter by another name, or not at all
RENAMED = {"secondary": "secondary_rays", "order": "emission_order"}
LEFT_OUT = ("mesh", "step", "part")


@cache
def committed(name: str) -> Rows:
    return [row for stem in TABLES.get(name, (name,)) for row in read_csv(FIGURES / f"{stem}.csv")]


def text(stem: str) -> str:
    return (FIGURES / f"{stem}.csv").read_text(encoding="utf-8")



def measured_again(name: str, **wanted: Any) -> None:
    """Cases that have the wanted parameters give rows that are in the committed tables."""
    experiment, rows = EXPERIMENTS[name], committed(name)
    cases = [case for case in experiment.cases(False) if all(case.get(key) == value for key, value in wanted.items())]
    assert cases
    known = [{key: value for key, value in row.items() if value != ""} for row in rows]
    for case in cases:
        for row in experiment.measure(**case):
            assert {key: value for key, value in row.items() if value != ""} in known, case


@pytest.mark.parametrize("name", [name for name, e in EXPERIMENTS.items() if not e.needs])
def test_every_full_case_is_in_a_table(name: str) -> None:
    rows = committed(name)
    for case in EXPERIMENTS[name].cases(False):
        given = {RENAMED.get(key, key): value for key, value in case.items() if key not in LEFT_OUT}
        if name.endswith("-equations"):
            given = {"id": case["item"]}
        if case.get("mesh") == "missing":
            # Made without the mesh here, with it where the figures come from
            given = {key: case[key] for key in ("published_scene", "panel") if key in case}
        assert any(all(row.get(key) == value for key, value in given.items() if key in row) for row in rows), case


def test_pictures_are_counted_again() -> None:
    measured_again("gsr-figure-1", panel="c")
    measured_again("gsr-figure-3", view="knot")


def test_occupancy_is_measured_again() -> None:
    measured_again("gsr-figure-4", part="a", view="mirroring room", passes=2)
    measured_again("gsr-figure-4", part="b", view="cornell box", mode="SC")


def test_operations_are_counted_again() -> None:
    measured_again("gsr-table-1", view="room", mode="SC")
    measured_again("gsr-table-1", view="knight in box", frame=99)


def test_warps_are_accounted_again() -> None:
    measured_again("gsr-table-2", configuration="no geometry shader")


def test_scenes_are_counted_again() -> None:
    measured_again("gsr-table-3", published_scene="Cornell Box", mode="RT")


@pytest.mark.parametrize("name", ["corrected", "GSR-E1", "GSR-E8", "as_printed"])
def test_errata_are_counted_again(name: str) -> None:
    measured_again("gsr-errata", errata=name)


def test_targets_are_compared_again() -> None:
    measured_again("gsr-order", lights=1, passes=3, secondary="reflected")


@pytest.mark.parametrize(
    ("name", "part"), [("gsr-paper-case", "as-printed"), ("gsr-paper-case", "passes"), ("gsr-stages", "packed"),
                       ("gsr-set-up", "lists"), ("gsr-set-up", "room")],
)  # fmt: skip
def test_statements_are_counted_again(name: str, part: str) -> None:
    measured_again(name, part=part)


def test_derived_tables_follow_from_their_rows() -> None:
    assert csv_text(gsr_table_1.distribution(committed("gsr-table-1"))) == text("gsr-table-1")
    assert csv_text(gsr_table_1.frames_of(committed("gsr-table-1"))) == text("gsr-table-1-frames")
    assert csv_text(gsr_table_3.ratios(committed("gsr-table-3"))) == text("gsr-table-3-ratios")
    assert csv_text(gsr_moving_light.summary(committed("gsr-moving-light"))) == text("gsr-moving-light-summary")
    assert csv_text(published.published_rows()) == text("claims-gsr-published")


def test_verdicts_follow_from_the_committed_tables() -> None:
    claims = EXPERIMENTS["claims-gsr"]
    made = claims.tables_of([], {name: committed(name) for name in claims.needs})
    for stem in ("claims-gsr", "claims-gsr-quotients"):
        assert csv_text(made[stem]) == text(stem)


def test_the_papers_example_fills_48_mebibytes() -> None:
    rows = [row for row in gsr_figure_4.of_part(committed("gsr-figure-4"), "a") if row["passes"] == 2]
    assert {row["size_px"] for row in rows} == {published.SIDE}
    assert {row["capacity_bytes"] for row in rows} == {published.buffer_bytes()}
    assert max(row["bytes_out"] for row in rows) == 48 * 2**20


def test_figures_were_made_with_the_real_meshes() -> None:
    triangles = {row["published_scene"]: row["triangles"] for row in committed("gsr-table-3")}
    same = ("Dragon", "Horse", "Stanford Bunny", "Cornell Box", "Cornell Knot")
    assert {name: triangles[name] for name in same} == {name: published.TABLE_3[name][0] for name in same}
    assert (triangles["Fairy Forest"], triangles["Happy Buddha"]) == ("missing", 100_000)
    assert all(isinstance(row["rays"], int) for row in committed("gsr-figure-1"))


def test_committed_errata_are_all_of_them() -> None:
    floats = [row["errata"] for row in committed("gsr-errata") if row["color_format"] == gsr_errata.FLOAT]
    assert floats == list(gsr_errata.ABOUT)
