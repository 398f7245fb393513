"""Plan: the page of a run is whole and readable in a real browser, wide and narrow, light and dark.

- Nothing is wrong on the console, nothing is asked for, no picture is missing, nothing sticks out of the window.
- All text has the contrast of WCAG's level AA against what is behind it, in both colour schemes.
- Every box that scrolls can be reached by keyboard; filters of the ledger hide what they say, without a script.
- The committed page too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from refsim.experiments import page
from tests.browser.browser import Seen, see
from tests.experiments.page_report import draw_pictures, make_report

COMMITTED = Path(__file__).resolve().parents[2] / "figures" / page.NAME

# Ratio of luminances as WCAG 2 defines it, of each text that can be seen, against the nearest background that is opaque
CONTRAST = """() => {
    const parts = color => (color.match(/[\\d.]+/g) || []).map(Number)
    const light = color => {
        const linear = v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4
        const [r, g, b] = parts(color).map(v => linear(v / 255))
        return 0.2126 * r + 0.7152 * g + 0.0722 * b
    }
    const behind = element => {
        for (; element; element = element.parentElement) {
            const color = getComputedStyle(element).backgroundColor
            if (parts(color).length === 3 || parts(color)[3] === 1) return color
        }
        return 'rgb(255, 255, 255)'
    }
    const low = []
    const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT)
    while (walk.nextNode()) {
        const element = walk.currentNode.parentElement
        if (!walk.currentNode.data.trim() || !element.checkVisibility()) continue
        const [a, b] = [light(getComputedStyle(element).color), light(behind(element))].sort((x, y) => y - x)
        if ((a + 0.05) / (b + 0.05) < 4.5) low.push(walk.currentNode.data.trim().slice(0, 40))
    }
    return low
}"""
UNREACHED = """() => [...document.querySelectorAll('*')]
    .filter(box => ['auto', 'scroll'].includes(getComputedStyle(box).overflowX))
    .filter(box => box.scrollWidth > box.clientWidth + 1)
    .filter(box => box.tabIndex < 0).map(box => box.outerHTML.slice(0, 80))"""
OPEN = "() => { for (const part of document.querySelectorAll('details')) part.open = true }"
SHOWN = "() => [...document.querySelectorAll('#ledger tbody tr.edge')].filter(row => row.checkVisibility()).length"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("page")
    report = make_report()
    draw_pictures(out, report, (1200, 600))
    wide = {f"a_long_name_of_a_column_{k}": 1234567.25 for k in range(12)}
    report["experiments"][0]["tables"] = {"cover": [wide]}
    report["ledger"][0]["says"] = "a_word_that_is_far_too_long_for_a_narrow_screen" * 3
    return page.write_page(report, out)


def test_the_page_is_whole(tab: Any, written: Path) -> None:
    assert see(tab, written) == Seen()
    tab.evaluate(OPEN)
    assert tab.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    assert tab.evaluate(CONTRAST) == [] and tab.evaluate(UNREACHED) == []


def test_contrast_and_reach_are_measured(tab: Any) -> None:
    tab.set_content("<body style='background: #fff'><p style='color: #888'>faint<p style='color: #666'>clear")
    assert tab.evaluate(CONTRAST) == ["faint"]
    tab.set_content("<div style='overflow: auto; width: 90px'><p style='width: 900px'>a</div>")
    assert len(tab.evaluate(UNREACHED)) == 1


def test_filters_hide_what_they_say(tab: Any, written: Path) -> None:
    see(tab, written)
    report = make_report()
    entries = report["ledger"]
    assert tab.evaluate(SHOWN) == len(entries)
    tab.check("#of-gsr")
    rest = [one for one in entries if one["paper"] == "gsr"]
    assert tab.evaluate(SHOWN) == len(rest)
    tab.check("#of-all")
    tab.check("#show-reproduced")
    rest = [one for one in entries if one["verdict"] == "reproduced"]
    assert tab.evaluate(SHOWN) == len(rest)
    tab.check("#kind-statement")
    both = [one for one in rest if one["kind"] == "statement"]
    assert tab.evaluate(SHOWN) == len(both) not in (0, len(rest))
    tab.check("#kind-all")
    tab.check("#show-all")
    assert tab.evaluate(SHOWN) == len(entries)


def test_the_committed_page_is_whole(tab: Any) -> None:
    assert see(tab, COMMITTED) == Seen()
    # Links beside the page lead to files
    links = tab.evaluate("() => [...document.links].map(link => link.getAttribute('href'))")
    beside = {link for link in links if not link.startswith("#")}
    assert len(beside) > 100
    assert [link for link in sorted(beside) if not (COMMITTED.parent / link).is_file()] == []
    assert tab.evaluate(CONTRAST) == []
    tab.evaluate(OPEN)
    assert tab.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    assert tab.evaluate(UNREACHED) == []
