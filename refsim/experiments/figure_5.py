"""Figure 5: "images rendered using the hierarchical algorithm at 256×256 resolution" (The Hierarchical Ray Engine)."""

from __future__ import annotations

from refsim.experiments.gallery import gallery_cases, measure, plot
from refsim.experiments.registry import Case, Experiment

FULL = {"torus_knot_5000": 0.75, "blob_5000": 0.75, "sphere_5000": 0.75, "dragon_res4": 0.72}
QUICK = {"torus_knot_1024": 0.75, "blob_1000": 0.75, "sphere_896": 0.75, "dragon_res4": 0.72}


def cases(quick: bool) -> list[Case]:
    """256², or 96² of coarser bodies."""
    return gallery_cases(QUICK, 96) if quick else gallery_cases(FULL, 256)


EXPERIMENT = Experiment(
    "figure-5",
    "Images rendered with the hierarchical algorithm at 256 × 256",
    "Glass of index 1.5, interpolated normals, 8 generations, tiles of 16 × 16 pixels.",
    cases,
    measure,
    plot,
    alt="Glass bodies over a checkered floor, side by side: torus knot, blob, sphere and, where it is at hand, the "
    "Stanford Dragon, each with its ray-triangle tests and the fraction of the Ray Engine's.",
)
