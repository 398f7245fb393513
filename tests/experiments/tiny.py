"""What the tests of the experiments share: each experiment at a size at which the NumPy reference is quick.

The reference gives the pipeline's hits and counters (tests of the methods prove that), so nothing is compiled here but
by the tests that say so.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from refsim.experiments import (
    cover,
    dead_rays,
    errata,
    figure_4,
    figure_5,
    figure_6,
    figure_7,
    hre_claims,
    tightest_cone,
    tile_size,
)
from refsim.experiments.registry import Case, Experiment

SMALL = {"size_px": 24, "tile_px": 8, "backend": "numpy"}
RENDER = {**SMALL, "fill": 0.75, "generations": 3}


def tiny_cases(name: str) -> list[Case]:
    """A few cases of the experiment, the smallest that still make a picture."""
    if name == "figure-4":
        return [{**SMALL, "scene": scene, "fill": 0.55, "iterations": 4} for scene in ("torus_knot_100",)]
    if name in ("figure-5", "figure-6"):
        return [
            {**RENDER, "scene": "blob_100", "mesh": "made"},
            {**RENDER, "scene": "bunny_closed", "mesh": "missing"},
        ]
    if name == "cover":
        return [{**RENDER, "scene": "torus_knot_100", "samples": 2}]
    if name == "tile-size":
        case = {"scene": "blob_100", "size_px": 24, "fill": 0.55, "generations": 3, "backend": "numpy"}
        return [{**case, "tile_px": tile} for tile in (8, 16, 32)]
    if name == "tightest-cone":
        case = {"scene": "blob_100", "size_px": 24, "fill": 0.55}
        return [{**case, "tile_px": tile} for tile in (8, 16)]
    if name == "errata":
        case = {**SMALL, "scene": "blob_100", "fill": 0.55, "generations": 2}
        return [{**case, "errata": variant} for variant in ("corrected", "HRE-E1", "HRE-E4", "as_printed")]
    if name == "figure-7":
        sizes, bodies = (100, 200), {"torus_knot", "sphere"}
        cases = [case for case in figure_7.cases(True) if case["triangles"] == 100 and case["body"] in bodies]
        return [{**case, **SMALL, "generations": 3, "triangles": size} for size in sizes for case in cases]
    if name == "claims-hre":
        cases = [case for case in dead_rays.cases(True) if case["scene"] == "torus_knot_1024"]
        return [{**case, **SMALL, "scene": "torus_knot_100", "generations": 3} for case in cases]
    return []


TINY: dict[str, Experiment] = {
    module.EXPERIMENT.id: replace(
        module.EXPERIMENT, cases=lambda quick, name=module.EXPERIMENT.id: tiny_cases(name)
    )
    for module in (cover, figure_4, figure_5, figure_6, figure_7, tile_size, tightest_cone, errata, hre_claims)
}


@cache
def rows_of(name: str) -> list[dict]:
    """All rows of the tiny experiment, measured once."""
    experiment = TINY[name]
    return [row for case in experiment.cases(True) for row in experiment.measure(**case)]
