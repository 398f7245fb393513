"""What happens to one fragment, and the dense loop: a primitive over a bin of the screen, in vectorised passes.

`resolve` is the whole per-fragment order of the pipeline in one function: shader's keep, stencil, depth, writes. The
dense loop here and the loop over fragment lists (`fragment_list`) both call it.

A packet is a bin's pixels (at most 1,024) in working columns that stay in cache. For each primitive a packet is
*probed* first: the shader is evaluated for keep and depth alone and only counted; the compiler drops the rest and
nothing is stored. Only if some fragment would be written is the shader evaluated again, for its outputs (`commit`). A
shader is pure, so this cannot be seen; counters count logical invocations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.depth import stored_depth
from refsim.pipeline.state import StencilFaceState
from refsim.pipeline.stencil import compare, stencil_passes, stencil_update

PACKET = 1024
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
def cover(tests, values, alive, stencil, rect, log2_width, first, last):
    """Marks the packet's fragments [first, last) that `rect` covers; returns how many, and how many the mask leaves."""
    x0, y0, x1, y1 = rect
    covered = OFF
    left = OFF
    for j in range(first, last):
        i = U(j)
        x, y = I(j) & I((1 << log2_width) - 1), I(j) >> I(log2_width)
        inside = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
        passes = inside
        if tests.stencil_mode == STENCIL_MASK:
            passes = inside & stencil_passes(tests.stencil, stencil[i], values.reference, values.read_mask)
        alive[i] = ON if passes else OFF
        covered = I(covered + (ON if inside else OFF))
        left = I(left + (ON if passes else OFF))
    return np.int64(covered), np.int64(left)


@func
def probe(fragment, get_inputs, tests, values, u, t, varyings, z0, x0, y0, log2_width, first, last, columns):
    """Counts what a primitive would do to a packet, storing nothing: fragments left by two stages, and written."""
    TF, TI, alive, depth, stencil = columns
    n1 = OFF
    n2 = OFF
    n3 = OFF
    for j in range(first, last):
        i = U(j)
        pixel = x0 + (I(j) & I((1 << log2_width) - 1)), y0 + (I(j) >> I(log2_width))
        keep, z, _ = shade(fragment, tests, u, t, varyings, z0, get_inputs(TF, TI, i), pixel)
        covered = alive[i] != OFF
        written, s_ok, d_ok, _, _ = resolve(tests, values, covered, keep, z, depth[i], stencil[i])
        left1, left2 = stages(tests, covered, keep, s_ok, d_ok)
        n1 = I(n1 + (ON if left1 else OFF))
        if tests.stencil_mode == STENCIL_IN_LOOP or tests.tests_first:
            n2 = I(n2 + (ON if left2 else OFF))
        n3 = I(n3 + (ON if written else OFF))
    if not (tests.stencil_mode == STENCIL_IN_LOOP or tests.tests_first):
        n2 = n1
    return np.int64(n1), np.int64(n2), np.int64(n3)


@func
def commit(
    fragment, get_inputs, put_outputs, tests, values, u, t, varyings, z0, x0, y0, log2_width, first, last, columns, out
):
    """Runs a primitive over a packet: depth and stencil change, outputs and the written mask go to `out`."""
    TF, TI, alive, depth, stencil = columns
    OF, OI, write, invoked = out
    n1 = OFF
    n2 = OFF
    n3 = OFF
    for j in range(first, last):
        i = U(j)
        pixel = x0 + (I(j) & I((1 << log2_width) - 1)), y0 + (I(j) >> I(log2_width))
        keep, z, outputs = shade(fragment, tests, u, t, varyings, z0, get_inputs(TF, TI, i), pixel)
        covered = alive[i] != OFF
        written, s_ok, d_ok, new_depth, new_stencil = resolve(tests, values, covered, keep, z, depth[i], stencil[i])
        left1, left2 = stages(tests, covered, keep, s_ok, d_ok)
        put_outputs(OF, OI, i, outputs)
        depth[i] = new_depth
        if tests.stencil_mode != STENCIL_OFF:
            stencil[i] = new_stencil
        write[i] = ON if written else OFF
        if tests.tests_first:
            invoked[i] = ON if left2 else OFF
        elif tests.early_stencil:
            invoked[i] = ON if (covered & s_ok) else OFF
        n1 = I(n1 + (ON if left1 else OFF))
        n2 = I(n2 + (ON if left2 else OFF))
        n3 = I(n3 + (ON if written else OFF))
    return np.int64(n1), np.int64(n2), np.int64(n3)


@func
def select_plane(write, new, plane, first, last):
    """One plane of a colour target takes `new` where a fragment is written."""
    for j in range(first, last):
        i = U(j)
        a, b = new[i], plane[i]
        plane[i] = a if write[i] != OFF else b


@func
def add_scaled(total, mask, factor, n):
    """total += factor where mask."""
    for j in range(n):
        i = U(j)
        total[i] = I(total[i] + (factor if mask[i] != OFF else OFF))


@func
def load_plane(plane, packet, x0, y0, width, height, log2_width):
    """Copies the part of `plane` under a bin into a packet column; `width` and `height` end at the plane's edge."""
    for y in range(height):
        for x in range(width):
            packet[U((y << log2_width) + x)] = plane[U(y0 + y), U(x0 + x)]


@func
def store_plane(plane, packet, x0, y0, width, height, log2_width):
    """Copies a packet column back."""
    for y in range(height):
        for x in range(width):
            plane[U(y0 + y), U(x0 + x)] = packet[U((y << log2_width) + x)]
