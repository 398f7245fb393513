"""The loop over fragment lists, for primitives of a few pixels, and the fragment tap.

Fragments are listed in submission order, shaded in packets (order does not matter there, shaders are pure), then
tested and written one after the other. The same `shade` and `resolve` as in the dense loop, so the same bits. With
TAP on, every fragment's fate, depth and outputs are copied out as well.
"""

# ruff: noqa: F821
from __future__ import annotations

import numpy as np

from refsim.jit import borrowed, func
from refsim.pipeline.fragment import (
    COUNTS,
    DEPTH_FAILED,
    DISCARDED,
    EARLY_DEPTH,
    EARLY_STENCIL,
    STENCIL_FAILED,
    STENCIL_MASK,
    STENCIL_OFF,
    WRITTEN,
    TestValues,
    add_fates,
    resolve,
    shade,
    stages,
)
from refsim.pipeline.packet import OFF, PACKET
from refsim.pipeline.stencil import stencil_passes

I = np.int32  # noqa: E741
U = np.uintp


@func
def fate_of(tests, masked, keep, stencil_ok, depth_ok):
    """The fate of one covered fragment (a `FragmentFate`)."""
    if not masked:
        return EARLY_STENCIL
    if tests.tests_first:
        return EARLY_STENCIL if not stencil_ok else (EARLY_DEPTH if not depth_ok else (WRITTEN if keep else DISCARDED))
    late = WRITTEN if depth_ok else DEPTH_FAILED
    if tests.stencil_first:
        return EARLY_STENCIL if not stencil_ok else (late if keep else DISCARDED)
    return DISCARDED if not keep else (late if stencil_ok else STENCIL_FAILED)


@func
def settle(tests, values, local, covered, keep, z, depth, stencil):
    """One fragment's tests, its counts and its fate: (written, new depth, new stencil, fate)."""
    written, stencil_ok, depth_ok, new_depth, new_stencil = resolve(tests, values, covered, keep, z, depth, stencil)
    first, second = stages(tests, covered, keep, stencil_ok, depth_ok)
    add_fates(
        tests, local, np.int64(1), np.int64(covered), np.int64(first), np.int64(second), np.int64(written)
    )  # fmt: skip
    return written, new_depth, new_stencil, fate_of(tests, covered, keep, stencil_ok, depth_ok)


