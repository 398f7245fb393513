"""A progress bar on a terminal, silence in a pipe.

    with progress(total=12, description="figure 7") as advance:
        for row in rows:
            ...
            advance(doing="the next row")

The bar goes to stderr, so what a command prints on stdout stays clean; it disappears when the work is done.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol


class Advance(Protocol):
    """Says that ``steps`` more of the total are done, and what is being done now."""

    def __call__(self, steps: float = 1, doing: str | None = None) -> None: ...


class Progress(Protocol):
    """What long computations take as their ``progress`` argument: :func:`progress`, or :func:`silent`."""

    def __call__(self, total: float | None, description: str) -> AbstractContextManager[Advance]: ...


@contextmanager
def silent(total: float | None, description: str) -> Iterator[Advance]:
    """Report nothing."""
    yield lambda steps=1, doing=None: None


@contextmanager
def progress(total: float | None, description: str) -> Iterator[Advance]:
    """Show ``description`` and how much of ``total`` is done, if stderr is a terminal; None is an unknown total."""
    if not sys.stderr.isatty():
        with silent(total, description) as advance:
            yield advance
        return

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    # What is printed meanwhile appears above the bar; but what goes into a file must not come to the terminal
    shared = sys.stdout.isatty()
    with Bar(*columns, console=Console(stderr=True), transient=True, redirect_stdout=shared) as bar:
        task = bar.add_task(description, total=total)
        yield lambda steps=1, doing=None: bar.update(task, advance=steps, description=doing)
