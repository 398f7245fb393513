"""Plan: the committed figures of the sphere hierarchy's paper are those that the code makes.

- Each full case has its rows in a committed table.
- Parts that need no mesh are computed again and equal the committed rows.
- Tables that follow from others, verdicts among them, are, byte for byte, what the code makes of the committed ones.
- Real meshes were at hand when the figures were made; substitutes are named.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest

from refsim.experiments import bsh_growth, bsh_lists, bsh_table_1, bsh_table_2, bsh_table_3, experiments_of
from refsim.experiments import bsh_published as published
from refsim.experiments.bsh_table_1_statistics import effects, statistics
from refsim.experiments.files import csv_text, read_csv
from refsim.experiments.registry import Rows

FIGURES = Path(__file__).resolve().parents[2] / "figures"
EXPERIMENTS = experiments_of("bsh")
# The tables that hold an experiment's rows, and the `part` that a table does not have or repeats
TABLES = {
    "bsh-table-1": ("bsh-table-1-runs",),
    "bsh-table-2": ("bsh-table-2", "bsh-table-2-readings"),
    "bsh-histogram": ("bsh-histogram", "bsh-histogram-bins"),
    "claims-bsh": ("claims-bsh-errata", "claims-bsh-layers"),
}
RENAMED = {"name": "scene"}
# What a case says and its rows do not
LEFT_OUT = ("mesh", "cameras", "part", "shadows")


@cache
def committed(name: str) -> Rows:
    return [row for stem in TABLES.get(name, (name,)) for row in read_csv(FIGURES / f"{stem}.csv")]


def text(stem: str) -> str:
    return (FIGURES / f"{stem}.csv").read_text(encoding="utf-8")


def measured_again(experiment_id: str, **wanted: Any) -> None:
    """Cases that have the wanted parameters give rows that are in the committed tables."""
    experiment = EXPERIMENTS[experiment_id]
    cases = [case for case in experiment.cases(False) if all(case.get(key) == value for key, value in wanted.items())]
    assert cases
    known = [{key: value for key, value in row.items() if value != ""} for row in committed(experiment_id)]
    for case in cases:
        for row in experiment.measure(**case):
            assert {key: value for key, value in row.items() if value != ""} in known, case


@pytest.mark.parametrize("name", list(EXPERIMENTS))
def test_every_full_case_is_in_a_table(name: str) -> None:
    rows = committed(name)
    for case in EXPERIMENTS[name].cases(False):
        given = {RENAMED.get(key, key): value for key, value in case.items() if key not in LEFT_OUT}
        if name.endswith("-equations"):
            given = {"id": case["item"]}
        assert any(all(row[key] == value for key, value in given.items() if key in row) for row in rows), case


@pytest.mark.parametrize("name", ["bsh-figure-1", "bsh-figure-3"])
def test_drawings_are_measured_again(name: str) -> None:
    measured_again(name)


def test_partitions_are_measured_again() -> None:
    measured_again("bsh-figure-2", lists=8)


def test_scenes_without_a_mesh_are_counted_again() -> None:
    measured_again("bsh-figure-4", published_scene="Cubes")
    measured_again("bsh-table-2", published_scene="Cubes")
    measured_again("bsh-table-3", published_scene="Cubes")
    measured_again("bsh-growth", name="sphere_400")
    measured_again("bsh-threshold", name="cubes", threshold=0.5)
    measured_again("bsh-lists", name="cubes", part="all on")
    measured_again("bsh-locality", name="cubes", shadows=0)


def test_errata_are_counted_again() -> None:
    measured_again("claims-bsh", of="BSH-E9")


def test_derived_tables_follow_from_their_rows() -> None:
    runs = committed("bsh-table-1")
    table = bsh_table_1.compared(runs)
    assert csv_text(table) == text("bsh-table-1")
    assert csv_text(effects(table)) == text("bsh-table-1-pairs")
    assert csv_text(statistics(table)) == text("bsh-table-1-statistics")
    assert csv_text(bsh_table_1.fits(table)) == text("bsh-table-1-fits")
    assert csv_text(bsh_table_2.fits(committed("bsh-table-2"))) == text("bsh-table-2-fits")
    assert csv_text(bsh_table_3.links(committed("bsh-table-3"))) == text("bsh-table-3-links")
    assert csv_text(bsh_table_3.hidden(committed("bsh-table-3"))) == text("bsh-table-3-hidden")
    assert csv_text(bsh_growth.laws(committed("bsh-growth"))) == text("bsh-growth-laws")
    assert csv_text(bsh_lists.gains(committed("bsh-lists"))) == text("bsh-lists-gains")
    assert csv_text(published.published_rows()) == text("claims-bsh-published")


def test_verdicts_follow_from_the_committed_tables() -> None:
    claims = EXPERIMENTS["claims-bsh"]
    needed = {name: committed(name) for name in claims.needs}
    assert csv_text(claims.tables(committed("claims-bsh"), needed)["claims-bsh"]) == text("claims-bsh")  # type: ignore[misc]


def test_figures_were_made_with_the_real_meshes() -> None:
    rows = {row["published_scene"]: row for row in committed("bsh-figure-4")}
    triangles = {scene: row["triangles"] for scene, row in rows.items()}
    real = {scene: count for scene, (count, _, _) in published.TABLE_2.items() if scene != "Happy Buddha"}
    assert {scene: triangles[scene] for scene in real} == real
    for scene in ("Suzanne", "Bunny", "Dragon"):
        assert rows[scene]["vertices_of_file_and_ground"] == published.TABLE_2[scene][1]
    assert (triangles["Happy Buddha"], rows["Happy Buddha"]["substitute"] != "") == (100_002, True)
    assert all("missing" not in row.values() for name in EXPERIMENTS for row in committed(name))


def test_index_names_every_table() -> None:
    index = (FIGURES / "index-bsh.md").read_text(encoding="utf-8")
    for name, experiment in EXPERIMENTS.items():
        assert experiment.caption in index and f"({name}.csv)" in index
        assert (FIGURES / f"{name}.png").is_file() is (experiment.plot is not None)
