"""What the tables of equations share: an item of a paper, what is checked of it, and its row.

Each numbered or displayed equation, formula, listing and layout of a paper is an item. On seeded random inputs
- the compiled code is held against its plain NumPy twin (`refsim.reference`), bit for bit: `twin_differs`;
- what the item must do is checked of it as printed and as corrected: `printed_fails`, `corrected_fails`.
What does not apply (a formula with no code of its own, a text with nothing to correct) is left empty.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.registry import Case, Row, Rows, Tables

Count = int | str
NOT_APPLICABLE = ""


class Found(NamedTuple):
    """How many cases, and how many of them differ or fail."""

    cases: int
    twin_differs: Count = NOT_APPLICABLE
    printed_fails: Count = NOT_APPLICABLE
    corrected_fails: Count = NOT_APPLICABLE


@dataclass(frozen=True)
class Item:
    """An item: `check(count)` looks at about so many seeded inputs.

    compared  what of the compiled code is held against the twin
    """

    name: str
    place: str
    erratum: str
    compared: str
    property: str
    check: Callable[[int], Found]


def cases_of(items: Mapping[str, Item], quick: bool, full_count: int, quick_count: int) -> list[Case]:
    """A case an item."""
    return [{"item": key, "count": quick_count if quick else full_count} for key in items]


def row_of(paper: str, key: str, item: Item, count: int) -> Row:
    """The one row of an item."""
    found = item.check(count)
    return {
        "paper": paper,
        "id": key,
        "item": item.name,
        "place": item.place,
        "erratum": item.erratum,
        "cases": found.cases,
        "compared": item.compared,
        "twin_differs": found.twin_differs,
        "printed_fails": found.printed_fails,
        "corrected_fails": found.corrected_fails,
        "property": item.property,
    }


def table_of(stem: str) -> Callable[[Rows, Mapping[str, Rows]], Tables]:
    """The rows as they are."""
    return lambda rows, others: {stem: rows}


def bits_differ(a: Any, b: Any) -> NDArray[np.bool_]:
    """Rows of two arrays in which any bit differs; NaN equals NaN. Another shape or type differs everywhere."""
    a, b = np.asarray(a), np.asarray(b)
    if a.shape != b.shape or a.dtype != b.dtype:
        return np.ones(max(len(a), len(b)), np.bool_)
    same = a == b
    if a.dtype.kind == "f":
        word = np.uint32 if a.dtype.itemsize == 4 else np.uint64
        same = (a.view(word) == b.view(word)) | (np.isnan(a) & np.isnan(b))
    return ~same.reshape(len(a), -1).all(axis=1)


def number(mask: Any) -> int:
    """How many are true."""
    return int(np.count_nonzero(mask))
