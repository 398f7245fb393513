"""The page of a run, `index.html`: what the papers show and say, our pictures and numbers beside it, and each verdict.

    report, pictures ─▶ view ─▶ template ─▶ one file that needs nothing else and asks nothing of any other machine

The same report and pictures give the same bytes.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from refsim.experiments import page_view, page_words
from refsim.experiments.files import replace_file

if TYPE_CHECKING:
    from jinja2 import Template

NAME = "index.html"
TEMPLATES = Path(__file__).parent / "templates"


def write_page(report: dict[str, Any], out: Path) -> Path:
    """Write the page of `report` to `out`, where its pictures and tables are."""
    text = page_text(report, out)
    return replace_file(out / NAME, lambda part: part.write_text(text, encoding="utf-8", newline="\n"))


def page_text(report: dict[str, Any], out: Path) -> str:
    """The page; `out` holds the pictures."""
    ledger = page_view.lines(report)
    papers = page_view.papers(report, ledger, out)
    return _template().render(
        report=report,
        topics=papers,
        ledger=ledger,
        errata=page_view.errata(papers),
        marks=[mark for mark in page_words.MARKS.values() if any(line.mark == mark for line in ledger)],
        kinds=list(dict.fromkeys(line.entry["kind"] for line in ledger)),
        size=" --quick" if report["size"] == "quick" else "",
    )


@cache
def _template() -> Template:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        number=page_words.number,
        sentence=page_words.sentence,
        code=page_words.code,
        column=page_words.column,
        short=page_words.short,
    )
    return environment.get_template("page.html")
