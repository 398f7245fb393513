"""Plan: `refsim reproduce` hands its options to the experiments and prints the files they write, one a line.

- Without options it is the first paper, everything, into `figures`; options arrive under their Python names.
- Quick figures go to a folder of their own unless told otherwise.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

import refsim
from refsim.progress import progress


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((), {"quick": False, "only": None, "out": Path("figures")}),
        (("hre", "--quick"), {"quick": True, "only": None, "out": Path("figures-quick")}),
        (("hre", "--quick", "--out", "figures"), {"quick": True, "only": None, "out": Path("figures")}),
        (("hre", "--only", "figure_4", "--out", "a/b"), {"quick": False, "only": "figure_4", "out": Path("a/b")}),
    ],
)
def test_options_arrive(given, expected, refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    experiments = ModuleType("refsim.experiments")

    def reproduce(paper, **options):
        calls.append((paper, options))
        return [Path("figures/a.png"), Path("figures/a.csv")]

    experiments.reproduce = reproduce
    monkeypatch.setitem(sys.modules, "refsim.experiments", experiments)
    monkeypatch.setattr(refsim, "experiments", experiments, raising=False)
    answer = refsim_main("reproduce", *given)
    assert (answer.code, answer.out) == (0, "figures/a.png\nfigures/a.csv\n")
    assert calls == [("hre", {**expected, "progress": progress})]
