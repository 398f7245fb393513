"""The end of a run: the ledger judges what was found, and report and page say it."""

from __future__ import annotations

from pathlib import Path

from refsim.experiments import ledger, report
from refsim.experiments.ledger import Judgement
from refsim.experiments.outcome import Outcome


def conclude(outcome: Outcome, accept: bool = False) -> tuple[Judgement, list[Path]]:
    """Judge the outcome and, if everything was run, write report and page; `accept` commits the verdicts before."""
    judgement = ledger.judge(outcome)
    if accept:
        ledger.accept(judgement, outcome)
        judgement = ledger.judge(outcome)
    if not outcome.complete:
        return judgement, []
    from refsim.experiments.page import write_page

    found = report.make_report(outcome, judgement)
    return judgement, [report.write_report(outcome.out, found), write_page(found, outcome.out)]


def summary_rows(judgement: Judgement) -> list[tuple[str, str]]:
    """Papers, and how many claims of each got which verdict."""
    rows = [
        (paper, ", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
        for paper, counts in judgement.summary().items() if counts
    ]  # fmt: skip
    lacking = len(judgement.not_compared)
    return rows + ([("not compared", f"{lacking}, for want of meshes")] if lacking else [])
