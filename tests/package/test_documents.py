"""Plan: what the documents say is what the project does.

- Package, CITATION.cff and CHANGELOG.md carry the same version; CITATION.cff names the three papers.
- `.ci/run` takes its two commands from the README, which sets up from nothing but Python each time.
- The README's Python examples run; its commands, methods and counters exist; its links lead to files.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import refsim
from refsim.counters import REGISTRY

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_version_is_the_same_everywhere() -> None:
    assert "version" in PROJECT["project"]["dynamic"]
    assert PROJECT["tool"]["hatch"]["version"]["path"] == "refsim/__init__.py"
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [refsim.__version__]
    assert re.findall(r"^## \[(\d.*?)\]", changelog, re.MULTILINE)[0] == refsim.__version__


@pytest.mark.parametrize(
    "words",
    [
        ("The Hierarchical Ray Engine", "Szécsi", "WSCG 2006"),
        ("Recursive Ray Tracing in Geometry Shader", "Ralovich", "Magdics"),
        ("Efficient stackless ray traversal for bounding sphere hierarchies with CUDA", "Toczek", "Houzet", "Mancini"),
    ],
    ids=["hre", "gsr", "bsh"],
)
def test_citation_names_the_paper(words: tuple[str, ...]) -> None:
    references = (ROOT / "CITATION.cff").read_text(encoding="utf-8").partition("\nreferences:")[2]
    (paper,) = [entry for entry in references.split("  - type:") if f'"{words[0]}"' in entry]
    assert all(word in paper for word in words)


def test_continuous_integration_runs_the_readme() -> None:
    listed = subprocess.run(["bash", ".ci/run", "--list"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    main_job, tests = listed.splitlines()
    assert [block.strip() for block in blocks("sh")[:2]] == [main_job, tests]
    setup = "python3 -m venv .venv && .venv/bin/pip install -e "
    assert main_job == f"{setup}. && .venv/bin/refsim reproduce --quick"
    assert tests == f"{setup}'.[test]' && .venv/bin/python -m pytest -n auto --maxprocesses 8 --dist loadfile"


EXAMPLES = blocks("python")


@pytest.mark.parametrize(
    ("place", "first", "last"),
    [
        (0, r"0 4096 rays, ", r"\(64, 64, 3\) float32"),
        (1, r"\d+ points, [1-9]\d+ fragments", r".*first: \d+"),
        (2, r"6 triangles culled, 6 drawn, 1\d\d\d fragments$", r".* fragments"),
        (3, r"62 points emitted, 12 without room$", r"\(\[-0\.96875, .*1\.0? *\], 0\.03125\)"),
        (4, r"0 9216 rays shot; \d+ of 36864 records captured$", r"2 \d+ rays shot; \d+ of 36864 records captured"),
        (5, r"1 lists: \d+ nodes for 9216 eye rays and", r"8 lists: \d+ nodes for 9216 eye rays and \d+ shadow rays"),
    ],
)
def test_readme_examples_run(tmp_path: Path, place: int, first: str, last: str) -> None:
    script = tmp_path / "example.py"
    script.write_text(EXAMPLES[place])
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert re.match(first, lines[0]) and re.fullmatch(last, lines[-1])


def test_every_readme_example_has_its_row() -> None:
    (rows,) = (mark for mark in test_readme_examples_run.pytestmark if mark.name == "parametrize")
    assert [place for place, _, _ in rows.args[1]] == list(range(len(EXAMPLES)))


def test_readme_counters_exist() -> None:
    named = set(re.findall(r"`([a-z_]+\.[a-z_]+)`", README.partition("## Counters")[2].partition("\n## ")[0]))
    assert named - {"trace.counters"} <= set(REGISTRY)


def test_readme_commands_exist() -> None:
    from refsim.cli import commands

    assert set(re.findall(r"`refsim (\w+)", README)) == set(commands.commands)


def test_readme_methods_exist() -> None:
    methods = re.findall(r"`(\w+)`", re.search(r"^Methods: (.+?)\. ", README, re.MULTILINE)[1])
    for method in methods:
        assert refsim.render(method, "room", 4, 4, generations=1).rgb.shape == (4, 4, 3)


def test_readme_links_lead_to_files() -> None:
    targets = [target for target in re.findall(r"\]\(([^)]+)\)", README) if "://" not in target]
    assert targets
    assert [target for target in targets if not (ROOT / target.partition("#")[0]).is_file()] == []
