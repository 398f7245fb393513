"""Primary intersections by rasterisation: what the first pass may know before it searches.

"Our system may be optimized to calculate primary intersections through rasterization of eye rays for the highest
possible performance on the graphics hardware. This would only require changing the first pass of the algorithm"
(section 6). In: the scene, and eye rays that are a pinhole camera's. Out: the number of the triangle drawn nearest at
every pixel, which the first pass tests before it searches.

The rasteriser moves corners to a grid of 1/256 pixel, so at a border it may draw a neighbour of what the ray meets:
where the ray misses the triangle drawn, the pass has to search. Where it hits it, a nearer triangle whose border passes
within that step of the pixel's centre may have been left out.

Depth is near / w, with w along the view and no far plane, cleared to 0 and kept where greater: float32 then tells
distances apart by their ratio (2^-23) everywhere, while w scaled to [0, 1] would spend nearly all of its steps close to
the eye. Of triangles at the same depth the one listed first stays.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.geometry.vector import dot, sub
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import f32, i32, vec3
from refsim.pipeline.resources import Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import (
    CompareFunction,
    CullMode,
    DepthStencilState,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)
from refsim.pipeline.taps import Taps
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

Float64 = NDArray[np.float64]

NO_PINHOLE = "primary rays by rasterisation need a pinhole camera's rays"
# Radians by which a ray may be off the fitted camera's: float32 rounds a direction by 2^-24 or so
MOST_RESIDUAL = 2.0**-20
# The camera is fitted to this many columns and rows at most, the first and last among them
FITTED = 33
# A second solution this much worse than the best one is none: less, and the live pixels stand in a line
LEAST_SPREAD = 2.0**-22
# The near plane, in distances of the farthest corner of the scene's box
NEAR = 2.0**-20

F1 = np.float32(1)
CORNERS = np.int32(3)


class Pinhole(NamedTuple):
    """float64[3] each: the ray of NDC (x, y) starts at `eye` towards x · right + y · up + forward; |forward| = 1."""

    eye: Float64
    right: Float64
    up: Float64
    forward: Float64


class Position(NamedTuple):
    """A corner of a triangle, world space."""

    position: vec3


class Projection(NamedTuple):
    """From world to clip space: x, y and w are scalar products with what lies ahead of the eye, z is `near`."""

    eye: vec3
    x: vec3
    y: vec3
    w: vec3
    near: f32


class Number(NamedTuple):
    """The triangle's number: as a varying and as the only target."""

    triangle: i32


def pinhole(rays: Rays) -> Pinhole:
    """The camera whose pixel centres these rays go through, by least squares in float64.

    Right, up and forward are the columns of the matrix M with d × M (x, y, 1) = 0 for all directions d: homogeneous
    equations, whose solution of least residual is the last right singular vector. Every live ray must start at the same
    point, bit for bit, and lie within 2^-20 radians of the camera's. `InputError` if the rays have no width and
    height, are fewer than 2 × 2, mostly dead, or no pinhole's.
    """
    width, height = rays.width, rays.height
    if width is None or height is None:
        raise InputError(f"{NO_PINHOLE}: these have no width and height.")
    if min(width, height) < 2:
        raise InputError(f"{NO_PINHOLE}: {width} × {height} pixels do not tell its axes; at least 2 × 2 do.")
    live = np.flatnonzero(rays.alive)
    if len(live) == 0:
        raise InputError(f"{NO_PINHOLE}: all of these are dead.")
    origins = rays.origin[live]
    if (origins != origins[0]).any():
        ray = int(live[np.argmax((origins != origins[0]).any(axis=1))])
        raise InputError(f"{NO_PINHOLE}: ray {ray} does not start where ray {int(live[0])} does.")
    direction = rays.direction[live].T.astype(np.float64, order="C")
    x, y = _pixel_centres(live, width, height)
    rows = _sample(live, width, height)
    axes = _least_squares(direction[:, rows], x[rows], y[rows])
    _check_residual(axes, direction, x, y, live)
    return Pinhole(origins[0].astype(np.float64), *axes)


def first_triangles(
    scene: Scene,
    rays: Rays,
    counters: Counters,
    threads: int | None = None,
    taps: Taps | None = None,
    *,
    facing: str = "both",
) -> Texture:
    """Draws all triangles as the rays' camera sees them: int32[1, h, w], the triangle at every pixel, −1 where none is.

    `facing` "front" culls triangles seen from behind. What is nearer to the eye, along the view, than 2^-20 of the
    farthest corner of the scene's box is not drawn. Pixels of dead rays are drawn like others. `InputError` as
    `pinhole`.
    """
    camera = pinhole(rays)
    mirrored = float(np.cross(camera.right, camera.up) @ camera.forward) > 0.0
    cull = CullMode.NONE if facing == "both" else (CullMode.FRONT if mirrored else CullMode.BACK)
    assert rays.width is not None and rays.height is not None
    target = Framebuffer(rays.width, rays.height, {"triangle": TextureFormat.R32SINT})
    target.clear_color("triangle", -1)
    target.clear_depth(0.0)
    draw(
        drawing_pass(cull),
        vertices=VertexBuffer.of(Position, position=scene.triangles.reshape(-1, 3)),
        uniforms=projection(camera, scene),
        framebuffer=target,
        counters=counters,
        taps=taps,
        threads=threads,
    )
    return target.texture("triangle")


