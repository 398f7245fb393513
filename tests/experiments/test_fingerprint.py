"""Plan: kept rows are stale exactly when something that computes them has changed.

- Every function of the room that cases or measure of any experiment can call, found by walking the names that their
  code uses, is in a module that the experiment's key reads; so are modules whose constants they use.
- A change of such a module changes the key; a change of what only draws, or of another experiment, does not.
"""

from __future__ import annotations

import sys
from types import CodeType, FunctionType, ModuleType

import pytest

from refsim.experiments import fingerprint, style, topics
from refsim.experiments.registry import Experiment

ROOM = "refsim.experiments."
EXPERIMENTS = {experiment.id: experiment for own in topics.TOPICS.values() for experiment in own}
CHANGES = [
    ("shoot-out", "shoot_out_runs", True),
    ("shoot-out-speed", "shoot_out_runs", True),
    ("gsr-order", "gsr_errata", True),
    ("bsh-growth", "bsh_runs", True),
    ("tightest-cone", "tightest_cone", True),
    ("tightest-cone", "bsh_runs", False),
    ("tightest-cone", "style", False),
    ("figure-3", "figure_3_plot", False),
    ("figure-3", "construction", True),
]


def names_of(code: CodeType) -> set[str]:
    """Names that a function's code and the functions within it use."""
    inner = [names_of(part) for part in code.co_consts if isinstance(part, CodeType)]
    return set(code.co_names).union(*inner)


def reachable(experiment: Experiment) -> set[str]:
    """Modules of the room in which there is a function that `cases` or `measure` can come to."""
    left: list[object] = [experiment.cases, experiment.measure]
    seen: set[int] = set()
    found: set[str] = set()
    while left:
        one = left.pop()
        one = getattr(one, "__wrapped__", one)
        if not isinstance(one, FunctionType) or id(one) in seen or not one.__module__.startswith(ROOM):
            continue
        seen.add(id(one))
        found.add(one.__module__.removeprefix(ROOM))
        names = names_of(one.__code__)
        here = vars(sys.modules[one.__module__])
        used = [here[name] for name in names if name in here]
        # A module by its name, and what is asked of it
        used += [vars(module)[name] for module in used if isinstance(module, ModuleType) for name in names
                 if module.__name__.startswith(ROOM) and name in vars(module)]  # fmt: skip
        left += used
    return found


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_key_reads_all_that_measures(name: str) -> None:
    read = {path.removeprefix("experiments/").removesuffix(".py") for path in fingerprint.measuring(EXPERIMENTS[name])}
    called = reachable(EXPERIMENTS[name])
    assert called and called <= read


def test_the_walk_finds_what_is_called() -> None:
    assert {"shoot_out", "shoot_out_runs"} <= reachable(EXPERIMENTS["shoot-out"])
    assert {"bsh_growth", "bsh_runs", "runs"} <= reachable(EXPERIMENTS["bsh-growth"])
    assert style.__name__.removeprefix(ROOM) not in reachable(EXPERIMENTS["tightest-cone"])


@pytest.mark.parametrize(("name", "module", "changes"), CHANGES)
def test_a_change_of_code(name: str, module: str, changes: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    before = fingerprint.rows_key(EXPERIMENTS[name])
    sources = fingerprint._sources()
    path = f"experiments/{module}.py"
    assert path in sources
    monkeypatch.setattr(fingerprint, "_sources", lambda: {**sources, path: "changed"})
    assert (fingerprint.rows_key(EXPERIMENTS[name]) != before) is changes
