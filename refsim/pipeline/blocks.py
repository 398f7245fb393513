"""The dense loop: a primitive over the packet of a bin, in vectorised passes.

For each primitive every block of 64 lanes is *probed* first: the shader is evaluated for keep and depth alone and only
counted; the compiler drops the rest and nothing is stored. Only if some fragment would be written is the shader
evaluated again, for its outputs (`commit`). A shader is pure, so this cannot be seen; counters count logical
invocations.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.pipeline.fragment import STENCIL_IN_LOOP, STENCIL_MASK, STENCIL_OFF, resolve, shade, stages
from refsim.pipeline.packet import BLOCK, OFF, ON
from refsim.pipeline.stencil import stencil_passes

I = np.int32  # noqa: E741
U = np.uintp


@func
def list_lanes(tests, values, packet, stencil_plane, origin, size, fixed):
    """Chooses the packet's lanes from the pixels of a bin; returns how many there are.

    A pixel that fails an early stencil test stays failed while no write reaches the bits that are read (`fixed`): then
    it needs no lane. `packet.x`, `packet.y` (in the bin) and `packet.stencil` are filled; lanes keep row order.
    """
    lanes = 0
    for y in range(size[1]):
        for x in range(size[0]):
            value = I(stencil_plane[U(origin[1] + y), U(origin[0] + x)])
            packet.x[U(lanes)] = I(x)
            packet.y[U(lanes)] = I(y)
            packet.stencil[U(lanes)] = value
            takes = True
            if fixed:
                takes = stencil_passes(tests.stencil, value, values.reference, values.read_mask)
            lanes += np.int64(takes)
    # The rest of the last block is shaded too, and thrown away: its pixel must be one of the framebuffer
    for j in range(lanes, (lanes + BLOCK - 1) // BLOCK * BLOCK):
        packet.x[U(j)] = I(0)
        packet.y[U(j)] = I(0)
    return lanes


@func
def cover(tests, values, packet, rect, lanes, edged, inside, edges):
    """Marks the lanes that a primitive covers and the stencil mask leaves; returns how many it covers and how many are
    left.

    `rect` bounds the primitive in the bin; with `edged` a lane must also lie `inside` its `edges` there.
    `packet.block_alive` gets the number in each block of lanes.
    """
    ax, ay, bx, by = rect
    all_covered, left = np.int64(0), np.int64(0)
    for block in range((lanes + BLOCK - 1) // BLOCK):
        in_block, covered = OFF, OFF
        # Lanes keep row order: a block above or below the primitive has none of its rows
        last = min(block * BLOCK + BLOCK, lanes) - 1
        if edged and (packet.y[U(last)] < ay or packet.y[U(block * BLOCK)] >= by):
            for j in range(BLOCK):
                packet.alive[U(block * BLOCK + j)] = OFF
            packet.block_alive[U(block)] = OFF
            continue
        for j in range(BLOCK):
            i = U(block * BLOCK + j)
            x, y = packet.x[i], packet.y[i]
            passes = (x >= ax) & (x < bx) & (y >= ay) & (y < by) & (I(i) < I(lanes))
            if edged:
                passes = passes & inside(edges, x, y)
            if tests.stencil_mode == STENCIL_MASK:
                covered = I(covered + (ON if passes else OFF))
                passes = passes & stencil_passes(
                    tests.stencil, packet.stencil[i], values.reference, values.read_mask
                )
            packet.alive[i] = ON if passes else OFF
            in_block = I(in_block + (ON if passes else OFF))
        packet.block_alive[U(block)] = in_block
        left += in_block
        all_covered += covered if tests.stencil_mode == STENCIL_MASK else in_block
    return all_covered, left


@func
def probe(fragment, get_inputs, at, tests, values, u, t, shape, surface, x0, y0, first, packet):
    """Counts what a primitive would do to a block of lanes, storing nothing: left by two stages, and written."""
    n1 = OFF
    n2 = OFF
    n3 = OFF
    for j in range(BLOCK):
        i = U(first + j)
        pixel = x0 + packet.x[i], y0 + packet.y[i]
        varyings, z0 = at(shape, surface, pixel)
        keep, z, _ = shade(fragment, tests, values, u, t, varyings, z0, get_inputs(packet.TF, packet.TI, i), pixel)
        covered = packet.alive[i] != OFF
        written, s_ok, d_ok, _, _ = resolve(tests, values, covered, keep, z, packet.depth[i], packet.stencil[i])
        left1, left2 = stages(tests, covered, keep, s_ok, d_ok)
        n1 = I(n1 + (ON if left1 else OFF))
        if tests.stencil_mode == STENCIL_IN_LOOP or tests.tests_first:
            n2 = I(n2 + (ON if left2 else OFF))
        n3 = I(n3 + (ON if written else OFF))
    if not (tests.stencil_mode == STENCIL_IN_LOOP or tests.tests_first):
        n2 = n1
    return n1, n2, n3


@func
def commit(fragment, get_inputs, put_outputs, at, tests, values, u, t, shape, surface, x0, y0, first, packet):
    """Runs a primitive over a block of lanes: depth and stencil change, outputs and the written mask are stored."""
    n1 = OFF
    n2 = OFF
    n3 = OFF
    for j in range(BLOCK):
        i = U(first + j)
        pixel = x0 + packet.x[i], y0 + packet.y[i]
        varyings, z0 = at(shape, surface, pixel)
        keep, z, outputs = shade(
            fragment, tests, values, u, t, varyings, z0, get_inputs(packet.TF, packet.TI, i), pixel
        )
        covered = packet.alive[i] != OFF
        written, s_ok, d_ok, new_depth, new_stencil = resolve(
            tests, values, covered, keep, z, packet.depth[i], packet.stencil[i]
        )
        left1, left2 = stages(tests, covered, keep, s_ok, d_ok)
        put_outputs(packet.OF, packet.OI, i, outputs)
        packet.depth[i] = new_depth
        if tests.stencil_mode != STENCIL_OFF:
            packet.stencil[i] = new_stencil
        packet.write[i] = ON if written else OFF
        if tests.tests_first:
            packet.total[i] = I(packet.total[i] + (ON if left2 else OFF))
        elif tests.stencil_first:
            packet.total[i] = I(packet.total[i] + (ON if left1 else OFF))
        elif tests.counts_lanes:
            packet.total[i] = I(packet.total[i] + (ON if covered else OFF))
        n1 = I(n1 + (ON if left1 else OFF))
        n2 = I(n2 + (ON if left2 else OFF))
        n3 = I(n3 + (ON if written else OFF))
    return n1, n2, n3
