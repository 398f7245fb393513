"""The front end of triangles: vertex stage, clipping, screen space, culling, bounding boxes, varyings of survivors.

`triangle_front` is a template (see `refsim.jit.specialise`); its free names are slots. Positions of a block of
triangles come first, in SIMD; then every triangle by itself. A triangle that needs no clipping is one row of the
columns, a clipped one as many as its polygon has triangles. Whoever needs more rows than there are is told so
(`fates[0]`) and runs again with more: shaders are pure.
"""

# ruff: noqa: F821
from __future__ import annotations

import numpy as np

from refsim.jit import borrowed, func
from refsim.pipeline.clip import CORNER, MOST_CORNERS, clip_polygon, convex_ring, whole_ring
from refsim.pipeline.raster import CLIPPED, CULLED, DRAWN, EMPTY
from refsim.pipeline.triangle import bias_of, doubled_area
from refsim.pipeline.viewport import LEAST_W, REACH, snapped, to_depth, to_screen

BLOCK = 512
D = np.float64
F = np.float32
I = np.int32  # noqa: E741
U = np.uintp
F0 = np.float32(0)
F1 = np.float32(1)
D1 = np.float64(1)
FARTHEST = np.float32((REACH + 1) * 256)
HALF_PIXEL = I(128)


@func
def outside_one_plane(position, a, b, c):
    """Whether all three corners lie beyond the same side of the clip volume."""
    left = (position[0, a] < -position[3, a]) & (position[0, b] < -position[3, b]) & (position[0, c] < -position[3, c])
    right = (position[0, a] > position[3, a]) & (position[0, b] > position[3, b]) & (position[0, c] > position[3, c])
    below = (position[1, a] < -position[3, a]) & (position[1, b] < -position[3, b]) & (position[1, c] < -position[3, c])
    above = (position[1, a] > position[3, a]) & (position[1, b] > position[3, b]) & (position[1, c] > position[3, c])
    near = (position[2, a] < F0) & (position[2, b] < F0) & (position[2, c] < F0)
    far = (position[2, a] > position[3, a]) & (position[2, b] > position[3, b]) & (position[2, c] > position[3, c])
    behind = (position[3, a] < LEAST_W) & (position[3, b] < LEAST_W) & (position[3, c] < LEAST_W)
    return left | right | below | above | near | far | behind


@func
def is_finite(position, i):
    """Whether a position holds four numbers."""
    total = position[0, i] * F0 + position[1, i] * F0 + position[2, i] * F0 + position[3, i] * F0
    return total == F0


@func
def needs_clipping(position, i, view):
    """Whether a corner lies where the rasteriser cannot go: before the near plane, beyond the far one, behind the eye
    or outside the guard band."""
    x, y, z, w = position[0, i], position[1, i], position[2, i], position[3, i]
    return (z < F0) | (z > w) | (w < LEAST_W) | (abs(x) > view[6] * w) | (abs(y) > view[7] * w)


@func
def on_screen(x, y, z, w, view, corner):
    """Writes a corner's row: x and y on the sub-pixel grid, depth, 1/w."""
    inverse = F1 / w
    sx, sy = to_screen(x, y, inverse, view)
    corner[0] = min(max(snapped(sx), -FARTHEST), FARTHEST)
    corner[1] = min(max(snapped(sy), -FARTHEST), FARTHEST)
    corner[2] = to_depth(z, inverse, view)
    corner[3] = inverse


@func
def first_centre(grid):
    """The first pixel whose centre is at or beyond a coordinate in 1/256 pixel."""
    return (grid + HALF_PIXEL - I(1)) >> I(8)


@func
def bounding_box(x0, y0, x1, y1, x2, y2, bounds):
    """Pixels whose centres lie in the box around three corners, within `bounds`: [x0, x1) × [y0, y1).

    The box is open at its right and lower side: no top or left edge runs there.
    """
    ax = max(first_centre(min(x0, min(x1, x2))), I(bounds[0]))
    ay = max(first_centre(min(y0, min(y1, y2))), I(bounds[1]))
    bx = min(first_centre(max(x0, max(x1, x2))), I(bounds[2]))
    by = min(first_centre(max(y0, max(y1, y2))), I(bounds[3]))
    return ax, ay, bx, by


