"""Plan: `refsim reproduce` hands its options to the experiments, prints the files they write, one a line, and judges.

- Without options it is everything, on all processors, into `figures`; options arrive under their Python names.
- Quick figures go to a folder of their own unless told otherwise.
- What is found is what is judged; verdicts follow the files; each difference is a line on stderr, and the exit code 1.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

import refsim
from refsim.progress import progress

ALL = {"quick": False, "only": None, "out": Path("figures"), "jobs": 3, "backend": "joblib"}


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The experiments replaced: what they were asked for, and what the ledger is to find."""
    seen = SimpleNamespace(topic="", options={}, outcome=None, accept=None, differs=[])
    experiments = ModuleType("refsim.experiments")

    def reproduce(topic, **options):
        seen.outcome = options.pop("outcome")
        seen.topic, seen.options = topic, options
        return [Path("figures/a.png"), Path("figures/a.csv")]

    def conclude(outcome, accept):
        assert outcome is seen.outcome
        seen.accept = accept
        return SimpleNamespace(differs=seen.differs), [outcome.out / "report.json"]

    experiments.reproduce, experiments.conclude = reproduce, conclude
    experiments.processors, experiments.summary_rows = lambda: 3, lambda judgement: [("hre", "7 reproduced")]
    experiments.Outcome = lambda quick, out: SimpleNamespace(quick=quick, out=out)
    monkeypatch.setitem(sys.modules, "refsim.experiments", experiments)
    monkeypatch.setattr(refsim, "experiments", experiments, raising=False)
    return seen


@pytest.mark.parametrize(
    ("given", "topic", "changes"),
    [
        ((), None, {}),
        (("--quick",), None, {"quick": True, "out": Path("figures-quick")}),
        (("hre", "--quick", "--out", "figures"), "hre", {"quick": True}),
        (("across", "--only", "a", "--out", "b/c"), "across", {"only": ("a",), "out": Path("b/c")}),
        (("--only", "a", "--only", "b"), None, {"only": ("a", "b")}),
        (("gsr", "--jobs", "7", "--backend", "dask"), "gsr", {"jobs": 7, "backend": "dask"}),
    ],
)
def test_options_arrive(given, topic, changes, called, refsim_main) -> None:
    answer = refsim_main("reproduce", *given)
    expected = {**ALL, **changes}
    assert (called.topic, called.options) == (topic, {**expected, "progress": progress})
    assert (called.outcome.quick, called.outcome.out) == (expected["quick"], expected["out"])
    assert answer.code == 0 and answer.err == ""
    assert answer.out.splitlines() == [
        "figures/a.png", "figures/a.csv", str(expected["out"] / "report.json"), "  hre  7 reproduced",
    ]  # fmt: skip
    assert called.accept is False


def test_differences_are_lines_and_exit_code_1(called, refsim_main) -> None:
    called.differs = ["hre/a: contradicted; committed is reproduced.", "figure-7: 1 of 60 cases\ngives other rows."]
    answer = refsim_main("reproduce", "hre", "--accept")
    assert answer.code == 1 and called.accept is True
    lines = ["hre/a: contradicted; committed is reproduced.", "figure-7: 1 of 60 cases gives other rows."]
    assert answer.err.splitlines() == [f"refsim: {line}" for line in lines]


@pytest.mark.parametrize("given", [("xyz",), ("--jobs", "0"), ("--jobs", "many"), ("--backend", "threads")])
def test_what_does_not_exist_is_refused(given, called, refsim_main) -> None:
    answer = refsim_main("reproduce", *given)
    assert (answer.code, answer.out, called.topic) == (2, "", "")
    assert given[-1] in answer.err


def test_topics_of_the_command_are_those_that_there_are() -> None:
    from refsim import cli
    from refsim.experiments import topics

    assert tuple(topics.TOPICS) == cli.TOPICS
