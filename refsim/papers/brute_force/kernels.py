"""Brute force's two loops: rays against all triangles, and the rays that leave the hits. Templates of `refsim.jit`."""

from __future__ import annotations

import numpy as np

from refsim.geometry.optics import next_ray
from refsim.geometry.triangle import intersect
from refsim.geometry.vector import add, normalise, scale

BLOCK = 256
F0 = np.float32(0)
F1 = np.float32(1)
INFINITY = np.float32(np.inf)
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


def new_rays(origin, direction, hit_triangle, hit, normals, vertex_normals, surface, epsilon, smooth, out, kind):
    """Rays that leave the hits: `out` f32[7, n] origin, direction, t_max; `kind` i32[n]. Misses stay zero."""
    for j in range(hit_triangle.shape[0]):
        i = U(j)
        if hit_triangle[i] < 0:
            continue
        k = U(hit_triangle[i])
        o = origin[0, i], origin[1, i], origin[2, i]
        d = direction[0, i], direction[1, i], direction[2, i]
        n = normals[k, 0], normals[k, 1], normals[k, 2]
        shading = n
        if smooth:
            u, v = hit[1, i], hit[2, i]
            n0 = vertex_normals[k, 0, 0], vertex_normals[k, 0, 1], vertex_normals[k, 0, 2]
            n1 = vertex_normals[k, 1, 0], vertex_normals[k, 1, 1], vertex_normals[k, 1, 2]
            n2 = vertex_normals[k, 2, 0], vertex_normals[k, 2, 1], vertex_normals[k, 2, 2]
            shading = normalise(add(add(scale(n0, F1 - u - v), scale(n1, u)), scale(n2, v)))
        new_origin, new_direction, new_kind, alive = next_ray(o, d, hit[0, i], n, shading, surface[k], epsilon)
        for c in range(3):
            out[U(c), i] = new_origin[c]
            out[U(c + 3), i] = new_direction[c]
        out[6, i] = INFINITY if alive else F0
        kind[i] = new_kind
