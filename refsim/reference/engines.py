"""The Ray Engine and the Hierarchical Ray Engine without a pipeline: what their draws do to every pixel, and count.

A pass is a function ``(k, rays, kind) -> Generation``. State that lives from pass to pass is the stencil.
The Hierarchical Ray Engine, sections 2.1 (Ray Engine), 3 (tiles and sprites), 4 (cones), 5 (stencil).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.reference.fragments import FragmentTests, Target
from refsim.reference.sphere import enclosing_spheres
from refsim.reference.surfaces import Following, Surfaces, following_rays, shoot
from refsim.reference.tiles import TileCones, Tiles, errata_of
from refsim.results import Cones, Generation, RayKind, TileState
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays

Pass = Callable[[int, Rays, np.ndarray], Generation]


@dataclass(frozen=True)
class Image:
    """Rays as pixels: columns of width · height rows, dead where there are more pixels than rays."""

    width: int
    height: int
    origin: np.ndarray
    direction: np.ndarray
    t_max: np.ndarray

    @classmethod
    def of(cls, rays: Rays) -> Image:
        """Rays without an image size fill the squarest image that holds them."""
        width, height = rays.width, rays.height
        if width is None or height is None:
            width = max(int(np.ceil(np.sqrt(len(rays)))), 1)
            height = max(-(-len(rays) // width), 1)
        missing = ((0, width * height - len(rays)), (0, 0))
        origin, direction = np.pad(rays.origin, missing), np.pad(rays.direction, missing)
        return cls(width, height, origin, direction, np.pad(rays.t_max, missing[0]))

    def __len__(self) -> int:
        return self.width * self.height


@dataclass(frozen=True)
class Found:
    """The nearest hits so far: triangle int32[n] (−1 none), t (inf), u, v f32[n]."""

    triangle: np.ndarray
    t: np.ndarray
    u: np.ndarray
    v: np.ndarray

    @classmethod
    def nothing(cls, n: int) -> Found:
        """A cleared target."""
        zero = np.zeros(n, np.float32)
        return cls(np.full(n, -1, np.int32), np.full(n, np.inf, np.float32), zero, zero.copy())

    def write(self, rows: np.ndarray, triangle: int, t: np.ndarray, u: np.ndarray, v: np.ndarray) -> None:
        """Replaces the rows (a mask or indices) by these hits, given for all rows."""
        self.triangle[rows] = triangle
        self.t[rows], self.u[rows], self.v[rows] = t[rows], u[rows], v[rows]


def depth_scale(scene: Scene, eye: Rays) -> np.float32:
    """The power of two that takes every t below 1: the diagonal of the box around scene and origins, and a margin."""
    origins = eye.origin[eye.t_max > 0].astype(np.float64)
    points = np.concatenate([np.stack([scene.lower, scene.upper]).astype(np.float64), origins])
    diagonal = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
    farthest = max(1.01 * diagonal + 4 * float(scene.epsilon), float(np.finfo(np.float32).tiny))
    return np.float32(2.0 ** -np.ceil(np.log2(farthest)))


def ray_engine(scene: Scene, eye: Rays, options: Mapping[str, Any]) -> Pass:
    """Section 2.1: every triangle a full-screen quad over all pixels, dead rays included."""
    surfaces, scale = Surfaces.of(scene, options), depth_scale(scene, eye)
    tests = FragmentTests(options["early_tests"], options["depth_format"], options["stencil"])
    stencil = np.zeros(len(Image.of(eye)), np.uint8)

    def run(k: int, rays: Rays, kind: np.ndarray) -> Generation:
        image, counters = Image.of(rays), Counters()
        target = Target(tests, stencil, k)
        found = Found.nothing(len(image))
        everywhere = np.arange(len(image))
        count_quads(counters, len(scene))
        for triangle in range(len(scene)):
            draw_triangle(surfaces, triangle, image, everywhere, scale, target, found)
        target.count(counters)
        counters.add("intersection.triangle_tests", int(target.invocations.sum()))
        return completed(k, surfaces, image, rays, kind, found, target, counters, None)

    return run


def hierarchical_ray_engine(scene: Scene, eye: Rays, options: Mapping[str, Any]) -> Pass:
    """Sections 3 to 5: a triangle over the tiles whose cone meets its sphere."""
    surfaces, scale = Surfaces.of(scene, options), depth_scale(scene, eye)
    centre, radius = enclosing_spheres(scene.triangles)
    printed = errata_of(options["errata"])
    tests = FragmentTests(options["early_tests"], options["depth_format"], True)
    image = Image.of(eye)
    tiles = Tiles(image.width, image.height, options["tile_size"])
    stencil = np.zeros(len(image), np.uint8)

    def run(k: int, rays: Rays, kind: np.ndarray) -> Generation:
        image, counters = Image.of(rays), Counters()
        cones = TileCones.around(tiles, image.origin, image.direction, image.t_max, printed)
        count_quads(counters, 1)
        count_cone_fragments(counters, tiles.count)
        target = Target(tests, stencil, k)
        found = Found.nothing(len(image))
        kept = 0
        for triangle in range(len(scene)):
            meets = cones.meet(centre[triangle], radius[triangle], printed)
            kept += int(meets.sum())
            draw_triangle(surfaces, triangle, image, np.flatnonzero(meets[tiles.of_pixel]), scale, target, found)
        count_sprites(counters, tiles.count * len(scene), kept)
        target.count(counters)
        counters.add("intersection.triangle_tests", int(target.invocations.sum()))
        return completed(k, surfaces, image, rays, kind, found, target, counters, cones.result())

    return run


def draw_triangle(
    surfaces: Surfaces, triangle: int, image: Image, rows: np.ndarray, scale: np.float32, target: Target, found: Found
) -> None:
    """One triangle over the pixels `rows`: intersection, t as depth, tests, and the hit written where all pass."""
    hit, t, u, v = shoot(surfaces, triangle, image.origin[rows], image.direction[rows], image.t_max[rows])
    with np.errstate(invalid="ignore", over="ignore"):
        written = target.fragments(rows, hit, t * scale)
    found.triangle[rows[written]] = triangle
    for column, new in ((found.t, t), (found.u, u), (found.v, v)):
        column[rows[written]] = new[written]


def count_quads(counters: Counters, quads: int) -> None:
    """A draw of full-screen quads: four vertices each, none clipped or empty."""
    counters.add("draw.calls", 1)
    counters.add("vertex.invocations", 4 * quads)
    counters.add("assembly.primitives", quads)
    counters.add("raster.primitives", quads)
    counters.add("raster.clipped", 0)
    counters.add("raster.empty", 0)
    counters.add("raster.drawn", quads)


def count_cone_fragments(counters: Counters, tiles: int) -> None:
    """The cone pass: one fragment a tile, all written."""
    for name in ("raster.fragments", "fragment.invocations", "fragment.written"):
        counters.add(name, tiles)


def count_sprites(counters: Counters, pairs: int, kept: int) -> None:
    """A draw of one point a tile and triangle; a tile covers at least one pixel of the image, so none is empty."""
    counters.add("draw.calls", 1)
    counters.add("vertex.invocations", pairs)
    counters.add("assembly.primitives", pairs)
    counters.add("raster.primitives", pairs)
    counters.add("raster.clipped", pairs - kept)
    counters.add("raster.empty", 0)
    counters.add("raster.drawn", kept)
    counters.add("cone.sphere_tests", pairs)
    counters.add("cone.pairs_kept", kept)


def completed(
    k: int,
    surfaces: Surfaces,
    image: Image,
    rays: Rays,
    kind: np.ndarray,
    found: Found,
    target: Target,
    counters: Counters,
    cones: Cones | None,
) -> Generation:
    """The pass with the rays that follow its hits, its laws checked."""
    new = following_rays(surfaces, image.origin, image.direction, found.triangle, found.t, found.u, found.v)
    if cones is not None:
        for state in TileState:
            counters.add(f"cone.tiles_{state.name.lower()}", int((cones.state == state).sum()))
    counters.check()
    return generation_of(k, rays, kind, found, new, target.invocations, counters, cones)


def generation_of(
    k: int,
    rays: Rays,
    kind: np.ndarray,
    found: Found,
    new: Following,
    tests: np.ndarray,
    counters: Counters,
    cones: Cones | None,
) -> Generation:
    """Rows of the rays alone (pixels beyond them go), and the rays counted by kind."""
    n = len(rays)
    alive = rays.t_max > 0
    pixel = np.arange(n, dtype=np.int32)
    counters.add("rays.eye", int(alive.sum()) if k == 0 else 0)
    counters.add("rays.reflected", int((alive & (kind == RayKind.REFLECTED)).sum()))
    counters.add("rays.refracted", int((alive & (kind == RayKind.REFRACTED)).sum()))
    hits = Hits(found.triangle[:n], found.t[:n], found.u[:n], found.v[:n])
    following = Rays.unchecked(new.origin[:n], new.direction[:n], new.t_max[:n], rays.width, rays.height)
    parent = np.where(alive & (k > 0), pixel, -1).astype(np.int32)
    per_ray = {"triangle_tests": tests[:n]}
    return Generation(rays, hits, alive, kind, pixel, parent, per_ray, counters, cones, following, new.kind[:n])
