"""What the page shows, made from a report: papers, their figures and tables in order, and the claims of each.

    report ─▶ claims, a `Line` each ─▶ sections, one for each figure or table ─▶ papers ─▶ template

A claim stands once: with the figure or table that it is about, with the experiment that is its evidence, or in its
paper's list of equations or of sentences.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from refsim.experiments import page_words as words
from refsim.experiments.ledger_evidence import select
from refsim.experiments.page_pictures import Embedded, embedded
from refsim.experiments.page_words import MARKS, Mark
from refsim.experiments.registry import Row, Rows

Entry = dict[str, Any]

NUMBERED = re.compile(r"(?:^|-)(figure|table)-(\d+)$")  # ids of experiments that are a figure or table of a paper
ABOUT = re.compile(r"^(Figure|Table) (\d+)")
PREFIX = re.compile(r"^(?:Figure|Table) \d+: ")
FEW_ROWS, FEW_COLUMNS = 32, 14  # of a table that is shown, not only linked
FEW_FAILS = 8  # settings at which a claim fails that are named
FEW_LINES = 3  # of a table of verdicts that are shown at once
FORMAL = ("equation", "listing")


@dataclass(frozen=True)
class Line:
    """A claim as it is shown; `lines` are the rows of a table of verdicts that it was judged by, `rows` of others."""

    entry: Entry
    mark: Mark
    printed: str
    measured: str
    rule: str
    lines: Rows
    columns: list[str]
    rows: list[list[Any]]
    fails_at: str

    @property
    def few(self) -> bool:
        """Whether the lines are few enough to be shown at once."""
        return 0 < len(self.lines) <= FEW_LINES

    @property
    def same_rule(self) -> bool:
        """Whether one rule judged all lines."""
        return len({row["rule"] for row in self.lines}) == 1

    @property
    def says_open(self) -> bool:
        """Whether the reason of the verdict already names what the paper leaves open."""
        return all(text in self.entry["why"] for text in self.entry["open"])


@dataclass(frozen=True)
class Table:
    """A table: its file beside the page; the rows, if they are few, else none."""

    stem: str
    href: str
    count: int
    columns: list[str]
    rows: list[list[Any]]


@dataclass(frozen=True)
class Section:
    """An experiment: a figure or table of a paper, or one beyond them."""

    experiment: Row
    number: str
    title: str
    picture: Embedded | None
    shows: list[Line]
    lines: list[Line]
    tables: list[Table]
    judges: list[Line]


@dataclass(frozen=True)
class Count:
    """How many claims of a paper have a verdict, and how many of these were judged by its own numbers alone."""

    mark: Mark
    claims: int
    in_print: int


@dataclass(frozen=True)
class Paper:
    """A topic: a paper with its verdicts, or what is about all of them."""

    id: str
    title: str
    paper: Row | None
    counts: list[Count]
    sections: list[Section]
    formal: list[Line]
    said: list[Line]
    evidence: list[Section]

    @property
    def total(self) -> int:
        """How many claims."""
        return sum(count.claims for count in self.counts)


def lines(report: Row) -> list[Line]:
    """All claims, in the papers' order."""
    return [_line(entry, report) for entry in report["ledger"]]


def papers(report: Row, ledger: list[Line], out: Path) -> list[Paper]:
    """All topics of the report, with the claims of `ledger`; pictures are read from `out`."""
    return [_paper(topic, report, ledger, out) for topic in report["topics"]]


def errata(found: list[Paper]) -> dict[str, list[Line]]:
    """Errata in the papers' order and by number, each with the claims that it is about."""
    groups: dict[str, list[Line]] = {}
    for paper in found:
        own = [line for line in all_lines([paper]) if line.entry["erratum"]]
        for line in sorted(own, key=lambda line: [int(part) for part in re.findall(r"\d+", line.entry["erratum"])]):
            groups.setdefault(line.entry["erratum"], []).append(line)
    return groups


def all_lines(found: Iterable[Paper]) -> list[Line]:
    """Every claim, in the order of the page."""
    return [
        line for paper in found
        for group in (*((*s.shows, *s.lines) for s in paper.sections), paper.formal, paper.said) for line in group
    ]  # fmt: skip


