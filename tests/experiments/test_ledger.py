"""Plan: a verdict follows from evidence by a rule, and nothing else; what differs from what was committed is said.

- Rules (hypothesis): the order of rows does not matter but to `grows`; evidence that holds everywhere is reproduced,
  nowhere contradicted; a wider tolerance never takes a verdict away; what is open decides where rows disagree.
- A table of rule, evidence and verdict at the borders of each rule.
- An accepted run has no differences; one counter shifted by one, one verdict changed, one experiment removed, one case
  left out have; a mesh that is missing is not compared, and says so.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.experiments import ledger, ledger_committed, topics
from refsim.experiments.ledger_file import Claim, read_paper
from refsim.experiments.ledger_rules import (
    CONTRADICTED,
    CORRECTED,
    HARDWARE,
    MISSING_MESH,
    NOT_MEASURED,
    REPRODUCED,
    RULES,
    TREND,
    UNSAID,
)
from refsim.experiments.outcome import Outcome
from refsim.experiments.registry import Experiment
from tests.experiments.ledger_cases import FILE, NUMBER

VALUES = st.lists(st.floats(0.1, 100.0), min_size=1, max_size=8)
WORDS = st.lists(st.sampled_from(("holds", "depends", "fails")), min_size=1, max_size=8)


def verdict(claim: Claim, values: list) -> str:
    return RULES[claim.rule].judge(claim, values).verdict


@given(VALUES, st.randoms(use_true_random=False), st.sampled_from(("equals", "at least", "at most", "rounds to")))
def test_order_of_rows_does_not_matter(values, random, rule) -> None:
    shuffled = random.sample(values, len(values))
    assert verdict(replace(NUMBER, rule=rule), values) == verdict(replace(NUMBER, rule=rule), shuffled)


@given(VALUES, st.sampled_from(("equals", "at least", "at most")), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_wider_tolerance_never_takes_a_verdict_away(values, rule, one, other) -> None:
    rank = [CONTRADICTED, TREND, REPRODUCED]
    narrow, wide = (
        verdict(replace(NUMBER, rule=rule, tolerance=t), values) for t in sorted((one, other))
    )
    assert rank.index(narrow) <= rank.index(wide)


@given(WORDS)
def test_verdicts_of_a_table(words) -> None:
    claim = replace(NUMBER, rule="verdicts", printed=None)
    found, left_open = verdict(claim, words), verdict(replace(claim, open=("the camera",)), words)
    if set(words) == {"holds"}:
        assert found == left_open == REPRODUCED
    elif set(words) == {"fails"}:
        assert found == left_open == CONTRADICTED
    elif set(words) == {"depends", "fails"}:
        assert (found, left_open) == (CONTRADICTED, UNSAID)
    else:
        assert (found, left_open) == (TREND, UNSAID)


@given(st.lists(st.tuples(*[st.integers(0, 5)] * 3), min_size=1, max_size=6))
def test_errata(triples) -> None:
    differ, printed, corrected = (sum(column) for column in zip(*triples, strict=True))
    found = verdict(replace(NUMBER, rule="errata"), triples)
    assert (found == REPRODUCED) is (differ == printed == corrected == 0)
    assert (found == CORRECTED) is (differ == 0 and printed > 0 and corrected == 0)
    assert found in (REPRODUCED, CORRECTED, CONTRADICTED)


@given(st.lists(st.floats(0.5, 50.0), min_size=3, max_size=7, unique=True), st.floats(0.01, 100.0))
def test_proportional_pairs_follow(printed, factor) -> None:
    assert verdict(replace(NUMBER, rule="follows"), [(factor * p, p) for p in printed]) == REPRODUCED


@pytest.mark.parametrize(
    ("changes", "values", "expected"),
    [
        ({}, [9.0, 11.0], REPRODUCED),
        ({}, [10.0, 11.1], TREND),
        ({"open": ("the scene",)}, [10.0, 11.1], UNSAID),
        ({}, [8.9], CONTRADICTED),
        ({"trend": 1.0}, [8.9, 2.0], TREND),
        ({"trend": 1.0, "open": ("the scene",)}, [8.9, 2.0], TREND),
        ({"trend": 1.0, "open": ("the scene",)}, [10.0, 2.0], TREND),
        ({"trend": 1.0}, [8.9, 0.9], CONTRADICTED),
        ({"corrected": 9.0, "tolerance": 0.0}, [9.0, 9.0], CORRECTED),
        ({"corrected": 9.0, "tolerance": 0.0}, [9.0, 8.0], CONTRADICTED),
        ({"rule": "at least"}, [9.0, 50.0], REPRODUCED),
        ({"rule": "at most"}, [11.0], REPRODUCED),
        ({"rule": "at most"}, [11.2], CONTRADICTED),
        ({"rule": "between", "printed": [5.0, 15.0], "tolerance": 0.0}, [5.0, 15.0], REPRODUCED),
        ({"rule": "between", "printed": [5.0, 15.0], "tolerance": 0.0}, [4.9, 15.0], TREND),
        ({"rule": "rounds to"}, [9.5, 10.5], REPRODUCED),
        ({"rule": "rounds to", "printed": 2.25}, [2.2549], REPRODUCED),
        ({"rule": "rounds to", "printed": 2.25}, [2.256], CONTRADICTED),
        ({"rule": "grows"}, [1.0, 2.0, 3.0], REPRODUCED),
        ({"rule": "grows"}, [1.0, 3.0, 2.0], TREND),
        ({"rule": "grows"}, [3.0, 2.0, 2.0], CONTRADICTED),
        ({"rule": "grows"}, [3.0], NOT_MEASURED),
        ({"rule": "follows"}, [(1.0, 1.0), (2.0, 2.5), (9.0, 4.0)], TREND),
        ({"rule": "follows"}, [(2.0, 1.0), (1.0, 2.0), (9.0, 4.0)], CONTRADICTED),
        ({"rule": "follows"}, [(2.0, 1.0), (1.0, 2.0)], MISSING_MESH),
        ({"rule": "matches"}, [(9.0, 10.0), (1.05, 1.0)], REPRODUCED),
        ({"rule": "matches"}, [(20.0, 10.0), (2.0, 1.0)], TREND),
        ({"rule": "matches"}, [(20.0, 10.0), (30.0, 1.0)], CONTRADICTED),
        ({"rule": "matches"}, [(20.0, 10.0)], CONTRADICTED),
        ({"rule": "matches", "open": ("the scene",)}, [(10.0, 10.0), (2.0, 1.0)], TREND),
        ({"rule": "matches", "open": ("the scene",)}, [(10.0, 10.0), (20.0, 1.0)], UNSAID),
        ({"rule": "points", "tolerance": 2.0}, [(99.0, 97.0), (3.0, 1.0)], REPRODUCED),
        ({"rule": "points", "tolerance": 2.0}, [(99.5, 97.0), (3.0, 1.0)], TREND),
        ({"rule": "points", "tolerance": 2.0}, [(3.5, 1.0)], CONTRADICTED),
        ({"rule": "chosen", "open": ("the camera",)}, [(11.0, 10.0), (0.9, 1.0)], UNSAID),
        ({"rule": "chosen", "open": ("the camera",)}, [(11.2, 10.0), (0.9, 1.0)], CONTRADICTED),
        ({"rule": "predicts", "tolerance": 25.0}, [25.0, -25.0], REPRODUCED),
        ({"rule": "predicts", "tolerance": 25.0}, [10.0, -25.1], HARDWARE),
        ({"rule": "put right", "printed": "old"}, [("old", "holds"), ("new", "fails")], REPRODUCED),
        ({"rule": "put right", "printed": "old"}, [("old", "fails"), ("new", "holds")], CORRECTED),
        ({"rule": "put right", "printed": "old"}, [("old", "fails"), ("new", "depends")], CONTRADICTED),
        ({"rule": "errata"}, [[0, "", 0]], REPRODUCED),
        ({"rule": "errata"}, [["", 0, ""]], REPRODUCED),
        ({"rule": "errata"}, [[0, 3, ""]], CONTRADICTED),
        ({"rule": "errata"}, [[0, 3, 0], [0, 0, 0]], CORRECTED),
        ({"rule": "errata"}, [[0, 3, 0], ["", 1, ""]], CONTRADICTED),
        ({"rule": "any verdict"}, ["fails", "holds"], REPRODUCED),
        ({"rule": "any verdict"}, ["fails", "depends"], TREND),
        ({"rule": "any verdict", "open": ("what",)}, ["fails", "depends"], UNSAID),
        ({"rule": "any verdict"}, ["fails", "fails"], CONTRADICTED),
        ({"rule": "left open", "open": ("what",)}, ["holds", "fails"], UNSAID),
        ({"rule": "left open"}, ["holds"], REPRODUCED),
        ({"rule": "made"}, ["a"], REPRODUCED),
        ({"rule": "made", "open": ("the scene",)}, ["a"], UNSAID),
        ({"rule": "hardware", "unit": "ms"}, [], HARDWARE),
        ({"rule": "hardware", "unit": "triangles"}, [], UNSAID),
        ({"rule": "unsaid", "open": ("the scene",)}, [], UNSAID),
    ],
)  # fmt: skip
def test_borders_of_each_rule(changes, values, expected) -> None:
    assert verdict(replace(NUMBER, **changes), values) == expected


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    """A ledger of one claim, one experiment of two cases, and a run of it that was accepted."""
    (tmp_path / "hre.toml").write_text(FILE)
    monkeypatch.setattr(ledger_committed, "FOLDER", tmp_path)
    monkeypatch.setattr(ledger, "papers", lambda: {"hre": read_paper(tmp_path / "hre.toml")})
    experiment = Experiment("e", "E", "", lambda quick: [], lambda: [])
    monkeypatch.setitem(topics.TOPICS, "hre", (experiment,))
    for topic in set(topics.TOPICS) - {"hre"}:
        monkeypatch.setitem(topics.TOPICS, topic, ())
    outcome = run(3, 4)
    ledger.accept(ledger.judge(outcome), outcome)
    return outcome


def run(first: float, second: float, **changes) -> Outcome:
    """A run in which the claim's value is `first` and a number that no claim reads is `second`."""
    rows = {'{"case": 1}': [{"v": first}], '{"case": 2, "mesh": "present"}': [{"other": second}]}
    table = {"e": {"e": [row for own in rows.values() for row in own]}}
    return replace(Outcome(False, Path(), True, {"e": rows}, table), **changes)


