"""The rasteriser: primitives become rectangles of pixels, rectangles are sorted into bins of the screen.

Points and quads cover whole rectangles, so a primitive's coverage is four integers (x0, y0, x1, y1), half open; of a
triangle they bound it (`refsim.pipeline.triangle`). A pixel is covered when its centre lies in [x0, x1) × [y0, y1) of
the rectangle, whose centre, size and corners are rounded to 1/256 pixel. A point or quad of which any
vertex lies outside the clip volume −w ≤ x, y ≤ w, 0 ≤ z ≤ w, w > 0 is clipped as a whole: that is what OpenGL and
Direct3D do with points, and full-screen quads never cross the volume. A quad's depth is its first vertex's.

Bins hold primitives in submission order. Sources: WebGPU "rasterization", OpenGL 4.6 section 14.4 (points).
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import PrimitiveFate
from refsim.pipeline.viewport import snapped, to_depth, to_screen

F0 = np.float32(0)
F1 = np.float32(1)
HALF = np.float32(0.5)
GRID = np.float32(1 / 256)
I = np.int32  # noqa: E741
U = np.uintp

# What becomes of a primitive, as kernels take it
DRAWN, CLIPPED, EMPTY, CROOKED, CULLED = (np.int32(fate) for fate in PrimitiveFate)


@func
def inside_clip_volume(x, y, z, w):
    """Whether a vertex lies in the clip volume."""
    return (w > F0) & (x >= -w) & (x <= w) & (y >= -w) & (y <= w) & (z >= F0) & (z <= w)


@func
def first_pixel(edge, low, high):
    """Index of the first pixel whose centre is at or beyond `edge`, clamped to [low, high]; NaN gives low."""
    pixel = np.ceil(edge - HALF)
    pixel = pixel if pixel > low else low
    return I(pixel if pixel < high else high)


@func
def rasterise_points(position, size, count, view, bounds, rect, depth, fate):
    """Rectangles of `count` points. `fate`: drawn, clipped or empty (covers no pixel)."""
    bx0, by0, bx1, by1 = bounds
    for j in range(count):
        i = U(j)
        x, y, z, w = position[0, i], position[1, i], position[2, i], position[3, i]
        inside = inside_clip_volume(x, y, z, w)
        inverse = F1 / w
        cx, cy = to_screen(x, y, inverse, view)
        cx, cy, half = snapped(cx) * GRID, snapped(cy) * GRID, snapped(size[i]) * GRID * HALF
        ax, bx = first_pixel(cx - half, bx0, bx1), first_pixel(cx + half, bx0, bx1)
        ay, by = first_pixel(cy - half, by0, by1), first_pixel(cy + half, by0, by1)
        rect[0, i] = ax
        rect[1, i] = ay
        rect[2, i] = bx
        rect[3, i] = by
        depth[i] = to_depth(z, inverse, view)
        empty = (bx <= ax) | (by <= ay) | (not (half > F0))
        fate[i] = CLIPPED if not inside else (EMPTY if empty else DRAWN)


@func
def rasterise_quads(position, count, view, bounds, rect, depth, fate):
    """Rectangles of `count` quads of four vertices each. `fate` crooked: no axis-aligned rectangle."""
    bx0, by0, bx1, by1 = bounds
    for j in range(count):
        inside = True
        left, right, top, bottom = np.float32(np.inf), np.float32(-np.inf), np.float32(np.inf), np.float32(-np.inf)
        corners = 0
        for k in range(4):
            i = U(4 * j + k)
            x, y, z, w = position[0, i], position[1, i], position[2, i], position[3, i]
            inside &= inside_clip_volume(x, y, z, w)
            cx, cy = to_screen(x, y, F1 / w, view)
            cx, cy = snapped(cx), snapped(cy)
            left, right, top, bottom = min(left, cx), max(right, cx), min(top, cy), max(bottom, cy)
        for k in range(4):
            i = U(4 * j + k)
            cx, cy = to_screen(position[0, i], position[1, i], F1 / position[3, i], view)
            cx, cy = snapped(cx), snapped(cy)
            at_corner = ((cx == left) | (cx == right)) & ((cy == top) | (cy == bottom))
            corners |= (1 << (I(cx == right) + 2 * I(cy == bottom))) if at_corner else 16
        ax, bx = first_pixel(left * GRID, bx0, bx1), first_pixel(right * GRID, bx0, bx1)
        ay, by = first_pixel(top * GRID, by0, by1), first_pixel(bottom * GRID, by0, by1)
        i = U(j)
        rect[0, i] = ax
        rect[1, i] = ay
        rect[2, i] = bx
        rect[3, i] = by
        depth[i] = to_depth(position[2, U(4 * j)], F1 / position[3, U(4 * j)], view)
        # Four distinct corners, or a quad of no width or height; anything else is no rectangle
        flat = (left == right) | (top == bottom)
        rectangle = (corners == 15) | (flat & (corners < 16))
        empty = (bx <= ax) | (by <= ay)
        fate[i] = CLIPPED if not inside else (CROOKED if not rectangle else (EMPTY if empty else DRAWN))


@func
def bins_of(rect, row, log2_width, log2_height):
    """The bins that a rectangle touches, [x0, x1) × [y0, y1)."""
    i = U(row)
    return (
        rect[i, 0] >> log2_width,
        rect[i, 1] >> log2_height,
        ((rect[i, 2] - I(1)) >> log2_width) + 1,
        ((rect[i, 3] - I(1)) >> log2_height) + 1,
    )


def bin_primitives(rect, ids, first, log2_width, log2_height, bins_x, start, items):
    """Sorts primitives ids[first:] into bins by counting; stops before `items` overflows.

    `rect` i32[n, 4] rows; `ids` i32[m] rows of `rect` in submission order; `start` i64[bins + 2], of which [b, b + 1)
    bounds bin b afterwards; `items` i32[capacity] rows of `rect`. Returns the place in `ids` of the first primitive
    that was left out. Submission order is kept within every bin.
    """
    bins = start.shape[0] - 2
    start[:] = 0
    last = first
    total = np.int64(0)
    while last < ids.shape[0]:
        bx0, by0, bx1, by1 = bins_of(rect, ids[U(last)], log2_width, log2_height)
        total += np.int64(bx1 - bx0) * np.int64(by1 - by0)
        if total > items.shape[0]:
            break
        if (bx1 - bx0) * (by1 - by0) == 1:  # the usual case, without loops
            start[U(by0 * bins_x + bx0 + 2)] += 1
        else:
            for by in range(by0, by1):
                for bx in range(bx0, bx1):
                    start[U(by * bins_x + bx + 2)] += 1
        last += 1
    for b in range(2, bins + 2):
        start[U(b)] += start[U(b - 1)]
    for k in range(first, last):
        i = ids[U(k)]
        bx0, by0, bx1, by1 = bins_of(rect, i, log2_width, log2_height)
        for by in range(by0, by1):
            for bx in range(bx0, bx1):
                slot = U(by * bins_x + bx + 1)
                items[U(start[slot])] = i
                start[slot] += 1
    return last
