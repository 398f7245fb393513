"""Figures and tables, the papers' and the pipeline's own: one file each, `measure(...)` -> rows and `plot(rows)` ->
picture.

    refsim reproduce hre|gsr|bsh|pipeline [--quick] [--only ID] [--out DIR]

    cases ─▶ measure ─▶ rows ─▶ tables ─▶ CSV
                          └───▶ plot ───▶ PNG

Files are there whole or not at all. Rows of finished cases are kept in `DIR/.resume` until the code that computes them
changes, so an interrupted run goes on where it was.
"""

from __future__ import annotations

from refsim.experiments.reproduction import reproduce
from refsim.experiments.topics import experiments_of

__all__ = ["experiments_of", "reproduce"]
