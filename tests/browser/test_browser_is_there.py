"""The browser is there, or its absence is told; and what it is asked for, it sees.

Plan
- It is there. Where REFSIM_BROWSER=required this test fails without it.
- Without the package playwright no test of this room exists, nothing fails, and the summary gives the reason; if the
  browser is required, one test fails.
- A page with one fault of each kind is seen to have it, and one with none to have none.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from tests.browser.browser import FOUND, Seen, look, opened, see

ROOT = Path(__file__).resolve().parents[2]
GOOD = "<!DOCTYPE html><html lang='en'><link rel='icon' href='data:,'><title>t</title><body>{}</body></html>"
SCROLLS = "<div style='overflow-x: auto'><div style='width: 900px'>wide</div></div>"


def test_the_browser_is_there() -> None:
    assert FOUND["present"], FOUND["reason"]


@pytest.mark.parametrize(("required", "code", "said"), [("", 5, "no tests ran"), ("required", 1, "1 failed")])
def test_absence_is_told(tmp_path: Path, required: str, code: int, said: str) -> None:
    script = (
        "import importlib.util as u, sys, pytest; find = u.find_spec;"
        "u.find_spec = lambda name, *rest: None if name == 'playwright' else find(name, *rest);"
        "chosen = 'not absence and not fault and not picture';"
        "sys.exit(pytest.main(['tests/browser', '-q', '-k', chosen, '-p', 'no:cacheprovider']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "REFSIM_BROWSER": required},
    )  # fmt: skip
    assert done.returncode == code, done.stdout
    assert "browser: absent (the package playwright is not installed)" in done.stdout and said in done.stdout


# Before the others: it starts a browser of its own, and one process has one at a time
def test_look_takes_a_picture(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(GOOD.format("<p style='height: 1500px'>a</p>"), encoding="utf-8")
    assert look(tmp_path / "page.html", 380, dark=True, picture=tmp_path / "page.png") == Seen()
    with Image.open(tmp_path / "page.png") as picture:
        assert picture.width == 380 and picture.height > 1500


@pytest.mark.parametrize(
    ("body", "part"),
    [
        ("<script>console.error('no')</script>", "console_errors"),
        ("<script>throw new Error('no')</script>", "console_errors"),
        ("<img src='data:image/png;base64,AAAA' alt='broken'>", "missing_pictures"),
        ("<img src='gone.png' alt='gone'>", "missing_pictures"),
        ("<link rel='stylesheet' href='gone.css'>", "failed_requests"),
        ("<div style='width: 900px'>wide</div>", "wider"),
        ("<div style='width: 900px'>wide</div>", "overflow_px"),
        (SCROLLS, ""),
    ],
)
def test_each_fault_is_seen(browser: Any, tmp_path: Path, body: str, part: str) -> None:
    page = tmp_path / "page.html"
    page.write_text(GOOD.format(body), encoding="utf-8")
    with opened(browser, 380) as tab:
        seen = see(tab, page)
    if part:
        assert getattr(seen, part)
    else:
        assert seen == Seen()
