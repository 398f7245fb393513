"""What the tests of the sphere hierarchy's experiments share: each experiment at a size of a few pixels."""

from __future__ import annotations

import json
from functools import cache

from refsim.experiments import experiments_of
from refsim.experiments.registry import Case

SIZE = 16
# Bodies of the library stand for the paper's meshes here, so that nothing depends on what is at hand
MADE = {"suzanne": "torus_knot_256", "bunny": "torus_knot_1024"}
SMALL = {"directions": 1_000, "size_px": SIZE, "cameras": 2}


def tiny_cases(name: str) -> list[Case]:
    """Fewer of the quick cases, smaller; a mesh that is left as it is reads `missing`."""
    cases = [{**case, **{key: SMALL[key] for key in SMALL if key in case}} for case in experiments_of("bsh")[name].cases(True)]
    if name in ("bsh-figure-4", "bsh-table-2", "bsh-table-3"):
        return [{**case, "mesh": "made" if case["published_scene"] == "Cubes" else "missing"} for case in cases]
    if name == "bsh-table-1":
        return [{**case, "mesh": "made"} for case in cases if case["culling"] != "sextant_same"]
    key = "scene" if name == "bsh-histogram" else "name"
    if name == "bsh-growth":
        return [case for case in cases if case["family"] != "blob" and case["mesh"] == "made"][:6] + [
            {**cases[-1], "mesh": "missing"}
        ]
    if cases and key in cases[0] and name != "bsh-figure-2":
        first = cases[0][key]
        made = [{**case, key: MADE.get(first, first), "mesh": "made"} for case in cases if case[key] == first]
        other = next(case for case in cases if case[key] != first)
        return [*made, {**other, "mesh": "missing"}]
    return cases


@cache
def rows_of(name: str) -> list[dict]:
    """All rows of the tiny experiment, as the journal gives them back; measured once."""
    experiment = experiments_of("bsh")[name]
    return json.loads(json.dumps([row for case in tiny_cases(name) for row in experiment.measure(**case)]))
