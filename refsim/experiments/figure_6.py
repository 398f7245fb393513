"""Figure 6: "images rendered using the hierarchical algorithm at 512×512 resolution" (The Hierarchical Ray Engine)."""

from __future__ import annotations

from refsim.experiments.gallery import gallery_cases, measure, plot
from refsim.experiments.registry import Case, Experiment

FULL = {"torus_knot_9600": 0.75, "blob_9600": 0.75, "bunny_closed": 0.76}
QUICK = {"torus_knot_1024": 0.75, "blob_1000": 0.75}


def cases(quick: bool) -> list[Case]:
    """512², or 192² of coarser bodies."""
    return gallery_cases(QUICK, 192) if quick else gallery_cases(FULL, 512)


EXPERIMENT = Experiment(
    "figure-6",
    "Images rendered with the hierarchical algorithm at 512 × 512",
    "Glass of index 1.5, interpolated normals, 8 generations, tiles of 16 × 16 pixels.",
    cases,
    measure,
    plot,
    dpi=200,
    alt="Three glass bodies over a checkered floor, larger: torus knot, blob and, where it is at hand, the Stanford "
    "Bunny, each with its ray-triangle tests and the fraction of the Ray Engine's.",
)
