"""Plan: the linters, the type checker and the import contracts find nothing, and files keep the house's rules.

- ruff, mypy and import-linter pass on the whole tree.
- A Python file has at most 300 lines, and no file or room is a drawer for anything.
- No file says where it lay on somebody's machine.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = (".ci", "refsim", "tests", "benchmarks", "docs", "figures", "ports")
DRAWERS = {"utils", "util", "helpers", "helper", "common", "misc", "core"}
MACHINE_PATH = re.compile(r"(?<![\w.~$}])/(?:work|tmp|home|root|Users|opt|mnt)/\w")
# Everything else is read, so that a new kind of file cannot be forgotten
PICTURES = {".png"}
BUILT = {"__pycache__", "_build", "build", ".ipynb_checkpoints"}


def files() -> Iterator[Path]:
    """The files that belong to the project, whether it lies in a repository or not."""
    yield from (path for path in ROOT.iterdir() if path.is_file())
    for room in ROOMS:
        yield from (path for path in (ROOT / room).rglob("*") if path.is_file() and not BUILT & set(path.parts))


FILES = sorted(files())
PYTHON = [path for path in FILES if path.suffix == ".py"]


def called(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize(
    "tool",
    [("ruff", "check", "."), ("mypy",), ("lint-imports",)],
    ids=lambda tool: tool[0],
)
def test_tool_finds_nothing(tool: tuple[str, ...]) -> None:
    program = shutil.which(tool[0], path=str(Path(sys.executable).parent))
    assert program, f"{tool[0]} is not installed beside {sys.executable}"
    done = subprocess.run([program, *tool[1:]], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_walk_sees_the_project() -> None:
    assert {"pyproject.toml", "README.md", ".ci/run", "refsim/cli.py", "tests/package/test_quality.py"} <= set(
        map(called, FILES)
    )


def test_files_are_short() -> None:
    lengths = {called(path): len(path.read_text(encoding="utf-8").splitlines()) for path in PYTHON}
    assert {name: length for name, length in lengths.items() if length > 300} == {}


def test_nothing_is_a_drawer() -> None:
    def names(path: Path) -> set[str]:
        parts = path.relative_to(ROOT).with_suffix("").parts
        return {word for part in parts for word in (part.lower(), part.lower().removeprefix("test_"))}

    assert [called(path) for path in FILES if names(path) & DRAWERS] == []


def test_no_file_knows_a_machine() -> None:
    texts = {path: path.read_text(encoding="utf-8", errors="replace") for path in FILES if path.suffix not in PICTURES}
    assert {".py", ".md", ".csv", ".html", ".css", ".json", ""} <= {path.suffix for path in texts}
    assert {called(path): found[0] for path, text in texts.items() if (found := MACHINE_PATH.search(text))} == {}


@pytest.mark.parametrize(
    ("text", "tells"),
    [
        ("open('/" + "home/me/mesh.ply')", True),
        ("cd /" + "tmp/x", True),
        ("../shared/scenes/bunny.ply", False),
        ("https://example.org/" + "home/page", False),
        ("a / b", False),
    ],
)
def test_machine_path_pattern(text: str, tells: bool) -> None:
    assert bool(MACHINE_PATH.search(text)) is tells
