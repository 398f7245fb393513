"""Counters: what is counted, in which unit, and the laws that every run must obey.

A counter is declared once, here, with a sentence; code that counts adds to a `Counters` object. Counts are logical
invocations: they do not depend on tiles, packets, threads or taps. `Counters.check()` tests the conservation laws.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple


class Counter(NamedTuple):
    """Name, unit, and one sentence on what is counted."""

    name: str
    unit: str
    sentence: str


_DECLARED = (
    Counter("draw.calls", "draws", "Draw calls submitted to the pipeline."),
    Counter("vertex.invocations", "invocations", "Vertex shader runs: one per index (or vertex) and instance."),
    Counter("assembly.primitives", "primitives", "Points, quads or triangles assembled from vertices."),
    Counter("geometry.invocations", "invocations", "Geometry shader runs: one per assembled primitive."),
    Counter("geometry.vertices_out", "vertices", "Vertices that the geometry shader emitted."),
    Counter("geometry.primitives_out", "primitives", "Points and strip triangles made of emitted vertices."),
    Counter("stream_output.generated", "primitives", "Primitives offered to stream output."),
    Counter("stream_output.primitives", "primitives", "Primitives written to the captured buffer."),
    Counter("stream_output.overflowed", "primitives", "Primitives for which the captured buffer had no room."),
    Counter("raster.primitives", "primitives", "Primitives that reach the rasteriser."),
    Counter("raster.culled", "primitives", "Triangles dropped for the way they face."),
    Counter("raster.clipped_pieces", "primitives", "Triangles drawn in the place of clipped ones."),
    Counter("raster.clipped", "primitives", "Primitives outside the clip volume, those moved out of view included."),
    Counter("raster.empty", "primitives", "Primitives in the clip volume whose bounds hold no pixel of the scissor."),
    Counter("raster.drawn", "primitives", "Primitives whose bounds hold at least one pixel."),
    Counter("raster.fragments", "fragments", "Fragments made by the rasteriser inside the scissor."),
    Counter("stencil.failed_early", "fragments", "Fragments rejected by the stencil test before the fragment shader."),
    Counter("depth.failed_early", "fragments", "Fragments rejected by the depth test before the fragment shader."),
    Counter("fragment.invocations", "invocations", "Fragment shader runs: fragments not rejected by an early test."),
    Counter("fragment.discarded", "fragments", "Fragments that the shader discarded (a ray that misses its triangle)."),
    Counter("stencil.failed", "fragments", "Fragments that failed the stencil test, early or late."),
    Counter("depth.failed", "fragments", "Fragments that failed the depth test, early or late."),
    Counter("fragment.written", "fragments", "Fragments that passed everything and were written to the targets."),
    Counter("blend.fragments", "fragments", "Written fragments that were blended in at least one target."),
    Counter("intersection.triangle_tests", "tests", "Ray–triangle tests: one a run of the intersection shader."),
    Counter("intersection.sphere_tests", "tests", "Ray–sphere tests: one an internal node that a ray visits."),
    Counter("traversal.nodes", "nodes", "Elements of traversal lists that rays visited, spheres and triangles."),
    Counter("intersection.degenerate_triangles", "triangles", "Zero-area triangles of the scene: kept, never hit."),
    Counter("cone.sphere_tests", "tests", "Cone–sphere tests: one per triangle, tile and generation."),
    Counter("cone.pairs_kept", "pairs", "Pairs of tile and triangle that the cone–sphere test let through."),
    Counter("cone.tiles_empty", "tiles", "Tiles with no ray to trace, summed over generations."),
    Counter("cone.tiles_bounded", "tiles", "Tiles whose cone can cull, summed over generations."),
    Counter("cone.tiles_unbounded", "tiles", "Tiles whose cone is too wide (82.8 degrees) to cull anything."),
    Counter("traversal.cells", "cells", "Cells of the grid (nodes of another structure) that rays visited."),
    Counter("traversal.box_rejections", "rays", "Rays that the scene's bounding box alone rejected."),
    Counter("geometry.in_finished", "primitives", "Rays shaded in the pass before, which end in the geometry shader."),
    Counter("geometry.in_eye", "primitives", "Eye rays that reached the geometry shader with their intersection."),
    Counter("geometry.in_shadow", "primitives", "Shadow rays that reached the geometry shader intersected."),
    Counter("geometry.in_reflected", "primitives", "Reflected rays that reached the geometry shader intersected."),
    Counter("geometry.in_refracted", "primitives", "Refracted rays that reached the geometry shader intersected."),
    Counter("geometry.passed_eye", "primitives", "Eye rays that the geometry shader passed on to be shaded."),
    Counter("geometry.passed_shadow", "primitives", "Shadow rays that the geometry shader passed on."),
    Counter("geometry.passed_reflected", "primitives", "Reflected rays that the geometry shader passed on."),
    Counter("geometry.passed_refracted", "primitives", "Refracted rays that the geometry shader passed on."),
    Counter("geometry.spawned_shadow", "primitives", "Shadow rays that the geometry shader emitted anew."),
    Counter("geometry.spawned_reflected", "primitives", "Reflected rays that the geometry shader emitted anew."),
    Counter("geometry.spawned_refracted", "primitives", "Refracted rays that the geometry shader emitted anew."),
    Counter("vertex.arithmetic", "operations", "Arithmetic of vertex shaders, counted on their source."),
    Counter("vertex.fetches", "texels", "Texels that vertex shaders fetched, counted on their source."),
    Counter("geometry.arithmetic", "operations", "Arithmetic of geometry shaders, counted on their source."),
    Counter("geometry.fetches", "texels", "Texels that geometry shaders fetched, counted on their source."),
    Counter("fragment.arithmetic", "operations", "Arithmetic of fragment shaders, counted on their source."),
    Counter("fragment.fetches", "texels", "Texels that fragment shaders fetched, counted on their source."),
    Counter("rays.shadow", "rays", "Shadow rays that were shot."),
    Counter("rays.eye", "rays", "Rays of generation 0 that were shot."),
    Counter("rays.reflected", "rays", "Reflected rays that were shot, total internal reflection included."),
    Counter("rays.refracted", "rays", "Refracted rays that were shot."),
)

REGISTRY: Mapping[str, Counter] = {counter.name: counter for counter in _DECLARED}


class Law(NamedTuple):
    """The sum of the counters on the left equals the sum on the right, whenever one of them was counted."""

    left: tuple[str, ...]
    right: tuple[str, ...]


GEOMETRY_IN = tuple(f"geometry.in_{kind}" for kind in ("finished", "eye", "shadow", "reflected", "refracted"))
GEOMETRY_OUT = (
    *(f"geometry.passed_{kind}" for kind in ("eye", "shadow", "reflected", "refracted")),
    *(f"geometry.spawned_{kind}" for kind in ("shadow", "reflected", "refracted")),
)

COSTS = tuple(f"{stage}.{cost}" for stage in ("vertex", "geometry", "fragment") for cost in ("arithmetic", "fetches"))
# What methods count of their shaders' work; all else under a stage's name the pipeline counts itself
OF_SHADERS = (*GEOMETRY_IN, *GEOMETRY_OUT, *COSTS)

LAWS = (
    Law(("stream_output.generated",), ("stream_output.primitives", "stream_output.overflowed")),
    Law(("raster.primitives",), ("raster.clipped", "raster.culled", "raster.empty", "raster.drawn")),
    Law(
        ("raster.fragments",),
        ("fragment.discarded", "stencil.failed", "depth.failed", "fragment.written"),
    ),
    Law(("raster.fragments",), ("fragment.invocations", "stencil.failed_early", "depth.failed_early")),
)


class ConservationError(AssertionError):
    """A run broke a conservation law: a fault of refsim, never of its input."""


class Counters(Mapping[str, int]):
    """Counts by name. Missing names count 0; only declared names can be added to."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}

    def add(self, name: str, count: int) -> None:
        """Adds `count` to counter `name`."""
        if name not in REGISTRY:
            raise KeyError(f"counter {name!r} is not declared in refsim.counters.")
        self._counts[name] = self._counts.get(name, 0) + int(count)

    def merge(self, other: Mapping[str, int]) -> None:
        """Adds all counts of `other`."""
        for name, count in other.items():
            self.add(name, count)

    def check(self) -> None:
        """Raises `ConservationError` naming the first law that does not hold."""
        for law in LAWS:
            left = sum(self[name] for name in law.left)
            right = sum(self[name] for name in law.right)
            if left != right:
                raise ConservationError(f"{' + '.join(law.left)} = {left}, but {' + '.join(law.right)} = {right}.")

    def __getitem__(self, name: str) -> int:
        if name not in REGISTRY:
            raise KeyError(f"there is no counter {name!r}.")
        return self._counts.get(name, 0)

    def __iter__(self) -> Iterator[str]:
        return iter(name for name in REGISTRY if name in self._counts)

    def __len__(self) -> int:
        return len(self._counts)

    def __repr__(self) -> str:
        return f"Counters({ {name: self._counts[name] for name in self} })"
