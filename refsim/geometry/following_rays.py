"""The rays that leave the hits of a generation, one a path. A template of `refsim.jit`, for methods without shaders."""

from __future__ import annotations

import numpy as np

from refsim.geometry.optics import next_ray
from refsim.geometry.vector import add, normalise, scale

F0 = np.float32(0)
F1 = np.float32(1)
INFINITY = np.float32(np.inf)
U = np.uintp


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
