"""Plan: what CONTRIBUTING.md and SECURITY.md point to is there.

- Links and paths in backticks lead to files; commands and their options exist; extras are the project's.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from refsim.cli import commands

ROOT = Path(__file__).resolve().parents[2]
GUIDES = ("CONTRIBUTING.md", "SECURITY.md")
ROOMS = ("refsim/", "tests/", "docs/", "benchmarks/", "figures/")
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]


@pytest.mark.parametrize("guide", GUIDES)
def test_paths_lead_somewhere(guide: str) -> None:
    text = (ROOT / guide).read_text(encoding="utf-8")
    named = {target for target in re.findall(r"\]\(([^)]+)\)", text) if "://" not in target}
    words = re.findall(r"`([\w./-]+)`", text)
    named |= {word for word in words if word.startswith(ROOMS) or word.endswith((".md", ".sh"))}
    assert named
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("guide", GUIDES)
def test_commands_exist(guide: str) -> None:
    text = (ROOT / guide).read_text(encoding="utf-8")
    named = re.findall(r"(?:`|\.venv/bin/)refsim ((?!-)[\w -]+)", text)
    assert named
    for words in named:
        command = commands.commands[words.split()[0]]
        options = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in words.split() if word.startswith("--")} <= options, words


def test_extras_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\.\[(\w+)\]", text)) == {"dev"} <= set(EXTRAS)
    assert {"refsim[test]"} == set(EXTRAS["dev"])
    assert "refsim[docs]" in EXTRAS["test"]
    assert set(EXTRAS["fetch"]) <= set(EXTRAS["test"])
