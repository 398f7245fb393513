"""Plan: every number printed in the README, the documents and the page comes from a run.

- Each is found in figures/report.json, rounded as it is shown; what is no measurement is exempt by its kind alone. The
  README's table of claims is the one made of that report.
- The page of any report passes against that report and not against another one; a number changed by one digit fails.
- Properties (hypothesis): a number is found however it is written (thousands, k, M, G, percent, powers of ten) and at
  any rounding; one that is further off than its last digit is not.
- Boundary table of what is a number, and of each kind of exemption beside what it must not take.
- How often a wrong whole number is seen: of three digits mostly, from four on nearly always.
"""

from __future__ import annotations

import json
import random
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.experiments import page, page_view, readme_table
from tests.experiments.page_report import draw_pictures, make_report
from tests.package.numbers import EXEMPT, Values, measured, numbers, prose, visible

ROOT = Path(__file__).resolve().parents[2]
REPORT = ROOT / "figures" / "report.json"
SHORT = page_view.FEW_ROWS  # what the page shows of a table
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    return json.loads(REPORT.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def shown(report: dict[str, Any]) -> Values:
    return Values(report, SHORT)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_documents(shown: Values, path: Path) -> None:
    assert shown.unknown(prose(path.read_text(encoding="utf-8"))) == []


def test_the_committed_page(report: dict[str, Any]) -> None:
    committed = Values(report)
    text = visible((ROOT / "figures" / page.NAME).read_text(encoding="utf-8"))
    assert len(list(numbers(text))) > 1000
    assert committed.unknown(text) == []


def test_any_page_has_the_numbers_of_its_report(tmp_path: Path) -> None:
    report = make_report()
    draw_pictures(tmp_path, report)
    text = visible(page.page_text(report, tmp_path))
    assert Values(report).unknown(text) == []
    other = json.loads(json.dumps(report).replace("1234567", "1234576").replace("1.507e+08", "1.508e+08"))
    assert Values(other).unknown(text) == ["1,234,567", "150.7 M"]
    assert Values(report).unknown(text.replace("12.345", "12.354")) == ["12.354"]


@given(st.floats(0.001, 1e9), st.integers(0, 3))
def test_found_at_any_rounding(value, places) -> None:
    held = Values({"value": value})
    assert held.unknown(f"{value:,.{places}f}") == []
    wrong = value + 2.1 * 10.0**-places
    assert held.unknown(f"{wrong:,.{places}f}") != []


@given(st.floats(1.0, 9999.0), st.sampled_from(("k", "M", "G")))
def test_found_with_a_suffix(scaled, suffix) -> None:
    scale = {"k": 1e3, "M": 1e6, "G": 1e9}[suffix]
    value, shown = scaled * scale, f"{scaled:,.2f}"
    assert Values({"a": [value, 0.5]}).unknown(f"{shown} {suffix} tests, {shown}{suffix}") == []
    assert Values({"a": [value + 0.02 * scale, 0.5]}).unknown(f"{shown} {suffix}") != []


@given(st.floats(0.0, 1.0))
def test_a_share_may_be_a_percentage(value) -> None:
    assert Values({"a": value}).unknown(f"{100 * value:.1f} percent, {100 * value:.1f} %") == []


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("9,600 triangles", [9600]), ("1,2,3", [1, 2, 3]), ("0.23 frames/s", [0.23]), ("256²", [256]),
        ("1.5 k", [1500]), ("3k", [3000]), ("2.5 × 10⁶", [2.5e6]), ("1e−07", [1e-7]), ("12 %", [12]),
        ("float32 torus_knot_1024 E3", []), ("512 × 512", [512, 512]), ("150 MB", [150]), ("3 G nodes", [3e9]),
        ("1/12.4", [1, 12.4]), ("v0.1.0", []),
    ],
)  # fmt: skip
def test_what_is_a_number(text: str, values: list[float]) -> None:
    assert [number.value for number in numbers(text)] == pytest.approx(values)


@pytest.mark.parametrize(
    ("kind", "gone", "stays"),
    [
        ("sections", "see section 7.1, Figures 5, 6 and Table 3", "7.1 degrees"),
        ("headings", "## 2.1 Lists", "2.1 lists"),
        ("errata", "HRE-E2 to E7, BSH-E3", "3 errors"),
        ("versions", "Python 3.11, Direct3D 10.1", "3.11 times"),
        ("products", "GeForce 8600, GTX 280", "8600 rays"),
        ("norms", "SHA-256, IEEE 754", "256 rays"),
        ("widths", "32-bit floats, 64 bytes", "64 rays"),
        ("limits", "| guard band: pixels | 32767 |", "| others | 32767 |"),
        ("exit", "exits with 0 if all is well", "with 15 rays"),
    ],
)
def test_exemptions(kind: str, gone: str, stays: str) -> None:
    (name,) = [name for name in EXEMPT if kind in name]
    assert not list(numbers(EXEMPT[name].sub(" ", gone))) and list(numbers(measured(stays)))


def test_code_and_links_are_no_prose() -> None:
    text = "a `1` [b](c2.md) <!-- 3 -->\n```sh\n4\n```\n    5\n\n6 <img width=7> 8 < 9"
    assert [number.value for number in numbers(prose(text))] == [6, 8, 9]


@pytest.mark.parametrize(("digits", "share"), [(3, 0.5), (4, 0.9), (5, 0.98)])
def test_changed_digits_are_seen(shown: Values, digits: int, share: float) -> None:
    drawn = random.Random(digits)
    texts = [f"{drawn.randrange(10 ** (digits - 1), 10**digits):,}" for _ in range(1000)]
    assert sum(bool(shown.unknown(text)) for text in texts) >= share * len(texts)


def test_bulk_rows_hold_no_document() -> None:
    rows, verdicts = (
        [{"a": 100 + k} for k in range(50)],
        [{"verdict": "holds", "measured": k + 0.25} for k in range(50)],
    )
    report = {"experiments": [{"tables": {"long": rows, "claims": verdicts, "short": rows[:2]}}], "summary": {}}
    assert Values(report).unknown("149, 49.25") == []
    assert Values(report, SHORT).unknown("149, 101, 49.25") == ["149"]


def test_every_exemption_is_needed() -> None:
    texts = "\n".join(prose(path.read_text(encoding="utf-8")) for path in DOCUMENTS)
    texts += visible((ROOT / "figures" / page.NAME).read_text(encoding="utf-8"))
    assert [kind for kind, pattern in EXEMPT.items() if not re.search(pattern, texts)] == []


def test_the_readme_has_the_table_of_this_report(report: dict[str, Any]) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme_table.put(readme, report) == readme
    text = (ROOT / "figures" / page.NAME).read_text(encoding="utf-8")
    places = re.findall(r"\(figures/index\.html#([^)]+)\)", readme)
    assert places and [place for place in places if f'id="{place}"' not in text] == []
