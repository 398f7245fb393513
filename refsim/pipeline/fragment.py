"""What happens to one fragment: the whole per-fragment order of the pipeline in one function.

`resolve` takes the shader's keep, then stencil, depth and writes. The dense loop (`refsim.pipeline.blocks`) and the
loop over fragment lists (`refsim.pipeline.fragment_list`) both call it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.depth import stored_depth
from refsim.pipeline.enums import FragmentFate
from refsim.pipeline.state import StencilFaceState
from refsim.pipeline.stencil import compare, stencil_passes, stencil_update

# Places of the kernel's counters: all fragments, then each fate
COVERED = 0
EARLY_STENCIL, EARLY_DEPTH, DISCARDED, STENCIL_FAILED, DEPTH_FAILED, WRITTEN = (int(fate) for fate in FragmentFate)
COUNTS = 1 + len(FragmentFate)

STENCIL_OFF, STENCIL_MASK, STENCIL_IN_LOOP = 0, 1, 2


class Tests(NamedTuple):
    """What a compiled draw does with a fragment; all constants.

    `stencil_mode`: off; mask (tested before the shader, once for all primitives until the stencil changes: only legal
    when failing has no effect); in the loop. `tests_first`: stencil and depth decide before the shader may discard.
    `forced`: they also write before it does. `early_stencil`: stencil failures count as rejected early.
    `stencil_first`: the stencil alone decides before the shader, fragment by fragment. `counts_lanes`: the dense loop
    counts shader runs lane by lane, as not every covered lane runs the shader.
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
    stencil_first: bool = False
    counts_lanes: bool = False


class TestValues(NamedTuple):
    """The run-time values of the tests: int32 of the stencil's, float32 bounds of the depth."""

    reference: np.int32
    read_mask: np.int32
    write_mask: np.int32
    min_depth: np.float32
    max_depth: np.float32


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
def shade(fragment, tests, values, u, t, varyings, primitive_depth, inputs, pixel):
    """The fragment shader with what the pipeline state makes of its results: (keep, stored depth, outputs)."""
    keep, z, outputs = fragment(u, t, varyings, inputs, pixel)
    keep = keep | (not tests.discards)
    z = z if tests.writes_depth else primitive_depth
    return keep, stored_depth(tests.depth_format, z, values.min_depth, values.max_depth), outputs


@func
def stages(tests, covered, keep, stencil_ok, depth_ok):
    """Which fragments are left after the first and the second of the three stages, in their order."""
    if tests.tests_first:
        return covered & stencil_ok, covered & stencil_ok & depth_ok
    if tests.stencil_first:
        return covered & stencil_ok, covered & stencil_ok & keep
    return covered & keep, covered & keep & stencil_ok


@func
def add_fates(tests, counts, covered, masked, first, second, written):
    """Counters from how many fragments were covered, left by the stencil mask, by two stages, and written."""
    counts[COVERED] += covered
    counts[STENCIL_FAILED] += covered - masked
    counts[EARLY_STENCIL] += covered - masked
    counts[WRITTEN] += written
    if tests.tests_first or tests.stencil_first:
        counts[STENCIL_FAILED] += masked - first
        counts[EARLY_STENCIL] += masked - first
    if tests.tests_first:
        counts[DEPTH_FAILED] += first - second
        counts[EARLY_DEPTH] += first - second
        counts[DISCARDED] += second - written
    elif tests.stencil_first:
        counts[DISCARDED] += first - second
        counts[DEPTH_FAILED] += second - written
    else:
        counts[DISCARDED] += masked - first
        counts[STENCIL_FAILED] += first - second
        counts[DEPTH_FAILED] += second - written
