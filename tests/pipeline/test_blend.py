"""The blend stage's function for one component, compiled with the whole state at run time.

Plan
- Every pair of factors × operation × format × kind of component (a colour beside alpha, a colour without, alpha): the
  bits of the NumPy reference in float32, on rows that hold every pair of boundary values and random ones. Boundary: 0,
  −0, 1 and their neighbours, beyond both, infinity, NaN, k / 255 and half a step from it.
- Random states and colours (hypothesis): the bits of the one-fragment restatement in float32 scalars; and beside exact
  fractions: float32 within 3 roundings of the two terms' size; 8 bits hold a k whose distance from 255 times the exact
  result is at most 1/2 and those roundings.
- A replaced component is the source (8 bits: rounded), the default blend state is replacement, bit for bit.
- 8 bits: every k / 255 stays, every tie between two goes to the even one, both its neighbours to the near one.
- Minimum and maximum take the stored value where there is no number to compare.
"""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from refsim.pipeline.blend import (
    ADD,
    FACTOR_CODE,
    ONE,
    OPERATION_CODE,
    ZERO,
    Channel,
    clear_values,
    component,
)
from refsim.pipeline.enums import BlendFactor, BlendOperation, TextureFormat
from refsim.reference import blend as reference
from tests.pipeline.one_blend import clamp, in_8_bits, joined

F = np.float32
COLOR, LONE_COLOR, ALPHA = (False, True), (False, False), (True, True)  # is alpha, target has alpha
FACTORS = [factor.value for factor in BlendFactor]
EQUATIONS = [(op, src, dst) for op in ("add", "subtract", "reverse-subtract") for src, dst in product(FACTORS, FACTORS)]
EQUATIONS += [("min", "one", "one"), ("max", "one", "one")]
STEPS = [F(k) / F(255) for k in (0, 1, 2, 127, 128, 254, 255)]
HALVES = [F((k + 0.5) / 255) for k in (0, 1, 127, 253, 254)]
AROUND = [np.nextafter(half, F(side)) for half in HALVES for side in (0, 1)]
INSIDE = [F(x) for x in (0, 1, 0.5, 0.25, 1e-40)] + [np.nextafter(F(1), F(0))]
OUTSIDE = [F(x) for x in (-0.0, -1, -1e-40, 2, 3e38, np.inf, -np.inf, np.nan)] + [np.nextafter(F(1), F(2))]
BOUNDARY = np.array(INSIDE + OUTSIDE + STEPS + HALVES + AROUND, F)


@njit(error_model="numpy")
def components(state, blended, unorm8, is_alpha, has_alpha, operands, out):
    """`out` [n] = what is stored for `operands` f32[7, n] under `state` i64[3] = operation and factors, as codes."""
    channel = Channel(state[0], state[1], state[2], blended, unorm8, is_alpha, has_alpha)
    for i in range(len(out)):
        s, d, s1, c, s_alpha, d_alpha, s1_alpha = operands[:, i]
        out[i] = component(channel, s, d, s1, c, s_alpha, d_alpha, s1_alpha)


def stored(equation, kind, fixed, operands):
    """What the device function stores, f32[n]; `equation` None: replaced."""
    names = equation or ("add", "one", "zero")
    codes = np.array([OPERATION_CODE[names[0]], FACTOR_CODE[names[1]], FACTOR_CODE[names[2]]])
    out = np.empty(operands.shape[1], F)
    components(codes, equation is not None, fixed, *kind, operands, out)
    return out


def boundary_rows(fixed: bool) -> np.ndarray:
    """Operands f32[7, n]: every pair of source and destination, every pair of alphas, random rows of boundary values.

    What an 8-bit target stores is a k / 255, so destinations are.
    """
    rng = np.random.default_rng(7)
    held = np.array(STEPS, F) if fixed else BOUNDARY
    pairs = np.array(list(product(BOUNDARY, held)), F).T
    rows = rng.choice(BOUNDARY, (7, 3 * pairs.shape[1]))
    rows[1], rows[5] = rng.choice(held, (2, rows.shape[1]))
    n = pairs.shape[1]
    rows[:2, :n], rows[[4, 5], n : 2 * n], rows[[6, 5], 2 * n :] = pairs, pairs, pairs
    return rows


