"""Hermetic caches: every test compiles into its own directory and forgets its kernels afterwards."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import pytest

from refsim.jit import clones

ROOT = Path(__file__).resolve().parents[2]
Run = Callable[..., Any]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forget: Callable[[], None]) -> Path:
    """The directory in which numba caches during this test."""
    directory = tmp_path / "cache"
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(directory))
    forget()
    return directory


@pytest.fixture
def forget(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Start with the memory of a new process."""

    def forget() -> None:
        for memory in ("_kernels", "_devices", "_copies", "_classes", "_calls"):
            monkeypatch.setattr(clones, memory, {})

    return forget


@pytest.fixture
def run(cache: Path) -> Run:
    """Run a script in a process of its own; returns the JSON that it prints. ``NAME=None`` unsets a variable."""

    def run(script: Path, *arguments: str, **environment: str | None) -> Any:
        wanted = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT), **environment}
        done = subprocess.run([sys.executable, str(script), *arguments], capture_output=True, text=True, timeout=120,
                              env={name: value for name, value in wanted.items() if value is not None}, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run
