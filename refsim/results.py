"""What a method returns: rays and hits of every generation, the rays that left, counters. Plain arrays, one row a ray.

For image methods a generation's rows are pixels (n = width · height, row-major, row 0 at the top).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.counters import Counters
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays


class RayKind(IntEnum):
    """What a ray is."""

    EYE = 0
    SHADOW = 1
    REFLECTED = 2
    REFRACTED = 3


class TileState(IntEnum):
    """What a tile's cone encloses: no ray, all its rays, or (unbounded) no cone of less than a half-space does."""

    EMPTY = 0
    BOUNDED = 1
    UNBOUNDED = 2


@dataclass(frozen=True, eq=False)
class Cones:
    """Enclosing cones of a generation's live rays, one row a tile, tiles row-major.

    apex f32[tiles, 3] world space; axis f32[tiles, 3] unit; half_angle f32[tiles] radians; state int32[tiles]
    (`TileState`); slack f32[tiles], scene units, how far outside the float32 cone a ray may be; width, height in
    tiles, tile_size in pixels. Rows of a tile that is not bounded mean nothing but their state and half_angle: 0 where
    empty, π where unbounded.
    """

    apex: NDArray[np.float32]
    axis: NDArray[np.float32]
    half_angle: NDArray[np.float32]
    state: NDArray[np.int32]
    slack: NDArray[np.float32]
    width: int
    height: int
    tile_size: int


@dataclass(frozen=True)
class Occupancy:
    """How full a captured vertex buffer was after a pass: vertices in it and those it has room for, bytes a vertex."""

    vertices: int
    capacity: int
    vertex_bytes: int

    @property
    def bytes(self) -> int:
        """Bytes that the vertices take."""
        return self.vertices * self.vertex_bytes

    @property
    def capacity_bytes(self) -> int:
        """Bytes that were allocated."""
        return self.capacity * self.vertex_bytes


@dataclass(frozen=True, eq=False)
class Generation:
    """Rays of recursion depth k, shot in pass k, and what they hit.

    alive bool[n]: the ray was shot (a dead row has zero direction and hits nothing); kind int32[n] (`RayKind`); pixel
    int32[n]; parent int32[n], row of the generation a ray came from (−1 for eye rays and dead rows): the one before, or
    that of number `parent_generation` in the trace if it is not −1; per_ray name -> int32[n];
    counters of this pass alone; cones with the hierarchical engine. `next_rays` and `next_kind`: the rays that this
    pass wrote for the next one, in its rows (image methods that follow one ray a path). Methods that follow trees:
    `node` int32[n], the surface ray of the pixel's ray tree that a ray is, or from whose hit its shadow ray starts;
    `light` int32[n], of shadow rays, else −1; `weight` f32[n] of the path; `occupancy`, the vertex buffer captured;
    `slot` int32[n], place of the ray in the vertex buffer drawn.
    """

    rays: Rays
    hits: Hits
    alive: NDArray[np.bool_]
    kind: NDArray[np.int32]
    pixel: NDArray[np.int32]
    parent: NDArray[np.int32]
    per_ray: Mapping[str, NDArray[np.int32]]
    counters: Counters
    cones: Cones | None = None
    next_rays: Rays | None = None
    next_kind: NDArray[np.int32] | None = None
    node: NDArray[np.int32] | None = None
    light: NDArray[np.int32] | None = None
    weight: NDArray[np.float32] | None = None
    occupancy: Occupancy | None = None
    parent_generation: int = -1
    slot: NDArray[np.int32] | None = None


@dataclass(frozen=True, eq=False)
class Trace:
    """All generations of one run of `method`.

    `per_ray` name -> int64[n]: summed over generations per pixel. `options`: every option's value, defaults included.
    `image` f32[h, w, 3]: the picture that the method composed itself, row 0 at the top.
    """

    method: str
    scene: Scene
    options: Mapping[str, Any]
    generations: tuple[Generation, ...]
    counters: Counters
    per_ray: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    image: NDArray[np.float32] | None = None

    @cached_property
    def exit_rays(self) -> Rays:
        """The last ray of each path [n], which leaves the scene or ends; put together when first asked for."""
        return last_rays(self.generations)

    @property
    def hits(self) -> Hits:
        """What the first generation hit."""
        return self.generations[0].hits


@dataclass(frozen=True, eq=False)
class Image:
    """A picture: linear RGB f32[h, w, 3], row 0 at the top, and the trace that it was made from."""

    rgb: NDArray[np.float32]
    trace: Trace


def summed_per_ray(generations: list[Generation], pixels: int) -> dict[str, NDArray[np.int64]]:
    """Per-ray counts of all generations added up by pixel; int64[pixels] a name."""
    names = sorted({name for generation in generations for name in generation.per_ray})
    totals = {name: np.zeros(pixels, np.int64) for name in names}
    for generation in generations:
        for name, counts in generation.per_ray.items():
            if len(counts) == pixels:  # rows are pixels
                totals[name] += counts
            else:
                sums = np.bincount(generation.pixel, counts, pixels)  # exact in float64
                totals[name] += sums.astype(np.int64)
    return totals


def last_rays(generations: Sequence[Generation]) -> Rays:
    """The last ray of each path (image methods): the one that missed or ended on a diffuse surface, or the ray that the
    last generation's hit sent on. Where paths branch: the surface ray of the pixel that was shot last."""
    eye = generations[0].rays
    if generations[0].next_rays is None:
        return _last_of_trees(generations)
    last = [eye.origin.copy(), eye.direction.copy(), eye.t_max.copy()]
    goes_on = np.ones(len(eye), np.bool_)
    for k, generation in enumerate(generations):
        following = generation.next_rays
        assert following is not None
        sent_on = following.t_max > 0
        if k > 0:
            _take(last, generation.rays, np.flatnonzero(goes_on & ~sent_on))
        goes_on = sent_on
    assert following is not None
    _take(last, following, np.flatnonzero(goes_on))
    return Rays.unchecked(last[0], last[1], last[2], eye.width, eye.height)


def _last_of_trees(generations: Sequence[Generation]) -> Rays:
    eye = generations[0].rays
    last = [eye.origin.copy(), eye.direction.copy(), eye.t_max.copy()]
    for generation in generations[1:]:
        rows = np.flatnonzero(generation.alive & (generation.kind != RayKind.SHADOW))
        rays = generation.rays
        for column, new in zip(last, (rays.origin, rays.direction, rays.t_max), strict=True):
            column[generation.pixel[rows]] = new[rows]
    return Rays.unchecked(last[0], last[1], last[2], eye.width, eye.height)


def _take(columns: list[NDArray[np.float32]], rays: Rays, rows: NDArray[np.intp]) -> None:
    for column, new in zip(columns, (rays.origin, rays.direction, rays.t_max), strict=True):
        column[rows] = new[rows]