def _paper(topic: Row, report: Row, lines: list[Line], out: Path) -> Paper:
    own = [experiment for experiment in report["experiments"] if experiment["topic"] == topic["id"]]
    drawn = [experiment for experiment in own if experiment["picture"]]
    mine = [line for line in lines if line.entry["paper"] == topic["id"]]
    places = {line.entry["id"]: _place(line.entry, drawn) for line in mine}
    rest = [line for line in mine if not places[line.entry["id"]]]
    counts, in_print = (report[name].get(topic["id"], {}) for name in ("summary", "in_print"))
    head = report["papers"].get(topic["id"])
    return Paper(
        id=topic["id"],
        title=head["title"] if head else topic["title"],
        paper=head,
        counts=[Count(m, counts[v], in_print.get(v, 0)) for v, m in MARKS.items() if counts.get(v)],
        sections=[
            _section(e, [line for line in mine if places[line.entry["id"]] == e["id"]], lines, out) for e in drawn
        ],
        formal=[line for line in rest if line.entry["kind"] in FORMAL],
        said=[line for line in rest if line.entry["kind"] not in FORMAL],
        evidence=[_section(e, [], lines, out) for e in own if not e["picture"]],
    )


def _place(entry: Entry, drawn: list[Row]) -> str:
    """The experiment that the claim stands with: the one of its figure or table, else the one that is its evidence."""
    about = ABOUT.match(entry["item"]) or ABOUT.match(entry["place"])
    if about:
        for experiment in drawn:
            found = NUMBERED.search(experiment["id"])
            if found and (found[1], found[2]) == (about[1].lower(), about[2]):
                return str(experiment["id"])
    return str(entry["experiment"]) if any(e["id"] == entry["experiment"] for e in drawn) else ""


def _section(experiment: Row, own: list[Line], lines: list[Line], out: Path) -> Section:
    found = NUMBERED.search(experiment["id"])
    path = out / experiment["picture"] if experiment["picture"] else None
    here = {line.entry["id"] for line in own}
    return Section(
        experiment=experiment,
        number=f"{found[1].capitalize()} {found[2]}" if found else "",
        title=_capital(PREFIX.sub("", experiment["title"])),
        picture=embedded(path) if path else None,
        shows=[line for line in own if line.entry["kind"] == "figure"],
        lines=[line for line in own if line.entry["kind"] != "figure"],
        tables=[_table(stem, rows, experiment["timed"]) for stem, rows in experiment["tables"].items()],
        judges=[
            line for line in lines
            if line.entry["experiment"] == experiment["id"] and line.entry["id"] not in here and experiment["picture"]
        ],
    )  # fmt: skip


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _cells(rows: Rows) -> tuple[list[str], list[list[Any]]]:
    """Columns, and the rows if they are few."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    few = len(rows) <= FEW_ROWS and len(columns) <= FEW_COLUMNS
    return columns, [[row.get(name, "") for name in columns] for row in rows] if few else []


def _table(stem: str, rows: Rows, timed: bool) -> Table:
    columns, cells = _cells(rows)
    return Table(stem, f"{'timings/' if timed else ''}{stem}.csv", len(rows), columns, cells)


def _line(entry: Entry, report: Row) -> Line:
    tables: dict[str, Rows] = next((e["tables"] for e in report["experiments"] if e["id"] == entry["experiment"]), {})
    rows = select(tables.get(entry["table"], []), entry["where"])
    judged = [row for row in rows if {"rule", "measured", "verdict"} <= set(row)]
    columns, cells = _cells([] if judged else rows)
    return Line(
        entry=entry,
        mark=MARKS[entry["verdict"]],
        printed=words.printed(entry),
        measured=words.measured(entry, judged),
        rule=words.rule_text(entry, judged),
        lines=judged,
        columns=columns,
        rows=cells,
        fails_at=_fails_at(entry["sensitivity"]),
    )


def _fails_at(sensitivity: Row | None) -> str:
    """The settings at which the claim does not hold, if they are few."""
    if sensitivity is None:
        return ""
    bad = [row for row in sensitivity["settings"] if row["holds"] == "no"]
    named = list(dict.fromkeys(f"{row['parameter']}: {row['setting']}" for row in bad))
    more = " and others" if len(named) > FEW_FAILS else ""
    return "; ".join(named[:FEW_FAILS]) + more
