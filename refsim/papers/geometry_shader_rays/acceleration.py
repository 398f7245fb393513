"""What finds a ray's triangle: the interface that the shaders call, and the test that every structure ends in.

Section 6 wishes for "another structure in the grid's place"; whatever fits here can stand there. An `Accelerator` is
data, bound with the textures, and a device function

    traverse(structure, triangles, o, d, t_max, any_hit, front_only)
        -> (triangle, t, u, v, cells, tests, rejected)

o, d: tuples of three float32; the search ends at t_max. `any_hit`: the first triangle found is enough (shadow rays).
`triangles` is the texture that `triangle_textures` makes. Of two triangles at the same t the lower number wins, so
every structure finds the same. On a miss triangle is −1, t is t_max and u, v are 0. `cells`, `tests` and `rejected`
count what was visited, every triangle test (a triangle tested twice counts twice), and 1 if the scene's box alone
answered.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from refsim.geometry.triangle import intersect
from refsim.jit import func
from refsim.papers.geometry_shader_rays.triangle_textures import fetch

F0 = np.float32(0)
NONE = np.int32(-1)


class Accelerator(NamedTuple):
    """A structure and the function that searches it."""

    name: str
    structure: Any
    traverse: Any


@func
def test_triangle(triangles, candidate, o, d, t_max, front_only, triangle, t, u, v):
    """One ray–triangle test: ``(triangle, t, u, v)`` of the nearer one, the candidate or what was found before.

    `t` is that of the hit found before, or t_max. At the same t the lower number wins.
    """
    a, b = fetch(triangles, candidate, 0), fetch(triangles, candidate, 1)
    m1, m2 = fetch(triangles, candidate, 2), fetch(triangles, candidate, 3)
    hit, s, p, q, facing = intersect(
        o, d, t_max, (a[0], a[1], a[2]), (b[0], b[1], b[2]), (m1[0], m1[1], m1[2]), (m2[0], m2[1], m2[2])
    )
    nearer = (s <= t) & ((s < t) | (candidate < triangle))
    if hit & nearer & ((facing < F0) | (front_only == 0)):
        triangle, t, u, v = candidate, s, p, q
    return triangle, t, u, v
