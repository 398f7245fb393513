"""Plan: the documentation is what its code gave, hangs together, and asks nothing of another machine.

- It builds without a warning. Every block of every page ran, in order, and what is shown is the block that ran.
- Every link and anchor leads somewhere; scripts, styles and pictures lie beside the page.
- Every picture says in words what it shows, and the words are the page's own.
- The chapters go through all numbered sections of their papers; what a page asks one to predict, it then runs.
- Every public name has a place in the interface; every counter and law stands on the counters' page.
- The first chapter needs nothing but what installing refsim brings.
- In a browser: no error, no missing picture, nothing wider than a telephone.
"""

from __future__ import annotations

import ast
import importlib
import json
import re
import sys
from functools import cache
from html import unescape
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from bs4 import BeautifulSoup, Tag

from refsim.counters import LAWS, REGISTRY
from tests.browser.browser import FOUND, launched, opened, see
from tests.docs.conftest import DOCS, ROOT, Build

PAGES = sorted(path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md"))
FENCE = re.compile(r"^```python([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Numbers of the headings, as the papers print them
SECTIONS = {
    "hierarchical-ray-engine": "1 2 2.1 2.2 2.3 2.4 2.5 3 4 5 6 7 7.1 8 9",
    "geometry-shader-rays": "1 2 3 4 4.1 4.2 4.3 4.4 5 6",
    "sphere-hierarchies": "1 2 2.1 2.2 3 3.1 3.2 4 5 6",
}
# By how much what stands on a page is wider than its column
INSIDE = "() => [...document.querySelectorAll('div.content')].map(column => column.scrollWidth - column.clientWidth)"


def text_of(page: str) -> str:
    return (DOCS / f"{page}.md").read_text(encoding="utf-8")


def blocks(page: str) -> list[tuple[str, str]]:
    """What each block of Python is marked with, and its code."""
    return [(info.strip(), code.rstrip()) for info, code in FENCE.findall(text_of(page))]


@cache
def soup(path: Path) -> BeautifulSoup:
    return BeautifulSoup(path.read_text(encoding="utf-8"), "html.parser")


def article(html: Path, page: str) -> Tag:
    found = soup(html / f"{page}.html").find("article")
    assert isinstance(found, Tag)
    return found


def test_it_builds_without_a_warning(docs_build: Build) -> None:
    assert docs_build.status == 0, docs_build.said[-4000:]
    assert docs_build.warnings == ""


def test_pages_are_there() -> None:
    others = {"index", "first-steps", "pipeline", "conventions", "adding-a-method", "reproduction", "counters"}
    assert set(PAGES) == set(SECTIONS) | others
    assert [page for page in PAGES if not blocks(page)] == ["index"]


@pytest.mark.parametrize("page", [page for page in PAGES if page != "index"])
def test_what_is_shown_is_what_ran(docs_build: Build, built_docs: Path, page: str) -> None:
    ran = json.loads((docs_build.notebooks / f"{page}.ipynb").read_text(encoding="utf-8"))
    cells = [cell for cell in ran["cells"] if cell["cell_type"] == "code"]
    written = [code for _, code in blocks(page)]
    assert ["".join(cell["source"]) for cell in cells] == written
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert [output for output in outputs if output["output_type"] == "error" or output.get("name") == "stderr"] == []
    shown = [found.get_text() for found in article(built_docs, page).select("div.cell_input pre")]
    assert [text.rstrip() for text in shown] == written
    # A kernel sends what a block prints in one piece or in several; the first of them takes up the others
    streams = [[output for output in cell["outputs"] if output["output_type"] == "stream"] for cell in cells]
    printed = ["".join(found[0]["text"]).rstrip() for found in streams if found]
    assert [found.get_text().rstrip() for found in article(built_docs, page).select("div.output.stream pre")] == printed


def targets(path: Path) -> list[tuple[str, str]]:
    """(name of the element, address) of all that a built page refers to."""
    found = []
    for name, attribute in (("a", "href"), ("link", "href"), ("img", "src"), ("script", "src"), ("source", "src")):
        for element in soup(path).find_all(name):
            if element.get(attribute):
                found.append((name, unescape(str(element[attribute]))))
    return found


@cache
def anchors(path: Path) -> frozenset[str]:
    return frozenset(str(element["id"]) for element in soup(path).find_all(id=True)) | {
        str(element["name"]) for element in soup(path).find_all("a", attrs={"name": True})
    }


def leads_somewhere(path: Path, address: str) -> bool:
    """Whether the file that a page refers to exists, and the place in it."""
    parts = urlsplit(address)
    file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    anchored = bool(parts.fragment) and file.suffix == ".html"
    return file.is_file() and (not anchored or unquote(parts.fragment) in anchors(file))


def test_links_and_anchors_lead_somewhere(built_docs: Path) -> None:
    pages = sorted(built_docs.rglob("*.html"))
    inside = [(path, address) for path in pages for _, address in targets(path) if not urlsplit(address).scheme]
    assert len(inside) > 500
    assert [(path.name, address) for path, address in inside if not leads_somewhere(path, address)] == []


def test_pages_ask_nothing_of_other_machines(built_docs: Path) -> None:
    outside = [
        (path.name, name, address)
        for path in built_docs.rglob("*.html")
        for name, address in targets(path)
        if name != "a" and urlsplit(address).scheme not in ("", "data")
    ]
    assert outside == []
    for style in built_docs.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:)?//", style.read_text(encoding="utf-8")), style


@pytest.mark.parametrize("page", PAGES)
def test_pictures_say_what_they_show(built_docs: Path, page: str) -> None:
    said = [re.fullmatch(r"(?:hide )?alt=\"(.+)\"", info)[1] for info, _ in blocks(page) if "alt=" in info]
    shown = [str(image.get("alt", "")) for image in article(built_docs, page).find_all("img")]
    assert shown == said
    assert all(len(alt.split()) >= 4 for alt in shown)


@pytest.mark.parametrize("page", sorted(SECTIONS))
def test_chapters_go_through_their_paper(page: str) -> None:
    heads = re.findall(r"^##+ (\d+(?:\.\d+)?) \S", text_of(page), re.MULTILINE)
    assert heads == SECTIONS[page].split()


@pytest.mark.parametrize("page", PAGES)
def test_what_is_to_be_predicted_is_run(page: str) -> None:
    text = text_of(page)
    assert text.count("<details>") == text.count("</details>") == len(re.findall(r"<details><summary>[^<]*", text))
    for part in text.split("</details>")[1:]:
        if part.strip().startswith("<details>"):
            continue
        until = re.split(r"^#+ ", re.sub(FENCE, "RUN", part), maxsplit=1, flags=re.MULTILINE)[0]
        assert "RUN" in until, f"{page}: nothing runs after a prediction"
    if page in SECTIONS:
        assert text.count("<details>") >= 3


def test_every_public_name_has_its_place(built_docs: Path) -> None:
    known = set().union(*(anchors(path) for path in (built_docs / "api").glob("*.html")))
    short = {name.rpartition(".")[2] for name in known}
    for module in ("refsim", "refsim.pipeline", "refsim.oracle"):
        public = importlib.import_module(module).__all__
        assert [name for name in public if name not in short] == []


def test_every_public_name_is_explained() -> None:
    """Classes and functions of refsim; names of types such as vec2 and plain numbers stand for themselves."""
    explained = 0
    for module in map(importlib.import_module, ("refsim", "refsim.pipeline", "refsim.oracle")):
        for value in (getattr(module, name) for name in module.__all__):
            function = getattr(value, "py_func", value)
            if str(getattr(function, "__module__", "")).startswith("refsim") and hasattr(function, "__qualname__"):
                assert function.__doc__ and len(function.__doc__.split()) >= 3, function
                explained += 1
    assert explained > 60


def test_counters_and_laws_are_all_there(built_docs: Path) -> None:
    text = article(built_docs, "counters").get_text()
    assert [name for name, counter in REGISTRY.items() if name not in text or counter.sentence not in text] == []
    assert [law for law in LAWS if f"{' + '.join(law.left)} = {' + '.join(law.right)}" not in text] == []


def test_the_first_chapter_needs_no_extras() -> None:
    imported = set()
    for _, code in blocks("first-steps"):
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add(str(node.module).partition(".")[0])
    assert imported == {"numpy", "matplotlib", "refsim"}


def test_the_reader_takes_pages_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    reader = importlib.import_module("python_blocks")
    first = 'Words\n\n```python hide alt="A dot"\nx = 1\n```\n\n'
    text = first + 'more\n\n```sh\nls\n```\n\n```python\ny = """\n# no title\n"""\n```\n'
    book = reader.read(text)
    assert [cell["cell_type"] for cell in book.cells] == ["markdown", "code", "markdown", "code"]
    assert book.cells[1]["source"] == "x = 1" and book.cells[3]["source"] == 'y = """\n# no title\n"""'
    assert book.cells[1]["metadata"] == {"tags": ["hide-input"], "mystnb": {"image": {"alt": "A dot"}}}
    assert book.cells[3]["metadata"] == {} and "```sh\nls\n```" in book.cells[2]["source"]
    lines = text.splitlines()
    assert [lines[at] for at in book.metadata["source_map"]][1::2] == ['```python hide alt="A dot"', "```python"]
    with pytest.raises(ValueError, match="marks are hide and alt"):
        reader.read("```python alt=no quotes\n```\n")
    sys.modules.pop("python_blocks")


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("a |x| and 2 * y_", "a \\|x\\| and 2 \\* y\\_"),
        ("`a_b | c` and ``d*``", "`a_b | c` and ``d*``"),
        ("name   what it is\nother  what that is", "::\n\n    name   what it is\n    other  what that is"),
        ("    indented", "::\n\n        indented"),
        ("- one\n- two", "- one\n- two"),
        ("As follows::", "As follows:"),
    ],
)
def test_docstrings_stay_what_they_are(monkeypatch: pytest.MonkeyPatch, written: str, read: str) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    assert importlib.import_module("docstrings").rewritten(written) == read


def test_the_readme_leads_here() -> None:
    linked = re.findall(r"\]\((docs/[^)#]+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert {"docs/index.md", "docs/first-steps.md", "docs/conventions.md"} <= set(linked)


if FOUND["present"]:  # where there is no browser, the summary of the run says so

    @pytest.mark.parametrize(("width", "dark"), [(1400, True), (380, False)], ids=["wide and dark", "narrow"])
    def test_in_a_browser(built_docs: Path, width: int, dark: bool) -> None:
        pages = sorted(path for path in built_docs.rglob("*.html"))
        assert len(pages) > len(PAGES)
        with launched() as browser, opened(browser, width, dark=dark) as tab:
            for page in pages:
                seen = see(tab, page)
                assert seen.console_errors == [] and seen.failed_requests == [], page.name
                assert seen.missing_pictures == [] and seen.overflow_px <= 0, page.name
                # The drawer with the contents waits outside of a narrow window; the theme lets a page scroll in itself
                assert [name for name in seen.wider if "toc-" not in name] == [], page.name
                assert tab.evaluate(INSIDE) == [0], page.name
                assert [url for url in seen.requests if not url.startswith("file://")] == [], page.name
