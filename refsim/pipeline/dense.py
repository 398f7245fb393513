"""The dense loop's kernel: bins [first_bin, last_bin) of the screen, each with its primitives in submission order.

A template (see `refsim.jit.specialise`); its free capital names and functions are slots. All working columns are rows
of two arrays, so that the compiler can prove that they do not overlap.
"""

from __future__ import annotations

import numpy as np

from refsim.pipeline.fragment import (
    COUNTS,
    OFF,
    PACKET,
    STENCIL_MASK,
    STENCIL_OFF,
    StencilValues,
    add_fates,
    add_scaled,
    commit,
    cover,
    load_plane,
    probe,
    select_plane,
    store_plane,
)

I = np.int32  # noqa: E741
U = np.uintp


def dense_bins(
    uniforms, textures, stencil_values, primitives, bins, shape, input_floats, input_ints, target, counts
):
    """Runs the fragment stage over bins.

    `primitives` = (rect i32[n, 4], depth f32[n], VF f32[n, k], VI i32[n, k]); `bins` = (start, items, first_bin,
    last_bin, bins_x); `shape` = (log2 of a bin's width, of its height); `input_…` planes of the input attachments;
    `target` = (floats [k, h, w], ints [k, h, w], depth, stencil, invocations); `counts` i64[COUNTS] is added to.
    """
    u = rebuild_uniforms(uniforms)  # noqa: F821
    t = rebuild_textures(textures)  # noqa: F821
    values = StencilValues(stencil_values[0], stencil_values[1], stencil_values[2])
    rect, depths, VF, VI = primitives
    start, items, first_bin, last_bin, bins_x = bins
    log2_width, log2_height = shape
    color_f, color_i, depth_plane, stencil_plane, invocation_plane = target
    target_height, target_width = depth_plane.shape
    n = 1 << (log2_width + log2_height)
    # Working columns: input texels, outputs, colour targets, depth; then the integer ones
    FW = np.zeros((IN_F + 2 * OUT_F + 1, PACKET), np.float32)  # noqa: F821
    IW = np.zeros((IN_I + 2 * OUT_I + 5, PACKET), np.int32)  # noqa: F821
    TF, OF, CF = FW[:IN_F], FW[IN_F : IN_F + OUT_F], FW[IN_F + OUT_F : IN_F + 2 * OUT_F]  # noqa: F821
    TI, OI, CI = IW[:IN_I], IW[IN_I : IN_I + OUT_I], IW[IN_I + OUT_I : IN_I + 2 * OUT_I]  # noqa: F821
    depth = FW[IN_F + 2 * OUT_F]  # noqa: F821
    stencil = IW[IN_I + 2 * OUT_I]  # noqa: F821
    alive = IW[IN_I + 2 * OUT_I + 1]  # noqa: F821
    write = IW[IN_I + 2 * OUT_I + 2]  # noqa: F821
    invoked = IW[IN_I + 2 * OUT_I + 3]  # noqa: F821
    total = IW[IN_I + 2 * OUT_I + 4]  # noqa: F821
    columns = TF, TI, alive, depth, stencil
    out = OF, OI, write, invoked
    local = np.zeros(COUNTS, np.int64)
    for b in range(first_bin, last_bin):
        if start[U(b)] == start[U(b + 1)]:
            continue
        y0, x0 = I((b // bins_x) << log2_height), I((b % bins_x) << log2_width)
        width = min(1 << log2_width, target_width - x0)
        height = min(1 << log2_height, target_height - y0)
        load_plane(depth_plane, depth, x0, y0, width, height, log2_width)
        load_plane(stencil_plane, stencil, x0, y0, width, height, log2_width)
        for k in range(IN_F):  # noqa: F821
            load_plane(input_floats[k], TF[k], x0, y0, width, height, log2_width)
        for k in range(IN_I):  # noqa: F821
            load_plane(input_ints[k], TI[k], x0, y0, width, height, log2_width)
        total[:n] = OFF
        changed = False
        fresh = False
        rx0, ry0, rx1, ry1 = I(0), I(0), I(0), I(0)
        first, last = 0, 0
        covered, masked = np.int64(0), np.int64(0)
        pending = OFF
        for k in range(start[U(b)], start[U(b + 1)]):
            p = U(items[U(k)])
            # Coverage of this bin; kept from the primitive before if neither rectangle nor stencil mask changed
            ax, ay = max(I(rect[p, 0] - x0), I(0)), max(I(rect[p, 1] - y0), I(0))
            bx, by = min(I(rect[p, 2] - x0), I(width)), min(I(rect[p, 3] - y0), I(height))
            if not (fresh and ax == rx0 and ay == ry0 and bx == rx1 and by == ry1):
                add_scaled(total, alive, pending, n)
                pending = OFF
                if last > first:
                    alive[first:last] = OFF
                rx0, ry0, rx1, ry1 = ax, ay, bx, by
                first, last = np.int64(ay) << log2_width, np.int64(by) << log2_width
                covered, masked = cover(TESTS, values, alive, stencil, (ax, ay, bx, by), log2_width, first, last)  # noqa: F821
                fresh = True
            if masked == 0:
                add_fates(TESTS, local, covered, masked, masked, masked, masked)  # noqa: F821
                continue
            varyings = get_varyings(VF, VI, p)  # noqa: F821
            z0 = depths[p]
            if not COUNT_LANES:  # noqa: F821
                pending = I(pending + 1)
            if TESTS.probe:  # noqa: F821
                n1, n2, n3 = probe(
                    fragment, get_inputs, TESTS, values, u, t, varyings, z0, x0, y0, log2_width, first, last, columns  # noqa: F821
                )
                if n3 == 0:
                    add_fates(TESTS, local, covered, masked, n1, n2, n3)  # noqa: F821
                    continue
            if not changed:
                for c in range(OUT_F):  # noqa: F821
                    load_plane(color_f[c], CF[c], x0, y0, width, height, log2_width)
                for c in range(OUT_I):  # noqa: F821
                    load_plane(color_i[c], CI[c], x0, y0, width, height, log2_width)
                changed = True
            n1, n2, n3 = commit(
                fragment, get_inputs, put_outputs, TESTS, values, u, t, varyings, z0, x0, y0, log2_width,  # noqa: F821
                first, last, columns, out,
            )
            add_fates(TESTS, local, covered, masked, n1, n2, n3)  # noqa: F821
            if COUNT_LANES:  # noqa: F821
                for j in range(first, last):
                    total[U(j)] = I(total[U(j)] + invoked[U(j)])
            for c in range(OUT_F):  # noqa: F821
                select_plane(write, OF[c], CF[c], first, last)
            for c in range(OUT_I):  # noqa: F821
                select_plane(write, OI[c], CI[c], first, last)
            # The mask outlives a write unless the write reaches bits that it reads
            if TESTS.stencil_mode == STENCIL_MASK:  # noqa: F821
                fresh = fresh and (values.read_mask & values.write_mask) == OFF
        add_scaled(total, alive, pending, n)
        if last > first:
            alive[first:last] = OFF
        for y in range(height):
            for x in range(width):
                invocation_plane[y0 + y, x0 + x] += total[(y << log2_width) + x]
        if changed:
            store_plane(depth_plane, depth, x0, y0, width, height, log2_width)
            if TESTS.stencil_mode != STENCIL_OFF:  # noqa: F821
                for y in range(height):
                    for x in range(width):
                        stencil_plane[y0 + y, x0 + x] = np.uint8(stencil[(y << log2_width) + x])
            for c in range(OUT_F):  # noqa: F821
                store_plane(color_f[c], CF[c], x0, y0, width, height, log2_width)
            for c in range(OUT_I):  # noqa: F821
                store_plane(color_i[c], CI[c], x0, y0, width, height, log2_width)
    for c in range(COUNTS):
        counts[c] += local[c]
