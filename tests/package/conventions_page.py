"""The page docs/conventions.md taken apart: its tables as rows, its code blocks as one program."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")


@cache
def program() -> dict[str, Any]:
    """The names that the page's code blocks define, run in order."""
    names: dict[str, Any] = {"__name__": "conventions"}
    for block in re.findall(r"^```python[^\n]*\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL):
        exec(compile(block, "docs/conventions.md", "exec", dont_inherit=True), names)
    return names


def called(name: str) -> Any:
    """A function of the page."""
    return program()[name]


def bare(cell: str) -> str:
    """A cell without the marks of code."""
    return cell.strip().strip("`")


def table(*heads: str) -> list[list[str]]:
    """The rows, as cells, of the one table that starts with these column heads."""
    found = []
    for lines in re.findall(r"(?:^\|.*\|\n)+", PAGE, re.MULTILINE):
        rows = [line.strip().strip("|").split("|") for line in lines.splitlines()]
        if [bare(cell) for cell in rows[0]][: len(heads)] == list(heads):
            found.append([[cell.strip() for cell in row] for row in rows[2:]])
    (rows,) = found
    return rows


def pairs(*heads: str) -> dict[str, str]:
    """First and second column of a table, without the marks of code; nothing stands twice."""
    rows = table(*heads)
    named = {bare(row[0]): bare(row[1]) for row in rows}
    assert len(named) == len(rows)
    return named


def worth(expression: str, **names: Any) -> Any:
    """The value of an expression in a cell."""
    return eval(expression, {"__builtins__": {}, "min": min, "max": max}, names)
