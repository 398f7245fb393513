"""What rows depend on besides their case: the sources that compute them. A change there makes kept rows stale."""

from __future__ import annotations

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
# Rooms and files that compute nothing of a row
SILENT = {EXPERIMENTS, "oracle", "cli.py", "cli_options.py", "doctor.py", "progress.py", "image.py", "__main__.py"}
# Modules of the room that several measurements call
SHARED = (
    "runs", "pictures", "gsr_runs", "gsr_moved", "gsr_published", "bsh_runs", "bsh_small", "bsh_published",
    "sensitivity_frame", "sensitivity_list_runs", "equations", "hre_equations_checks", "hre_equations_spheres",
    "hre_equations_kernels", "gsr_equations_checks", "gsr_equations_colours", "bsh_equations_lists",
    "bsh_equations_rays", "caustic_pictures", "construction", "depth_24", "depth_24_kernels",
)  # fmt: skip


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


def rows_key(experiment: Experiment) -> str:
    """Version, numerical rooms, and the modules in which the experiment's cases are stated and measured."""
    shared = {f"{EXPERIMENTS}/{name}.py" for name in SHARED}
    own = {_home(experiment.cases), _home(experiment.measure)}
    facts = (refsim.__version__, _version("numpy"), _version("numba"), experiment.id)
    return _digest(_numerical() | shared | own, *facts)


def plot_key(experiment: Experiment, rows_text: str) -> str:
    """What a picture depends on: its rows, all sources, and the plotting library."""
    room = {name for name in _sources() if name.startswith(EXPERIMENTS)}
    return _digest(_numerical() | room, experiment.id, _version("matplotlib"), rows_text)
