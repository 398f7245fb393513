"""What the tests of the geometry-shader paper's experiments share: each experiment at a size of a few pixels.

The pipeline runs here, as layers, occupancy and emission orders are the pipeline's own; the views share one compiled
pipeline where they can.
"""

from __future__ import annotations

import json
from functools import cache

from refsim.experiments import experiments_of
from refsim.experiments.registry import Case

SIZE = 24


def tiny_cases(name: str) -> list[Case]:
    """The quick cases, smaller, and fewer where many say the same."""
    cases = [{**case, "size_px": SIZE} for case in experiments_of("gsr")[name].cases(True)]
    if name == "gsr-figure-1":
        return [{**case, "view": "knot", "mesh": "made"} if case["panel"] == "a" else
                {**case, "mesh": "missing"} if case["panel"] == "b" else case for case in cases]  # fmt: skip
    if name == "gsr-table-1":
        return [{**case, "size_px": 16} for case in cases if case.get("frame", 0) in (0, 66)]
    if name == "gsr-table-3":
        known = [case for case in cases if case["published_scene"] in ("Cornell Box", "Cornell Knot")]
        return [*known, {**known[0], "published_scene": "Horse", "view": "horse", "mesh": "missing"}]
    if name == "gsr-moving-light":
        return [{**case, "steps": 5} for case in cases]
    return cases


@cache
def rows_of(name: str) -> list[dict]:
    """All rows of the tiny experiment, as the journal gives them back; measured once."""
    experiment = experiments_of("gsr")[name]
    return json.loads(json.dumps([row for case in tiny_cases(name) for row in experiment.measure(**case)]))
