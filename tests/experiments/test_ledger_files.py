"""Plan: the ledger's files are whole, and rows are selected as they say.

- Every part of each paper's inventory has a claim, and every claim says something; all rules named are there.
- A claim that lacks what its rule needs, an unknown rule or field, a claim that stands twice, an inventory that is not
  covered are refused, each in one sentence.
- Rows are selected by values, lists, beginnings, largest and smallest; missing meshes and stand-ins are no evidence.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from refsim.errors import InputError
from refsim.experiments import ledger_file
from refsim.experiments.ledger_evidence import evidence_of
from refsim.experiments.ledger_file import read_paper
from refsim.experiments.ledger_rules import RULES
from tests.experiments.ledger_cases import FILE, NUMBER, TWIN


def test_every_rule_that_is_named_is_there() -> None:
    used = {claim.rule for paper in ledger_file.papers().values() for claim in paper.claims}
    assert used <= set(RULES)


@pytest.mark.parametrize("name", ledger_file.PAPERS)
def test_inventory_is_complete(name: str) -> None:
    paper = read_paper(ledger_file.FOLDER / f"{name}.toml")
    kinds = {kind for kind, _ in paper.inventory}
    assert {"figure", "equation"} <= kinds and len(paper.claims) > 40
    for claim in paper.claims:
        assert claim.says and claim.place, claim.name
        assert claim.rule not in ("unsaid", "left open") or claim.open, claim.name


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('item = "Figure 1"', "", "no claim on Figure 1"),
        ('rule = "equals"', 'rule = "magic"', "no rule 'magic'"),
        ('value = "v"', "", "reads a table"),
        ('kind = "figure"', 'kind = "poem"', "kind 'poem'"),
        ('kind = "figure"', 'kind = "figure"\nbasis = "faith"', "basis 'faith'"),
        ('place = "Figure 1"', 'plaice = "Figure 1"', "unknown fields plaice"),
        ("printed = 3", "printed = 3\ntolerance = 0.5", "no reason"),
        ("printed = 3", "printed = ", "cannot be read"),
        ("year = 2000", "", "cannot be read"),
        ("printed = 3\n", f"printed = 3\n{TWIN}", "stands twice"),
    ],
)  # fmt: skip
def test_mistakes_in_a_file_are_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "paper.toml"
    path.write_text(FILE)
    assert len(read_paper(path).claims) == 1
    path.write_text(FILE.replace(old, new))
    with pytest.raises(InputError, match=words):
        read_paper(path)


ROWS = [
    {"scene": "blob_100", "n": 100, "v": 1.0, "p": 2.0},
    {"scene": "blob_200", "n": 200, "v": 3.0, "p": 4.0},
    {"scene": "bunny", "n": "missing", "v": "", "p": 6.0},
    {"scene": "buddha", "n": 300, "v": 9.0, "p": "NA", "mesh": "a stand-in, not the paper's mesh"},
]


@pytest.mark.parametrize(
    ("where", "changes", "values", "missing"),
    [
        ({}, {}, [1.0, 3.0], 2),
        ({"scene": "blob_200"}, {}, [3.0], 0),
        ({"scene": "blob*"}, {}, [1.0, 3.0], 0),
        ({"scene": ["bunny", "blob_1*"]}, {}, [1.0], 1),
        ({"scene": "blob*", "n": "@largest"}, {}, [3.0], 0),
        ({"n": "@smallest"}, {}, [1.0], 0),
        ({"scene": "knot"}, {}, [], 0),
        ({}, {"printed": "@p"}, [[1.0, 2.0], [3.0, 4.0]], 2),
        ({}, {"value": ["v", "n"]}, [[1.0, 100], [3.0, 200]], 2),
        ({}, {"value": "w"}, [], 2),
    ],
)
def test_rows_are_selected(where, changes, values, missing) -> None:
    found = evidence_of(replace(NUMBER, where=where, **changes), {"e": ROWS})
    assert (found.values, found.missing) == (values, missing)
