"""What a triangle covers and what its fragments get: exact edges on the sub-pixel grid, barycentrics, depth.

Corners are whole numbers of 1/256 pixel below 2²³ in size, so every edge function is a whole number below 2⁵⁰: float64
holds it exactly, in whatever order it is summed. What is covered therefore depends on nothing but the corners. A pixel
is covered if its centre lies inside, or on a top or left edge. Sources: WebGPU "polygon rasterization", OpenGL 4.6
section 14.6.1, Direct3D 11.3 functional specification section 3.4.2.1 (top-left rule).

    edge k of corners a, b:  Eₖ(p) = (b − a) × (p − a)          weights:  bₖ = Eₖ / 2A
    depth:                   z = z₀ + b₁(z₁−z₀) + b₂(z₂−z₀)     perspective weights:  pₖ = (bₖ / wₖ) / Σ (bⱼ / wⱼ)
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func

D = np.float64
F = np.float32
I = np.int32  # noqa: E741
F1 = np.float32(1)
D0 = np.float64(0)
D1 = np.float64(1)
HALF = np.float64(128)  # a pixel's centre, in 1/256 pixel
PIXEL = np.float64(256)
FAR = np.float64(2**30)

# Columns of a triangle: corners (in 1/256 pixel, turned so that the area is positive) and whether it faces the front;
# depths of the corners, their 1/w, depth bias
CORNER_COLUMNS = 7
PLANE_COLUMNS = 7


@func
def doubled_area(x0, y0, x1, y1, x2, y2):
    """Twice the signed area in (1/256 pixel)², int64; positive if the corners go round clockwise on the screen."""
    return (np.int64(x1) - np.int64(x0)) * (np.int64(y2) - np.int64(y0)) - (np.int64(x2) - np.int64(x0)) * (
        np.int64(y1) - np.int64(y0)
    )


@func
def edge(ax, ay, bx, by):
    """E(x, y) = A·x + B·y + C for the pixel in column x and row y, and 1 if its own points are not covered.

    Positive area and y down: the inside is where E > 0. An edge that goes up is a left one; one that goes straight to
    the right is a top one.
    """
    dx, dy = bx - ax, by - ay
    constant = dx * (HALF - ay) - dy * (HALF - ax)
    top_left = (dy < D0) | ((dy == D0) & (dx > D0))
    return -dy * PIXEL, dx * PIXEL, constant, D0 if top_left else D1


@func
def shape_of_triangle(corner, p):
    """The three edges of triangle p, opposite to corner 0, 1, 2, and the inverse of twice its area."""
    x0, y0 = D(corner[p, 0]), D(corner[p, 1])
    x1, y1 = D(corner[p, 2]), D(corner[p, 3])
    x2, y2 = D(corner[p, 4]), D(corner[p, 5])
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    return edge(x1, y1, x2, y2), edge(x2, y2, x0, y0), edge(x0, y0, x1, y1), D1 / area


@func
def edge_at(e, x, y):
    """The edge function at the centre of pixel (x, y), in (1/256 pixel)²."""
    return e[0] * x + e[1] * y + e[2]


@func
def start_walk(shape, px, py):
    """The three edge functions at pixel (x, y), to be carried along its row."""
    x, y = D(px), D(py)
    return edge_at(shape[0], x, y), edge_at(shape[1], x, y), edge_at(shape[2], x, y)


@func
def step_walk(shape, walk):
    """One pixel to the right; exact, as everything here is a whole number."""
    return walk[0] + shape[0][0], walk[1] + shape[1][0], walk[2] + shape[2][0]


@func
def locate_on_walk(shape, walk):
    """`locate_in_triangle` where the walk stands."""
    covered = (walk[0] >= shape[0][3]) & (walk[1] >= shape[1][3]) & (walk[2] >= shape[2][3])
    return covered, walk[1] * shape[3], walk[2] * shape[3]


@func
def locate_in_triangle(shape, px, py):
    """(whether the pixel is covered, b₁, b₂) in float64."""
    return locate_on_walk(shape, start_walk(shape, px, py))


@func
def edge_in_bin(e, x0, y0):
    """An edge for the pixels of a bin at (x0, y0), which is at most 32 pixels wide: int32 (a, b, c). A pixel is on the
    covered side if a·x + b·y + c ≥ 0, x and y counted in the bin.

    A and B are multiples of 256, so only the constant is rounded, downwards, and that changes no sign. Where the edge
    is far away the constant is cut at ±2³⁰; a·x + b·y stays below that.
    """
    a, b = e[0] / PIXEL, e[1] / PIXEL
    c = np.floor((e[2] - e[3]) / PIXEL) + a * D(x0) + b * D(y0)
    return I(a), I(b), I(min(max(c, -FAR - D1), FAR))


@func
def triangle_in_bin(shape, x0, y0):
    """All three edges for the pixels of a bin."""
    return edge_in_bin(shape[0], x0, y0), edge_in_bin(shape[1], x0, y0), edge_in_bin(shape[2], x0, y0)


@func
def inside_edges(edges, x, y):
    """Whether pixel (x, y) of the bin is covered: none of three int32 is negative."""
    e0 = I(I(edges[0][0] * x) + I(edges[0][1] * y)) + edges[0][2]
    e1 = I(I(edges[1][0] * x) + I(edges[1][1] * y)) + edges[1][2]
    e2 = I(I(edges[2][0] * x) + I(edges[2][1] * y)) + edges[2][2]
    return I(I(e0) | I(e1) | I(e2)) >= I(0)


@func
def edge_bounds(e, x0, y0, x1, y1):
    """Least and greatest value of an edge over the pixels [x0, x1) × [y0, y1)."""
    ax, bx = e[0] * D(x0), e[0] * D(x1 - 1)
    ay, by = e[1] * D(y0), e[1] * D(y1 - 1)
    return min(ax, bx) + min(ay, by) + e[2], max(ax, bx) + max(ay, by) + e[2]


@func
def triangle_over(shape, x0, y0, x1, y1):
    """Over a rectangle of pixels: 0 surely none covered, 1 perhaps some, 2 all."""
    low0, high0 = edge_bounds(shape[0], x0, y0, x1, y1)
    low1, high1 = edge_bounds(shape[1], x0, y0, x1, y1)
    low2, high2 = edge_bounds(shape[2], x0, y0, x1, y1)
    some = (high0 >= shape[0][3]) & (high1 >= shape[1][3]) & (high2 >= shape[2][3])
    every = (low0 >= shape[0][3]) & (low1 >= shape[1][3]) & (low2 >= shape[2][3])
    return I(2) if every else (I(1) if some else I(0))


@func
def plane_of(plane, p):
    """Depths (bias in the first), depth differences, and 1/w of triangle p's corners."""
    z0 = D(plane[p, 0])
    return (
        z0 + D(plane[p, 6]), D(plane[p, 1]) - z0, D(plane[p, 2]) - z0,
        plane[p, 3], plane[p, 4], plane[p, 5],
    )  # fmt: skip


