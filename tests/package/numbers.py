"""Numbers in documents: which there are, which of them are measured, and whether a report holds each.

A number is held if some value of the report, rounded to the digits that are shown, is it. Values are the report's
numbers and those in its texts (cells of tables, settings of cases, lines of the ledger, versions, years), how many rows
a table has, and how many claims a paper. A report holds thousands of values: a slip in a number of one or two digits
may well be another's value; one in four digits or more is nearly always seen (`test_numbers` measures how often). So
documents are held against the short tables alone: bulk rows would hold almost any number of three digits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from bs4 import BeautifulSoup

SCALES = {"k": 1e3, "M": 1e6, "G": 1e9}
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
NUMBER = re.compile(
    r"(?<![\w.])(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:e[+−-]?\d+)?"
    r"(?:\s?×\s?10(?P<power>[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)|\s?(?P<scale>[kMG])(?![\w/])|\s?(?P<percent>%|percent\b))?(?![A-Za-z_0-9])"
)
LIST = r"\d+(?:\.\d+)*(?:[a-d]|\([a-d]\))?(?:(?:,| and| to| or|,? \d+ and|–|-)\s?\d+(?:\.\d+)*[a-d]?)*"

# What is no measurement, by kind
KINDS = {
    "numbers of sections, figures, tables, equations, listings and steps":
        rf"\b(?:sections?|chapters?|figures?|tables?|eqs?\.|equations?|listings?|appendix|steps?|iterations?) {LIST}",
    "numbers of headings": r"^#{1,6} \d+(?:\.\d+)*",
    "names of errata": r"\b(?:HRE|GSR|BSH)-E\d+[a-z]?(?: (?:to|and) E?\d+[a-z]?)*|\bE\d+[a-z]?\b",
    "versions of programs and interfaces":
        r"\b(?:Python|NumPy|OpenGL|Direct3D|DirectX|Vulkan|WebGPU|CUDA|Shader Model|GLSL|version) \d+(?:\.\w+)*",
    "names of products": r"\b(?:GeForce|GTX|RTX|Radeon|Tesla|NV|G)\s?\d+\w*",
    "names of norms, hashes and licences": r"\b(?:UTF|SHA|IEEE|ISO|RFC|Apache|GPL|BSD|WCAG)[- ]\d+(?:[.-]\d+)*",
    "widths of formats": r"\b\d+(?:-| )?bits?\b|\b\d+(?:-| )bytes?\b",
    "limits that `test_conventions` compares with the code": r"^\| guard band[^|]*\|[^|]*\|",
    "exit codes": r"\bexits? (?:code )?(?:is |with )?\d\b|\bwith \d (?:if|and)\b|\bends with \d\b",
}  # fmt: skip
EXEMPT = {kind: re.compile(pattern, re.IGNORECASE | re.MULTILINE) for kind, pattern in KINDS.items()}

HIDDEN = re.compile(
    r"^```.*?^```$|^ {4,}.*?$|<!--.*?-->|`[^`\n]*`|(?<=\])\([^)]*\)|https?://\S+|</?[a-z][^>\n]*>",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Number:
    """A number as it is written, the value that it stands for, half its last digit, and whether it is a percentage."""

    text: str
    value: float
    slack: float
    percent: bool


def numbers(text: str) -> Iterator[Number]:
    """The numbers in a text."""
    for found in NUMBER.finditer(text):
        digits = re.match(r"[\d,]+(?:\.\d+)?", found[0])
        assert digits
        bare = digits[0].replace(",", "")
        tail = re.match(r"e([+−-]?\d+)", found[0][digits.end() :])
        scale = SCALES.get(found["scale"] or "", 1.0)
        if found["power"]:
            scale = 10.0 ** int(found["power"].translate(SUPERSCRIPTS))
        if tail:
            scale = 10.0 ** int(tail[1].replace("−", "-"))
        places = len(bare.partition(".")[2])
        yield Number(found[0], float(bare) * scale, 0.5 * 10.0**-places * scale, bool(found["percent"]))


def measured(text: str) -> str:
    """The text without what is no measurement."""
    for pattern in EXEMPT.values():
        text = pattern.sub(" ", text)
    return text


def prose(markdown: str) -> str:
    """A Markdown document without code, links and comments."""
    return HIDDEN.sub(" ", markdown)


def visible(html: str) -> str:
    """What a reader of a page sees, without code."""
    soup = BeautifulSoup(html, "html.parser")
    for tag in soup(["style", "script", "svg", "code", "title"]):
        tag.decompose()
    return soup.get_text(" ")


class Values:
    """The values of a report; without the rows of tables that are longer than `longest`, but for tables of verdicts."""

    def __init__(self, report: Any, longest: int | None = None) -> None:
        found: set[float] = set()
        _collect(report if longest is None else _short(report, longest), found)
        found.update(float(sum(counts.values())) for counts in report.get("summary", {}).values())
        self.sorted = np.array(sorted(found))

    def holds(self, number: Number) -> bool:
        """Whether a value, rounded as the number is, is the number; a share may be written as a percentage."""
        near = self._near(number.value, number.slack)
        return near or (number.percent and self._near(number.value / 100, number.slack / 100))

    def _near(self, value: float, slack: float) -> bool:
        slack += 1e-12 * abs(value)  # of binary fractions
        place = np.searchsorted(self.sorted, value - slack)
        return bool(place < len(self.sorted) and self.sorted[place] <= value + slack)

    def unknown(self, text: str) -> list[str]:
        """The numbers of a text that no value is."""
        return list(dict.fromkeys(n.text for n in numbers(measured(text)) if not self.holds(n)))


def _short(report: Any, longest: int) -> Any:
    def kept(rows: Any) -> bool:
        return len(rows) <= longest or "verdict" in rows[0]

    short = [
        {**one, "tables": {stem: rows for stem, rows in one["tables"].items() if kept(rows)}}
        for one in report["experiments"]
    ]
    return {**report, "experiments": short}


def _collect(part: Any, found: set[float]) -> None:
    if isinstance(part, dict):
        for name, value in part.items():
            _collect(name, found)
            _collect(value, found)
    elif isinstance(part, list):
        found.add(float(len(part)))  # rows of a table
        for value in part:
            _collect(value, found)
    elif isinstance(part, str):
        found.update(number.value for number in numbers(part.replace("_", " ")))
    elif isinstance(part, int | float) and not isinstance(part, bool):
        found.add(abs(float(part)))