def of_kind(kind, rows: np.ndarray) -> np.ndarray:
    """Operands as a target's plane has them: of alpha itself component and alpha are one, a missing alpha is 1."""
    is_alpha, has_alpha = kind
    rows = rows.copy()
    if is_alpha:
        rows[4:] = rows[:3]
    elif not has_alpha:
        rows[5] = 1
    return rows


def bits(values: np.ndarray) -> np.ndarray:
    """Bits, with one NaN for all: which operand's a sum passes on is the processor's."""
    return np.where(np.isnan(values), F(np.nan), values).view(np.int32)


def referred(equation, kind, fixed, rows) -> np.ndarray:
    """What the NumPy reference stores."""
    operands = reference.Operands(*rows, alpha=kind[0])
    with np.errstate(all="ignore"):
        operands = reference.clamped(operands) if fixed else operands
        value = reference.blend(*equation, operands) if equation else operands.source
        return reference.to_unorm8(value) if fixed else value


@pytest.mark.parametrize("fixed", [False, True], ids=["float32", "unorm8"])
@pytest.mark.parametrize("kind", [COLOR, LONE_COLOR, ALPHA], ids=["color", "lone color", "alpha"])
def test_every_equation_has_the_bits_of_the_reference(kind, fixed):
    rows = of_kind(kind, boundary_rows(fixed))
    given_rows = rows if kind != LONE_COLOR else np.vstack([rows[:5], rows[1:2], rows[6:]])  # 1 comes from the state
    seen = set()
    for equation in [None, *EQUATIONS]:
        result = stored(equation, kind, fixed, given_rows)
        expected = referred(equation, kind, fixed, rows)
        wrong = np.flatnonzero(bits(result) != bits(expected))
        assert not len(wrong), (equation, rows[:, wrong[0]], result[wrong[0]], expected[wrong[0]])
        seen.add(expected.tobytes())
    assert len(seen) > 0.75 * len(EQUATIONS) if kind == COLOR else len(seen) > 100  # the rows tell equations apart


numbers = st.one_of(
    st.sampled_from([float(x) for x in BOUNDARY]), st.floats(-4, 4, width=32), st.floats(0, 1, width=32)
)
colors = st.tuples(numbers, numbers, numbers, numbers)
EIGHT_BITS = st.tuples(*[st.integers(0, 255).map(lambda k: float(F(k) / F(255)))] * 4)
CASES = st.tuples(st.sampled_from(EQUATIONS), colors, colors, colors, st.integers(0, 3))


def as_operands(k: int, s, d, s1, c) -> np.ndarray:
    """Component `k` of four colours as operands f32[7, 1]."""
    return np.array([s[k], d[k], s1[k], c[k], s[3], d[3], s1[3]], F)[:, None]


def float32_color(values) -> tuple:
    """Numbers as float32 scalars."""
    return tuple(F(value) for value in values)


@settings(deadline=None, max_examples=600)
@given(CASES, colors)
def test_a_float_component_is_the_restated_one_and_near_the_exact_one(case, d):
    (operation, src, dst), s, s1, c, k = case
    result = stored((operation, src, dst), (k == 3, True), False, as_operands(k, s, d, s1, c))
    scalars = [float32_color(color) for color in (s, d, s1, c)]
    with np.errstate(all="ignore"):
        assert bits(result) == bits(np.array([joined(operation, src, dst, k, *scalars)]))
    if all(np.isfinite(color).all() for color in scalars) and np.abs(scalars).max() < 1e18:
        exact, size = exactly(operation, src, dst, k, scalars)
        assert abs(Fraction(float(result[0])) - exact) <= size


@settings(deadline=None, max_examples=600)
@given(CASES, EIGHT_BITS)
def test_an_8_bit_component_is_the_restated_one_and_near_the_exact_one(case, d):
    (operation, src, dst), s, s1, c, k = case
    result = stored((operation, src, dst), (k == 3, True), True, as_operands(k, s, d, s1, c))
    scalars = [float32_color(color) for color in (s, d, s1, c)]
    scalars = [tuple(map(clamp, color)) for color in scalars]
    with np.errstate(all="ignore"):
        value = in_8_bits(clamp(joined(operation, src, dst, k, *scalars)))
    assert result[0] == F(value) / F(255)
    exact, size = exactly(operation, src, dst, k, scalars)
    # Half a step, the equation's roundings, and that of the product with 255
    assert abs(255 * clamp(exact) - value) <= Fraction(1, 2) + 255 * (size + Fraction(1, 2**24))


