"""The search without any structure: every triangle, after the early exit against the scene's box (section 4.2)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.papers.geometry_shader_rays.acceleration import NONE, Accelerator, test_triangle
from refsim.papers.geometry_shader_rays.grid_margins import margins, rounded_down, rounded_up
from refsim.papers.geometry_shader_rays.grid_rays import inverse_direction, is_walked, larger, smaller
from refsim.scene.mesh import Scene

F0 = np.float32(0)
INFINITY = np.float32(np.inf)
I = np.int32  # noqa: E741
Triple = tuple[np.float32, np.float32, np.float32]


class AllTriangles(NamedTuple):
    """How many triangles there are, and the box around them, grown as `grid_margins` derives.

    `boxed` is 0 where a triangle has no bound to how far off it float32 accepts hits: then no ray is turned away. Nor
    is one whose origin is further than `far` from `lower` along an axis.
    """

    count: np.int32
    boxed: np.int32
    lower: Triple
    upper: Triple
    far: np.float32


def naive(scene: Scene, reach: float | None = None) -> Accelerator:
    """The search through all triangles; `reach` bounds how far from the scene's box rays start."""
    bounds = margins(scene, reach)
    lower, upper = _triple(rounded_down(bounds.lower)), _triple(rounded_up(bounds.upper))
    boxed = np.int32(len(bounds.loose) == 0)
    return Accelerator("naive", AllTriangles(np.int32(len(scene)), boxed, lower, upper, bounds.far), all_triangles)


def _triple(values: Any) -> Triple:
    x, y, z = values
    return x, y, z


@func
def misses_box(structure, o, d, t_max):
    """Slab test: the ray does not meet the box before t_max. False for rays that the margins do not cover."""
    lower, upper = structure.lower, structure.upper
    s = lower[0] - o[0], lower[1] - o[1], lower[2] - o[2]
    covered = (structure.boxed != 0) & is_walked(s, d, structure.far)
    inverse, _ = inverse_direction(d)
    ax, ay, az = s[0] * inverse[0], s[1] * inverse[1], s[2] * inverse[2]
    bx, by, bz = (upper[0] - o[0]) * inverse[0], (upper[1] - o[1]) * inverse[1], (upper[2] - o[2]) * inverse[2]
    enter = larger(larger(smaller(ax, bx), smaller(ay, by)), larger(smaller(az, bz), F0))
    leave = smaller(smaller(larger(ax, bx), larger(ay, by)), larger(az, bz))
    return covered & (not (enter <= smaller(t_max, leave)))


@func
def all_triangles(structure, triangles, o, d, t_max, any_hit, front_only):
    """Naive intersection: every triangle, in file order; see `acceleration` for what goes in and out.

    A ray with a number that is not finite, or without direction, is turned away too: it hits nothing.
    """
    speed = abs(d[0]) + abs(d[1]) + abs(d[2])
    distance = abs(o[0]) + abs(o[1]) + abs(o[2])
    possible = (speed > F0) & (speed < INFINITY) & (distance < INFINITY)
    left = structure.count if possible & (not misses_box(structure, o, d, t_max)) else I(0)
    rejected = I(left == 0)
    triangle, t, u, v = NONE, t_max, F0, F0
    k = I(0)
    tests = I(0)
    while k < left:
        triangle, t, u, v = test_triangle(triangles, k, o, d, t_max, front_only, triangle, t, u, v)
        tests += I(1)
        k += I(1)
        if (any_hit != 0) & (triangle >= 0):
            k = left
    return triangle, t, u, v, I(0), tests, rejected
