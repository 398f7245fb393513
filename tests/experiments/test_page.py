"""Plan: the page says what the report says, all of it once, in one file that needs nothing else.

- Properties (hypothesis): any text of a report is shown as it is, never as markup; whole numbers are read back as they
  were; a picture's pixels are those of its file, on white.
- Every claim has one place, with its figure or table if it is about one, and a line in the complete ledger; every
  experiment its heading, caption, picture with alternative text, command and data; what is missing or stands in named.
- The same report and pictures give the same bytes; nothing is fetched, nothing runs.
- The HTML is whole: tags close, ids are unique, inner links lead somewhere, headings go down one step at a time.
- Boundary table of numbers and lines as people write them.
- A report of a part, one that differs from what was committed, and one without claims are shown too.
- The README's table: its claims in order, with links to the page; marks that lack, claims that lack are refused.
"""

from __future__ import annotations

import base64
import io
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bs4 import BeautifulSoup
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from refsim.errors import InputError
from refsim.experiments import page, page_pictures, page_words, readme_table
from refsim.experiments.page_words import MARKS
from tests.experiments.page_report import draw_pictures, entry, make_report

TEXT = st.text(st.characters(blacklist_categories=("Cs", "Cc"), blacklist_characters="'`*x"), min_size=1, max_size=40)
VOID = {"meta", "link", "br", "img", "input", "path", "use"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("page")
    draw_pictures(out, make_report())
    return out


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    return page.write_page(make_report(), folder).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def soup(text: str) -> BeautifulSoup:
    return BeautifulSoup(text, "html.parser")


def words(tag: object) -> str:
    return " ".join(tag.get_text(" ").split())  # type: ignore[attr-defined]


def digits(value: int) -> str:
    return page_words.number(value).replace(",", "").replace("−", "-")


@settings(max_examples=40)
@given(TEXT)
def test_text_is_shown_never_run(said) -> None:
    report = {**make_report(), "experiments": []}
    report["ledger"] = [entry("hre.any", "section 1", "reproduced", says=said, why=said, measured=said)]
    shown = BeautifulSoup(page.page_text(report, Path()), "html.parser").find(id="hre.any")
    assert shown is not None
    expected = " ".join(page_words.sentence(said).split())
    assert words(shown.find(class_="says")) == expected and words(shown.find(class_="why")) == expected


@given(st.integers(-999_999, 999_999))
def test_whole_numbers_are_read_back(value) -> None:
    assert int(digits(value)) == value


@given(st.floats(0.001, 99_999.0), st.integers(1, 4))
def test_rounded_numbers_are_read_back(value, places) -> None:
    rounded = round(value, places)
    assert float(page_words.number(rounded).replace(",", "")) == pytest.approx(rounded, rel=1e-9)


@settings(max_examples=40)
@given(st.sampled_from(("RGB", "RGBA", "L", "P")), st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_pixels_are_those_of_the_file(tmp_path_factory, mode, width, height, seed) -> None:
    values = np.random.default_rng(seed).integers(0, 256, (height, width, 4), np.uint8)
    path = tmp_path_factory.getbasetemp() / "any.png"
    Image.fromarray(values).convert(mode).save(path)
    with Image.open(path) as picture:
        rgba = np.asarray(picture.convert("RGBA"), np.float64)
    shown = page_pictures.embedded(path)
    kind, _, data = shown.uri.partition(";base64,")
    with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
        assert kind == f"data:image/{(picture.format or '').lower()}" and picture.size == (shown.width, shown.height)
        again = np.asarray(picture.convert("RGBA"), np.float64)
    on_white = [pixels[..., :3] * pixels[..., 3:] / 255 + 255 - pixels[..., 3:] for pixels in (rgba, again)]
    assert np.abs(on_white[0] - on_white[1]).max() <= 1.0  # one step: alpha blending rounds


def test_same_bytes_again(folder: Path, text: str, tmp_path: Path) -> None:
    draw_pictures(tmp_path, make_report())
    assert page.write_page(make_report(), tmp_path).read_bytes() == text.encode()


def test_nothing_is_fetched_and_nothing_runs(soup: BeautifulSoup, text: str) -> None:
    assert soup.find("script") is None and not re.search(r"\son\w+=|javascript:|@import|url\(", text)
    sources = [tag.get("src") or tag.get("href") for tag in soup.find_all(["img", "link", "iframe", "source"])]
    assert sources and all(source.startswith("data:") for source in sources)
    assert not [tag["href"] for tag in soup.find_all("a") if "://" in tag["href"]]


def test_every_claim_stands_once(soup: BeautifulSoup) -> None:
    for one in make_report()["ledger"]:
        (place,) = soup.find_all(id=one["id"])
        assert MARKS[one["verdict"]].word in words(place) and one["place"] in words(place)
        lines = soup.find(id="ledger").find_all("a", href=f"#{one['id']}")
        assert len(lines) == 1 and MARKS[one["verdict"]].word in words(lines[0].find_parent("tr"))


@pytest.mark.parametrize(
    ("claim", "section"),
    [
        ("hre.figure-7", "figure-7"), ("hre.tests", "figure-7"), ("hre.course", "figure-7"),
        ("hre.text", "hre-said"), ("hre.rate", "hre-said"),
        ("hre.equation", "hre-formal"), ("gsr.table-1", "gsr-table-1"), ("gsr.mesh", "gsr-table-1"),
        ("gsr.listing", "gsr-formal"), ("bsh.open", "bsh-said"),
    ],
)  # fmt: skip
def test_claims_stand_with_what_they_are_about(soup: BeautifulSoup, claim: str, section: str) -> None:
    assert soup.find(id=claim).find_parent("section")["id"] == section


def test_every_experiment_is_whole(soup: BeautifulSoup) -> None:
    for one in make_report()["experiments"]:
        section = soup.find(id=one["id"])
        assert one["command"] in [code.get_text() for code in section.find_all("code")]
        assert {f"{'timings/' if one['timed'] else ''}{stem}.csv" for stem in one["tables"]} <= {
            link["href"] for link in section.find_all("a")
        }
        pictures = section.find_all("img")
        assert [picture.parent["href"] for picture in pictures] == ([one["picture"]] if one["picture"] else [])
        assert [picture["alt"] for picture in pictures] == ([one["alt"]] if one["picture"] else [])
        assert all(picture["width"] == "96" and picture["loading"] == "lazy" for picture in pictures)
        assert f"Rays of {one['id']} , 64² & more." in words(section)
    assert "Buddha is shown by buddha_100k" in words(soup.find(id="figure-7"))
    assert "Fairy is missing" in words(soup.find(id="figure-7"))
    assert "no run gives them twice" in words(soup.find(id="speed"))


def test_a_claim_says_what_it_depends_on(soup: BeautifulSoup) -> None:
    said = words(soup.find(id="hre.tests"))
    assert "150 M tests/s" in said and "150.7 M tests/s" in said and "2 percent, for two digits" in said
    assert "Holds at 2 of 3 settings, from 0.5 to 4.625 (times)" in said and "Fails at camera: far & <near>" in said
    assert "12.5 · 30 (× 0.5 to 0.75 of what is printed)" in words(soup.find(id="gsr.table-1"))
    assert "25 · 40 percent" in words(soup.find(id="gsr.table-1"))
    assert "12 percent" in words(soup.find(id="hre.text")) and "at most 20 percent" in words(soup.find(id="hre.text"))
    names = [item.b.get_text() for item in soup.find(class_="errata").find_all("li", recursive=False)]
    assert names == ["HRE-E2", "GSR-E2", "GSR-E10"]


def test_summary_counts_and_filters(soup: BeautifulSoup) -> None:
    for paper, card in zip(("hre", "gsr", "bsh"), soup.find(class_="cards").find_all("article"), strict=True):
        counts = make_report()["summary"][paper]
        assert f"{sum(counts.values())} claims" in words(card)
        assert all(f"{count} {verdict}" in words(card) for verdict, count in counts.items())
        assert ("3 reproduced, 1 in print" in words(card)) is (paper == "hre")
    style = soup.find("style").get_text()
    boxes = [box["id"] for box in soup.find(class_="filters").find_all("input")]
    chosen = {one[part] for one in make_report()["ledger"] for part in ("paper", "verdict", "kind")}
    everything = {box for box in boxes if box.endswith("-all")}
    assert len(everything) == 3 and len(boxes) == len(chosen) + len(everything)
    assert all(f"#ledger:has(#{box}:checked)" in style for box in boxes if box not in everything)


def test_html_is_whole(soup: BeautifulSoup, text: str) -> None:
    body = re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL)
    left: list[str] = []
    for close, name, ends in re.findall(r"<(/?)([a-z][a-z0-9]*)\b[^>]*?(/?)>", body):
        if not close and not ends and name not in VOID:
            left.append(name)
        elif close:
            assert left.pop() == name
    assert left == []
    ids = [tag["id"] for tag in soup.find_all(id=True)]
    assert len(ids) == len(set(ids))
    assert {a["href"][1:] for a in soup.find_all("a") if a["href"].startswith("#")} <= set(ids)
    levels = [int(tag.name[1]) for tag in soup.find_all(re.compile(r"h[1-6]$"))]
    assert levels.count(1) == 1 and all(b <= a + 1 for a, b in pairwise(levels))
    assert soup.html["lang"] == "en" and all(soup.find(tag) for tag in ("header", "nav", "main", "footer"))
    assert all(th.get("scope") for th in soup.find_all("th"))
    assert all(box.get("tabindex") == "0" and box.get("aria-label") for box in soup.find_all(class_="scroll"))


def test_other_runs_are_shown_too(folder: Path) -> None:
    report = make_report()
    odd = {"differs": ["hre.a: contradicted; committed is reproduced."], "not_compared": ["gsr.b: mesh"]}
    quick = page.page_text({**report, "size": "quick", "complete": False, "check": odd}, folder)
    shown = words(BeautifulSoup(quick, "html.parser"))
    assert "refsim reproduce --quick" in shown and "Not everything was run" in shown
    assert "hre.a: contradicted; committed is reproduced." in shown and "gsr.b: mesh" in shown
    bare = page.page_text({**report, "ledger": [], "experiments": [], "summary": {}}, folder)
    assert "0 claims" in words(BeautifulSoup(bare, "html.parser"))


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0, "0"), (-1, "−1"), (9999, "9,999"), (69453, "69,453"), (1e6, "1 M"), (150000000.0, "150 M"), (2e9, "2 G"),
        (1234567, "1,234,567"), (0.23, "0.23"), (13.0, "13"), (1e-7, "1e−07"), (True, "True"), ("room", "room"),
    ],
)  # fmt: skip
def test_numbers(value: object, shown: str) -> None:
    assert page_words.number(value) == shown


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("1.507e+08", "150.7 M"), ("1.966e+09 to 2e+09", "1.966 G to 2 G"), ("1.5e+04", "15,000"), ("1e-05", "1e−05"),
        ("4725909 rays", "4,725,909 rays"), ("torus_knot_10240", "torus_knot_10240"), ("x 32.9", "× 32.9"),
        ("512 * 512", "512 × 512"), ("the paper's", "the paper’s"), ("0.123456", "0.123456"),
    ],
)  # fmt: skip
def test_lines(line: str, shown: str) -> None:
    assert page_words.sentence(line) == shown