def test_accepted_run_has_no_differences(small: Outcome) -> None:
    found = ledger.judge(run(3, 4))
    assert (found.differs, found.not_compared) == ([], [])
    assert [entry["verdict"] for entry in found.entries] == [REPRODUCED]
    assert found.summary() == found.summary("run") == {"hre": {REPRODUCED: 1}}
    assert found.summary("print") == {"hre": {}}
    json.dumps(found.entries)


def test_questions_of_ours_are_judged_and_not_counted(small: Outcome, monkeypatch: pytest.MonkeyPatch) -> None:
    paper = ledger.papers()["hre"]
    asked = replace(paper, claims=tuple(replace(claim, kind="analysis") for claim in paper.claims))
    monkeypatch.setattr(ledger, "papers", lambda: {"hre": asked})
    found = ledger.judge(run(3, 4))
    assert [entry["verdict"] for entry in found.entries] == [REPRODUCED] and found.summary() == {"hre": {}}


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (4, 4, ("hre.a: contradicted", "1 of 2 cases")),
        (3, 5, ("e: 1 of 2 cases give other rows",)),
        (3.0 + 1e-6, 4, ("hre.a: contradicted", "1 of 2 cases")),
        (3, 4 + 1e-6, ("1 of 2 cases",)),
    ],
)
def test_one_number_shifted_is_a_difference(small: Outcome, first, second, words) -> None:
    found = ledger.judge(run(first, second))
    assert len(found.differs) == len(words)
    assert all(any(word in line for line in found.differs) for word in words)


