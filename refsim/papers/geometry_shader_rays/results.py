"""Between the tracer's buffers and the public result: rays and hits of each pass, their kinds and parents, counts.

A pass's rays are copied from the vertex buffer that it drew, before the next pass captures over it; what they hit is
what the vertex shader noted. Rows keep the buffer's order.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from refsim.counters import GEOMETRY_IN, GEOMETRY_OUT, ConservationError, Counters
from refsim.papers.geometry_shader_rays import record
from refsim.papers.geometry_shader_rays.pass_costs import PassCosts
from refsim.papers.geometry_shader_rays.shaders import Found
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer
from refsim.pipeline.resources import VertexBuffer
from refsim.results import Generation, Occupancy, RayKind, Trace, summed_per_ray
from refsim.scene.rays import Hits, Rays

KINDS = {kind: kind.name.lower() for kind in RayKind}
Columns = NDArray[np.float32]


class Recorder:
    """Gathers a generation a pass; give `after_pass` to `GeometryShaderTracer.draw_passes`."""

    def __init__(self, tracer: GeometryShaderTracer, eye: Rays) -> None:
        self._tracer, self._eye = tracer, eye
        self._lights, self._branching = len(tracer.options.lights), tracer.prepared.branching
        self._parent = np.full(len(eye), -1, np.int32)
        self._costs = PassCosts(tracer)
        self.generations: list[Generation] = []

    def after_pass(self, k: int, source: VertexBuffer, target: VertexBuffer, found: Found, counters: Counters) -> None:
        """Copies what pass k shot and found, and sets down whose child each captured ray is."""
        drawn = source.floats[:, : source.rows]
        shot = drawn[record.STATE] <= record.TO_BE_SHOT
        rows = np.arange(source.rows) if k == 0 else np.flatnonzero(shot)
        everything = len(rows) == source.rows
        columns = drawn.copy() if everything else drawn[:, rows]
        counts = found.counts[: source.rows] if everything else found.counts[rows]
        hits = found.hits[: source.rows] if everything else found.hits[rows]
        generation = self._generation(k, columns, shot[rows], hits, counts, found, counters)
        generation = replace(generation, slot=rows.astype(np.int32))
        if self._tracer.pipeline.stream_output:
            captured = target.floats[:, : target.rows]
            self._count_kinds(drawn, columns, shot, captured, counters)
            self._parent = self._parents(generation, columns, captured)
        self._costs.add(k, generation, counters)
        counters.check()
        self.generations.append(generation)

    def _generation(
        self, k: int, columns: Columns, alive: NDArray[np.bool_], hits: Columns, counts: NDArray[np.int32],
        found: Found, counters: Counters,
    ) -> Generation:  # fmt: skip
        """The rays of a pass as rows; completes its counters."""
        types = columns[record.TYPE]
        kind = record.kinds_of(types, self._branching)
        rays = self._rays(k, columns, found)
        triangle = np.where(alive, counts[:, 0], -1).astype(np.int32)
        missed = triangle < 0
        t, u, v = (np.where(missed, fill, hits[:, c]).astype(np.float32) for c, fill in enumerate((np.inf, 0, 0)))
        per_ray = {
            name: np.where(alive, counts[:, c], 0).astype(np.int32)
            for name, c in (("cells", 1), ("triangle_tests", 2), ("box_rejections", 3))
        }
        counters.add("intersection.triangle_tests", int(per_ray["triangle_tests"].sum(dtype=np.int64)))
        counters.add("traversal.cells", int(per_ray["cells"].sum(dtype=np.int64)))
        counters.add("traversal.box_rejections", int(per_ray["box_rejections"].sum(dtype=np.int64)))
        for number, name in KINDS.items():
            counters.add(f"rays.{name}", int((alive & (kind == number)).sum()))
        target = self._tracer.buffers[1 - k % 2]
        shadow = kind == RayKind.SHADOW
        light = np.where(shadow, (types.astype(np.int64) - 1) % max(self._lights, 1), -1)
        return Generation(
            rays, Hits(triangle, t, u, v), alive, kind, self._pixels(columns), self._parent, per_ray, counters,
            node=record.nodes_of(types, self._lights).astype(np.int32), light=light.astype(np.int32),
            weight=columns[record.WEIGHT].copy(),
            occupancy=Occupancy(target.rows, self._tracer.capacity, record.RECORD_BYTES), parent_generation=k - 1,
        )  # fmt: skip

    def _rays(self, k: int, columns: Columns, found: Found) -> Rays:
        if k == 0 and len(found.made):
            made = found.made[: columns.shape[1]].copy()
            t_max = np.where(self._eye.t_max > 0, np.inf, 0).astype(np.float32)
            return Rays.unchecked(made[:, :3], made[:, 3:], t_max, self._eye.width, self._eye.height)
        if k == 0:
            return self._eye
        origin, direction = columns[record.ORIGIN : record.T], columns[record.DIRECTION : record.INDEX]
        rows = [np.ascontiguousarray(part.T) for part in (origin, direction)]
        return Rays.unchecked(rows[0], rows[1], columns[record.T].copy(), None, None)

    def _pixels(self, columns: Columns) -> NDArray[np.int32]:
        """The pixel whose centre the point is at."""
        x = np.rint((columns[record.X] + 1) * np.float32(0.5 * self._tracer.width) - np.float32(0.5))
        y = np.rint((1 - columns[record.Y]) * np.float32(0.5 * self._tracer.height) - np.float32(0.5))
        return y.astype(np.int32) * np.int32(self._tracer.width) + x.astype(np.int32)

    def _count_kinds(
        self, drawn: Columns, columns: Columns, shot: NDArray[np.bool_], captured: Columns, counters: Counters
    ) -> None:
        """Primitives into and out of the geometry shader by kind; they must add up to the stage's own counts."""
        counters.add("geometry.in_finished", int((~shot).sum()))
        kind = record.kinds_of(drawn[record.TYPE, shot], self._branching)
        out = record.kinds_of(captured[record.TYPE], self._branching)
        passed = _passed(captured)
        for number, name in KINDS.items():
            counters.add(f"geometry.in_{name}", int((kind == number).sum()))
            counters.add(f"geometry.passed_{name}", int((passed & (out == number)).sum()))
            if number != RayKind.EYE:
                counters.add(f"geometry.spawned_{name}", int((~passed & (out == number)).sum()))
        for total, parts in (("geometry.invocations", GEOMETRY_IN), ("geometry.primitives_out", GEOMETRY_OUT)):
            if counters[total] != sum(counters[part] for part in parts):
                raise ConservationError(f"{total} is {counters[total]}; by kind they are others: {dict(counters)}.")

    def _parents(self, generation: Generation, columns: Columns, captured: Columns) -> NDArray[np.int32]:
        """Row of this pass that each ray to be shot in the next one comes from.

        What one invocation emits lies together, the ray passed on first (or last, where the order is reversed); so
        the rays passed on tell the groups apart.
        """
        tracer, passed = self._tracer, _passed(captured)
        goes_on = generation.hits.triangle >= 0
        printed = tracer.setting.printed
        if any(np.float32(part) for part in tracer.options.background) and not printed.E2 and not printed.E3:
            missed = generation.alive & ~goes_on & (columns[record.TYPE] < 0)
            goes_on = goes_on | missed
        parents = np.flatnonzero(goes_on).astype(np.int32)
        if len(parents) != int(passed.sum()):
            raise ConservationError(f"{len(parents)} rays were to be passed on, {int(passed.sum())} were.")
        group = np.cumsum(passed) - (passed if tracer.setting.emission_order == "reversed" else 1)
        shot = captured[record.STATE] <= record.TO_BE_SHOT
        return parents[group[shot]]


def _passed(captured: Columns) -> NDArray[np.bool_]:
    """Captured rays that were passed on, as against those emitted anew."""
    return (captured[record.STATE] == record.SHADED) | (captured[record.INDEX] >= 0)


def trace_of(tracer: GeometryShaderTracer, eye: Rays) -> Trace:
    """Draws all passes and puts the result together."""
    scene, counters, recorder = tracer.prepared.scene, Counters(), Recorder(tracer, eye)
    image = tracer.draw_passes(eye, counters, recorder.after_pass)
    generations = recorder.generations
    counters = _completed(counters, generations)
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    counters.check()
    rgb = np.ascontiguousarray(np.moveaxis(image[:3], 0, 2))
    per_ray = summed_per_ray(generations, len(eye))
    return Trace("geometry_shader", scene, {}, tuple(generations), counters, per_ray, rgb)


def _completed(drawn: Counters, generations: list[Generation]) -> Counters:
    """All draws, and what the passes counted beside them."""
    names = {name for generation in generations for name in generation.counters} - set(drawn)
    counters = Counters()
    counters.merge(drawn)
    for generation in generations:
        counters.merge({name: count for name, count in generation.counters.items() if name in names})
    return counters