@func
def set_up(corners, a, b, c, facing, bias, bounds, row, rect, corner, plane):
    """Screen-space set-up of a triangle into `row` of the columns: its fate, the area of its box, whether turned.

    `corners` f32[n, 4] rows of `on_screen`; `facing` = (sign of the area of a front face, fronts are culled, backs are
    culled, depth is biased), constants.
    """
    x0, y0 = I(corners[a, 0]), I(corners[a, 1])
    x1, y1 = I(corners[b, 0]), I(corners[b, 1])
    x2, y2 = I(corners[c, 0]), I(corners[c, 1])
    area = doubled_area(x0, y0, x1, y1, x2, y2)
    front = (area > 0) == (facing[0] > 0)
    bx0, by0, bx1, by1 = bounding_box(x0, y0, x1, y1, x2, y2, bounds)
    empty = (area == 0) | (bx1 <= bx0) | (by1 <= by0)
    culled = (area != 0) & ((facing[1] & front) | (facing[2] & (not front)))
    fate = CULLED if culled else (EMPTY if empty else DRAWN)
    boxed = np.int64(0)
    if fate == DRAWN and row < rect.shape[0]:
        i = U(row)
        rect[i, 0], rect[i, 1], rect[i, 2], rect[i, 3] = bx0, by0, bx1, by1
        # Corners go round clockwise on the screen from here on; the first stays the first
        turned = area < 0
        corner[i, 0], corner[i, 1] = x0, y0
        corner[i, 2], corner[i, 3] = (x2, y2) if turned else (x1, y1)
        corner[i, 4], corner[i, 5] = (x1, y1) if turned else (x2, y2)
        corner[i, 6] = I(front)
        z0, z1, z2 = corners[a, 2], corners[b, 2], corners[c, 2]
        plane[i, 0], plane[i, 3] = z0, corners[a, 3]
        plane[i, 1], plane[i, 4] = (z2, corners[c, 3]) if turned else (z1, corners[b, 3])
        plane[i, 2], plane[i, 5] = (z1, corners[b, 3]) if turned else (z2, corners[c, 3])
        plane[i, 6] = bias_of(z0, z1, z2, x0, y0, x1, y1, x2, y2, area, bias) if facing[3] else F0
    if fate == DRAWN:
        boxed = np.int64(bx1 - bx0) * np.int64(by1 - by0)
    return fate, boxed, area < 0


@func
def mixed(mix, polygon, at, position, a, b, c, va, vb, vc):
    """The varyings of a corner that clipping made: perspective ones by its weights in clip space, linear ones by those
    on the screen, where corner k weighs wₖ / w as much."""
    scale = D1 / max(polygon[at, 3], D(LEAST_W))
    b1, b2 = polygon[at, 5] * D(position[3, b]) * scale, polygon[at, 6] * D(position[3, c]) * scale
    return mix(va, vb, vc, F(b1), F(b2), F(polygon[at, 5]), F(polygon[at, 6]))


