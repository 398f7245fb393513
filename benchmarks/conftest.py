"""Prints what the benchmarks measured as rates and ratios of one run, beside the targets; no test asserts a time."""

from __future__ import annotations

import pytest

LINES: list[str] = []


@pytest.fixture
def report():
    """Adds a line to the summary."""
    return LINES.append


def pytest_terminal_summary(terminalreporter) -> None:
    """The summary, after pytest-benchmark's own table."""
    if LINES:
        terminalreporter.section("rates and ratios of this run")
        for line in LINES:
            terminalreporter.write_line(line)
