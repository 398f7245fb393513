"""What the tests of the command line share: a directory of their own, and ways to call the command there."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Answer:
    """What a call of the command gave back."""

    code: int
    out: str
    err: str


Call = Callable[..., Answer]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory, with no real meshes known."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("REFSIM_SCENES", raising=False)
    monkeypatch.setattr("refsim.scene.known.cache_folder", lambda: tmp_path / "cache")
    return tmp_path


@pytest.fixture
def refsim_main(here: Path, capsys: pytest.CaptureFixture[str]) -> Call:
    """Call the command inside this process."""
    from refsim.cli import main

    def call(*arguments: str) -> Answer:
        code = main(arguments)
        out, err = capsys.readouterr()
        return Answer(code, out, err)

    return call


@pytest.fixture
def refsim_process(here: Path) -> Call:
    """Call the command as a user does, in a process of its own."""

    def call(*arguments: str) -> Answer:
        done = subprocess.run(
            [sys.executable, "-m", "refsim", *arguments],
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
        )
        return Answer(done.returncode, done.stdout, done.stderr)

    return call
