"""The method "geometry_shader" without a pipeline: `whitted`'s rays in the order of the vertex buffers (Recursive Ray
Tracing in Geometry Shader, sections 3 and 4.2: what a pass draws is what the one before captured), and the counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.reference.ray_trees import MOST_LIGHTS, Tree, cost_counts, costs_of, fragment_counts, trace_of, traced
from refsim.reference.searches import Found
from refsim.reference.whitted import Bundle, Shot
from refsim.results import Generation, Occupancy, RayKind, Trace
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays

RECORD_BYTES = 64
# Order of what a hit emits: s shadow rays, r the reflected, t the refracted (transmitted) ray
EMISSION_ORDERS = {"listed": "srt", "reflected_first": "rts", "reversed": "trs"}
LETTERS = {RayKind.SHADOW: "s", RayKind.REFLECTED: "r", RayKind.REFRACTED: "t"}


class Rows(NamedTuple):
    """Rays of one pass, a row each: columns of n, those of `results.Generation`, and what the search took."""

    kind: np.ndarray
    node: np.ndarray
    light: np.ndarray
    parent: np.ndarray
    pixel: np.ndarray
    origin: np.ndarray
    direction: np.ndarray
    t_max: np.ndarray
    weight: np.ndarray
    triangle: np.ndarray
    t: np.ndarray
    u: np.ndarray
    v: np.ndarray
    cells: np.ndarray
    tests: np.ndarray
    rejected: np.ndarray

    @property
    def found(self) -> Found:
        """What the rays hit."""
        return Found(*self[-len(Found._fields) :])

    @property
    def alive(self) -> np.ndarray:
        """bool[n]: eye rays may be dead."""
        return (self.kind != RayKind.EYE) | (self.t_max > 0)

    @classmethod
    def of(cls, shot: Shot, parent: np.ndarray) -> Rows:
        """A bundle's rays and what they hit."""
        rays, n = shot.rays, len(parent)
        kind, node, light = (np.full(n, value, np.int32) for value in (shot.kind, rays.node, rays.light))
        sender, pixel = parent.astype(np.int32), rays.pixel.astype(np.int32)
        return cls(kind, node, light, sender, pixel, *rays[3:], *shot.found)

    def numbers_of(self, node: int, pixels: np.ndarray) -> np.ndarray:
        """The rows of a node's surface rays at these pixels."""
        rows = np.flatnonzero((self.node == node) & (self.kind != RayKind.SHADOW))
        order = np.argsort(self.pixel[rows])
        return rows[order[np.searchsorted(self.pixel[rows], pixels, sorter=order)]]


def eye_rows(tree: Tree, rays: Rays) -> Rows:
    """Pass 0: a row a pixel, dead rays among them."""
    n = len(rays)
    pixel = np.arange(n)
    missed = Found.nothing(n)
    for shot in tree.shots(0):
        for column, new in zip(missed, shot.found, strict=True):
            column[shot.rays.pixel] = new
    eye = Bundle(0, -1, pixel, rays.origin, rays.direction, rays.t_max, np.ones(n, np.float32))
    return Rows.of(Shot(0, RayKind.EYE, eye, missed), np.full(n, -1))


