"""Brute force's loop: rays against all triangles. A template of `refsim.jit`."""

from __future__ import annotations

import numpy as np

from refsim.geometry.triangle import intersect

BLOCK = 256
F0 = np.float32(0)
I = np.int32  # noqa: E741
U = np.uintp


def nearest_hits(origin, direction, t_max, triangles, first, last, front_only, hit_triangle, hit):
    """Closest hits of rays [first, last); the triangle listed first wins a tie.

    `origin`, `direction` f32[3, n]; `triangles` f32[m, 12] rows (v0, n, m1, m2); `hit_triangle` i32[n], `hit` f32[3, n]
    (t, u, v) are written.
    """
    nearest = np.empty(BLOCK, np.float32)
    for start in range(first, last, BLOCK):
        n = min(BLOCK, last - start)
        for j in range(n):
            nearest[U(j)] = t_max[U(start + j)]
        for k in range(triangles.shape[0]):
            a = triangles[U(k)]
            v0, normal, m1, m2 = (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11])
            for j in range(n):
                i = U(start + j)
                o = origin[0, i], origin[1, i], origin[2, i]
                d = direction[0, i], direction[1, i], direction[2, i]
                found, t, u, v, facing = intersect(o, d, nearest[U(j)], v0, normal, m1, m2)
                if found and ((facing < F0) or not front_only):
                    nearest[U(j)] = t
                    hit_triangle[i] = I(k)
                    hit[0, i], hit[1, i], hit[2, i] = t, u, v
