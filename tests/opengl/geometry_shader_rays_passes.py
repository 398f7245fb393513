"""What the passes of *Recursive Ray Tracing in Geometry Shader* drew and captured, on refsim and on OpenGL alike.

`Drawn` is a pass as records; `shot` are its rays and what they hit, told from the records alone: a ray that hit is
passed on, with its hit, and a ray is known by its pixel and type, which no other ray of a pass has both.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from refsim import Hits, Rays, Scene
from refsim.counters import Counters
from refsim.methods import METHODS
from refsim.options import checked
from refsim.papers.geometry_shader_rays import record
from refsim.papers.geometry_shader_rays.setup import options_of, prepared
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer, Setting

METHOD = "geometry_shader"
TYPES = 2**16  # more than a pass has of either sign


class Drawn(NamedTuple):
    """A pass: records f32[n, 16] that it drew and captured; primitives that were generated and that were captured."""

    source: np.ndarray
    captured: np.ndarray
    generated: int
    written: int


class Shot(NamedTuple):
    """Rays that a pass intersected, in their order: `key` i64[n] of pixel and type, `type` i64[n], rays and hits."""

    key: np.ndarray
    type: np.ndarray
    rays: Rays
    hits: Hits


def tracer_of(scene: Scene, rays: Rays, capacity: int | None = None, **options: Any) -> GeometryShaderTracer:
    """refsim's tracer with everything set up, as `refsim.trace` makes it."""
    given = checked(METHOD, METHODS[METHOD].options, options)
    shared = options_of(scene, given)
    assert rays.width and rays.height
    made = prepared(scene, rays, given, shared)
    return GeometryShaderTracer(made, rays.width, rays.height, shared, Setting(capacity=capacity))


def ours(tracer: GeometryShaderTracer, rays: Rays) -> tuple[list[Drawn], np.ndarray]:
    """refsim's passes and its picture f32[h, w, 3]."""
    drawn = []

    def after(k: int, source: Any, target: Any, found: Any, counters: Counters) -> None:
        before, captured = (np.ascontiguousarray(buffer.floats[:, : buffer.rows].T) for buffer in (source, target))
        drawn.append(Drawn(before, captured, counters["stream_output.generated"], counters["stream_output.primitives"]))

    image = tracer.draw_passes(rays, Counters(), after)
    return drawn, np.ascontiguousarray(np.moveaxis(image[:3], 0, 2))


def pixels_of(records: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """i64[n]: the pixel whose centre each record's point is at, in rows from the top."""
    width, height = size
    x = np.rint((records[:, record.X] + 1) * width / 2 - 0.5)
    y = np.rint((1 - records[:, record.Y]) * height / 2 - 0.5)
    return (y * width + x).astype(np.int64)


def keys_of(records: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """i64[n]: pixel and type as one number."""
    return pixels_of(records, size) * TYPES + records[:, record.TYPE].astype(np.int64) + TYPES // 2


def shot(drawn: Drawn, size: tuple[int, int]) -> Shot:
    """The rays of a pass and their hits; a ray that was not passed on has missed."""
    rays = drawn.source[drawn.source[:, record.STATE] <= record.TO_BE_SHOT]
    key = keys_of(rays, size)
    passed = drawn.captured[drawn.captured[:, record.STATE] == record.SHADED]
    passed_key = keys_of(passed, size)
    order = np.argsort(passed_key)
    assert len(np.unique(key)) == len(key) and len(np.unique(passed_key)) == len(passed_key)
    assert np.isin(passed_key, key).all()
    at = np.searchsorted(passed_key[order], key)
    found = np.flatnonzero(np.isin(key, passed_key))
    row = order[at[found]]
    triangle = np.full(len(rays), -1, np.int32)
    t, u, v = (np.full(len(rays), fill, np.float32) for fill in (np.inf, 0, 0))
    triangle[found] = passed[row, record.INDEX]
    for column, values in ((record.T, t), (record.U, u), (record.V, v)):
        values[found] = passed[row, column]
    t[triangle < 0] = np.inf
    origin, direction = rays[:, record.ORIGIN : record.T], rays[:, record.DIRECTION : record.INDEX]
    columns = (np.ascontiguousarray(part) for part in (origin, direction, rays[:, record.T]))
    made = Rays.unchecked(*columns, None, None)
    return Shot(key, rays[:, record.TYPE].astype(np.int64), made, Hits(triangle, t, u, v))


def outcome(rays: Shot) -> np.ndarray:
    """i64[n]: what decides the course of things: the triangle of a surface ray, hit or miss of a shadow ray."""
    return np.where(rays.type > 0, rays.hits.triangle >= 0, rays.hits.triangle)


def otherwise(a: Shot, b: Shot) -> np.ndarray:
    """Pixels where a ray that both sides shot hit something else on one than on the other, i64[k]."""
    both, at_a, at_b = np.intersect1d(a.key, b.key, return_indices=True)
    return np.unique(both[outcome(a)[at_a] != outcome(b)[at_b]] // TYPES)
