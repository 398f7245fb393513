"""Plan: `.ci/run` gives each command the machine that the README promises it.

Git, Python and the two commands are played by small scripts that say how they were called, so nothing is installed.

- The first command sees no mesh, whatever the caller had set; the second finds the folder beside the checkout.
- Between them the first chapter runs, with the environment that the first command has made.
- A command or a chapter that fails ends the run with its exit code; nothing is left behind.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FIRST = "mkdir -p .venv/bin && cp played .venv/bin/python && echo first ${REFSIM_SCENES-none}"
README = "<!-- ci -->\n```sh\n{first}\n```\n\n<!-- ci -->\n```sh\n{second}\n```\n"
PLAYED = {"git": "printf 'README.md\\0played\\0'", "python3": "exit 0", "chromium": "exit 0"}
SAID = ["first none", "played tests/docs/run_chapter.py docs/first-steps.md with none"]


def go(folder: Path, first: str = FIRST, chapter: int = 0) -> subprocess.CompletedProcess[str]:
    """The script in a checkout of its own, with the caller's REFSIM_SCENES set."""
    checkout, programs, rest = folder / "checkout", folder / "bin", folder / "rest"
    for room in (checkout / ".ci", folder / "shared" / "scenes", programs, rest):
        room.mkdir(parents=True)
    shutil.copy(ROOT / ".ci" / "run", checkout / ".ci")
    readme = README.format(first=first, second="echo second ${REFSIM_SCENES-none}")
    (checkout / "README.md").write_text(readme, encoding="utf-8")
    played = {checkout / "played": f'echo "played $* with ${{REFSIM_SCENES-none}}"; exit {chapter}'}
    for path, text in (played | {programs / name: text for name, text in PLAYED.items()}).items():
        path.write_text(f"#!/usr/bin/env bash\n{text}\n", encoding="utf-8")
        path.chmod(0o755)
    environment = {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "TMPDIR": str(rest), "REFSIM_SCENES": "set"}
    done = subprocess.run(["bash", checkout / ".ci" / "run"], env=environment, capture_output=True, text=True)
    assert list(rest.iterdir()) == [], "the copy is left behind"
    return done


def said(done: subprocess.CompletedProcess[str]) -> list[str]:
    return [line for line in done.stdout.splitlines() if line.startswith(("first", "played", "second"))]


def test_each_command_has_its_machine(tmp_path: Path) -> None:
    done = go(tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert said(done) == [*SAID, f"second {tmp_path / 'shared' / 'scenes'}"]


@pytest.mark.parametrize(
    ("first", "chapter", "code", "lines"),
    [("exit 3", 0, 3, []), (FIRST, 1, 1, SAID)],
    ids=["the first command", "the chapter"],
)
def test_a_failure_ends_the_run(tmp_path: Path, first: str, chapter: int, code: int, lines: list[str]) -> None:
    done = go(tmp_path, first, chapter)
    assert (done.returncode, said(done)) == (code, lines)
