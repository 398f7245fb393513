"""Which rays a structure walks, and what becomes of the others: device functions that grid and hierarchy share.

`grid_margins` derives the limits. No float64 in here, and no component of a direction that is walked along is zero.
"""

from __future__ import annotations

import math

import numpy as np

from refsim.jit import func
from refsim.papers.geometry_shader_rays.acceleration import test_triangle

F0, F1, INFINITY = np.float32(0), np.float32(1), np.float32(np.inf)
NONE = np.int32(-1)
I = np.int32  # noqa: E741
U = np.uintp
FLATTEST = np.float32(2.0**-26)
SHORTEST, LONGEST = np.float32(2.0**-20), np.float32(2.0**20)


@func
def larger(a, b):
    """The larger of two; the second where one is not a number."""
    return a if a > b else b


@func
def smaller(a, b):
    """The smaller of two; the second where one is not a number."""
    return a if a < b else b


@func
def steep(component, least):
    """A direction's component, its size raised to `least` where it is smaller or not a number; its sign stays."""
    return math.copysign(larger(abs(component), least), component)


@func
def inverse_direction(d):
    """1 / d of the ray as it is walked, and d itself: no component smaller than 2⁻²⁶ of the largest."""
    least = FLATTEST * larger(abs(d[0]), larger(abs(d[1]), abs(d[2])))
    e = steep(d[0], least), steep(d[1], least), steep(d[2], least)
    return (F1 / e[0], F1 / e[1], F1 / e[2]), e


@func
def is_walked(s, d, far):
    """Whether the margins hold for the ray: `s` is the box's lower corner − origin."""
    most = larger(abs(d[0]), larger(abs(d[1]), abs(d[2])))
    near = (abs(s[0]) <= far) & (abs(s[1]) <= far) & (abs(s[2]) <= far)
    return near & (most >= SHORTEST) & (most <= LONGEST)


@func
def search_unwalked(loose, total, walked, triangles, o, d, t_max, any_hit, front_only):
    """What is tested before any walk: the loose triangles, or all `total` where the ray is not walked.

    A ray with a number that is not finite, or without direction, hits nothing; where it is not walked it tests nothing.
    Returns ``(triangle, t, u, v, tests)``.
    """
    speed, distance = abs(d[0]) + abs(d[1]) + abs(d[2]), abs(o[0]) + abs(o[1]) + abs(o[2])
    possible = (speed > F0) & (speed < INFINITY) & (distance < INFINITY)
    n = I(loose.size) if walked else (total if possible else I(0))
    triangle, t, u, v = NONE, t_max, F0, F0
    k, tests = I(0), I(0)
    while k < n:
        candidate = loose[U(k)] if walked else k
        triangle, t, u, v = test_triangle(triangles, candidate, o, d, t_max, front_only, triangle, t, u, v)
        tests += I(1)
        k += I(1)
        if (any_hit != 0) & (triangle >= 0):
            k = n
    return triangle, t, u, v, tests
