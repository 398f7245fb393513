"""Plan: `refsim doctor` and `refsim scenes` say what is there.

- A sound machine gives 0; a missing run-time package, no place for kernels, no folder of meshes give 1 and a sentence.
- The OpenGL witness is named with its version, or absent with a reason: no package, no driver. None is a problem.
- All packages that the project depends on are looked for.
- Each real mesh is present, missing or another file of that name, by what lies in REFSIM_SCENES; none is a problem.
- Every scene of the library is listed with the triangles it really has, and so is every mesh in the folder.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import re
import sys
import tomllib
from pathlib import Path

import pytest

import refsim

ROOT = Path(__file__).resolve().parents[2]


def test_sound_machine(refsim_main) -> None:
    answer = refsim_main("doctor", "--json")
    report = json.loads(answer.out)
    assert (answer.code, report["problems"]) == (0, [])
    assert report["refsim"] == refsim.__version__
    assert report["packages"]["numpy"] == importlib.metadata.version("numpy")
    assert report["kernel_cache"]["writable"] and Path(report["kernel_cache"]["directory"]).is_dir()
    assert report["processor"]["threads"] >= 1


def test_report_for_people_names_everything(refsim_main) -> None:
    out = refsim_main("doctor").out
    for word in ("refsim", "python", "numba", "processor", "kernel cache", "REFSIM_SCENES", "gcc"):
        assert word in out
    assert "problem" not in out


def test_missing_package_is_a_problem(refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.metadata.version

    def version(name: str) -> str:
        if name == "scipy":
            raise importlib.metadata.PackageNotFoundError(name)
        return found(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    answer = refsim_main("doctor")
    assert answer.code == 1
    assert "the package scipy is not installed" in answer.out


def test_every_dependency_is_looked_for(refsim_main) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = {re.split(r"[^\w-]", line)[0] for line in project["dependencies"]}
    assert {"numpy", "joblib", "jinja2", "markupsafe"} <= needed
    assert needed <= set(json.loads(refsim_main("doctor", "--json").out)["packages"])


def test_no_place_for_kernels_is_a_problem(refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_):
        raise RuntimeError("no locator")

    monkeypatch.setattr("numba.core.caching.FunctionCache", refuse)
    answer = refsim_main("doctor", "--json")
    assert answer.code == 1
    (problem,) = json.loads(answer.out)["problems"]
    assert "NUMBA_CACHE_DIR" in problem


def test_kernel_cache_follows_the_environment(here: Path, refsim_process, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(here / "kernels"))
    directory = json.loads(refsim_process("doctor", "--json").out)["kernel_cache"]["directory"]
    assert Path(directory).is_relative_to(here / "kernels")


def test_opengl_witness_is_named_or_absent_with_a_reason(
    tmp_path: Path, refsim_main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def row(code: str) -> str:
        (tmp_path / "moderngl.py").write_text(code)
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "moderngl", raising=False)
        importlib.invalidate_caches()
        answer = refsim_main("doctor")
        assert answer.code == 0
        return next(line for line in answer.out.splitlines() if "OpenGL witness" in line)

    started = "class context:\n info = {'GL_RENDERER': 'some pipe', 'GL_VERSION': '4.6'}\n release = lambda: None\n"
    refused = "def create_standalone_context(**_): raise ValueError('no display')\n"
    assert "absent (the package moderngl is not installed)" in row("raise ImportError\n")
    assert "absent (no OpenGL 4.5 through EGL: no display)" in row(refused)
    assert row(started + "def create_standalone_context(**_): return context\n").endswith("some pipe, 4.6")


def test_meshes_are_present_or_missing(here: Path, refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    def found() -> dict:
        answer = refsim_main("doctor", "--json")
        assert answer.code == 0
        return json.loads(answer.out)["scenes"]

    nothing = found()
    assert (nothing["folder"], nothing["present"], nothing["different"]) == (None, [], [])
    assert "bunny" in nothing["missing"]
    monkeypatch.setenv("REFSIM_SCENES", str(here))
    assert found() == {**nothing, "folder": str(here)}
    (here / "bunny.ply").write_text("not the known rabbit")
    rest = [name for name in nothing["missing"] if name != "bunny"]
    assert found() == {"folder": str(here), "present": [], "missing": rest, "different": ["bunny"]}


def test_folder_of_meshes_that_is_none_is_a_problem(refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REFSIM_SCENES", "nowhere")
    answer = refsim_main("doctor", "--json")
    assert answer.code == 1
    (problem,) = json.loads(answer.out)["problems"]
    assert "REFSIM_SCENES" in problem and "nowhere" in problem


def test_scenes_lists_what_the_folder_holds(here: Path, refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\nelement face 7\nend_header\n"
    (here / "mine.ply").write_text(header)
    (here / "notes.txt").touch()
    before = json.loads(refsim_main("scenes", "--json").out)
    monkeypatch.setenv("REFSIM_SCENES", str(here))
    after = json.loads(refsim_main("scenes", "--json").out)
    assert before["meshes"] == [] and "bunny" in before["missing"]
    assert after == {**before, "meshes": [{"name": "mine", "triangles": 7}]}
    rows = dict(line.split(maxsplit=1) for line in refsim_main("scenes").out.splitlines())
    assert rows["mine"] == "7 triangles" and rows["bunny"] == "missing"
    assert rows["cornell_box"] == "36 triangles" and rows["blob"].endswith("blob_N has N")


def test_library_is_listed_with_its_triangles(refsim_main) -> None:
    library = json.loads(refsim_main("scenes", "--json").out)["library"]
    assert {"cornell_box", "torus_knot", "room", "cubes", "sphere", "blob"} <= {entry["name"] for entry in library}
    for entry in library:
        assert len(refsim.load_scene(entry["name"]).triangles) == entry["triangles"]
    out = refsim_main("scenes").out
    assert all(entry["name"] in out for entry in library)
