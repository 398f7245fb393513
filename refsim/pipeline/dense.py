"""The dense loop's kernel: bins [first_bin, last_bin) of the screen, each with its primitives in submission order.

A template (see `refsim.jit.specialise`); its free names are slots.
"""

# ruff: noqa: F821
from __future__ import annotations

import numpy as np

from refsim.jit import borrowed
from refsim.pipeline.blocks import commit, cover, list_lanes, probe
from refsim.pipeline.fragment import COUNTS, STENCIL_MASK, STENCIL_OFF, TestValues, add_fates
from refsim.pipeline.packet import (
    BLOCK,
    OFF,
    add_pending,
    load_plane,
    new_packet,
    select_plane,
    store_plane,
)
from refsim.pipeline.state import StencilOperation
from refsim.pipeline.surface import NONE_COVERED, SOME_COVERED

I = np.int32  # noqa: E741
U = np.uintp


def dense_bins(
    uniforms, textures, test_values, blend_constant, primitives, bins, shape, input_floats, input_ints, target, counts
):
    """Runs the fragment stage over bins.

    `primitives` = (rect i32[n, 4], depth f32[n], VF f32[n, k], VI i32[n, k], corner and plane of triangles);
    `blend_constant` 4 float32; `bins` = (start, items, first_bin, last_bin, bins_x); `shape` = (log2 of a bin's width,
    of its height); `input_…` planes of the input attachments;
    `target` = (floats [k, h, w], ints [k, h, w], depth, stencil, invocations); `counts` i64[COUNTS] is added to.
    """
    u = rebuild_uniforms(borrowed(uniforms))
    t = rebuild_textures(borrowed(textures))
    values = TestValues(test_values[0], test_values[1], test_values[2], test_values[3], test_values[4])
    rect, _, _, _, corner, _ = primitives
    start, items, first_bin, last_bin, bins_x = bins
    log2_width, log2_height = shape
    color_f, color_i, depth_plane, stencil_plane, invocation_plane = target
    target_height, target_width = depth_plane.shape
    packet = new_packet(IN_F, IN_I, OUT_F, OUT_I)
    local = np.zeros(COUNTS, np.int64)
    # Lanes that count every invocation themselves need no pending count
    count_lanes = TESTS.counts_lanes
    fixed = TESTS.stencil_mode == STENCIL_MASK and (values.read_mask & values.write_mask) == OFF
    for b in range(first_bin, last_bin):
        if start[U(b)] == start[U(b + 1)]:
            continue
        # Load the bin: its lanes, their input texels and depths; colours only when something is written
        y0, x0 = I((b // bins_x) << log2_height), I((b % bins_x) << log2_width)
        width = min(I(1 << log2_width), I(target_width - x0))
        height = min(I(1 << log2_height), I(target_height - y0))
        origin, size = (x0, y0), (width, height)
        lanes = list_lanes(TESTS, values, packet, stencil_plane, origin, size, fixed and not TRIANGLES)
        load_plane(depth_plane, packet.depth, packet, origin, size, lanes)
        for k in range(IN_F):
            load_plane(input_floats[k], packet.TF[k], packet, origin, size, lanes)
        for k in range(IN_I):
            load_plane(input_ints[k], packet.TI[k], packet, origin, size, lanes)
        packet.total[:] = OFF
        packet.alive[:] = OFF
        blocks = (lanes + BLOCK - 1) // BLOCK
        changed = False
        fresh = False
        rx0, ry0, rx1, ry1 = I(0), I(0), I(0), I(0)
        masked, covered = np.int64(0), np.int64(0)
        pending = OFF
        for k in range(start[U(b)], start[U(b + 1)]):
            p = U(items[U(k)])
            # Live lanes; kept from the primitive before if neither rectangle nor stencil mask changed
            ax, ay = max(I(rect[p, 0] - x0), I(0)), max(I(rect[p, 1] - y0), I(0))
            bx, by = min(I(rect[p, 2] - x0), width), min(I(rect[p, 3] - y0), height)
            shape = shape_of(primitives, p)
            over = shape_over(shape, I(x0 + ax), I(y0 + ay), I(x0 + bx), I(y0 + by))
            if over == NONE_COVERED:
                continue
            if over == SOME_COVERED or not (fresh and ax == rx0 and ay == ry0 and bx == rx1 and by == ry1):
                if pending != OFF:
                    add_pending(packet, pending, lanes)
                    pending = OFF
                rx0, ry0, rx1, ry1 = ax, ay, bx, by
                covered = np.int64(bx - ax) * np.int64(by - ay)
                edges = edges_of(shape, x0, y0)
                if over == SOME_COVERED:
                    covered, masked = cover(TESTS, values, packet, (ax, ay, bx, by), lanes, True, inside, edges)
                else:
                    _, masked = cover(TESTS, values, packet, (ax, ay, bx, by), lanes, False, inside, edges)
                fresh = over != SOME_COVERED
            surface = surface_of(primitives, p)
            n1, n2, n3 = OFF, OFF, OFF
            for block in range(blocks):
                if packet.block_alive[U(block)] == OFF:
                    continue
                first = block * BLOCK
                if TESTS.probe:
                    if TWO_SIDED and corner[p, 6] == OFF:
                        m1, m2, m3 = probe(
                            fragment, get_inputs, at, BACK_TESTS, values, u, t, shape, surface, x0, y0, first, packet
                        )
                    else:
                        m1, m2, m3 = probe(
                            fragment, get_inputs, at, TESTS, values, u, t, shape, surface, x0, y0, first, packet
                        )
                    if m3 == OFF and (m2 == OFF or not count_lanes):
                        n1, n2 = I(n1 + m1), I(n2 + m2)
                        continue
                if not changed:
                    for c in range(TARGET_F):
                        load_plane(color_f[c], packet.CF[c], packet, origin, size, lanes)
                    for c in range(TARGET_I):
                        load_plane(color_i[c], packet.CI[c], packet, origin, size, lanes)
                    changed = True
                if TWO_SIDED and corner[p, 6] == OFF:
                    m1, m2, m3 = commit(
                        fragment, get_inputs, put_outputs, at, BACK_TESTS, values, u, t, shape, surface, x0, y0, first,
                        packet,
                    )  # fmt: skip
                else:
                    m1, m2, m3 = commit(
                        fragment, get_inputs, put_outputs, at, TESTS, values, u, t, shape, surface, x0, y0, first,
                        packet,
                    )  # fmt: skip
                n1, n2, n3 = I(n1 + m1), I(n2 + m2), I(n3 + m3)
                if PLAIN:
                    for c in range(TARGET_F):
                        select_plane(packet.write, packet.OF[c], packet.CF[c], first)
                    for c in range(TARGET_I):
                        select_plane(packet.write, packet.OI[c], packet.CI[c], first)
                else:
                    write_block(packet, blend_constant, first)
            if not count_lanes:
                pending = I(pending + 1)
            if TWO_SIDED and corner[p, 6] == OFF:
                add_fates(BACK_TESTS, local, covered, masked, np.int64(n1), np.int64(n2), np.int64(n3))
            else:
                add_fates(TESTS, local, covered, masked, np.int64(n1), np.int64(n2), np.int64(n3))
            # The mask outlives a write, or a depth failure that counts, unless that reaches bits that it reads
            if TESTS.stencil_mode == STENCIL_MASK:
                fresh = fresh and (fixed or (n3 == OFF and TESTS.stencil.depth_fail_op == StencilOperation.KEEP))
        # Store what changed
        add_pending(packet, pending, lanes)
        for j in range(lanes):
            i = U(j)
            invocation_plane[U(y0 + packet.y[i]), U(x0 + packet.x[i])] += packet.total[i]
        if changed:
            store_plane(depth_plane, packet.depth, packet, origin, size, lanes)
            if TESTS.stencil_mode != STENCIL_OFF:
                for j in range(lanes):
                    i = U(j)
                    stencil_plane[U(y0 + packet.y[i]), U(x0 + packet.x[i])] = np.uint8(packet.stencil[i])
            for c in range(TARGET_F):
                store_plane(color_f[c], packet.CF[c], packet, origin, size, lanes)
            for c in range(TARGET_I):
                store_plane(color_i[c], packet.CI[c], packet, origin, size, lanes)
    for c in range(COUNTS):
        counts[c] += local[c]
