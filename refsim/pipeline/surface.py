"""How the fragment loops see a primitive: which pixels its shape covers, and what its surface has at each of them.

Rectangles (points, quads) cover all of their bounds with one depth and one set of varyings; triangles have edges, a
depth plane and interpolated varyings. Both loops are written once, against these functions:

    shape_of(primitives, p)         what decides on coverage     shape_over(shape, x0, y0, x1, y1)    none, some or all
    locate(shape, x, y)             (covered, b₁, b₂)            fragments_of(shape, x0, y0, x1, y1)  how many
    edges_of(shape, x0, y0)         the edges in a bin           inside(edges, x, y)                  covered, in SIMD
    start_walk(shape, x, y), step_walk(shape, walk), here(shape, walk)      `locate` along a row
    surface_of(primitives, p)       what its fragments see
    surface_at(surface, b₁, b₂)     (varyings, depth)            at(shape, surface, pixel)            both at once
"""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.jit import func
from refsim.pipeline.interpolation import Spread
from refsim.pipeline.layout import Layout, device_function
from refsim.pipeline.triangle import (
    depth_at,
    inside_edges,
    locate_in_triangle,
    locate_on_walk,
    plane_of,
    shape_of_triangle,
    start_walk,
    step_walk,
    triangle_in_bin,
    triangle_over,
    weights_at,
)

NONE_COVERED, SOME_COVERED, ALL_COVERED = np.int32(0), np.int32(1), np.int32(2)
D0 = np.float64(0)


@func
def no_shape(primitives, p):
    """A rectangle is its bounds."""
    return ()


@func
def all_over(shape, x0, y0, x1, y1):
    """A rectangle covers all of its bounds."""
    return ALL_COVERED


@func
def anywhere(shape, x, y):
    """A rectangle covers all of its bounds, and everywhere it is the same."""
    return True, D0, D0


@func
def no_walk(shape, x, y):
    """A rectangle is the same everywhere."""
    return ()


@func
def no_step(shape, walk):
    """So is a step of it."""
    return walk


@func
def all_along(shape, walk):
    """And all of it is covered."""
    return True, D0, D0


@func
def no_edges(shape, x0, y0):
    """A rectangle has none but its bounds."""
    return ()


@func
def always_inside(edges, x, y):
    """A rectangle covers all of its bounds."""
    return True


@func
def all_of(shape, ax, ay, bx, by):
    """Fragments that a rectangle makes within bounds."""
    return np.int64(max(bx - ax, 0)) * np.int64(max(by - ay, 0))


@func
def triangle_fragments(shape, ax, ay, bx, by):
    """Fragments that a triangle makes within bounds."""
    total = np.int64(0)
    for y in range(ay, by):
        for x in range(ax, bx):
            covered, _, _ = locate_in_triangle(shape, x, y)
            total += np.int64(covered)
    return total


@func
def triangle_shape(primitives, p):
    """Edges of triangle p."""
    return shape_of_triangle(primitives[4], p)


RECTANGLE = """
def surface_of(primitives, p):
    return get(primitives[2], primitives[3], p), primitives[1][p]
def surface_at(surface, b1, b2):
    return surface
"""

TRIANGLE = """
def surface_of(primitives, p):
    return take(primitives[2], primitives[3], p), plane_of(primitives[5], p)
def surface_at(surface, b1, b2):
    linear1, linear2, p1, p2 = weights_at(surface[1], b1, b2)
    return spread_at(surface[0], linear1, linear2, p1, p2), depth_at(surface[1], b1, b2)
"""

AT = """
def at(shape, surface, pixel):
    covered, b1, b2 = locate(shape, pixel[0], pixel[1])
    return surface_at(surface, b1, b2)
"""


def rectangle_slots(varyings: Layout) -> dict[str, Any]:
    """The functions for points and quads."""
    names = {"get": varyings.get_row}
    slots = {name: device_function(RECTANGLE, name, names) for name in ("surface_of", "surface_at")}
    return _with_at({
        **slots, "shape_of": no_shape, "shape_over": all_over, "locate": anywhere, "fragments_of": all_of,
        "edges_of": no_edges, "inside": always_inside,
        "start_walk": no_walk, "step_walk": no_step, "here": all_along,
    })  # fmt: skip


def triangle_slots(varyings: Spread) -> dict[str, Any]:
    """The functions for triangles."""
    names = {
        "take": varyings.take, "spread_at": varyings.at, "plane_of": plane_of, "weights_at": weights_at,
        "depth_at": depth_at,
    }  # fmt: skip
    slots = {name: device_function(TRIANGLE, name, names) for name in ("surface_of", "surface_at")}
    return _with_at({
        **slots, "shape_of": triangle_shape, "shape_over": triangle_over, "locate": locate_in_triangle,
        "fragments_of": triangle_fragments, "edges_of": triangle_in_bin, "inside": inside_edges,
        "start_walk": start_walk, "step_walk": step_walk, "here": locate_on_walk,
    })  # fmt: skip


def _with_at(slots: dict[str, Any]) -> dict[str, Any]:
    names = {"locate": slots["locate"], "surface_at": slots["surface_at"]}
    return {**slots, "at": device_function(AT, "at", names)}
