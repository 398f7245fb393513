"""How all tests draw: Hypothesis from a seed fixed by the test itself, the same in every run, and without a clock; and
what the OpenGL witness compared, in the summary of every run.

To look for new counterexamples: `pytest --hypothesis-profile=explore`; a failure prints how to have it again.
"""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("fixed", deadline=None, derandomize=True, print_blob=True)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile("fixed")


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: Any) -> None:
    """Takes over the verdicts of a worker that has ended, where tests run in several processes."""
    from tests.opengl.verdicts import note

    for room, counts in getattr(node, "workeroutput", {}).get("verdicts", {}).items():
        note(room, **counts)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """One line on the witness, and what it compared."""
    from refsim.doctor import opengl_witness, witness_row
    from tests.opengl.verdicts import VERDICTS

    found = opengl_witness()
    if found["present"] and not VERDICTS:
        return
    terminalreporter.section("OpenGL witness")
    terminalreporter.write_line(f"OpenGL witness: {witness_row(found)}")
    for room, counts in sorted(VERDICTS.items()):
        terminalreporter.write_line(f"  {room}: " + ", ".join(f"{name} {n:,}" for name, n in sorted(counts.items())))
