"""The method "fragment_grid" without a pipeline: `whitted`'s rays, a row a pixel, a generation for each node and light.

The previous work that the paper is compared with (Ralovich 2007): "every pass operates on one single ray generation
only" (section 1). Nothing is read back, so passes are drawn for all that options and materials allow, rays or none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.reference.ray_trees import Tree, cost_counts, costs_of, fragment_counts, trace_of, traced
from refsim.reference.searches import Found
from refsim.reference.whitted import Shot
from refsim.results import Generation, RayKind, Trace
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays


class Pass(NamedTuple):
    """One ray generation; `sender`: the node whose hits send its rays (−1 none)."""

    kind: RayKind
    node: int
    light: int
    sender: int


def passes_of(tree: Tree) -> Iterator[Pass]:
    """Node by node: its surface rays, then the shadow rays from their hits, light by light."""
    whitted = tree.whitted
    depth = [Pass(RayKind.EYE, 0, -1, -1)]
    for k in range(whitted.passes):
        for surface in depth:
            yield surface
            if whitted.shadows and k + 1 < whitted.passes:
                for light in range(len(whitted.lights)):
                    yield Pass(RayKind.SHADOW, surface.node, light, surface.node)
        depth = [child for surface in depth for child in children(tree, surface.node)] if tree.goes_on else []


def children(tree: Tree, node: int) -> list[Pass]:
    """The surface rays that a node's hits may send on."""
    whitted, first = tree.whitted, tree.whitted.branching * node + 1
    reflected = [Pass(RayKind.REFLECTED, first, -1, node)] if whitted.reflections else []
    return reflected + ([Pass(RayKind.REFRACTED, first + 1, -1, node)] if whitted.branching == 2 else [])


def fragment_grid(scene: Scene, rays: Rays, options: Mapping[str, Any]) -> Trace:
    """Method "fragment_grid": a generation a node, and one a node and light."""
    tree = traced(scene, rays, options)
    shots = {(shot.rays.node, shot.rays.light): shot for shot in tree.whitted.shots}
    generations: list[Generation] = []
    surfaces = {-1: -1}
    drawn = Counters()
    for shooting in passes_of(tree):
        parent = surfaces[shooting.sender]
        if shooting.kind != RayKind.SHADOW:
            surfaces[shooting.node] = len(generations)
        generations.append(_generation(tree, rays, shooting, shots.get((shooting.node, shooting.light)), parent))
        drawn.merge(generations[-1].counters)
    # The image: a quad for what no shadow takes from a node, and one for each light
    nodes = sum(generation.kind[0] != RayKind.SHADOW for generation in generations)
    for _ in range(nodes * (1 + len(tree.whitted.lights))):
        drawn.merge(_quad(tree) | {"blend.fragments": tree.width * tree.height})
    return trace_of("fragment_grid", scene, tree, generations, drawn)


def _quad(tree: Tree) -> dict[str, int]:
    """What drawing a viewport quad counts."""
    counts = fragment_counts(1, tree.width * tree.height, 0)
    del counts["blend.fragments"]
    return counts | {"draw.calls": 1, "vertex.invocations": 4, "assembly.primitives": 1}


def _generation(tree: Tree, eye: Rays, shooting: Pass, shot: Shot | None, parent: int) -> Generation:
    """The rays of a pass, a row a pixel, dead where it has none. A ray that ends where it starts is dead too."""
    n = len(eye)
    origin, direction, t_max = np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32), np.zeros(n, np.float32)
    weight, found = np.full(n, shooting.kind == RayKind.EYE, np.float32), Found.nothing(n)
    if shot is not None:
        sent = shot.rays.pixel
        origin[sent], direction[sent], t_max[sent] = shot.rays.origin, shot.rays.direction, shot.rays.t_max
        weight[sent] = shot.rays.weight
        started = shot.rays.t_max > 0
        direction[sent[~started]] = 0
        for column, new in zip(found, shot.found, strict=True):
            column[sent[started]] = new[started]
    alive = t_max > 0
    counters = Counters()
    counters.merge(_quad(tree) | cost_counts(found) | {f"rays.{shooting.kind.name.lower()}": int(alive.sum())})
    counters.check()
    pixel = np.arange(n, dtype=np.int32)
    rays = Rays.unchecked(origin, direction, t_max, eye.width, eye.height) if parent >= 0 else eye
    return Generation(
        rays,
        Hits(found.triangle, found.t, found.u, found.v),
        alive,
        np.full(n, shooting.kind, np.int32),
        pixel,
        np.where(alive & (parent >= 0), pixel, -1).astype(np.int32),
        costs_of(found),
        counters,
        node=np.full(n, shooting.node, np.int32),
        light=np.full(n, shooting.light, np.int32),
        weight=weight,
        parent_generation=parent,
    )