def projection(camera: Pinhole, scene: Scene) -> Projection:
    """The inverse of the camera's matrix, row by row, and the near plane."""
    rows = np.linalg.inv(np.stack(camera[1:], axis=1))
    farthest = np.maximum(np.abs(scene.lower - camera.eye), np.abs(scene.upper - camera.eye))
    near = NEAR * float(np.sqrt((farthest * farthest).sum()))
    eye, x, y, w = (_vector(vector) for vector in (camera.eye, *rows))
    return Projection(eye, x, y, w, np.float32(near))


@cache
def drawing_pass(cull: CullMode) -> Pipeline:
    """Triangles with their numbers, the nearest kept."""
    return Pipeline(
        VertexState(projecting_vertex, Number, (VertexBufferLayout(Position),)),
        FragmentState(number_fragment, Number),
        PrimitiveTopology.TRIANGLE_LIST,
        DepthStencilState(depth_write_enabled=True, depth_compare=CompareFunction.GREATER),
        label="primary intersections",
        cull_mode=cull,
    )


@func
def projecting_vertex(u: Any, t: Any, attributes: Any, vertex_index: Any, instance_index: Any) -> Any:
    """World to clip space; every three vertices are a triangle."""
    ahead = sub(attributes[0].position, u.eye)
    position = dot(u.x, ahead), dot(u.y, ahead), u.near, dot(u.w, ahead)
    return position, F1, Number(np.int32(vertex_index) // CORNERS)


@func
def number_fragment(u: Any, t: Any, v: Any, inputs: Any, pixel: Any) -> Any:
    """Writes the number."""
    return True, F1, v


def _pixel_centres(pixels: NDArray[np.intp], width: int, height: int) -> tuple[Float64, Float64]:
    """NDC of pixel centres; row 0 is the top."""
    row, column = np.divmod(pixels, width)
    return (2.0 * column + 1.0) / width - 1.0, 1.0 - (2.0 * row + 1.0) / height


def _sample(live: NDArray[np.intp], width: int, height: int) -> NDArray[np.intp]:
    """Rows of `live` to fit the camera to: a lattice over the picture, or all where too little of it is alive."""
    columns = np.unique(np.linspace(0, width - 1, min(width, FITTED)).astype(np.intp))
    rows = np.unique(np.linspace(0, height - 1, min(height, FITTED)).astype(np.intp))
    lattice = (rows[:, None] * width + columns).ravel()
    chosen = np.flatnonzero(np.isin(live, lattice, assume_unique=True)) if len(live) < width * height else lattice
    return chosen if 2 * len(chosen) > len(lattice) else np.arange(len(live))


def _least_squares(direction: Float64, x: Float64, y: Float64) -> tuple[Float64, Float64, Float64]:
    d = direction / np.sqrt((direction * direction).sum(axis=0))
    p, zero = np.stack([x, y, np.ones_like(x)], axis=1), np.zeros_like(x)
    # d × (M p) = 0: three equations a ray, in the nine entries of M, row by row
    cross = np.array([[zero, -d[2], d[1]], [d[2], zero, -d[0]], [-d[1], d[0], zero]])
    equations = (cross.transpose(2, 0, 1)[..., None] * p[:, None, None, :]).reshape(-1, 9)
    _, sizes, solutions = np.linalg.svd(equations, full_matrices=False)
    if sizes[-2] <= LEAST_SPREAD * sizes[0]:
        raise InputError(f"{NO_PINHOLE}: the live ones are too few, or in a line, or all but parallel.")
    matrix = solutions[-1].reshape(3, 3)
    matrix = matrix / np.linalg.norm(matrix[:, 2])
    right, up, forward = (matrix if ((matrix @ p.T) * d).sum() > 0.0 else -matrix).T
    return right, up, forward


def _check_residual(
    axes: tuple[Float64, Float64, Float64], direction: Float64, x: Float64, y: Float64, live: NDArray[np.intp]
) -> None:
    a, b, c = (x * r + (y * u + f) for r, u, f in zip(*axes, strict=True))
    i, j, k = direction
    across = np.sqrt((b * k - c * j) ** 2 + (c * i - a * k) ** 2 + (a * j - b * i) ** 2)
    off = np.arctan2(across, a * i + b * j + c * k)
    worst = int(np.argmax(off))
    if off[worst] > MOST_RESIDUAL:
        raise InputError(
            f"{NO_PINHOLE}: ray {int(live[worst])} is {off[worst]:.2g} radians off the camera that fits best, "
            f"and {MOST_RESIDUAL:.2g} is allowed."
        )


def _vector(vector: Float64) -> tuple[np.float32, np.float32, np.float32]:
    x, y, z = vector.astype(np.float32)
    return x, y, z