@func
def depth_at(plane, b1, b2):
    """Window depth, linear on the screen; rounded to float32 once."""
    return F(plane[0] + b1 * plane[1] + b2 * plane[2])


@func
def weights_at(plane, b1, b2):
    """(b₁, b₂, p₁, p₂): linear and perspective weights of corners 1 and 2, float32."""
    linear0, linear1, linear2 = F(D1 - b1 - b2), F(b1), F(b2)
    q0, q1, q2 = linear0 * plane[3], linear1 * plane[4], linear2 * plane[5]
    inverse = F1 / (q0 + q1 + q2)
    return linear1, linear2, q1 * inverse, q2 * inverse


@func
def bias_of(z0, z1, z2, x0, y0, x1, y1, x2, y2, area, bias):
    """Depth bias of a triangle, float32; ``bias`` = (constant, slope scale, clamp, step of the format or 0).

    WebGPU "depth bias" / OpenGL 4.6 section 14.6.5: constant · r + scale · max(|∂z/∂x|, |∂z/∂y|), clamped. r is the
    step of a fixed-point format; for float32 that of the triangle's greatest depth.
    """
    constant, scale, clamp, step = bias
    dz1, dz2 = D(z1) - D(z0), D(z2) - D(z0)
    dzdx = (dz1 * D(y2 - y0) - dz2 * D(y1 - y0)) * PIXEL / D(area)
    dzdy = (dz2 * D(x1 - x0) - dz1 * D(x2 - x0)) * PIXEL / D(area)
    slope = F(max(abs(dzdx), abs(dzdy)))
    r = step
    if step == F(0):
        greatest = max(abs(z0), abs(z1), abs(z2))
        exponent = max(I(np.float32(greatest).view(np.int32) >> I(23)) - I(23), I(1))
        r = np.int32(exponent << I(23)).view(np.float32)
    value = constant * r + scale * slope
    value = min(value, clamp) if clamp > F(0) else value
    return max(value, clamp) if clamp < F(0) else value
