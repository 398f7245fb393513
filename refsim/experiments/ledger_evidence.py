"""What a claim's rule reads: rows of a table that match, and of these a column or several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from refsim.experiments.ledger_file import Claim
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import MISSING


@dataclass(frozen=True)
class Evidence:
    """`values` a row, in the table's order, and in how many matching rows a mesh is missing."""

    values: list[Any]
    missing: int


def evidence_of(claim: Claim, tables: Mapping[str, Rows]) -> Evidence:
    """The claim's evidence in the tables of its experiment, by stem."""
    rows = select(tables.get(claim.table, []), claim.where)
    present = [row for row in rows if MISSING not in row.values() and not _stand_in(row)]
    values = [_value(claim, row) for row in present]
    # The rule on errata knows forms that there are not
    kept = values if claim.rule == "errata" else [value for value in values if not _blank(value)]
    return Evidence(kept, len(rows) - len(present))


# Marks of rows on another body than the paper's: shown, but no evidence on it
STAND_INS = ("a stand-in", "another scene", "decimated to")
NONE = ("", None, "NA")  # what a row lacks, or the paper


def _stand_in(row: Row) -> bool:
    return any(isinstance(cell, str) and cell.startswith(STAND_INS) for cell in row.values())


def _blank(value: Any) -> bool:
    """A cell that a row lacks, or a tuple with one."""
    return any(part in NONE for part in value) if isinstance(value, list) else value in NONE


def _value(claim: Claim, row: Row) -> Any:
    names = [claim.value] if isinstance(claim.value, str) else list(claim.value)
    if isinstance(claim.printed, str) and claim.printed.startswith("@"):
        names.append(claim.printed.removeprefix("@"))
    values = [row.get(name, "") for name in names]
    return values[0] if len(values) == 1 else values


def select(rows: Rows, where: Mapping[str, Any]) -> Rows:
    """Rows that match each condition; `@largest` and `@smallest` are those of the rows left by the others."""
    plain = {name: wanted for name, wanted in where.items() if wanted not in ("@largest", "@smallest")}
    found = [row for row in rows if all(_matches(row.get(name, ""), wanted) for name, wanted in plain.items())]
    for name, wanted in where.items():
        if name not in plain:
            numbers = [row[name] for row in found if isinstance(row.get(name), int | float)]
            end = (max if wanted == "@largest" else min)(numbers, default=None)
            found = [row for row in found if row.get(name) == end]
    return found


def _matches(cell: Any, wanted: Any) -> bool:
    if isinstance(wanted, list):
        return any(_matches(cell, one) for one in wanted)
    if isinstance(wanted, str) and wanted.endswith("*"):
        return str(cell).startswith(wanted[:-1])
    return bool(cell == wanted)
