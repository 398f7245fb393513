"""The ledger: every figure, table, equation, listing and claim of the papers, each with a computed verdict.

    outcome of a run ─▶ evidence ─▶ rule ─▶ verdict ─▶ compared with the committed one

`judge` makes the entries of report.json and says what differs from what was committed; `accept` commits.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from refsim.errors import InputError
from refsim.experiments.ledger_committed import Committed, canonical, digest, read_committed, write_committed
from refsim.experiments.ledger_evidence import Evidence, evidence_of
from refsim.experiments.ledger_file import ANALYSIS, Claim, papers
from refsim.experiments.ledger_rules import MISSING_MESH, NOT_MEASURED, RULES, Finding
from refsim.experiments.outcome import Outcome
from refsim.experiments.registry import Experiment, Row
from refsim.experiments.runs import MISSING, PRESENT
from refsim.experiments.topics import TOPICS

SENSITIVITY = "sensitivity"


@dataclass
class Judgement:
    """`entries` as in report.json; what differs from what was committed, and what could not be compared, in sentences.

    `judged` holds verdict and evidence by claim: what `accept` commits.
    """

    entries: list[Row] = field(default_factory=list)
    differs: list[str] = field(default_factory=list)
    not_compared: list[str] = field(default_factory=list)
    judged: dict[str, list[Any]] = field(default_factory=dict)

    def summary(self, basis: str | None = None) -> dict[str, dict[str, int]]:
        """Paper -> verdict -> how many of its claims, of one basis if given."""
        told = [e for e in self.entries if e["kind"] != ANALYSIS and basis in (None, e["basis"])]
        counts = {paper: Counter(e["verdict"] for e in told if e["paper"] == paper) for paper in papers()}
        return {paper: dict(sorted(count.items())) for paper, count in counts.items()}


def known_experiments() -> dict[str, Experiment]:
    """Every experiment of every topic by id."""
    return {experiment.id: experiment for own in TOPICS.values() for experiment in own}


def _topic_of(experiment: str) -> str:
    return next((topic for topic, own in TOPICS.items() if any(e.id == experiment for e in own)), "")


def judge(outcome: Outcome) -> Judgement:
    """Verdicts on all claims whose experiment is in the outcome, and what differs from the committed ones."""
    found = Judgement()
    committed = read_committed(outcome.size)
    known = known_experiments()
    bare = _without_meshes(outcome, committed)
    ran = {topic for topic, own in TOPICS.items() if any(experiment.id in outcome.tables for experiment in own)}
    for paper in papers().values():
        for claim in paper.claims:
            if claim.experiment and claim.experiment not in known:
                found.differs.append(f"{claim.name}: there is no experiment {claim.experiment!r} to judge it by.")
            elif claim.experiment in outcome.tables or (not claim.experiment and claim.paper in ran):
                _judge_claim(claim, outcome, committed, _closure(claim.experiment, known) & bare, found)
    if outcome.complete:
        gone = set(committed.verdicts) - {claim.name for paper in papers().values() for claim in paper.claims}
        found.differs += [f"{name}: committed, but no longer in the ledger." for name in sorted(gone)]
        lost = sorted(set(committed.rows) - set(known))
        found.differs += [f"{name}: committed, but no such experiment is left." for name in lost]
    for name in outcome.cases:
        if name in known and not known[name].timed:
            _compare_rows(name, outcome, committed, found)
    return found


def accept(judgement: Judgement, outcome: Outcome) -> None:
    """Make verdicts, evidence and rows of this run the committed ones; what was not run stays as it was.

    Raises `InputError` for a run that lacks meshes which the committed one had: it would commit less than was known.
    """
    old = read_committed(outcome.size)
    known = known_experiments()
    lost = _lost(outcome, old)
    if lost:
        raise InputError(f"this run cannot be accepted: meshes that the committed one had are missing, as in {lost}.")
    rows = {
        name: {case: digest(rows) for case, rows in own.items()}
        for name, own in outcome.cases.items() if name in known and not known[name].timed
    }  # fmt: skip
    verdicts = judgement.judged if outcome.complete else {**old.verdicts, **judgement.judged}
    write_committed(outcome.size, Committed(verdicts, rows if outcome.complete else {**old.rows, **rows}))


def _closure(experiment: str, known: dict[str, Experiment]) -> set[str]:
    """The experiment and all that its tables are made from."""
    found, left = set(), [experiment] if experiment else []
    while left:
        name = left.pop()
        if name in known and name not in found:
            found.add(name)
            left += known[name].needs
    return found


def _lost(outcome: Outcome, committed: Committed) -> str:
    """A case without its mesh that was committed with it, or ''."""
    there, gone = (json.dumps(state) for state in (PRESENT, MISSING))
    return next(
        (case for name, own in outcome.cases.items() for case in own
         if gone in case and case.replace(gone, there) in committed.rows.get(name, {})),
        "",
    )  # fmt: skip


def _without_meshes(outcome: Outcome, committed: Committed) -> set[str]:
    """Experiments in which a mesh is missing that was there when the verdicts were committed."""
    return {
        name for name, own in outcome.cases.items()
        for case in own if MISSING in case and case not in committed.rows.get(name, {})
    }  # fmt: skip


def _judge_claim(claim: Claim, outcome: Outcome, committed: Committed, bare: set[str], found: Judgement) -> None:
    rule = RULES[claim.rule]
    evidence = evidence_of(claim, outcome.tables.get(claim.experiment, {})) if rule.reads else Evidence([], 0)
    if rule.reads and not evidence.values:
        lacking = "no mesh is at hand" if evidence.missing else "no row of this size of run shows it"
        finding = Finding(MISSING_MESH if evidence.missing else NOT_MEASURED, "nothing", lacking)
    else:
        finding = rule.judge(claim, evidence.values)
    found.entries.append(_entry(claim, finding, evidence, outcome))
    values = canonical(evidence.values)
    found.judged[claim.name] = [finding.verdict, values]
    old = committed.verdicts.get(claim.name)
    if bare:
        found.not_compared.append(f"{claim.name}: meshes of {', '.join(sorted(bare))} are missing.")
    elif old is None:
        found.differs.append(f"{claim.name}: {finding.verdict}; nothing was committed.")
    elif old[0] != finding.verdict:
        found.differs.append(f"{claim.name}: {finding.verdict} ({finding.measured}); committed is {old[0]}.")
    elif old[1] != values:
        found.differs.append(f"{claim.name}: still {finding.verdict}, but on other numbers: {finding.measured}.")


def _entry(claim: Claim, finding: Finding, evidence: Evidence, outcome: Outcome) -> Row:
    rule = RULES[claim.rule]
    topic = _topic_of(claim.experiment)
    quick = " --quick" if outcome.quick else ""
    return {
        "id": claim.name, "paper": claim.paper, "place": claim.place, "kind": claim.kind, "item": claim.item,
        "basis": claim.basis,
        "says": claim.says, "experiment": claim.experiment, "table": claim.table, "where": dict(claim.where),
        "printed": claim.printed, "unit": claim.unit,
        "measured": finding.measured, "evidence": evidence.values, "missing": evidence.missing,
        "rule": rule.sentence, "tolerance": claim.tolerance, "reason": claim.reason, "open": list(claim.open),
        "erratum": claim.erratum, "verdict": finding.verdict, "why": finding.why,
        "command": f"refsim reproduce {topic}{quick} --only {claim.experiment}" if topic else "",
        "sensitivity": _sensitivity(claim, outcome),
    }  # fmt: skip


def _sensitivity(claim: Claim, outcome: Outcome) -> Row | None:
    """The settings at which the claim's headline was measured, and at how many the claim holds."""
    if not claim.headline:
        return None
    rows = [
        row for row in outcome.tables.get(SENSITIVITY, {}).get(SENSITIVITY, [])
        if row["headline"] == claim.headline and row["claim"] == claim.sensitivity and row["holds"] in ("yes", "no")
        and row.get("counted", "yes") == "yes"
    ]  # fmt: skip
    if not rows:
        return None
    values = [row["value"] for row in rows]
    good = [row for row in rows if row["holds"] == "yes"]
    return {
        "headline": claim.headline, "holds": len(good), "of": len(rows), "least": min(values), "most": max(values),
        "unit": rows[0]["unit"], "settings": rows,
        "only_at": f"{good[0]['parameter']} = {good[0]['setting']}" if len(good) == 1 else "",
    }  # fmt: skip


def _compare_rows(name: str, outcome: Outcome, committed: Committed, found: Judgement) -> None:
    """Rows of every case against the committed digests."""
    old, new = committed.rows.get(name), outcome.cases[name]
    if old is None:
        if new:
            found.differs.append(f"{name}: nothing was committed of it.")
        return
    changed = [case for case, rows in new.items() if case in old and old[case] != digest(rows)]
    added = [case for case in new if case not in old]
    missing = [case for case in added if MISSING in case]
    if changed:
        found.differs.append(f"{name}: {len(changed)} of {len(new)} cases give other rows; the first is {changed[0]}.")
    if len(added) > len(missing):
        found.differs.append(f"{name}: cases that are not committed: {next(c for c in added if c not in missing)}.")
    if missing:
        found.not_compared.append(f"{name}: {len(missing)} of {len(new)} cases lack a mesh.")
    elif set(old) - set(new):
        found.differs.append(f"{name}: committed cases are not run: {min(set(old) - set(new))}.")