def buffer_rows(tree: Tree, depth: int, before: Rows, order: str) -> Rows:
    """A later pass, in the order of its vertex buffer: by the ray that emitted it, then in the order of emission."""
    nothing = Rows(*(column[:0] for column in before))
    parts, slots = [nothing], [np.zeros(0, np.int64)]
    for shot in tree.shots(depth):
        node = shot.rays.node
        if shot.kind != RayKind.SHADOW:
            node = (node - 1) // tree.whitted.branching
        slot = EMISSION_ORDERS[order].index(LETTERS[shot.kind]) * MOST_LIGHTS + max(shot.rays.light, 0)
        parts.append(Rows.of(shot, before.numbers_of(node, shot.rays.pixel)))
        slots.append(np.full(len(shot.rays.pixel), slot))
    rows = Rows(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    sequence = np.lexsort((np.concatenate(slots), rows.parent))
    return Rows(*(column[sequence] for column in rows))


def geometry_shader(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    """Method "geometry_shader": a generation a pass, rows in the order of its vertex buffer."""
    tree = traced(scene, rays, options)
    emits = options["stages"] != "vertex_only"
    if not emits and tree.whitted.passes != 1:
        raise InputError("without a geometry shader no ray is spawned: stages='vertex_only' needs passes=1.")
    passes = [eye_rows(tree, rays)]
    for depth in range(1, tree.whitted.passes):
        passes.append(buffer_rows(tree, depth, passes[-1], options["emission_order"]))
    needed = tree.width * tree.height * sum(sorted(tree.most)[-2:])
    capacity = needed if options["capacity"] is None else options["capacity"]
    if capacity < tree.width * tree.height:
        raise InputError(f"capacity is {capacity}; the buffer drawn first holds {tree.width * tree.height} eye rays.")
    generations, drawn = [], Counters()
    finished = int((rays.t_max == 0).sum())
    for depth, rows in enumerate(passes):
        spawned = passes[depth + 1] if depth + 1 < len(passes) else Rows(*(column[:0] for column in rows))
        on = passes_on(tree, rows)
        counters = pass_counters(rows, finished, on, spawned, emits)
        captured = int(on.sum()) + len(spawned.kind) if emits else 0
        if captured > capacity:
            raise InputError(
                f"geometry_shader: pass {depth} had {captured - capacity} rays more than the stream-output buffer's "
                f"{capacity} records hold; S_VB needs {needed} records of 64 bytes."
            )
        occupancy = Occupancy(captured, capacity, RECORD_BYTES)
        shot = rays if depth == 0 else Rays.unchecked(rows.origin, rows.direction, rows.t_max)
        generations.append(generation_of(depth, rows, shot, counters, occupancy))
        drawn.merge(counters)
        finished = int(on.sum())
    count_blending(drawn, tree)
    return trace_of("geometry_shader", scene, tree, generations, drawn)


def passes_on(tree: Tree, rows: Rows) -> np.ndarray:
    """bool[n]: rays that are shaded in their pass (Listing 4; but secondary rays that miss see the background)."""
    shown = (rows.kind != RayKind.SHADOW) & (rows.node > 0) & bool(tree.whitted.background.any())
    return (rows.triangle >= 0) | shown


def pass_counters(rows: Rows, finished: int, on: np.ndarray, spawned: Rows, emits: bool) -> Counters:
    """What a draw over the pass's rays and `finished` ones counts."""
    counters, alive = Counters(), rows.alive
    points, captured, passed = int(alive.sum()) + finished, int(on.sum()) + len(spawned.kind), int(on.sum())
    count = {"draw.calls": 1, "vertex.invocations": points, "assembly.primitives": points}
    if emits:
        count |= {f"geometry.{name}": captured for name in ("vertices_out", "primitives_out")}
        count |= {f"stream_output.{name}": captured for name in ("generated", "primitives")}
        count |= {"geometry.invocations": points, "stream_output.overflowed": 0, "geometry.in_finished": finished}
    fragments = captured if emits else points
    count |= fragment_counts(fragments, fragments, fragments - passed)
    count |= cost_counts(rows.found)
    for kind in RayKind:
        name = kind.name.lower()
        count[f"rays.{name}"] = shot = int((alive & (rows.kind == kind)).sum())
        if emits:
            count[f"geometry.in_{name}"] = shot
            count[f"geometry.passed_{name}"] = int((on & (rows.kind == kind)).sum())
            if kind != RayKind.EYE:
                count[f"geometry.spawned_{name}"] = int((spawned.kind == kind).sum())
    counters.merge(count)
    counters.check()
    return counters


def count_blending(counters: Counters, tree: Tree) -> None:
    """Section 4.4's blending passes: a full-screen quad for each target of each layer, in one draw."""
    quads = tree.nodes * (1 + len(tree.whitted.lights))
    counters.merge({"draw.calls": 1, "vertex.invocations": 4 * quads, "assembly.primitives": quads})
    counters.merge(fragment_counts(quads, quads * tree.width * tree.height, 0))


def generation_of(depth: int, rows: Rows, rays: Rays, counters: Counters, occupancy: Occupancy) -> Generation:
    """Rows as the public result holds them."""
    hits = Hits(rows.triangle, rows.t, rows.u, rows.v)
    return Generation(
        rays, hits, rows.alive, rows.kind, rows.pixel, rows.parent, costs_of(rows.found), counters, node=rows.node,
        light=rows.light, weight=rows.weight, occupancy=occupancy, parent_generation=depth - 1,
    )  # fmt: skip
