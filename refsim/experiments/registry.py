"""What an experiment is: cases, a measurement that gives rows, tables and a picture made from rows alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Row = dict[str, Any]
Rows = list[Row]
Case = dict[str, Any]
Tables = Mapping[str, Rows]


@dataclass(frozen=True)
class Experiment:
    """One figure or table of a paper.

    id      what `--only` takes, and the stem of its files
    title   one line; `caption` says how to read the picture and what was run
    cases   `cases(quick)`: the parameters of each measurement; whole numbers, floats, text: what JSON holds
    measure `measure(**case)` -> rows. Deterministic: counters and geometry, never a time
    tables  `tables(rows, others)` -> file stem -> rows; `others` holds the rows of `needs`. The default is the rows
    plot    `plot(rows)` -> a matplotlib Figure, from rows alone (pictures are rendered again by `pictures.picture`)
    needs   experiments whose rows the tables are made from, of any topic
    alt     what the picture shows, for those who cannot see it
    drawn   stem of the table that `plot` takes instead of the rows, where it is made from what `needs` brings
    timed   rows hold times: they are measured alone and one after the other, their tables lie in `timings/`, and
            neither the ledger nor the comparison of bytes reads them
    """

    id: str
    title: str
    caption: str
    cases: Callable[[bool], Sequence[Case]]
    measure: Callable[..., Rows]
    plot: Callable[[Rows], Any] | None = None
    tables: Callable[[Rows, Mapping[str, Rows]], Tables] | None = None
    needs: tuple[str, ...] = ()
    dpi: int | None = None
    alt: str = ""
    timed: bool = False
    drawn: str = ""

    def tables_of(self, rows: Rows, others: Mapping[str, Rows]) -> Tables:
        """What to write: file stem -> rows."""
        return {self.id: rows} if self.tables is None else self.tables(rows, others)

    def drawn_rows(self, rows: Rows, tables: Tables) -> Rows:
        """What `plot` takes: the rows, or the table named `drawn`."""
        return tables[self.drawn] if self.drawn else rows
