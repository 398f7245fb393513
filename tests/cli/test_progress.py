"""Plan: progress shows on a terminal and nowhere else.

- In a pipe nothing is written; on a terminal the description and the count appear, and stdout stays clean.
- The number of steps may be given; an exception inside passes through.
"""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from refsim.progress import progress, silent

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
from refsim.progress import progress
with progress(4, "figure 7") as advance:
    advance()
    advance(3)
print("done")
"""


def run(stderr: int) -> str:
    """Run the program with that stderr and return its stdout."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm", "COLUMNS": "80"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=stderr, text=True, env=environment, check=True
    )
    return done.stdout


def test_terminal_shows_it() -> None:
    terminal, end = pty.openpty()
    assert run(end) == "done\n"
    os.close(end)
    shown = b""
    while chunk := read(terminal):
        shown += chunk
    os.close(terminal)
    assert b"figure 7" in shown and b"4/4" in shown


def read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # how Linux says that the other end is closed
        return b""


def test_pipe_stays_silent() -> None:
    reader, writer = os.pipe()
    assert run(writer) == "done\n"
    os.close(writer)
    assert os.read(reader, 4096) == b""
    os.close(reader)


@pytest.mark.parametrize("shown", [progress, silent])
def test_exception_passes_through(shown) -> None:
    with pytest.raises(KeyError), shown(1, "work") as advance:
        advance()
        raise KeyError
