"""Plan: what docs/sphere-hierarchies.md says is what the code does; the page is read, not repeated.

- Its code blocks run as one program; what they compare agrees, and what the text says of it holds.
- Options, errata, escape indices and culling rules are all of them, with their defaults and sentences.
- Counters exist; links lead to files; the room's own list of where the paper's parts are names what exists.
"""

from __future__ import annotations

import csv
import importlib
import pkgutil
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import refsim.papers.sphere_hierarchy as room
from refsim.counters import REGISTRY
from refsim.list_method import LIST
from refsim.papers.sphere_hierarchy.culling import RULES, SAFE
from refsim.papers.sphere_hierarchy.errata import NAMES
from refsim.results import Generation

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "sphere-hierarchies.md").read_text(encoding="utf-8")


def rows(*heads: str) -> list[list[str]]:
    """The rows, as cells, of the one table with these column heads."""
    found = []
    for lines in re.findall(r"(?:^\|.*\|\n)+", PAGE, re.MULTILINE):
        split = [re.split(r"(?<!\\)\|", line.strip()[1:-1]) for line in lines.splitlines()]
        cells = [[cell.strip() for cell in line] for line in split]
        if cells[0] == list(heads):
            found.append(cells[2:])
    (table,) = found
    return table


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The names that the page's code blocks define, run in order from a file."""
    text = "\n".join(re.findall(r"^```python[^\n]*\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
    script = tmp_path_factory.mktemp("page") / "page.py"
    script.write_text(text, encoding="utf-8")
    names: dict[str, Any] = {"__name__": "page"}
    exec(compile(text, str(script), "exec", dont_inherit=True), names)
    return names


def test_the_program_runs(ran: dict[str, Any]) -> None:
    trace, drawn = ran["trace"], ran["drawn"]
    assert trace.counters["rays.shadow"] > 500 and ran["image"].rgb.any()
    # In the shader and in the bare loop: same hits, same nodes; the picture is of the same trace
    assert np.array_equal(drawn.hits.t, trace.hits.t) and np.array_equal(drawn.hits.triangle, trace.hits.triangle)
    assert drawn.counters["traversal.nodes"] == trace.generations[0].counters["traversal.nodes"]
    assert np.array_equal(ran["image"].trace.hits.triangle, trace.hits.triangle)
    # What moved hits elsewhere; the glass ball loses every second hit as printed
    assert not np.array_equal(ran["again"].hits.t, trace.hits.t)
    costs = ran["costs"]
    assert costs["16"][0] < costs[""][0] and costs["16"][1] == costs[""][1]
    assert costs["regular, climb"][1] < costs[""][1] < costs["regular"][1] < costs["simple"][1]
    assert ran["differ"]["sextant_opposite"] > ran["differ"]["sextant_same"] > 0
    assert ran["differ"]["sextant_safe"] == ran["differ"]["octant"] == 0
    assert ran["errata"] == "BSH-E9" and (ran["run"].generations[1].hits.triangle < 0).all()


def test_options_are_all_there() -> None:
    said = rows("option", "default", "what it is")
    assert [(name.strip("`"), default.strip("`"), sentence) for name, default, sentence in said] == [
        (option.name, repr(option.default), option.sentence) for option in LIST
    ]


def test_errata_and_rules_are_all_there() -> None:
    errata = [row[0].strip("`") for row in rows("erratum", "as printed", "what is right, or open")]
    assert errata == [f"BSH-E{number}" for number in range(1, len(errata) + 1)]
    # All that the ledger knows; those that can be switched on are named before the table
    ledger = tomllib.loads((ROOT / "refsim" / "experiments" / "claims" / "bsh.toml").read_text(encoding="utf-8"))
    assert set(errata) >= {claim["erratum"] for claim in ledger["claim"] if "erratum" in claim}
    assert set(re.findall(r"BSH-E\d+|\bE9\b", PAGE.partition("`errata=\"as_printed\"`")[2].partition("\n\n")[0])) == {
        NAMES[0], *(name.removeprefix("BSH-") for name in NAMES[1:])
    }  # fmt: skip
    rules = rows("`culling`", "leaves out", "lists", "safe")
    assert tuple(row[0].strip("`") for row in rules) == RULES
    assert tuple(row[0].strip("`") for row in rules if row[3].startswith("yes")) == SAFE


def test_escape_indices_mean_what_is_said(ran: dict[str, Any]) -> None:
    lists, tree = ran["lists"], ran["tree"]
    part = slice(lists.first[2], lists.first[3])
    escape, payload = lists.escape[part], lists.payload[part]
    assert [row[0].strip("`") for row in rows("escape index", "the element is", "payload")] == [
        "above 1", "-1", "1", "0",
    ]  # fmt: skip
    triangle = (escape == 1) | (escape == 0)
    assert sorted(payload[triangle, 3]) == list(range(len(ran["scene"]))) and escape[-1] == 0
    assert (~triangle).sum() == len(tree) and (escape[~triangle] > 1).any() and escape[0] == -1


def test_counters_exist() -> None:
    named = [name for row in rows("counter", "counts") for name in re.findall(r"`([a-z_.]+)`", row[0])]
    assert set(named) <= set(REGISTRY) and len(set(named)) == len(named) == 7
    assert set(re.findall(r"generation\.(\w+)", PAGE)) <= set(Generation.__dataclass_fields__)


def test_the_threshold_named_is_within_a_percent_of_the_best() -> None:
    """Of the committed table: on each of its meshes."""
    assert "with 0.5 rays\nvisit fewest, or hardly more, on every mesh we tried" in PAGE
    nodes: dict[str, dict[str, float]] = {}
    with (ROOT / "figures" / "bsh-threshold.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            nodes.setdefault(row["scene"], {})[row["threshold"]] = float(row["nodes_per_ray"] or "nan")
    assert len(nodes) > 2
    for scene, found in nodes.items():
        assert found["0.5"] <= 1.01 * min(found.values()), scene


def test_links_lead_to_files() -> None:
    targets = [target for target in re.findall(r"\]\(([^)#]+)\)", PAGE) if "://" not in target]
    assert [target for target in targets if not (ROOT / "docs" / target).is_file()] == []


def test_the_room_names_what_exists() -> None:
    assert room.__doc__ is not None
    modules = {info.name for info in pkgutil.iter_modules(room.__path__)}
    for text in (room.__doc__.partition("Symbols")[0], PAGE):
        named = re.findall(r"`(\w+)((?:\.\w+)*)`", text)
        inside = [(first, rest) for first, rest in named if first in modules and first + rest not in REGISTRY]
        assert len(inside) >= 7
        for first, rest in inside:
            value: Any = importlib.import_module(f"{room.__name__}.{first}")
            for part in rest.split(".")[1:]:
                value = getattr(value, part)
    known = modules | {"refsim"}
    named = re.findall(r"`(\w+)(?:\.\w+)*`", room.__doc__.partition("Symbols")[0])
    assert len(named) > 25 and [first for first in named if first not in known] == []
