"""Stencil and depth of one fragment, on the stages' own source with the state at run time.

Plan
- stored_depth is the nearest multiple of 1 / (2^24 − 1) (exact fractions), or the float32 itself, of the clamped depth;
  it never decreases; clearing stores what a fragment of that depth stores.
- Any fragment at all (random state, values, masks; not covered; discarded; tests forced first) ends as restated.
- Every stencil operation on every value with every reference; every comparison of every pair of 8-bit values.
- Every comparison × fail × depth-fail × pass operation × depth outcome × boundary values, references, read and write
  masks: 10.6 million rows.
- Every depth comparison × format × depth write on all pairs of a table: equal, neighbours, ±0, denormal, 0, 1, beyond,
  infinite, no number; two depths a float32 step apart tie in 24 bits. Control rows state a few by hand.
- The comparisons themselves with NaN: only NOT_EQUAL and ALWAYS hold.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.pipeline.depth import clear_value
from refsim.pipeline.state import CompareFunction, DepthStencilFormat, DepthStencilState, StencilFaceState
from refsim.pipeline.state import StencilOperation as Operation
from tests.pipeline import device_loops, one_fragment
from tests.pipeline.one_fragment import BOUNDARY, COMPARISONS, OPERATIONS, PASSES, STENCIL_FAILS

D32, D24 = DepthStencilFormat
SMALL_DEPTHS = [np.nan, -np.inf, -1, -0.0, 0, 1e-45, 2.0**-26, 2.0**-25, 2.0**-24]
TABLE = np.array([*SMALL_DEPTHS, 0.3, 0.5, 0.5 + 2.0**-24, 1 - 2.0**-24, 1, 1 + 2.0**-23, 2, np.inf], np.float32)
floats = st.floats(width=32)
byte = st.integers(0, 255)


def stored(form: DepthStencilFormat, z) -> np.ndarray:
    """Depths through the device function."""
    z = np.atleast_1d(np.asarray(z, np.float32))
    out = np.empty_like(z)
    device_loops.stored_depths(np.int32(form), z, out)
    return out


@settings(deadline=None)
@given(st.lists(floats, min_size=1, max_size=30), st.sampled_from(DepthStencilFormat))
def test_stored_depth_is_the_nearest_of_its_format(z, form):
    expected = [one_fragment.stored_depth(form.name, float(np.float32(x))) for x in z]
    np.testing.assert_array_equal(stored(form, z), np.array(expected, np.float32))


@settings(deadline=None)
@given(st.lists(st.floats(-0.125, 1.125, width=32), min_size=2, max_size=30), st.sampled_from(DepthStencilFormat))
def test_stored_depth_never_decreases(z, form):
    assert (np.diff(stored(form, sorted(z))) >= 0).all()


@settings(deadline=None)
@given(floats, st.sampled_from(DepthStencilFormat))
def test_clearing_stores_what_a_fragment_of_that_depth_stores(z, form):
    assert clear_value(form, z).tobytes() == stored(form, z)[0].tobytes()


FRAGMENT = st.tuples(
    st.sampled_from(CompareFunction), *[st.sampled_from(Operation)] * 3, st.sampled_from(CompareFunction),
    *[byte] * 4, *[st.booleans()] * 4, *[st.sampled_from(TABLE)] * 2, st.sampled_from(DepthStencilFormat),
)  # fmt: skip


@settings(deadline=None, max_examples=200)
@given(st.lists(FRAGMENT, min_size=1, max_size=20))
def test_any_fragment_ends_as_restated(rows):
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    faces, depth_compare = np.stack(columns[:4], axis=1).astype(np.int32), columns[4].astype(np.int32)
    values = np.stack(columns[5:9], axis=1).astype(np.int32)
    depth_write, forced, covered, keep = columns[9:13]
    z = np.concatenate([stored(row[15], row[13]) for row in rows])
    depth = np.concatenate([stored(row[15], row[14]) for row in rows])
    new_depth, new_stencil, ok = np.empty_like(z), np.empty(len(z), np.int32), np.empty((len(z), 3), bool)
    device_loops.fragments(
        faces, values, depth_compare, depth_write, forced, covered, keep, z, depth, new_depth, new_stencil, ok
    )
    for i, row in enumerate(rows):
        state = DepthStencilState(row[15], row[9], row[4], StencilFaceState(*row[:4]))
        stencil, reference, read, write = (int(v) for v in values[i])
        outcome, d, s = one_fragment.one_fragment(state, reference, read, write, z[i], depth[i], stencil)
        acts = covered[i] and (keep[i] or forced[i])
        assert (new_depth[i], new_stencil[i]) == ((d, s) if acts else (depth[i], stencil))
        assert ok[i, 0] == (acts and keep[i] and outcome == PASSES)
        assert ok[i, 1] == (outcome != STENCIL_FAILS)
        assert outcome == STENCIL_FAILS or ok[i, 2] == (outcome == PASSES)


@pytest.fixture(scope="module")
def operation_table() -> np.ndarray:
    """The restated operations, [operation, value, reference]."""
    table = [[[OPERATIONS[op.name](v, r) for r in range(256)] for v in range(256)] for op in Operation]
    return np.array(table, np.int32)


@pytest.fixture(scope="module")
def holds_table() -> np.ndarray:
    """The restated comparisons, [comparison, new, stored]."""
    table = [[[COMPARISONS[c.name](a, b) for b in range(256)] for a in range(256)] for c in CompareFunction]
    return np.array(table, bool)


def cross() -> tuple[np.ndarray, ...]:
    """Every (function, 8-bit value, 8-bit value), as columns."""
    return tuple(np.ascontiguousarray(part.ravel(), np.int32) for part in np.indices((8, 256, 256)))


def test_every_operation_on_every_value_and_reference(operation_table):
    function, value, reference = cross()
    out = np.empty(len(value), np.int32)
    device_loops.operations(function, value, reference, out)
    np.testing.assert_array_equal(out.reshape(8, 256, 256), operation_table)


def test_every_comparison_of_every_pair_of_values(holds_table):
    function, new, old = cross()
    out = np.empty(len(new), bool)
    device_loops.comparisons(function, new, old, out)
    np.testing.assert_array_equal(out.reshape(8, 256, 256), holds_table)


def test_every_combination_of_operations_outcomes_and_boundary_values(operation_table, holds_table):
    through = np.zeros((256, 256, 256), np.int32)
    for value in BOUNDARY:
        for write in BOUNDARY:
            for new in np.unique(operation_table[:, value][:, list(BOUNDARY)]):
                through[value, new, write] = one_fragment.through_mask(value, int(new), write)
    wrong = np.zeros(5, np.int64)
    boundary = np.array(BOUNDARY, np.int32)
    differ = device_loops.every_stencil_update(operation_table, holds_table, through, boundary, wrong)
    assert differ == 0, f"{differ} rows; first (state, value, reference, read mask, write mask): {wrong}"


@pytest.mark.parametrize("form", DepthStencilFormat)
def test_every_depth_comparison_on_the_table(form):
    rows = [(f, w, a, b) for f in CompareFunction for w in (False, True) for a in TABLE for b in TABLE]
    function, write, new, old = (np.array(column) for column in zip(*rows, strict=True))
    z, depth = stored(form, new), stored(form, old)
    n = len(rows)
    faces = np.tile(np.array([CompareFunction.ALWAYS, 0, 0, 0], np.int32), (n, 1))
    yes, no = np.ones(n, bool), np.zeros(n, bool)
    new_depth, new_stencil, ok = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 3), bool)
    device_loops.fragments(faces, np.zeros((n, 4), np.int32), function.astype(np.int32), write, no, yes, yes, z, depth,
                           new_depth, new_stencil, ok)  # fmt: skip
    for i, (f, w, a, b) in enumerate(rows):
        state = DepthStencilState(form, w, f)
        za, zb = (one_fragment.stored_depth(form.name, float(x)) for x in (a, b))
        outcome, d, _ = one_fragment.one_fragment(state, 0, 0, 0, za, zb, 0)
        assert (bool(ok[i, 0]), float(new_depth[i])) == (outcome == PASSES, d), (f.name, w, a, b)


SMALL, SMALLER = np.float32(2**-20 + 2**-43), np.float32(2**-20)
ROWS = [
    # new, stored, format, LESS holds
    ("control: nearer", 0.25, 0.5, D32, True),
    ("control: nearer, 24 bits", 0.25, 0.5, D24, True),
    ("equal", 0.5, 0.5, D32, False),
    ("a float32 step nearer", SMALLER, SMALL, D32, True),
    ("a float32 step nearer ties in 24 bits", SMALLER, SMALL, D24, False),
    ("one unit of 24 bits nearer", 7 / (2**24 - 1), 8 / (2**24 - 1), D24, True),
    ("minus zero is zero", -0.0, 0.0, D32, False),
    ("a denormal lies behind zero", 0.0, 1e-45, D32, True),
    ("a denormal is zero in 24 bits", 0.0, 1e-45, D24, False),
    ("below 0 is clamped to it", -1.0, 0.0, D32, False),
    ("beyond 1 is clamped to it", 1.0, 2.0, D32, False),
    ("just below 1 in 24 bits rounds to unit 2^24 − 2", 1 - 2.0**-24, 1.0, D24, True),
    ("no number is the far end", np.nan, 0.5, D32, False),
    ("anything is nearer than no number", 0.5, np.nan, D32, True),
]


@pytest.mark.parametrize(("new", "old", "form", "nearer"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_depth_row(new, old, form, nearer):
    z, depth, out = stored(form, new), stored(form, old), np.empty(1, bool)
    device_loops.comparisons(np.array([CompareFunction.LESS], np.int32), z, depth, out)
    assert out[0] == nearer


def test_rounding_is_to_nearest_not_down():
    z = np.array([0.3, 0.6, 0.7, 2.0**-25, 2.0**-24], np.float32)
    assert stored(D24, z).tolist() == [5033165.0, 10066329.0, 11744050.0, 0.0, 1.0]


def test_no_number_is_unequal_to_everything():
    function = np.repeat(np.arange(8, dtype=np.int32), 3)
    pairs = np.tile(np.array([[np.nan, 0.5], [0.5, np.nan], [np.nan, np.nan]], np.float32), (8, 1))
    out = np.empty(24, bool)
    device_loops.comparisons(function, pairs[:, 0].copy(), pairs[:, 1].copy(), out)
    holds = {CompareFunction(f).name for f in np.unique(function[out])}
    assert holds == {"NOT_EQUAL", "ALWAYS"} and out.reshape(8, 3).all(axis=1).sum() == 2
