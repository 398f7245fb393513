"""Pictures of glass bodies by the hierarchical algorithm, with the counters of each: figures 5 and 6 share this."""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.pictures import picture, srgb
from refsim.experiments.registry import Case, Rows
from refsim.experiments.runs import MISSING, RAY_ENGINE, counts, hits_percent, mesh_state, run
from refsim.results import Trace

CREDIT = {
    "dragon_res4": "Stanford Dragon, res4",
    "bunny_closed": "Stanford Bunny, closed",
}


def gallery_cases(scenes: dict[str, float], size: int) -> list[Case]:
    """A case a scene; `scenes` maps names to the fill of the camera."""
    return [
        {"scene": scene, "mesh": mesh_state(scene), "size_px": size, "tile_px": 16, "fill": fill, "generations": 8}
        for scene, fill in scenes.items()
    ]


def measure(
    scene: str, mesh: str, size_px: int, tile_px: int, fill: float, generations: int, backend: str = "numba"
) -> Rows:
    """One row: what the pipeline did for the picture. A real mesh that is not at hand reads `missing`."""
    head = {"scene": scene, "size_px": size_px, "tile_px": tile_px, "fill": fill, "generations": generations}
    if mesh == MISSING:
        return [{**head, "triangles": MISSING}]
    image = picture(scene, size_px, size_px, fill, generations, "smooth", tile_px, backend)
    c = image.trace.counters
    number = len(image.trace.scene.triangles)
    exhaustive = size_px * size_px * number * generations
    return [
        {
            **head,
            "triangles": number,
            "backend": backend,
            "eye_rays_that_hit_percent": hits_percent(image.trace)[0],
            "reflected_rays": c["rays.reflected"],
            "refracted_rays": c["rays.refracted"],
            **counts(image.trace),
            "rays_with_other_hits": _other_hits(image.trace, scene, size_px, fill, generations, backend),
            "ray_engine_triangle_tests": exhaustive,
            "tests_ratio": round(exhaustive / c["intersection.triangle_tests"], 2),
        }
    ]


def _other_hits(found: Trace, scene: str, size_px: int, fill: float, generations: int, backend: str) -> int:
    """Rays of all generations whose hit is, in any bit, not that of the Ray Engine with its stencil."""
    options: dict[str, Any] = {"generations": generations, "shading": "smooth", "backend": backend}
    judge = run(RAY_ENGINE, scene, size_px, fill, stencil=True, **options)
    return sum(
        int(((a.hits.triangle != b.hits.triangle) | (a.hits.t.view(np.uint32) != b.hits.t.view(np.uint32))).sum())
        for a, b in zip(found.generations, judge.generations, strict=True)
    )


def plot(rows: Rows) -> Any:
    """The pictures side by side; a missing mesh leaves its place empty and says so."""
    figure = style.new_figure(style.WIDTH / len(rows) + 0.75)
    for axes, row in zip(figure.subplots(1, len(rows), squeeze=False)[0], rows, strict=True):
        style.no_frame(axes)
        name = CREDIT.get(row["scene"], style.body_name(row["scene"]))
        if row["triangles"] == MISSING:
            axes.text(0.5, 0.5, f"{name}:\nmissing", ha="center", va="center", color=style.FAINT)
            continue
        options = row["generations"], "smooth", row["tile_px"], row["backend"]
        image = picture(row["scene"], row["size_px"], row["size_px"], row["fill"], *options)
        axes.imshow(srgb(image), interpolation="lanczos")
        axes.set_title(f"{name}\n{row['triangles']:,} triangles")
        tests = f"{row['triangle_tests'] / 1e6:,.0f} M ray–triangle tests"
        axes.set_xlabel(f"{tests},\n1/{row['tests_ratio']:.1f} of the Ray Engine's", fontsize=8)
    return figure
