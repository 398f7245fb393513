"""What rows depend on besides their case: the sources that compute them. A change there makes kept rows stale."""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Callable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import refsim
from refsim.experiments.registry import Experiment

PACKAGE = Path(refsim.__file__).parent
EXPERIMENTS = "experiments"
ROOM = "refsim.experiments"
# Rooms and files that compute nothing of a row
SILENT = {EXPERIMENTS, "oracle", "cli.py", "cli_options.py", "doctor.py", "progress.py", "image.py", "__main__.py"}
# Modules of the room that only draw: no row depends on them
DRAWING = ("style", "registry")
DRAWN = "_plot"  # the end of their names


@cache
def _sources() -> dict[str, str]:
    """Digest of every source file by its path in the package; read once, as the process that runs them was."""
    return {
        path.relative_to(PACKAGE).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(PACKAGE.rglob("*.py"))
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"


def _digest(names: set[str], *facts: str) -> str:
    lines = [f"{name} {digest}" for name, digest in _sources().items() if name in names]
    return hashlib.sha256("\n".join([*facts, *lines]).encode()).hexdigest()[:32]


def _numerical() -> set[str]:
    return {name for name in _sources() if name.partition("/")[0] not in SILENT}


def _home(work: Callable[..., object]) -> str:
    """The file that a function of the package is written in; '' for one from elsewhere."""
    file = getattr(sys.modules.get(work.__module__), "__file__", None) or ""
    return Path(file).relative_to(PACKAGE).as_posix() if file and Path(file).is_relative_to(PACKAGE) else ""


@cache
def _imported(module: str) -> frozenset[str]:
    """Modules of the room that a module of the room imports, anywhere in it, as written in its source."""
    found: set[str] = set()
    for node in ast.walk(ast.parse((PACKAGE / EXPERIMENTS / f"{module}.py").read_bytes())):
        if isinstance(node, ast.ImportFrom) and node.module == ROOM:
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add((node.module or "").removeprefix(f"{ROOM}."))
        elif isinstance(node, ast.Import):
            found |= {name.name.removeprefix(f"{ROOM}.") for name in node.names}
    return frozenset(name for name in found if f"{EXPERIMENTS}/{name}.py" in _sources())


def measuring(experiment: Experiment) -> set[str]:
    """Files of the room in which the experiment's cases are stated and measured, and all that these import."""
    left = [Path(_home(work)).stem for work in (experiment.cases, experiment.measure) if _home(work)]
    found: set[str] = set()
    while left:
        module = left.pop()
        if module not in found and module not in DRAWING and not module.endswith(DRAWN):
            found.add(module)
            left += _imported(module)
    return {f"{EXPERIMENTS}/{module}.py" for module in found}


def rows_key(experiment: Experiment) -> str:
    """Version, numerical rooms, and the modules that state the experiment's cases and measure them."""
    facts = (refsim.__version__, _version("numpy"), _version("numba"), experiment.id)
    return _digest(_numerical() | measuring(experiment), *facts)


def plot_key(experiment: Experiment, rows_text: str) -> str:
    """What a picture depends on: its rows, all sources, and the plotting library."""
    room = {name for name in _sources() if name.startswith(EXPERIMENTS)}
    return _digest(_numerical() | room, experiment.id, _version("matplotlib"), rows_text)
