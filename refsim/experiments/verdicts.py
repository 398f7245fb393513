"""A line of a table of verdicts."""

from __future__ import annotations

from refsim.experiments.registry import Row


def claim(section: str, text: str, body: str, rule: str, measured: str, holds: bool | None) -> Row:
    """Place, what is said, of which body, by which rule, what was measured; None is `depends`."""
    verdict = {True: "holds", False: "fails", None: "depends"}[holds]
    return {"section": section, "claim": text, "body": body, "rule": rule, "measured": measured, "verdict": verdict}
