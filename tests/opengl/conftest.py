"""The witness for the tests of this room; where there is no OpenGL these tests do not exist, and the summary says so.

REFSIM_WITNESS=required in the environment (as `.ci/run` sets it) makes absence a failing test.
`python -m pytest tests/opengl --witness-results` writes `results/<driver>.json`: which driver, which versions, what was
compared and how it came out.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest

from refsim.doctor import opengl_witness

FOUND = opengl_witness()
REQUIRED = os.environ.get("REFSIM_WITNESS") == "required"
RESULTS = Path(__file__).with_name("results")

ALWAYS = "test_presence.py"  # says what is absent although it is required

collect_ignore_glob = []
if not FOUND["present"]:
    tests = {path.name for path in Path(__file__).parent.glob("test_*.py")}
    collect_ignore_glob = sorted(tests - {ALWAYS} if REQUIRED else tests)


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option that writes a results file."""
    parser.addoption("--witness-results", action="store_true", help="write tests/opengl/results/<driver>.json")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Hands a worker's verdicts to the process that sums up; writes the results file if it was asked for and everything
    passed."""
    if hasattr(session.config, "workeroutput"):
        from tests.opengl.verdicts import VERDICTS

        session.config.workeroutput["verdicts"] = {room: dict(counts) for room, counts in VERDICTS.items()}
        return
    if not session.config.getoption("--witness-results", default=False) or exitstatus != 0 or not FOUND["present"]:
        return
    from tests.opengl.verdicts import VERDICTS

    name = "-".join(re.findall(r"[a-z0-9.]+", f"{FOUND['renderer']} {FOUND['version']}".lower()))
    driver = {key: value for key, value in FOUND.items() if key in ("renderer", "version")}
    report = {**driver, "rooms": {room: dict(sorted(counts.items())) for room, counts in sorted(VERDICTS.items())}}
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.json").write_text(json.dumps(report, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


@pytest.fixture(scope="session")
def the_witness():
    """The one OpenGL context of the run."""
    from tests.opengl.witness import Witness

    return Witness()


@pytest.fixture
def witness(the_witness):
    """The witness, its context current: another test of the process may have made one of its own."""
    with the_witness.context:
        yield the_witness


@pytest.fixture(autouse=True)
def _count_tests(request: pytest.FixtureRequest):
    """Counts the tests of each file for the results."""
    from tests.opengl.verdicts import note

    note(request.path.stem.removeprefix("test_"), tests=1)
