"""The browser for the tests of this room; where there is none these tests do not exist, and the header says so.

REFSIM_BROWSER=required in the environment (as `.ci/run` sets it) makes absence a failing test.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.browser.browser import FOUND, launched, opened

REQUIRED = os.environ.get("REFSIM_BROWSER") == "required"
ALWAYS = "test_browser_is_there.py"  # says what is absent although it is required

collect_ignore_glob = []
if not FOUND["present"]:
    tests = {path.name for path in Path(__file__).parent.glob("test_*.py")}
    collect_ignore_glob = sorted(tests - {ALWAYS} if REQUIRED else tests)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """One line where there is no browser."""
    if not FOUND["present"]:
        terminalreporter.section("browser")
        terminalreporter.write_line(f"browser: absent ({FOUND['reason']}); pages were not looked at")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """One browser for the tests of a file; its event loop ends with it."""
    with launched() as program:
        yield program


@pytest.fixture(params=[(1280, False), (380, True)], ids=["wide-light", "narrow-dark"])
def tab(browser: Any, request: pytest.FixtureRequest) -> Iterator[Any]:
    """An empty page, wide in light colours or narrow in dark ones."""
    width, dark = request.param
    with opened(browser, width, dark=dark) as page:
        yield page
