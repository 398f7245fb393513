"""Figures and tables, the papers' and the pipeline's own: one file each, `measure(...)` -> rows and `plot(rows)` ->
picture.

    refsim reproduce [TOPIC] [--quick] [--only ID] [--out DIR] [--jobs N]

    cases ─▶ workers: measure ─▶ rows ─▶ tables ─▶ CSV ─▶ ledger ─▶ report
                                   └───▶ plot ───▶ PNG

Files are there whole or not at all. Rows of finished cases are kept in `DIR/.resume` until the code that computes them
changes, so an interrupted run goes on where it was. Names are imported when they are first used: a worker needs but one
experiment.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from refsim.experiments.conclusion import conclude, summary_rows
    from refsim.experiments.outcome import Outcome
    from refsim.experiments.pool import processors
    from refsim.experiments.reproduction import reproduce
    from refsim.experiments.topics import experiments_of

__all__ = ["Outcome", "conclude", "experiments_of", "processors", "reproduce", "summary_rows"]

_HOMES = {
    "Outcome": "outcome",
    "conclude": "conclusion",
    "experiments_of": "topics",
    "processors": "pool",
    "reproduce": "reproduction",
    "summary_rows": "conclusion",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
