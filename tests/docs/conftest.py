"""The documentation, built once for all that looks at it: every page run, warnings counted as errors."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


class Build(NamedTuple):
    """What came of it: the built pages, the executed notebooks, exit status, what was said, and the warnings alone."""

    html: Path
    notebooks: Path
    status: int
    said: str
    warnings: str


@pytest.fixture(scope="session")
def docs_build(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """The build, whether it went well or not. A block may take longer than `conf.py` grants it, which says why."""
    folder = tmp_path_factory.mktemp("docs")
    html, warnings = folder / "html", folder / "warnings.txt"
    command = [
        sys.executable, "-m", "sphinx", "-W", "--keep-going", "--jobs", "auto", "--define", "nb_execution_timeout=900",
        "--doctree-dir", folder / "doctrees", "--warning-file", warnings, "--builder", "html", DOCS, html,
    ]  # fmt: skip
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    environment["REFSIM_SCENES"] = str(folder)  # no mesh but refsim's own
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    found = warnings.read_text(encoding="utf-8") if warnings.is_file() else ""
    return Build(html, folder / "jupyter_execute", done.returncode, done.stdout + done.stderr, found)


@pytest.fixture(scope="session")
def built_docs(docs_build: Build) -> Path:
    """The folder of the built pages."""
    assert docs_build.status == 0, docs_build.said[-4000:] + docs_build.warnings
    return docs_build.html
