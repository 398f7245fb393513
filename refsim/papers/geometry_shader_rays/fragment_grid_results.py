"""Between the fragment shader's targets and the public result: a generation a pass that shoots rays, rows are pixels.

The targets are copied after each pass, before the next one draws over them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.counters import COSTS, Counters
from refsim.papers.geometry_shader_rays.fragment_grid import FragmentGridTracer, Shooting
from refsim.papers.geometry_shader_rays.fragment_grid_costs import QuadCosts
from refsim.pipeline.resources import Framebuffer
from refsim.results import Generation, RayKind, Trace, summed_per_ray
from refsim.scene.rays import Hits, Rays

COUNTS = ("cells", "triangle_tests", "box_rejections")
COUNTERS = ("traversal.cells", "intersection.triangle_tests", "traversal.box_rejections")


class PassRecorder:
    """Gathers a generation a pass; give `after_pass` to `FragmentGridTracer.draw_passes`."""

    def __init__(self, eye: Rays) -> None:
        self._eye = eye
        self._pixel = np.arange(len(eye), dtype=np.int32)
        self._surfaces: dict[int, int] = {}  # of each node, the generation of its surface rays
        self.generations: list[Generation] = []

    def after_pass(self, shooting: Shooting, target: Framebuffer, counters: Counters) -> None:
        """Copies what the pass shot and found; completes its counters."""
        count = len(self._eye)
        origin, direction, hit = (_columns(target, name, count) for name in ("origin", "direction", "hit"))
        alive = origin[3] > 0
        numbers = _columns(target, "counts", count).copy()
        for name, column in zip(COUNTERS, numbers, strict=True):
            counters.add(name, int(column.sum(dtype=np.int64)))
        counters.add(f"rays.{shooting.kind.name.lower()}", int(alive.sum()))
        counters.check()
        sent = shooting.sender >= 0
        if shooting.kind != RayKind.SHADOW:
            self._surfaces[shooting.node] = len(self.generations)
        generation = Generation(
            self._rays(origin, direction) if sent else self._eye,
            _hits(hit),
            alive,
            np.full(count, shooting.kind, np.int32),
            self._pixel,
            np.where(alive & sent, self._pixel, -1).astype(np.int32),
            dict(zip(COUNTS, numbers, strict=True)),
            counters,
            node=np.full(count, shooting.node, np.int32),
            light=np.full(count, shooting.light, np.int32),
            weight=direction[3].copy(),
            parent_generation=self._surfaces[shooting.sender] if sent else -1,
        )
        self.generations.append(generation)

    def _rays(self, origin: NDArray[np.float32], direction: NDArray[np.float32]) -> Rays:
        # Copies, as the target is drawn again; of one pixel the transpose would be a view
        rows = [np.array(part[:3].T, order="C") for part in (origin, direction)]
        rows[1][~(origin[3] > 0)] = 0  # a shadow ray that ends where it starts has no direction
        return Rays.unchecked(rows[0], rows[1], origin[3].copy(), self._eye.width, self._eye.height)


def _columns(target: Framebuffer, name: str, count: int) -> np.ndarray:
    """The planes of a target as columns [k, count]: a view."""
    planes = target.color(name)
    return planes.reshape(len(planes), -1)[:, :count]


def _hits(hit: NDArray[np.float32]) -> Hits:
    triangle = hit[3].astype(np.int32)
    t = np.where(triangle < 0, np.float32(np.inf), hit[0])
    return Hits(triangle, t, hit[1].copy(), hit[2].copy())


def trace_of(tracer: FragmentGridTracer, eye: Rays) -> Trace:
    """Draws all passes and puts the result together."""
    scene, counters, recorder = tracer.prepared.scene, Counters(), PassRecorder(eye)
    image = tracer.draw_passes(eye, counters, recorder.after_pass)
    generations = recorder.generations
    QuadCosts(tracer).add(generations)
    for generation in generations:  # the draws have been counted, what rays found has not
        counters.merge({name: n for name, n in generation.counters.items() if name.startswith(FOUND) or name in COSTS})
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    counters.check()
    rgb = np.ascontiguousarray(np.moveaxis(image[:3], 0, 2))
    return Trace("fragment_grid", scene, {}, tuple(generations), counters, summed_per_ray(generations, len(eye)), rgb)


FOUND = ("rays.", "traversal.", "intersection.")
