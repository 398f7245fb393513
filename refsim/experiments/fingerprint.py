"""What rows depend on besides their case: the sources that compute them. A change there makes kept rows stale."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType

import refsim
from refsim.experiments.registry import Experiment

PACKAGE = Path(refsim.__file__).parent
# Rooms and files that compute nothing of a row
SILENT = {"experiments", "oracle", "cli.py", "doctor.py", "progress.py", "image.py", "__main__.py"}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def _digest(paths: list[Path], *facts: str) -> str:
    found = hashlib.sha256("\n".join(facts).encode())
    for path in sorted(paths):
        found.update(f"\n{path.relative_to(PACKAGE).as_posix()}\n".encode())
        found.update(path.read_bytes())
    return found.hexdigest()[:32]


@cache
def _numerical() -> tuple[Path, ...]:
    return tuple(path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] not in SILENT)


def rows_key(experiment: Experiment) -> str:
    """Version, numerical rooms, and the modules in which the experiment's cases are stated and measured."""
    import sys

    modules = [sys.modules[work.__module__] for work in (experiment.cases, experiment.measure)]
    own = {Path(file) for module in modules if (file := _file(module)) and Path(file).is_relative_to(PACKAGE)}
    own |= {PACKAGE / "experiments" / "runs.py"}
    facts = (refsim.__version__, _version("numpy"), _version("numba"), experiment.id)
    return _digest([*_numerical(), *own], *facts)


def _file(module: ModuleType) -> str | None:
    return getattr(module, "__file__", None)


def plot_key(experiment: Experiment, rows_text: str) -> str:
    """What a picture depends on: its rows, all sources, and the plotting library."""
    room = list((PACKAGE / "experiments").glob("*.py"))
    return _digest([*_numerical(), *room], experiment.id, _version("matplotlib"), rows_text)
