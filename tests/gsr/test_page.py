"""Plan: what docs/geometry-shader-rays.md says is what the code does; the page is read, not repeated.

- Its code blocks run as one program, and what they compare agrees.
- Options, errata, states, the record's layout and counters are all of them, with their defaults and sentences.
- Names in code marks exist; links lead to files; the room's own list of where the paper's parts are names what exists.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import refsim.papers.geometry_shader_rays as room
from refsim.counters import REGISTRY
from refsim.methods import METHODS
from refsim.papers.geometry_shader_rays import record
from refsim.papers.geometry_shader_rays.errata import NAMES
from refsim.pipeline.vertex_buffer import record_type
from refsim.results import Generation, Trace
from refsim.tree_methods import GEOMETRY_SHADER, TREE

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "geometry-shader-rays.md").read_text(encoding="utf-8")


def rows(*heads: str) -> list[list[str]]:
    """The rows, as cells, of the one table with these column heads."""
    found = []
    for lines in re.findall(r"(?:^\|.*\|\n)+", PAGE, re.MULTILINE):
        cells = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines.splitlines()]
        if cells[0] == list(heads):
            found.append(cells[2:])
    (table,) = found
    return table


@cache
def program(folder: Path) -> dict[str, Any]:
    """The names that the page's code blocks define, run in order from a file."""
    text = "\n".join(re.findall(r"^```python[^\n]*\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
    script = folder / "page.py"
    script.write_text(text, encoding="utf-8")
    names: dict[str, Any] = {"__name__": "page"}
    exec(compile(text, str(script), "exec", dont_inherit=True), names)
    return names


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return program(tmp_path_factory.mktemp("page"))


def test_the_program_runs(ran: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    trace, own, previous = (ran[name] for name in ("trace", "own", "previous"))
    assert isinstance(trace, Trace) and trace.image is not None and trace.image.any()
    for other in (own, previous):
        assert np.array_equal(other.image, trace.image)
    # The structure of one's own counts, tests less than all, and its source is read
    shot = sum(own.counters[f"rays.{kind}"] for kind in ("eye", "shadow", "reflected", "refracted"))
    assert 0 < own.counters["intersection.triangle_tests"] < shot * len(own.scene)
    assert own.counters["vertex.arithmetic"] > own.counters["intersection.triangle_tests"] * 40
    assert own.counters["traversal.cells"] > 0 and trace.counters["rays.refracted"] > 0
    apart = ran["apart"]
    assert apart["together"].issued == apart["vertex"].issued + apart["geometry"].issued
    assert ran["shares"](trace.counters)["vertex"] > 50.0
    assert ran["wrong"].pop(0.25) == 0 and all(count > 500 for count in ran["wrong"].values())


def test_options_are_all_there() -> None:
    said = rows("option", "default", "what it is")
    assert [(cell.strip("`"), default.strip("`"), sentence) for cell, default, sentence in said] == [
        (option.name, repr(option.default), option.sentence) for option in (*TREE, *GEOMETRY_SHADER)
    ]
    shared = {option.name for option in METHODS["fragment_grid"].options}
    last_five = {option.name for option in GEOMETRY_SHADER}
    assert {option.name for option in TREE} <= shared and len(last_five) == 5 and not shared & last_five


def test_errata_are_all_there() -> None:
    assert tuple(row[0].strip("`") for row in rows("erratum", "as printed", "corrected", "where it matters")) == NAMES


def test_the_record_is_laid_out_as_said() -> None:
    kind = record_type(record.PackedHit)
    said = [(row[0].strip("`"), int(row[2])) for row in rows("field", "type", "offset", "holds")]
    assert said == [(name, kind.fields[name][1]) for name in kind.names] and kind.itemsize == record.RECORD_BYTES
    states = [row[0].strip("`") for row in rows("state", "the ray", "in this pass")]
    assert [getattr(record, name) for name in states] == [0, 1, 3]


def test_counters_exist() -> None:
    named = [name for row in rows("counter", "counts") for name in re.findall(r"`([a-z_.]+)`", row[0])]
    assert set(named) <= set(REGISTRY) and len(set(named)) == len(named)
    kinds = [name for name in REGISTRY if re.match(r"geometry\.(in|passed|spawned)_|.*\.(arithmetic|fetches)$", name)]
    assert set(kinds) <= set(named)
    assert set(re.findall(r"generation\.(\w+)", PAGE)) <= set(Generation.__dataclass_fields__)


def test_links_lead_to_files() -> None:
    targets = [target for target in re.findall(r"\]\(([^)#]+)\)", PAGE) if "://" not in target]
    assert [target for target in targets if not (ROOT / "docs" / target).is_file()] == []


def test_the_room_names_what_exists() -> None:
    assert room.__doc__ is not None
    modules = {info.name for info in pkgutil.iter_modules(room.__path__)}
    named = re.findall(r"`(\w+)((?:\.\w+)*)`", room.__doc__.partition("Symbols")[0])
    inside = [(first, rest) for first, rest in named if first in modules]
    assert len(inside) > 15
    for first, rest in inside:
        value: Any = importlib.import_module(f"{room.__name__}.{first}")
        for part in rest.split(".")[1:]:
            value = getattr(value, part)
    known = modules | {"Generation"}
    assert [first for first, _ in named if first not in known] == []
