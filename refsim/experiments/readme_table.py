"""The README's table of claims, made from a report: for each paper its verdicts in a line and the claims that matter.

It stands between `<!-- claims -->` and `<!-- /claims -->`; `put` replaces what is there.

    python -m refsim.experiments.readme_table README.md figures/report.json
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from refsim.errors import InputError
from refsim.experiments import page_words as words
from refsim.experiments.ledger_evidence import select
from refsim.experiments.page import NAME
from refsim.experiments.registry import Row, Rows
from refsim.experiments.report import read_report

# What a reader of a paper's abstract would ask for first
ASKED = {
    "hre": (
        "twice-at-100", "twice-at-100-stencil", "speedup-15", "speedup-15-stencil", "linear", "linear-cone-tests",
        "shader-runs-not-increased", "conservative",
    ),
    "gsr": ("one-to-one", "grid-apparent", "s-vb", "2-3-fold", "shorter-shaders", "as-printed"),
    "bsh": ("gain-5-15", "reduce-ours", "19.8-ours", "logarithmic", "gain-complex", "any-reading"),
}
BETWEEN = re.compile(r"(?<=<!-- claims -->\n).*?(?=<!-- /claims -->)", re.DOTALL)
PAGE = f"figures/{NAME}"


def claims_table(report: dict[str, Any]) -> str:
    """Markdown: a table a paper, each claim linked to its place on the page. Raises `InputError` for a claim that the
    report lacks."""
    entries = {entry["id"]: entry for entry in report["ledger"]}
    blocks = []
    for paper, head in report["papers"].items():
        names = [f"{paper}.{name}" for name in ASKED.get(paper, ())]
        lost = [name for name in names if name not in entries]
        if lost:
            raise InputError(f"the README's table lacks {', '.join(lost)}: no such claim is in the report.")
        rows = [_row(entries[name], report) for name in names]
        titled = f"[{_cell(head['title'])}]({PAGE}#topic-{paper})"
        blocks += [f"| {titled} | printed | measured | verdict |", "|---|---|---|---|", *rows]
        counts = ", ".join(_counts(report, paper))
        blocks += ["", f"In all: {counts}.", ""]
    return "\n".join(blocks)


def put(readme: str, report: dict[str, Any]) -> str:
    """The README with its table of claims as the report has it. Raises `InputError` without the marks."""
    if len(BETWEEN.findall(readme)) != 1:
        raise InputError("the README has no place for the table of claims: <!-- claims --> and <!-- /claims -->.")
    return BETWEEN.sub(lambda _: f"\n{claims_table(report)}\n", readme)


def _counts(report: Row, paper: str) -> list[str]:
    counts, in_print = report["summary"].get(paper, {}), report["in_print"].get(paper, {})
    return [
        f"{counts[verdict]} {verdict}" + (f" ({in_print[verdict]} in print)" if in_print.get(verdict) else "")
        for verdict in words.MARKS if counts.get(verdict)
    ]  # fmt: skip


def _row(entry: Row, report: Row) -> str:
    says = f"[{_cell(words.sentence(entry['says']))}]({PAGE}#{entry['id']})"
    cells = (says, _cell(words.printed(entry)) or "–", _cell(_measured(entry, report)), entry["verdict"])
    return f"| {' | '.join(cells)} |"


def _measured(entry: Row, report: Row) -> str:
    """What was measured; the one line of a table of verdicts says more than that it holds."""
    tables: dict[str, Rows] = next((e["tables"] for e in report["experiments"] if e["id"] == entry["experiment"]), {})
    rows = select(tables.get(entry["table"], []), entry["where"])
    lines = [row for row in rows if {"rule", "measured", "verdict"} <= set(row)]
    text = words.sentence(str(lines[0]["measured"])) if len(lines) == 1 else words.measured(entry, lines)
    text = f"in print: {text}" if entry["basis"] == "print" else text
    found = entry["sensitivity"]
    return f"{text}; at {found['holds']} of {found['of']} settings" if found else text


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    readme, found = map(Path, sys.argv[1:])
    readme.write_text(put(readme.read_text(encoding="utf-8"), read_report(found)), encoding="utf-8", newline="\n")