def listed_bins(
    uniforms, textures, test_values, blend_constant, primitives, bins, shape, input_floats, input_ints, target, counts,
    tap,
):  # fmt: skip
    """Runs the fragment stage over bins; arguments as `refsim.pipeline.dense.dense_bins`, and the tap's columns.

    `tap` = (offset i64[bins], primitive i32[m], pixel i32[2, m], fate i32[m], depth f32[m], floats [k, m], ints
    [k, m], what the targets hold after it: floats, ints); bin b's fragments are written from offset[b] on. Without TAP
    it is not touched.
    """
    u = rebuild_uniforms(borrowed(uniforms))
    t = rebuild_textures(borrowed(textures))
    values = TestValues(test_values[0], test_values[1], test_values[2], test_values[3], test_values[4])
    rect, _, _, _, corner, _ = primitives
    start, items, first_bin, last_bin, bins_x = bins
    log2_width, log2_height = shape
    color_f, color_i, depth_plane, stencil_plane, invocation_plane = target
    tap_offset, tap_primitive, tap_pixel, tap_fate, tap_depth, tap_f, tap_i, tap_stored_f, tap_stored_i = tap
    FW = np.zeros((IN_F + OUT_F + 1, PACKET), np.float32)
    IW = np.zeros((IN_I + OUT_I + 4, PACKET), np.int32)
    TF, OF, z_column = FW[:IN_F], FW[IN_F : IN_F + OUT_F], FW[IN_F + OUT_F]
    W1, W2 = np.zeros(PACKET, np.float64), np.zeros(PACKET, np.float64)
    TI, OI = IW[:IN_I], IW[IN_I : IN_I + OUT_I]
    xs, ys, owner, kept = IW[IN_I + OUT_I], IW[IN_I + OUT_I + 1], IW[IN_I + OUT_I + 2], IW[IN_I + OUT_I + 3]
    local = np.zeros(COUNTS, np.int64)
    none = np.int64(0)
    for b in range(first_bin, last_bin):
        y0, x0 = I((b // bins_x) << log2_height), I((b % bins_x) << log2_width)
        x_end, y_end = I(x0 + (1 << log2_width)), I(y0 + (1 << log2_height))
        item, last_item = start[U(b)], start[U(b + 1)]
        x, y = I(0), I(0)
        opened = False
        at = tap_offset[U(b)] if TAP else none
        while item < last_item:
            # List fragments in submission order until the packet is full or the bin has no more
            n = 0
            while n < PACKET and item < last_item:
                p = U(items[U(item)])
                ax, ay = max(rect[p, 0], x0), max(rect[p, 1], y0)
                bx, by = min(rect[p, 2], x_end), min(rect[p, 3], y_end)
                if not opened:
                    x, y, opened = ax, ay, True
                shape = shape_of(primitives, p)
                while n < PACKET and y < by:
                    walk = start_walk(shape, x, y)
                    while n < PACKET and x < bx:
                        inside, b1, b2 = here(shape, walk)
                        xs[U(n)], ys[U(n)], owner[U(n)] = x, y, I(p)
                        W1[U(n)], W2[U(n)] = b1, b2
                        n += 1 if inside else 0
                        walk = step_walk(shape, walk)
                        x = I(x + 1)
                    if x == bx:
                        x, y = ax, I(y + 1)
                if y == by:
                    item += 1
                    opened = False
            # Shade
            for k in range(IN_F):
                for j in range(n):
                    TF[U(k), U(j)] = input_floats[k][U(ys[U(j)]), U(xs[U(j)])]
            for k in range(IN_I):
                for j in range(n):
                    TI[U(k), U(j)] = input_ints[k][U(ys[U(j)]), U(xs[U(j)])]
            for j in range(n):
                i, p = U(j), U(owner[U(j)])
                pixel = xs[i], ys[i]
                varyings, z = surface_at(surface_of(primitives, p), W1[i], W2[i])
                keep, z, outputs = shade(
                    fragment, TESTS, values, u, t, varyings, z, get_inputs(TF, TI, i), pixel
                )
                kept[i] = I(keep)
                z_column[i] = z
                put_outputs(OF, OI, i, outputs)
            # Test and write, one after the other
            for j in range(n):
                i = U(j)
                px, py = U(xs[i]), U(ys[i])
                keep = kept[i] != I(0)
                old_stencil = I(stencil_plane[py, px])
                masked = True
                if TESTS.stencil_mode == STENCIL_MASK:
                    masked = stencil_passes(TESTS.stencil, old_stencil, values.reference, values.read_mask)
                if TWO_SIDED and corner[U(owner[i]), 6] == OFF:
                    written, new_depth, new_stencil, fate = settle(
                        BACK_TESTS, values, local, masked, keep, z_column[i], depth_plane[py, px], old_stencil
                    )
                else:
                    written, new_depth, new_stencil, fate = settle(
                        TESTS, values, local, masked, keep, z_column[i], depth_plane[py, px], old_stencil
                    )
                depth_plane[py, px] = new_depth
                if TESTS.stencil_mode != STENCIL_OFF:
                    stencil_plane[py, px] = np.uint8(new_stencil)
                if fate != EARLY_STENCIL and fate != EARLY_DEPTH:
                    invocation_plane[py, px] += I(1)
                if written and PLAIN:
                    for c in range(TARGET_F):
                        color_f[U(c), py, px] = OF[U(c), i]
                    for c in range(TARGET_I):
                        color_i[U(c), py, px] = OI[U(c), i]
                elif written:
                    write_fragment(OF, OI, i, color_f, color_i, py, px, blend_constant)
                if TAP:
                    a = U(at)
                    tap_primitive[a], tap_pixel[0, a], tap_pixel[1, a] = owner[i], xs[i], ys[i]
                    tap_fate[a], tap_depth[a] = I(fate), z_column[i]
                    for c in range(OUT_F):
                        tap_f[U(c), a] = OF[U(c), i]
                    for c in range(OUT_I):
                        tap_i[U(c), a] = OI[U(c), i]
                    for c in range(TARGET_F):
                        tap_stored_f[U(c), a] = color_f[U(c), py, px]
                    for c in range(TARGET_I):
                        tap_stored_i[U(c), a] = color_i[U(c), py, px]
                    at += 1
    for c in range(COUNTS):
        counts[c] += local[c]


def count_fragments(primitives, bins, shape, offset):
    """Fills `offset` i64[bins] with where each bin's fragments start in a tap; returns how many there are."""
    rect = primitives[0]
    start, items, first_bin, last_bin, bins_x = bins
    log2_width, log2_height = shape
    total = np.int64(0)
    for b in range(first_bin, last_bin):
        offset[U(b)] = total
        y0, x0 = I((b // bins_x) << log2_height), I((b % bins_x) << log2_width)
        for k in range(start[U(b)], start[U(b + 1)]):
            p = U(items[U(k)])
            ax, ay = max(rect[p, 0], x0), max(rect[p, 1], y0)
            bx, by = min(rect[p, 2], I(x0 + (1 << log2_width))), min(rect[p, 3], I(y0 + (1 << log2_height)))
            total += fragments_of(shape_of(primitives, p), ax, ay, bx, by)
    return total
