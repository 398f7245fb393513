"""Plan: what would be published is whole, and works where there is nothing else of the project.

- The wheel holds the package's files, all of them and nothing else (no tests, no figures), and says of itself what
  pyproject.toml says.
- The archive of sources holds what building and testing need, and is what the wheel was built from.
- Installed without dependencies into an empty environment, which borrows those of this one, every module can be
  imported, and the main job at its smallest runs in an empty folder: nothing of the checkout is read.
- The longer tier runs the whole main job there: all papers, report and page, with every verdict as committed.
"""

from __future__ import annotations

import email
import os
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import refsim

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
STEM = f"refsim-{refsim.__version__}"
# What the format of wheels adds.
ABOUT = ("METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE")
# What running and checking the code leaves behind, as .gitignore names it.
LEFT_BEHIND = {"__pycache__", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis", ".benchmarks", "_build"}


def files(room: str) -> set[str]:
    """The project's own files in a folder of the checkout."""
    paths = [path for path in (ROOT / room).rglob("*") if path.is_file() and not LEFT_BEHIND & set(path.parts)]
    return {path.relative_to(ROOT).as_posix() for path in paths}


def run(folder: Path, *command: str | Path) -> str:
    """Standard output of a command that gives 0, with nothing in its environment that leads to the checkout."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "REFSIM_SCENES")}
    done = subprocess.run(command, cwd=folder, env=kept, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def release(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel and the archive of sources that it was built from."""
    folder = tmp_path_factory.mktemp("release")
    run(folder, sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, ROOT)
    return folder


@pytest.fixture(scope="module")
def wheel(release: Path) -> Path:
    return release / f"{STEM}-py3-none-any.whl"


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of an environment that holds the wheel alone, and finds dependencies where this process does."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=os.name != "nt")
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    pip = (sys.executable, "-m", "pip", "--python", programs / "python", "--disable-pip-version-check")
    run(folder, *pip, "install", "--quiet", "--no-deps", "--no-index", wheel)
    place = run(folder, programs / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    borrowed = dict.fromkeys([sysconfig.get_path("purelib"), sysconfig.get_path("platlib")])
    (Path(place) / "borrowed.pth").write_text("\n".join(borrowed) + "\n", encoding="utf-8")
    return programs


def test_wheel_is_the_package(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if not name.endswith("/")}
    about = {f"{STEM}.dist-info/{name}" for name in ABOUT}
    assert names - about == files("refsim")
    assert about <= names
    assert {"refsim/py.typed", "refsim/experiments/claims/hre.toml"} <= names


def test_wheel_says_what_the_project_says(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        said = email.message_from_bytes(archive.read(f"{STEM}.dist-info/METADATA"))
        commands = archive.read(f"{STEM}.dist-info/entry_points.txt").decode()
    assert (said["Name"], said["Version"], said["License-Expression"]) == ("refsim", refsim.__version__, "MIT")
    assert said["Requires-Python"] == PROJECT["requires-python"]
    needed = [line for line in said.get_all("Requires-Dist") if "extra ==" not in line]
    assert sorted(needed) == sorted(PROJECT["dependencies"])
    assert set(said.get_all("Provides-Extra")) == set(PROJECT["optional-dependencies"])
    assert "refsim = refsim.cli:main" in commands
    assert said.get_payload().startswith("# refsim\n")


def test_archive_of_sources_is_whole(release: Path) -> None:
    with tarfile.open(release / f"{STEM}.tar.gz") as archive:
        names = {name.removeprefix(f"{STEM}/") for name in archive.getnames()}
    rooms = set().union(*(files(room) for room in ("refsim", "tests", "docs", "benchmarks")))
    assert rooms <= names
    assert {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "reproduce.sh"} <= names
    assert ".ci/run" in names, "tests of this archive read it"
    assert [name for name in names if LEFT_BEHIND & set(Path(name).parts) or name.startswith(".venv")] == []


IMPORT_ALL = """
import importlib, pathlib, pkgutil, refsim
names = [module.name for module in pkgutil.walk_packages(refsim.__path__, "refsim.")]
for name in names:
    if not name.endswith("__main__"):
        importlib.import_module(name)
print(pathlib.Path(refsim.__file__).resolve(), len(names))
"""


def test_every_module_comes_from_the_wheel(installed: Path, tmp_path: Path) -> None:
    place, count = run(tmp_path, installed / "python", "-c", IMPORT_ALL).split()
    assert Path(place).is_relative_to(installed.resolve().parent)
    assert int(count) > sum(path.endswith(".py") and not path.endswith("__init__.py") for path in files("refsim"))
    assert run(tmp_path, installed / "refsim", "--version") == f"refsim {refsim.__version__}\n"


def test_main_job_at_its_smallest(installed: Path, tmp_path: Path) -> None:
    arguments = ("reproduce", "hre", "--quick", "--only", "tightest-cone", "--jobs", "1", "--out", "made")
    printed = run(tmp_path, installed / "refsim", *arguments).splitlines()
    assert {"made/tightest-cone.csv", "made/tightest-cone.png"} <= {Path(line).as_posix() for line in printed}
    assert [path.name for path in tmp_path.iterdir()] == ["made"]
    assert (tmp_path / "made" / "tightest-cone.csv").stat().st_size > 0


@pytest.mark.slow
def test_main_job(installed: Path, tmp_path: Path) -> None:
    run(tmp_path, installed / "refsim", "reproduce", "--quick")
    made = {path.name for path in (tmp_path / "figures-quick").iterdir()}
    assert {"figure-4.png", "gsr-table-1.csv", "claims-bsh.csv", "report.json", "index.html"} <= made
    assert [path.name for path in tmp_path.iterdir()] == ["figures-quick"]