def test_readme_table(monkeypatch: pytest.MonkeyPatch) -> None:
    report = make_report()
    monkeypatch.setattr(readme_table, "ASKED", {"hre": ("tests", "text"), "gsr": ("table-1",), "bsh": ()})
    table = readme_table.claims_table(report)
    links = re.findall(r"\]\(figures/index\.html#([^)]+)\)", table)
    assert links == ["topic-hre", "hre.tests", "hre.text", "topic-gsr", "gsr.table-1", "topic-bsh"]
    assert "| 150 M tests/s | 150.7 M tests/s; at 2 of 3 settings | trend reproduced |" in table
    assert "| – | 12 percent | reproduced |" in table
    assert "In all: 3 reproduced (1 in print), 1 trend reproduced" in table
    readme = "before\n<!-- claims -->\nold\n<!-- /claims -->\nafter"
    once = readme_table.put(readme, report)
    assert once.startswith("before\n<!-- claims -->\n\n|") and once.endswith("<!-- /claims -->\nafter")
    assert "old" not in once and readme_table.put(once, report) == once


def test_readme_table_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readme_table, "ASKED", {"hre": ("gone",)})
    with pytest.raises(InputError, match=r"hre\.gone"):
        readme_table.claims_table(make_report())
    monkeypatch.setattr(readme_table, "ASKED", {})
    with pytest.raises(InputError, match="no place"):
        readme_table.put("# refsim", make_report())