def exactly(operation, src, dst, k, scalars) -> tuple[Fraction, Fraction]:
    """The exact result, and how far float32 may be from it: the factor's, the product's and the sum's rounding, each
    2^-24 of the terms (a little more for their products), and what is lost below the smallest float32."""
    exact = [tuple(Fraction(float(part)) for part in color) for color in scalars]
    value = joined(operation, src, dst, k, *exact)
    if operation in ("min", "max"):
        return value, Fraction(0)
    terms = [abs(joined("add", src, "zero", k, *exact)), abs(joined("add", "zero", dst, k, *exact))]
    return value, sum(terms) * Fraction(3, 2**24) * Fraction(1001, 1000) + Fraction(4, 2**149)


@pytest.mark.parametrize("kind", [COLOR, LONE_COLOR, ALPHA])
def test_the_default_blend_state_replaces(kind):
    for fixed in (False, True):
        rows = of_kind(kind, boundary_rows(fixed))
        replaced = stored(None, kind, fixed, rows)
        np.testing.assert_array_equal(bits(stored(("add", "one", "zero"), kind, fixed, rows)), bits(replaced))
        if not fixed:
            np.testing.assert_array_equal(bits(replaced), bits(rows[0]))


def test_eight_bits_keep_every_step_and_round_ties_to_even():
    steps = np.arange(256, dtype=F) / F(255)
    np.testing.assert_array_equal(clear_values(TextureFormat.R8UNORM, steps), steps)
    # Float32 x with 255 x = k + 1/2 after rounding: the largest run of neighbours around (k + 1/2) / 255
    for k in range(255):
        near = F((k + 0.5) / 255)
        for x in (near, *(np.nextafter(near, F(side)) for side in (0, 1)), F((k + 0.49) / 255), F((k + 0.51) / 255)):
            scaled = Fraction(float(x * F(255)))
            low = k if scaled < k + Fraction(1, 2) or (scaled == k + Fraction(1, 2) and k % 2 == 0) else k + 1
            rows = np.full((7, 1), x, F)
            assert stored(None, ALPHA, True, rows)[0] == steps[low] == clear_values(TextureFormat.RGBA8UNORM, x)


@pytest.mark.parametrize(
    ("x", "expected"), [(-0.0, 0), (-1, 0), (-np.inf, 0), (np.nan, 0), (2, 1), (np.inf, 1), (1e-40, 0), (0.999, 1)]
)
def test_eight_bits_take_what_is_out_of_range_to_the_ends(x, expected):
    result = stored(None, COLOR, True, np.full((7, 1), x, F))
    value = F(round(0.999 * 255) / 255) if x == 0.999 else F(expected)
    assert result.tobytes() == value.tobytes() == np.array([clear_values(TextureFormat.R8UNORM, x)]).tobytes()


@pytest.mark.parametrize("operation", ["min", "max"])
@pytest.mark.parametrize(("s", "d"), [(np.nan, 0.5), (0.5, np.nan), (0.0, -0.0), (-0.0, 0.0)])
def test_minimum_and_maximum_keep_what_is_stored_where_nothing_is_less(operation, s, d):
    rows = np.array([s, d, 0, 0, s, d, 0], F)[:, None]
    result = stored((operation, "one", "one"), COLOR, False, rows)
    assert bits(result) == bits(np.array([d], F))
    control = stored((operation, "one", "one"), COLOR, False, np.array([1, 2, 0, 0, 1, 2, 0], F)[:, None])
    assert control == (1 if operation == "min" else 2)


def test_a_factor_of_zero_reads_nothing():
    for value in (np.inf, np.nan):
        rows = np.array([0.5, value, value, value, value, value, value], F)[:, None]
        assert stored(("add", "one", "zero"), COLOR, False, rows) == F(0.5)
        # The control: a factor that is 0 at run time multiplies
        rows = np.array([0.5, value, 0, 0, 0, 0, 0], F)[:, None]
        assert np.isnan(stored(("add", "one", "constant"), COLOR, False, rows))


def test_codes_stand_for_the_enumerations_in_order():
    assert [FACTOR_CODE[factor] for factor in BlendFactor] == list(range(17))
    assert [OPERATION_CODE[operation] for operation in BlendOperation] == list(range(5))
    assert (FACTOR_CODE["zero"], FACTOR_CODE["one"], OPERATION_CODE["add"]) == (ZERO, ONE, ADD)