def triangle_front(
    uniforms, textures, buffers, indices, table, per_instance, first, count, view, bounds, bias, columns, fates
):
    """Runs triangles [first, first + count) of the draw; appends what is left to the columns.

    `columns` = (rect i32[c, 4], depth f32[c] (not used), source i64[c], VF f32[c, k], VI i32[c, k], corner i32[c, 7],
    plane f32[c, 7], became i8[count], the fate of every triangle); `fates` i64[8]: rows needed, triangles clipped,
    empty, 0, pixels in bounding boxes, triangles culled, drawn, pieces of clipped triangles that are drawn.
    """
    u = rebuild_uniforms(borrowed(uniforms))
    t = rebuild_textures(borrowed(textures))
    rect, _, source, VF, VI, corner, plane, became = columns
    position = np.empty((4, BLOCK * 3), np.float32)
    corners = np.empty((MOST_CORNERS, 4), np.float32)
    polygon = np.empty((MOST_CORNERS, CORNER), np.float64)
    spare = np.empty((MOST_CORNERS, CORNER), np.float64)
    ring = np.empty(MOST_CORNERS, np.int64)
    kept, clipped, empty, boxes, culled, drawn, pieces = 0, 0, 0, np.int64(0), 0, 0, 0
    done = 0
    while done < count:
        # A run of triangles of one instance
        primitive = first + done
        instance = primitive // per_instance
        start = primitive - instance * per_instance
        run = min(min(per_instance - start, count - done), BLOCK)
        for j in range(run):
            for k in range(3):
                p, _, _ = corner_shader(u, t, buffers, indices, table, start + j, instance, k)
                x, y, z, w = p
                position[0, U(3 * j + k)] = x
                position[1, U(3 * j + k)] = y
                position[2, U(3 * j + k)] = z
                position[3, U(3 * j + k)] = w
        for j in range(run):
            a, b, c = U(3 * j), U(3 * j + 1), U(3 * j + 2)
            finite = is_finite(position, a) and is_finite(position, b) and is_finite(position, c)
            if not finite or outside_one_plane(position, a, b, c):
                clipped += 1
                became[U(done + j)] = CLIPPED
                continue
            cut = needs_clipping(position, a, view) or needs_clipping(position, b, view)
            cut = cut or needs_clipping(position, c, view)
            n = 3
            if cut:
                for k in range(3):
                    for m in range(4):
                        polygon[U(k), U(m)] = D(position[U(m), U(3 * j + k)])
                    for m in range(3):
                        polygon[U(k), U(4 + m)] = D(k == m)
                n = clip_polygon(polygon, spare, D(view[6]), D(view[7]))
                if n < 3:
                    clipped += 1
                    became[U(done + j)] = CLIPPED
                    continue
                for k in range(n):
                    x, y, z, w = F(polygon[k, 0]), F(polygon[k, 1]), F(polygon[k, 2]), F(polygon[k, 3])
                    on_screen(x, y, z, max(w, LEAST_W), view, corners[U(k)])
            else:
                for k in range(3):
                    i = U(3 * j + k)
                    on_screen(position[0, i], position[1, i], position[2, i], position[3, i], view, corners[U(k)])
            # The triangle, or the fan of its polygon
            n = convex_ring(corners, n, ring) if cut else whole_ring(ring)
            fate = EMPTY
            for k in range(n - 2):
                at0, at1, at2 = U(ring[0]), U(ring[k + 1]), U(ring[k + 2])
                one, boxed, turned = set_up(
                    corners, at0, at1, at2, FACING, bias, bounds, kept, rect, corner, plane
                )
                fate = one if (fate == EMPTY or one == DRAWN) else fate
                if one != DRAWN:
                    continue
                boxes += boxed
                pieces += 1 if cut else 0
                if kept < rect.shape[0]:
                    source[U(kept)] = primitive + j
                    # The second corner changes places with the third where the set-up turned the triangle round
                    at1, at2 = (at2, at1) if turned else (at1, at2)
                    _, _, va = corner_shader(u, t, buffers, indices, table, start + j, instance, 0)
                    _, _, vb = corner_shader(u, t, buffers, indices, table, start + j, instance, 1)
                    _, _, vc = corner_shader(u, t, buffers, indices, table, start + j, instance, 2)
                    if cut:
                        cut0 = mixed(mix, polygon, at0, position, a, b, c, va, vb, vc)
                        cut1 = mixed(mix, polygon, at1, position, a, b, c, va, vb, vc)
                        cut2 = mixed(mix, polygon, at2, position, a, b, c, va, vb, vc)
                        put_spread(VF, VI, U(kept), cut0, cut1, cut2)
                    elif turned:
                        put_spread(VF, VI, U(kept), va, vc, vb)
                    else:
                        put_spread(VF, VI, U(kept), va, vb, vc)
                kept += 1
            became[U(done + j)] = fate
            drawn += 1 if fate == DRAWN else 0
            culled += 1 if fate == CULLED else 0
            empty += 1 if fate == EMPTY else 0
        done += run
    fates[0], fates[1], fates[2], fates[3] = kept, clipped, empty, 0
    fates[4], fates[5], fates[6], fates[7] = boxes, culled, drawn, pieces
