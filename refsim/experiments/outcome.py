"""What a run of experiments found: the runner fills it, ledger, report and page read it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from refsim.experiments.registry import Rows


@dataclass
class Outcome:
    """All that was measured, whether in this run or taken from one that was interrupted.

    quick     smaller sizes
    out       the folder of pictures and tables
    complete  every experiment of every topic is in it
    cases     experiment id -> case as JSON with sorted keys -> rows
    tables    experiment id -> file stem -> rows
    pictures  experiment id -> PNG
    """

    quick: bool
    out: Path
    complete: bool = False
    cases: dict[str, dict[str, Rows]] = field(default_factory=dict)
    tables: dict[str, dict[str, Rows]] = field(default_factory=dict)
    pictures: dict[str, Path] = field(default_factory=dict)

    @property
    def size(self) -> str:
        """`quick` or `full`."""
        return "quick" if self.quick else "full"
