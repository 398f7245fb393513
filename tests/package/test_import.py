"""Plan: `import refsim` costs next to nothing.

- A fresh process that imports refsim has loaded no plotting, mesh or scientific library, and no compiler.
- It takes less than a third of a second, the interpreter's own start included, at the best of five.
- Every public name can be had from the package, and so can its types.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import refsim

ROOT = Path(__file__).resolve().parents[2]


def python(program: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout


def test_import_loads_nothing_heavy() -> None:
    loaded = set(python("import refsim, sys; print(*sys.modules)").split())
    assert "refsim" in loaded
    assert not {"matplotlib", "trimesh", "scipy", "numba", "rich", "click", "PIL"} & loaded


@pytest.mark.parametrize("name", ["load_scene", "camera_rays", "trace", "render", "__version__"])
def test_public_name(name: str) -> None:
    assert name in dir(refsim)
    assert getattr(refsim, name)


def test_types_are_for_others_too() -> None:
    assert (Path(refsim.__file__).parent / "py.typed").is_file()


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        refsim.no_such_name  # noqa: B018
