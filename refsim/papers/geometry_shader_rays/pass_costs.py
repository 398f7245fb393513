"""From the rays and counters of a pass to its events, and so to the counters of arithmetic and fetches (`costs`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.counters import Counters
from refsim.papers.geometry_shader_rays.costs import PassEvents, Setup, pass_work
from refsim.papers.geometry_shader_rays.operations import Uncountable
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer
from refsim.results import Generation, RayKind
from refsim.scene.mesh import Scene

SPAWNED = ("shadow", "reflected", "refracted")


def surfaces_of(scene: Scene) -> tuple[tuple[tuple[float, float], ...], NDArray[np.int64]]:
    """Kinds of surface as `costs.Setup` names them, and the number of each triangle's kind."""
    kinds = [(float(m.specular), float(round(m.shininess))) for m in scene.materials]
    surfaces = tuple(sorted(set(kinds)))
    numbers = np.array([surfaces.index(kind) for kind in kinds])
    return surfaces, numbers[scene.material_ids]


class PassCosts:
    """Adds what the shaders of each pass cost; nothing where the accelerator's source cannot be read."""

    def __init__(self, tracer: GeometryShaderTracer) -> None:
        options, setting, prepared = tracer.options, tracer.setting, tracer.prepared
        surfaces, self._surface = surfaces_of(prepared.scene)
        self._printed, self._passes = setting.printed, options.passes
        self._setup = Setup(
            prepared.accelerator.traverse,
            setting.stages,
            len(options.lights),
            int(options.smooth),
            int(setting.primary == "raster"),
            options.background,
            setting.printed,
            surfaces,
        )

    def add(self, k: int, generation: Generation, counters: Counters) -> None:
        """Completes the counters of pass k, which hold all else already."""
        try:
            work = pass_work(self._setup, k == 0, self._events(k, generation, counters))
        except Uncountable:
            return
        for shader, done in work.items():
            counters.add(f"{shader}.arithmetic", done.arithmetic)
            counters.add(f"{shader}.fetches", done.fetches)

    def _events(self, k: int, generation: Generation, counters: Counters) -> PassEvents:
        triangle, cells = generation.hits.triangle, generation.per_ray["cells"]
        hit, surface = triangle >= 0, generation.kind != RayKind.SHADOW
        shot, hits = int(generation.alive.sum()), int(hit.sum())
        surface_hits = hit & surface
        sends = surface_hits & (generation.kind == RayKind.EYE) if self._printed.E5 else surface_hits
        spawning = int(sends.sum()) if k < self._passes - 1 else 0
        passed = sum(counters[f"geometry.passed_{kind}"] for kind in ("eye", *SPAWNED))
        searched = shot
        if self._setup.rasterised and k == 0:  # the others hit the triangle that was drawn
            searched -= int((hit & (cells == 0) & (generation.per_ray["triangle_tests"] == 1)).sum())
        # GSR-E3 as printed: no ray ever is to be shaded
        ready = not (self._printed.E3 and self._setup.stages != "vertex_only")
        kinds = len(self._setup.surfaces)
        of_kind = np.bincount(self._surface[triangle[surface_hits]], minlength=kinds)
        return PassEvents(
            finished=counters["vertex.invocations"] - shot,
            shot=shot,
            walked=int((cells > 0).sum()),
            searched=searched,
            cells=counters["traversal.cells"],
            tests=counters["intersection.triangle_tests"],
            spawning=spawning,
            emitted={"passed": passed, **{kind: counters[f"geometry.spawned_{kind}"] for kind in SPAWNED}},
            fragments=counters["fragment.invocations"],
            shadows=hits - int(surface_hits.sum()) if ready else 0,
            missed=max(passed - hits, 0) if ready else 0,
            surfaces=of_kind if ready else np.zeros(kinds, np.int64),
        )
