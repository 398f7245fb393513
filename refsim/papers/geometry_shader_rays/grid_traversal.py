"""3-D DDA through the grid (section 4.3): the device function that searches it.

The early exit against the scene's box comes first (section 4.2). Then cell after cell: its texel says where its list
starts and how long it is, each reference names a triangle, each triangle is tested. A hit beyond the cell is kept and
not yet accepted: the search ends in the cell that is left at a parameter not below that of the nearest hit.

Plane k of an axis is crossed at corner + k · spacing, from its number each time, so no error adds up; `grid_margins`
says why no cell that holds the nearest hit is stepped past. The walk never leaves the grid: its last planes end it.

One return, at the end: with several, numba counts references to the arrays for every ray, with atomic operations.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.papers.geometry_shader_rays.acceleration import test_triangle
from refsim.papers.geometry_shader_rays.grid_rays import (
    inverse_direction,
    is_walked,
    larger,
    search_unwalked,
    smaller,
)

F0, F1, INFINITY = np.float32(0), np.float32(1), np.float32(np.inf)
I = np.int32  # noqa: E741
U = np.uintp


@func
def first_cell(t, corner, e, inverse_size, shape):
    """The cell along one axis at parameter t, kept within the grid."""
    place = (t - corner) * (e * inverse_size)
    return U(smaller(larger(place, F0), shape - F1))


@func
def sign(x):
    """One with the sign of x, which is not zero."""
    return F1 if x > F0 else -F1


@func
def stride(direction, texels):
    """How the number of a texel changes with a step: unsigned, backwards by wrapping round."""
    return texels if direction > F0 else U(0) - texels


@func
def search_grid(grid, triangles, o, d, t_max, any_hit, front_only):
    """The nearest hit by walking the grid; see `acceleration` for what goes in and out."""
    lower, size, shape = grid.lower, grid.size, grid.shape
    s = lower[0] - o[0], lower[1] - o[1], lower[2] - o[2]
    walked = is_walked(s, d, grid.far)
    triangle, t, u, v, tests = search_unwalked(
        grid.loose, grid.total, walked, triangles, o, d, t_max, any_hit, front_only
    )
    inverse, e = inverse_direction(d)
    cx, cy, cz = s[0] * inverse[0], s[1] * inverse[1], s[2] * inverse[2]
    dx, dy, dz = size[0] * inverse[0], size[1] * inverse[1], size[2] * inverse[2]
    ex, ey, ez = cx + shape[0] * dx, cy + shape[1] * dy, cz + shape[2] * dz
    enter = larger(larger(smaller(cx, ex), smaller(cy, ey)), larger(smaller(cz, ez), F0))
    leave = smaller(smaller(larger(cx, ex), larger(cy, ey)), larger(cz, ez))
    going = walked & (enter <= leave) & (enter <= t) & ((any_hit == 0) | (triangle < 0))
    rejected = I((tests == 0) & (not going))
    cells = I(0)
    if going:
        x = first_cell(enter, cx, e[0], grid.inverse_size[0], shape[0])
        y = first_cell(enter, cy, e[1], grid.inverse_size[1], shape[1])
        z = first_cell(enter, cz, e[2], grid.inverse_size[2], shape[2])
        width, layer = U(shape[0]), U(shape[0]) * U(shape[1])
        at = z * layer + y * width + x
        # Steps of the plane to be crossed next, and of the texel
        fx, fy, fz = sign(e[0]), sign(e[1]), sign(e[2])
        sx, sy, sz = stride(fx, U(1)), stride(fy, width), stride(fz, layer)
        kx, ky, kz = np.float32(x) + larger(fx, F0), np.float32(y) + larger(fy, F0), np.float32(z) + larger(fz, F0)
        tx, ty, tz = cx + kx * dx, cy + ky * dy, cz + kz * dz
        while going:
            cells += I(1)
            count = grid.texels[at, 2]
            if count > 0:
                k = (U(grid.texels[at, 1]) << grid.row_bits) | U(grid.texels[at, 0])
                end = k + U(count)
                while k < end:
                    candidate = grid.lists[k]
                    triangle, t, u, v = test_triangle(triangles, candidate, o, d, t_max, front_only, triangle, t, u, v)
                    tests += I(1)
                    k += U(1)
                    if (any_hit != 0) & (triangle >= 0):
                        k, leave = end, -INFINITY
            # Branches, not selections: neighbouring rays take the same steps, and a guess is quicker than a wait
            if tx <= ty and tx <= tz:
                going = tx < smaller(t, leave)
                at += sx
                kx += fx
                tx = cx + kx * dx
            elif ty <= tz:
                going = ty < smaller(t, leave)
                at += sy
                ky += fy
                ty = cy + ky * dy
            else:
                going = tz < smaller(t, leave)
                at += sz
                kz += fz
                tz = cz + kz * dz
    return triangle, t, u, v, cells, tests, rejected
