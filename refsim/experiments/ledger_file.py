"""The ledger's files, `claims/*.toml`: what each paper shows and says, and how it is measured here.

Each file opens with a table `[paper]`, title, authors, venue, year and an inventory of figures, tables, equations and
listings; every part of the inventory must have a claim. A `[[claim]]` is a `Claim`. Nothing in these files is a result.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

from refsim.errors import InputError
from refsim.experiments.ledger_rules import RULES

FOLDER = Path(__file__).parent / "claims"
PAPERS = ("hre", "gsr", "bsh")
ANALYSIS = "analysis"  # a question of ours about what is printed: judged, and not counted among the paper's claims
KINDS = ("figure", "table", "equation", "listing", "number", "statement", ANALYSIS)
BASES = ("run", "print")
INVENTORY = {"figures": "figure", "tables": "table", "equations": "equation", "listings": "listing"}


@dataclass(frozen=True)
class Claim:
    """What a paper shows or says at one place.

    id          unique in its paper; the ledger writes `hre.id`
    paper       hre, gsr or bsh
    place       where it stands: a section, figure or table
    kind        one of `KINDS`
    says        what it says, in figures rather than prose
    rule        one of `ledger_rules.RULES`
    experiment  whose tables are the evidence; '' where the paper leaves nothing to measure
    table       the table, by file stem; `where` selects rows: a value, a list of values, a text with `*` at its end, or
                `@largest`, `@smallest` of a numeric column; `value` names the column, or columns, that the rule reads
    printed     the paper's number or numbers, or the column that holds them (`@column`), in `unit`; `corrected` what
                it should be where it is a slip
    tolerance   what the rule allows, and `reason` why
    trend       a value on whose other side the trend would be reversed (1 for a ratio)
    item        the part of the paper's inventory that this is about, as `Figure 4`
    open        what the paper does not say and the verdict may depend on
    erratum     its number in the conventions
    headline    the headline of the table of sensitivities that this is, and there `sensitivity` the claim
    basis       `run`: judged by what was run here; `print`: by the paper's own numbers, against each other
    """

    id: str
    paper: str
    place: str
    kind: str
    says: str
    rule: str
    experiment: str = ""
    table: str = ""
    where: Mapping[str, Any] = field(default_factory=dict)
    value: Any = ""
    printed: Any = None
    corrected: float | None = None
    unit: str = ""
    tolerance: float = 0.0
    reason: str = ""
    trend: float | None = None
    item: str = ""
    open: tuple[str, ...] = ()
    erratum: str = ""
    headline: str = ""
    sensitivity: str = ""
    basis: str = "run"

    @property
    def name(self) -> str:
        """`hre.id`."""
        return f"{self.paper}.{self.id}"


@dataclass(frozen=True)
class Paper:
    """A paper, its inventory as (kind, item), and its claims in the order of the file."""

    id: str
    title: str
    authors: str
    venue: str
    year: int
    inventory: tuple[tuple[str, str], ...]
    claims: tuple[Claim, ...]


@cache
def papers() -> dict[str, Paper]:
    """The three papers. Raises `InputError` for a file that is not as the docstrings say."""
    return {name: read_paper(FOLDER / f"{name}.toml") for name in PAPERS}


def read_paper(path: Path) -> Paper:
    """One file of the ledger."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        head = dict(content["paper"])
        inventory = [(kind, item) for part, kind in INVENTORY.items() for item in head.pop(part, ())]
        claims = tuple(_claim(path.stem, entry) for entry in content["claim"])
        paper = Paper(path.stem, inventory=tuple(inventory), claims=claims, **head)
    except (OSError, tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise InputError(f"the ledger's file {path.name} cannot be read: {error}") from error
    _check(paper)
    return paper


def _claim(paper: str, entry: dict[str, Any]) -> Claim:
    unknown = set(entry) - {f.name for f in fields(Claim)}
    if unknown:
        raise InputError(f"claim {entry.get('id')!r} of {paper} has unknown fields {', '.join(sorted(unknown))}.")
    return Claim(**{**entry, "paper": paper, "open": tuple(entry.get("open", ()))})


def _check(paper: Paper) -> None:
    """Every part of the inventory has a claim, and each claim all that its rule needs."""
    seen = set()
    for claim in paper.claims:
        if claim.name in seen:
            raise InputError(f"claim {claim.name} stands twice in the ledger.")
        seen.add(claim.name)
        if claim.kind not in KINDS:
            raise InputError(f"claim {claim.name}: kind {claim.kind!r} is none of {', '.join(KINDS)}.")
        if claim.basis not in BASES:
            raise InputError(f"claim {claim.name}: basis {claim.basis!r} is none of {', '.join(BASES)}.")
        if claim.rule not in RULES:
            raise InputError(f"claim {claim.name}: there is no rule {claim.rule!r}; choose from {', '.join(RULES)}.")
        if claim.tolerance and not claim.reason:
            raise InputError(f"claim {claim.name} has a tolerance and no reason for it.")
        if RULES[claim.rule].reads and not (claim.experiment and claim.table and claim.value):
            raise InputError(f"claim {claim.name}: rule {claim.rule!r} reads a table; experiment, table or value lack.")
    about = {(claim.kind, claim.item.partition(",")[0]) for claim in paper.claims}
    bare = [item for kind, item in paper.inventory if (kind, item) not in about]
    if bare:
        raise InputError(f"the ledger of {paper.id} has no claim on {', '.join(bare)}.")
