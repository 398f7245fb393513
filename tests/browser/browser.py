"""Looks at a page in a real browser: what it wrote to its console, what it could not load, what does not fit.

`look(page, width)` opens a file or address in headless Chromium, driven by Playwright. The browser itself is the
system's: where there is none, `FOUND` says so.
"""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome")
# Without these Chromium asks its maker's machines at every start
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--force-color-profile=srgb",
)  # fmt: skip
PICTURES = """() => [...document.images]
    .filter(picture => !(picture.complete && picture.naturalWidth > 0)).map(picture => picture.alt || picture.src)"""
WIDER = """() => {
    const width = document.documentElement.clientWidth
    const scrolls = element => {
        for (let above = element.parentElement; above; above = above.parentElement) {
            const overflow = getComputedStyle(above).overflowX
            if (above !== document.documentElement && above !== document.body && overflow !== 'visible') return true
        }
        return false
    }
    return [...document.body.querySelectorAll('*')]
        .filter(element => element.getBoundingClientRect().right > width + 0.5 && element.checkVisibility())
        .filter(element => !scrolls(element))
        .map(element => element.tagName.toLowerCase() + (element.id ? '#' + element.id : '.' + element.className))
}"""
OVERFLOW = "() => document.documentElement.scrollWidth - document.documentElement.clientWidth"
LAZY = "() => { for (const picture of document.images) picture.loading = 'eager' }"


@dataclass(frozen=True)
class Seen:
    """What a browser showed of a page.

    console_errors    errors that it wrote, and exceptions that nobody caught
    requests          addresses that it asked for besides the page itself
    failed_requests   those of them, and the page, that failed or were answered with an error
    missing_pictures  their alternative texts
    overflow_px       how much wider than the window the page is
    wider             elements that stick out of the window, and of no box that scrolls
    """

    console_errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    failed_requests: list[str] = field(default_factory=list)
    missing_pictures: list[str] = field(default_factory=list)
    overflow_px: int = 0
    wider: list[str] = field(default_factory=list)


def find_browser() -> dict[str, Any]:
    """`present`, the program, and the reason if it is absent."""
    program = next((path for name in NAMES if (path := shutil.which(name))), None)
    if importlib.util.find_spec("playwright") is None:
        return {"present": False, "program": program, "reason": "the package playwright is not installed"}
    reason = "" if program else f"none of the programs {', '.join(NAMES)} is installed"
    return {"present": program is not None, "program": program, "reason": reason}


FOUND = find_browser()


@contextmanager
def launched() -> Iterator[Any]:
    """A browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=FOUND["program"], args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(browser: Any, width: int = 1280, height: int = 900, dark: bool = False) -> Iterator[Any]:
    """An empty page in a window of the browser."""
    scheme = "dark" if dark else "light"
    size = {"width": width, "height": height}
    tab = browser.new_page(viewport=size, color_scheme=scheme, reduced_motion="reduce")
    try:
        yield tab
    finally:
        tab.close()


def address(page: Path | str) -> str:
    """A file's address; an address as it is."""
    return page.resolve().as_uri() if isinstance(page, Path) else page


def look(page: Path | str, width: int = 1280, dark: bool = False, picture: Path | None = None) -> Seen:
    """Open a page in a window of `width` pixels; `picture` takes what is seen, from top to bottom."""
    with launched() as browser, opened(browser, width, dark=dark) as tab:
        return see(tab, page, picture)


def see(tab: Any, page: Path | str, picture: Path | None = None) -> Seen:
    """Open a page in a tab that is there."""
    errors: list[str] = []
    requests: list[str] = []
    failed: list[str] = []
    own = address(page)
    tab.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.on("request", lambda request: requests.append(request.url))
    tab.on("requestfailed", lambda request: failed.append(request.url))
    tab.on("response", lambda response: failed.append(response.url) if response.status >= 400 else None)
    tab.goto(own, wait_until="load")
    tab.evaluate(LAZY)
    tab.wait_for_function("() => [...document.images].every(picture => picture.complete)")
    if picture:
        tab.screenshot(path=str(picture), full_page=True)
    asked = [url for url in requests if url != own and not url.startswith("data:")]
    missing, wider = tab.evaluate(PICTURES), tab.evaluate(WIDER)
    return Seen(errors, asked, failed, missing, tab.evaluate(OVERFLOW), wider)
