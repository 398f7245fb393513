"""What happens to one fragment, and the dense loop: a primitive over a bin of the screen, in vectorised passes.

`resolve` is the whole per-fragment order of the pipeline in one function: shader's keep, stencil, depth, writes. The
dense loop here and the loop over fragment lists (`fragment_list`) both call it.

A packet is a bin's pixels (at most 1,024) in working columns that stay in cache, a lane each; lanes whose pixel an
early stencil test has ruled out for good are left out. For each primitive every block of 64 lanes is *probed* first:
the shader is evaluated for keep and depth alone and only counted; the compiler drops the rest and nothing is stored.
Only if some fragment would be written is the shader evaluated again, for its outputs (`commit`). A shader is pure, so
this cannot be seen; counters count logical invocations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.depth import stored_depth
from refsim.pipeline.state import StencilFaceState
from refsim.pipeline.stencil import compare, stencil_passes, stencil_update

PACKET = 1024
STRIDE = PACKET + 16  # columns a cache line beyond 4 KiB apart, or they would all fall into one cache set
BLOCK = 64
I = np.int32  # noqa: E741
U = np.uintp
ON = np.int32(1)
OFF = np.int32(0)

# Fates a fragment can have, and places of the kernel's counters
COVERED, EARLY_STENCIL, EARLY_DEPTH, DISCARDED, STENCIL_FAILED, DEPTH_FAILED, WRITTEN = range(7)
COUNTS = 7

STENCIL_OFF, STENCIL_MASK, STENCIL_IN_LOOP = 0, 1, 2


class Tests(NamedTuple):
    """What a compiled draw does with a fragment; all constants.

    `stencil_mode`: off; mask (tested before the shader, once for all primitives until the stencil changes: only legal
    when failing has no effect); in the loop. `tests_first`: stencil and depth decide before the shader may discard.
    `forced`: they also write before it does. `early_stencil`: stencil failures count as rejected early.
    """

    stencil: StencilFaceState
    stencil_mode: int
    depth_format: int
    depth_compare: int
    depth_write: bool
    writes_depth: bool
    discards: bool
    early_stencil: bool
    tests_first: bool
    forced: bool
    probe: bool


class StencilValues(NamedTuple):
    """The run-time values of the stencil test, int32."""

    reference: np.int32
    read_mask: np.int32
    write_mask: np.int32


class Packet(NamedTuple):
    """A bin's working columns, [PACKET] each: place in the bin, input texels (k rows), live mask, depth, stencil, total
    of shader invocations, outputs and colour targets (k rows), written mask; live lanes of each block."""

    x: np.ndarray
    y: np.ndarray
    TF: np.ndarray
    TI: np.ndarray
    alive: np.ndarray
    depth: np.ndarray
    stencil: np.ndarray
    total: np.ndarray
    OF: np.ndarray
    OI: np.ndarray
    CF: np.ndarray
    CI: np.ndarray
    write: np.ndarray
    block_alive: np.ndarray


@func
def new_packet(in_f, in_i, out_f, out_i):
    """Columns for a draw. They are rows of two arrays, so that the compiler can prove that they do not overlap."""
    F = np.zeros((in_f + 2 * out_f + 1, STRIDE), np.float32)
    N = np.zeros((in_i + 2 * out_i + 7, STRIDE), np.int32)
    a, b, c = in_f + out_f, in_f + 2 * out_f, in_i + out_i
    d = in_i + 2 * out_i
    return Packet(
        N[d], N[d + 1], F[:in_f], N[:in_i], N[d + 2], F[b], N[d + 3], N[d + 4],
        F[in_f:a], N[in_i:c], F[a:b], N[c:d], N[d + 5], N[d + 6],
    )  # fmt: skip


@func
def resolve(tests, values, covered, keep, z, depth, stencil):
    """One fragment's tests and updates: (written, stencil passed, depth passed, new depth, new stencil)."""
    stencil_ok = True
    if tests.stencil_mode == STENCIL_IN_LOOP:
        stencil_ok = stencil_passes(tests.stencil, stencil, values.reference, values.read_mask)
    depth_ok = compare(tests.depth_compare, z, depth)
    # Discarded fragments reach no test, unless tests and updates were forced to come first
    acts = covered & (keep | tests.forced)
    passes = acts & stencil_ok & depth_ok
    new_depth = z if passes & tests.depth_write else depth
    new_stencil = stencil
    if tests.stencil_mode != STENCIL_OFF:
        updated = stencil_update(tests.stencil, stencil, values.reference, values.write_mask, stencil_ok, depth_ok)
        new_stencil = updated if acts else stencil
    return passes & keep, stencil_ok, depth_ok, new_depth, new_stencil


@func
def shade(fragment, tests, u, t, varyings, primitive_depth, inputs, pixel):
    """The fragment shader with what the pipeline state makes of its results: (keep, stored depth, outputs)."""
    keep, z, outputs = fragment(u, t, varyings, inputs, pixel)
    keep = keep | (not tests.discards)
    z = z if tests.writes_depth else primitive_depth
    return keep, stored_depth(tests.depth_format, z), outputs


