"""Shader runs on pixels without a ray, which the stencil test of section 5 is there to avoid.

The Hierarchical Ray Engine, section 5: "for pixels where there is no ray to trace, the pixel shader is not invoked at
all". A small measurement of its own, as the counters of the figures do not say on which pixels the shader ran.
"""

from __future__ import annotations

from refsim.experiments.registry import Case, Rows
from refsim.experiments.runs import HIERARCHICAL, run

SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
POLICIES = ("ideal", "mesa")
FILL = 0.55
# The stencil has 8 bits: pass 0 writes one untested, passes 1 to 7 test the one of the pass before
GENERATIONS = 8


def cases(quick: bool) -> list[Case]:
    """A case a scene and policy."""
    frame = {"size_px": 64 if quick else 128, "tile_px": 8, "fill": FILL, "generations": GENERATIONS}
    return [{"scene": scene, **frame, "early_tests": policy} for scene in SCENES for policy in POLICIES]


def measure(
    scene: str, size_px: int, tile_px: int, fill: float, generations: int, early_tests: str, backend: str = "numba"
) -> Rows:
    """One row: pixels without a ray and shader runs on them, summed over the generations behind the eye rays."""
    found = run(
        HIERARCHICAL, scene, size_px, fill,
        generations=generations, tile_size=tile_px, early_tests=early_tests, backend=backend,
    )  # fmt: skip
    later = found.generations[1:]
    return [
        {
            "scene": scene,
            "triangles": len(found.scene.triangles),
            "size_px": size_px,
            "tile_px": tile_px,
            "fill": fill,
            "last_generation": len(later),
            "early_tests": early_tests,
            "pixels_without_ray": sum(int((~passed.alive).sum()) for passed in later),
            "shader_runs": sum(int(passed.per_ray["triangle_tests"].sum()) for passed in later),
            "shader_runs_without_ray": sum(
                int(passed.per_ray["triangle_tests"][~passed.alive].sum()) for passed in later
            ),
        }
    ]
