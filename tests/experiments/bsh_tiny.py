"""What the tests of the sphere hierarchy's experiments share: each experiment at a size of a few pixels.

Bodies of the library stand for the paper's meshes here, so nothing depends on what is at hand; one line of each
experiment is made to read `missing`.
"""

from __future__ import annotations

import json
from functools import cache
from unittest import mock

from refsim.experiments import bsh_table_1, experiments_of
from refsim.experiments.registry import Case

SMALL = {"directions": 1_000, "size_px": 16, "cameras": 2}
BODY = "torus_knot_258"


def tiny_cases(name: str) -> list[Case]:
    """Fewer of the quick cases, smaller."""
    given = experiments_of("bsh")[name].cases(True)
    cases = [{**case, **{key: SMALL[key] for key in SMALL if key in case}} for case in given]
    if name == "bsh-table-1":
        return [{**case, "mesh": "made"} for case in cases if case["culling"] != "sextant_same"]
    if name == "bsh-growth":
        made = [case for case in cases if case["family"] == "sphere"][:3]
        return [*made, {**cases[-1], "mesh": "missing"}]
    if cases and "published_scene" in cases[0]:
        return [{**case, "mesh": "made" if case["published_scene"] == "Cubes" else "missing"} for case in cases]
    key = "scene" if name == "bsh-histogram" else "name"
    if not cases or key not in cases[0]:
        return cases
    # The last scene, as that is the one whose picture is drawn
    first, last = cases[0], cases[-1]
    made = [{**case, key: BODY, "mesh": "made"} for case in cases if case[key] == last[key]]
    return [{**first, "mesh": "missing"}, *made]


@cache
def rows_of(name: str) -> list[dict]:
    """All rows of the tiny experiment, as the journal gives them back; measured once."""
    experiment = experiments_of("bsh")[name]
    with mock.patch.object(bsh_table_1, "SCENE", BODY):
        return json.loads(json.dumps([row for case in tiny_cases(name) for row in experiment.measure(**case)]))