@func
def stages(tests, covered, keep, stencil_ok, depth_ok):
    """Which fragments are left after the first and the second of the stages keep, stencil, depth, in order."""
    if tests.tests_first:
        return covered & stencil_ok, covered & stencil_ok & depth_ok
    return covered & keep, covered & keep & stencil_ok


@func
def add_fates(tests, counts, covered, masked, first, second, written):
    """Counters from how many fragments were covered, left by the stencil mask, by two stages, and written."""
    counts[COVERED] += covered
    counts[STENCIL_FAILED] += covered - masked
    counts[EARLY_STENCIL] += covered - masked
    counts[WRITTEN] += written
    if tests.tests_first:
        counts[STENCIL_FAILED] += masked - first
        counts[EARLY_STENCIL] += masked - first
        counts[DEPTH_FAILED] += first - second
        counts[EARLY_DEPTH] += first - second
        counts[DISCARDED] += second - written
    else:
        counts[DISCARDED] += masked - first
        counts[STENCIL_FAILED] += first - second
        counts[DEPTH_FAILED] += second - written
        if tests.early_stencil:
            counts[EARLY_STENCIL] += first - second


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
    return lanes


@func
def cover(tests, values, packet, rect, lanes):
    """Marks the lanes that `rect` (in the bin) covers and the stencil mask leaves; returns how many those are.

    `packet.block_alive` gets the number in each block of lanes.
    """
    x0, y0, x1, y1 = rect
    left = np.int64(0)
    for block in range((lanes + BLOCK - 1) // BLOCK):
        in_block = OFF
        for j in range(BLOCK):
            i = U(block * BLOCK + j)
            x, y = packet.x[i], packet.y[i]
            passes = (x >= x0) & (x < x1) & (y >= y0) & (y < y1) & (I(i) < I(lanes))
            if tests.stencil_mode == STENCIL_MASK:
                passes = passes & stencil_passes(
                    tests.stencil, packet.stencil[i], values.reference, values.read_mask
                )
            packet.alive[i] = ON if passes else OFF
            in_block = I(in_block + (ON if passes else OFF))
        packet.block_alive[U(block)] = in_block
        left += in_block
    return left


@func
def probe(fragment, get_inputs, tests, values, u, t, varyings, z0, x0, y0, first, packet):
    """Counts what a primitive would do to a block of lanes, storing nothing: left by two stages, and written."""
    n1 = OFF
    n2 = OFF
    n3 = OFF
    for j in range(BLOCK):
        i = U(first + j)
        pixel = x0 + packet.x[i], y0 + packet.y[i]
        keep, z, _ = shade(fragment, tests, u, t, varyings, z0, get_inputs(packet.TF, packet.TI, i), pixel)
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
def commit(fragment, get_inputs, put_outputs, tests, values, u, t, varyings, z0, x0, y0, first, packet):
    """Runs a primitive over a block of lanes: depth and stencil change, outputs and the written mask are stored."""
    n1 = OFF
    n2 = OFF
    n3 = OFF
    for j in range(BLOCK):
        i = U(first + j)
        pixel = x0 + packet.x[i], y0 + packet.y[i]
        keep, z, outputs = shade(fragment, tests, u, t, varyings, z0, get_inputs(packet.TF, packet.TI, i), pixel)
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
        elif tests.early_stencil and tests.stencil_mode == STENCIL_IN_LOOP:
            packet.total[i] = I(packet.total[i] + (ON if (covered & s_ok) else OFF))
        n1 = I(n1 + (ON if left1 else OFF))
        n2 = I(n2 + (ON if left2 else OFF))
        n3 = I(n3 + (ON if written else OFF))
    return n1, n2, n3


@func
def select_plane(write, new, plane, first):
    """A block of one plane of a colour target takes `new` where a fragment is written."""
    for j in range(BLOCK):
        i = U(first + j)
        a, b = new[i], plane[i]
        plane[i] = a if write[i] != OFF else b


@func
def add_pending(packet, pending, lanes):
    """Counts `pending` shader invocations for every live lane."""
    for j in range(lanes):
        i = U(j)
        packet.total[i] = I(packet.total[i] + (pending if packet.alive[i] != OFF else OFF))


@func
def load_plane(plane, column, packet, origin, size, lanes):
    """Copies the lanes' pixels of `plane` into a working column: whole rows where every pixel has its lane."""
    x0, y0 = origin
    width, height = size
    if lanes == width * height:
        for y in range(height):
            for x in range(width):
                column[U(y * width + x)] = plane[U(y0 + y), U(x0 + x)]
    else:
        for j in range(lanes):
            i = U(j)
            column[i] = plane[U(y0 + packet.y[i]), U(x0 + packet.x[i])]


@func
def store_plane(plane, column, packet, origin, size, lanes):
    """Copies a working column back."""
    x0, y0 = origin
    width, height = size
    if lanes == width * height:
        for y in range(height):
            for x in range(width):
                plane[U(y0 + y), U(x0 + x)] = column[U(y * width + x)]
    else:
        for j in range(lanes):
            i = U(j)
            plane[U(y0 + packet.y[i]), U(x0 + packet.x[i])] = column[i]
