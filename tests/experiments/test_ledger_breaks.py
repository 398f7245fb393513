"""Plan: the ledger's check fails when the code behind it is broken, on the committed verdicts and rows themselves.

- The rows of one run, one equation and one counter, measured as they are, do not differ from what is committed.
- Each figure, table and check removed from the topics is missed by name.
- A twin whose equation is broken turns the equation's verdict, and its rows differ.
- A counter shifted by one, in any column of figure 7's run, makes its case differ.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from refsim.experiments import figure_7, hre_equations, hre_equations_checks, ledger, topics
from refsim.experiments.ledger_file import papers
from refsim.experiments.outcome import Outcome
from refsim.experiments.registry import Case, Experiment, Row, Tables
from refsim.reference import cone

# The smallest of figure 7's quick runs with all counters at work
CASE = next(case for case in figure_7.cases(True) if case["body"] == "sphere" and case["triangles"] == 100)


def outcome_of(experiment: Experiment, case: Case, rows: list[Row], tables: Tables) -> Outcome:
    """A quick run of one case."""
    cases = {experiment.id: {json.dumps(case, sort_keys=True): rows}}
    return Outcome(True, Path(), cases=cases, tables={experiment.id: dict(tables)} if tables else {})


def changed(experiment: Experiment, case: Case, rows: list[Row]) -> list[str]:
    """Cases that differ from the committed ones; that the others are not run is no matter here."""
    differs = ledger.judge(outcome_of(experiment, case, rows, {})).differs
    return [line for line in differs if "give other rows" in line]


@pytest.fixture(scope="module")
def run() -> list[Row]:
    return figure_7.measure(**CASE)


def test_run_is_the_committed_one(run) -> None:
    assert changed(figure_7.EXPERIMENT, CASE, run) == []


COUNTERS = (
    "cone_tests", "pairs_kept", "fragments", "stencil_rejected_early_fragments", "fragment_shader_runs",
    "triangle_tests", "fragments_written",
)  # fmt: skip


@pytest.mark.parametrize("counter", COUNTERS)
def test_counter_shifted_by_one_differs(counter: str, run) -> None:
    shifted = [{**row, counter: row[counter] + 1} for row in run]
    assert len(changed(figure_7.EXPERIMENT, CASE, shifted)) == 1


def test_counter_shifted_in_the_code_differs(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = figure_7.counts

    def off_by_one(found):
        row = counts(found)
        return {**row, "pairs_kept": row["pairs_kept"] + 1}

    monkeypatch.setattr(figure_7, "counts", off_by_one)
    assert len(changed(figure_7.EXPERIMENT, CASE, figure_7.measure(**CASE))) == 1


EQUATION = "extend-angle"


def judged_equation() -> tuple[str, list[str]]:
    """The verdict on an equation, measured now, and the differences."""
    hre_equations_checks.drawn.cache_clear()
    case = next(case for case in hre_equations.cases(True) if case["item"] == EQUATION)
    rows = hre_equations.measure(**case)
    tables = hre_equations.EXPERIMENT.tables_of(rows, {})
    found = ledger.judge(outcome_of(hre_equations.EXPERIMENT, case, rows, tables))
    (entry,) = [entry for entry in found.entries if entry["id"] == f"hre.eq-{EQUATION}"]
    own = [line for line in found.differs if entry["id"] in line or "give other rows" in line]
    return entry["verdict"], own


def test_broken_equation_differs(monkeypatch: pytest.MonkeyPatch) -> None:
    assert judged_equation() == ("corrected", [])
    average = cone.average_direction

    def wrong(e, r):
        found = average(e, r)
        return found[0], np.nextafter(found[1], np.float32(np.inf)), found[2]

    monkeypatch.setattr(cone, "average_direction", wrong)
    verdict, differs = judged_equation()
    hre_equations_checks.drawn.cache_clear()
    assert verdict == "contradicted" and len(differs) == 2


NEEDED = sorted({claim.experiment for paper in papers().values() for claim in paper.claims if claim.experiment})


@pytest.mark.parametrize("name", NEEDED)
def test_removed_figure_is_missed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for topic, own in topics.TOPICS.items():
        monkeypatch.setitem(topics.TOPICS, topic, tuple(e for e in own if e.id != name))
    differs = ledger.judge(Outcome(True, Path(), complete=True)).differs
    assert any(f"there is no experiment {name!r}" in line for line in differs)
    assert [line for line in differs if line.startswith(f"{name}: committed, but no such experiment")]