def test_last_digits_of_a_float_are_no_difference(small: Outcome) -> None:
    outcome = run(3, 4.5)
    ledger.accept(ledger.judge(outcome), outcome)
    assert ledger.judge(run(3, 4.5 + 1e-12)).differs == []
    assert len(ledger.judge(run(3, 4.5 + 1e-6)).differs) == 1


def test_removed_experiment_is_a_difference(small: Outcome, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(topics.TOPICS, "hre", ())
    found = ledger.judge(Outcome(False, Path(), complete=True))
    assert len(found.differs) == 2
    assert "hre.a: there is no experiment 'e'" in found.differs[0]
    assert "e: committed, but no such experiment" in found.differs[1]


def test_case_left_out_is_a_difference(small: Outcome) -> None:
    found = ledger.judge(run(3, 4, cases={"e": {'{"case": 1}': [{"v": 3}]}}))
    assert found.differs == ['e: committed cases are not run: {"case": 2, "mesh": "present"}.']


def test_missing_mesh_is_not_compared(small: Outcome) -> None:
    cases = {'{"case": 1}': [{"v": 3}], '{"case": 2, "mesh": "missing"}': [{"other": "missing"}]}
    found = ledger.judge(run(4, 4, cases={"e": cases}))
    assert found.differs == [] and len(found.not_compared) == 2


def test_run_without_its_meshes_is_not_accepted(small: Outcome, tmp_path: Path) -> None:
    cases = {'{"case": 1}': [{"v": 3}], '{"case": 2, "mesh": "missing"}': [{"other": "missing"}]}
    outcome = run(4, 4, cases={"e": cases})
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError, match="missing"):
        ledger.accept(ledger.judge(outcome), outcome)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(("quick", "command"), [(False, "hre --only e"), (True, "hre --quick --only e")])
def test_command_is_that_of_the_run(small: Outcome, quick: bool, command: str) -> None:
    entry = ledger.judge(replace(small, quick=quick)).entries[0]
    assert entry["command"] == f"refsim reproduce {command}"


def test_uncommitted_run_differs(small: Outcome) -> None:
    found = ledger.judge(replace(small, quick=True))
    assert found.differs == ["hre.a: reproduced; nothing was committed.", "e: nothing was committed of it."]
