"""Between the engines' targets and the public result: textures from rays, generations and a trace from targets."""

from __future__ import annotations

import numpy as np

from refsim.counters import ConservationError, Counters
from refsim.errors import InputError
from refsim.papers.hierarchical_ray_engine.shaders import RayTextures
from refsim.pipeline.resources import MAX_TARGET_PIXELS, Framebuffer, Texture
from refsim.pipeline.state import ScissorRect
from refsim.results import Cones, Generation, RayKind, TileState, Trace, summed_per_ray
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays


def image_size(rays: Rays) -> tuple[int, int]:
    """Width and height of the image that the rays' rows are; without one, the squarest that holds them."""
    if rays.width is not None and rays.height is not None:
        return rays.width, rays.height
    width = max(int(np.ceil(np.sqrt(len(rays)))), 1)
    return width, max(-(-len(rays) // width), 1)


def ray_textures(rays: Rays, tile_size: int) -> tuple[RayTextures, tuple[int, int]]:
    """Origin (w: t_max) and direction as textures, padded with dead rays to whole tiles; and the image's size."""
    if len(rays) == 0:
        raise InputError("there are no rays to trace.")
    width, height = image_size(rays)
    padded = (-(-height // tile_size) * tile_size, -(-width // tile_size) * tile_size)
    if padded[0] * padded[1] > MAX_TARGET_PIXELS:
        raise InputError(f"{width} × {height} rays are more than a target of 2**28 pixels holds.")
    origin, direction = np.zeros((4, *padded), np.float32), np.zeros((3, *padded), np.float32)
    missing = width * height - len(rays)

    def planes(columns: np.ndarray) -> np.ndarray:
        filled = np.concatenate([columns, np.zeros((missing, columns.shape[1]), np.float32)]) if missing else columns
        return filled.T.reshape(-1, height, width)

    origin[:3, :height, :width] = planes(rays.origin)
    origin[3:, :height, :width] = planes(rays.t_max[:, None])
    direction[:, :height, :width] = planes(rays.direction)
    return RayTextures(Texture(origin), Texture(direction)), (width, height)


def _cut(planes: np.ndarray, image: ScissorRect, count: int) -> np.ndarray:
    """Planes [k, h, w] without padding, as [k, count]."""
    return planes[:, : image.height, : image.width].reshape(len(planes), -1)[:, :count]


def _rows(planes: np.ndarray, image: ScissorRect, count: int) -> np.ndarray:
    """Planes [k, h, w] without padding as contiguous rows [count, k]."""
    rows = np.empty((count, len(planes)), np.float32)
    for k, plane in enumerate(_cut(planes, image, count)):  # quicker than copying the transpose
        rows[:, k] = plane
    return rows


def _column(plane: np.ndarray, image: ScissorRect, count: int) -> np.ndarray:
    """One plane [h, w] without padding as [count]; a copy, so that the target can be let go."""
    return _cut(plane[None], image, count)[0].copy()


def generation_of(
    eye: Rays,
    textures: RayTextures,
    target: Framebuffer,
    image: ScissorRect,
    before: list[Generation],
    counters: Counters,
    cones: Cones | None,
    triangles: int,
) -> Generation:
    """The pass that has just been drawn, as rows; completes and checks its counters."""
    count = len(eye)
    pixel = np.arange(count, dtype=np.int32)
    kind, rays = np.zeros(count, np.int32), eye
    if before and before[-1].next_rays is not None and before[-1].next_kind is not None:
        kind, rays = before[-1].next_kind, before[-1].next_rays
    hit, origin = target.color("hit"), target.color("origin")
    hits = Hits(
        _column(target.color("triangle")[0], image, count), *(_column(plane, image, count) for plane in hit)
    )
    following = Rays.unchecked(
        _rows(origin[:3], image, count),
        _rows(target.color("direction"), image, count),
        _column(origin[3], image, count),
        eye.width,
        eye.height,
    )
    alive = rays.t_max > 0
    tests = _column(target.invocations, image, count)
    counters.add("intersection.triangle_tests", int(target.invocations.sum()))
    counters.add("rays.eye", int(alive.sum()) if not before else 0)
    counters.add("rays.reflected", int((alive & (kind == RayKind.REFLECTED)).sum()))
    counters.add("rays.refracted", int((alive & (kind == RayKind.REFRACTED)).sum()))
    if cones is not None:
        for state in TileState:
            counters.add(f"cone.tiles_{state.name.lower()}", int((cones.state == state).sum()))
        if counters["cone.sphere_tests"] != len(cones.state) * triangles:
            raise ConservationError(f"{len(cones.state)} tiles, {triangles} triangles: not every pair was tested once.")
    if sum(counters[f"rays.{name}"] for name in ("eye", "reflected", "refracted")) != int(alive.sum()):
        raise ConservationError("a live ray is neither an eye ray nor reflected nor refracted.")
    counters.check()
    parent = np.where(alive & bool(before), pixel, -1).astype(np.int32)
    return Generation(
        rays, hits, alive, kind, pixel, parent, {"triangle_tests": tests}, counters, cones,
        following, _column(target.color("kind")[0], image, count),
    )  # fmt: skip


def cones_of(target: Framebuffer, tile_size: int) -> Cones:
    """The cone texture as rows."""
    apex, axis = target.color("apex").reshape(4, -1), target.color("axis").reshape(4, -1)
    state = target.color("state").reshape(-1).copy()
    # In float64, rounded once: an arc tangent of float32 has other bits on other processors
    angle = np.arctan2(axis[3], apex[3], dtype=np.float64)
    angle[state == TileState.EMPTY] = 0.0
    return Cones(
        np.ascontiguousarray(apex[:3].T),
        np.ascontiguousarray(axis[:3].T),
        angle.astype(np.float32),
        state,
        target.color("slack").reshape(-1).copy(),
        target.width,
        target.height,
        tile_size,
    )


def trace_of(method: str, scene: Scene, eye: Rays, generations: list[Generation]) -> Trace:
    """All generations together: the last ray of each path, counters, counts per ray."""
    counters = Counters()
    for generation in generations:
        counters.merge(generation.counters)
    counters.add("intersection.degenerate_triangles", int(scene.degenerate.sum()))
    counters.check()
    per_ray = summed_per_ray(generations, len(eye))
    return Trace(method, scene, {}, tuple(generations), counters, per_ray)
