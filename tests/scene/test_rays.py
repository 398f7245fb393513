"""Plan: rays are contiguous float32 columns, and wrong ones are refused by row.

- Whatever numbers and layout rays are made from, their columns are contiguous float32 of the same values.
- Making rays without checks keeps the very same arrays.
- A scalar limit serves live rays and leaves dead ones at 0.
- Any single row made wrong is named in the error; the same rays without the fault are accepted.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.scene import Hits, Rays

LAYOUTS = {
    "float64": lambda a: a.astype(np.float64),
    "column-major": np.asfortranarray,
    "every other row": lambda a: np.repeat(a, 2, axis=0)[::2],
    "lists": lambda a: a.tolist(),
}


def columns(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions, float32."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return rng.normal(size=(count, 3)).astype(np.float32), direction.astype(np.float32)


@given(st.integers(1, 40), st.integers(0, 2**32), st.sampled_from(sorted(LAYOUTS)))
def test_columns_are_contiguous_float32_of_the_same_values(count: int, seed: int, layout: str) -> None:
    origin, direction = columns(count, seed)
    rays = Rays(LAYOUTS[layout](origin), LAYOUTS[layout](direction), np.arange(count))
    for column, wanted in ((rays.origin, origin), (rays.direction, direction), (rays.t_max, np.arange(count))):
        assert column.dtype == np.float32 and column.flags.c_contiguous
        np.testing.assert_array_equal(column, wanted)
    assert len(rays) == count and rays.alive.all()


def test_unchecked_keeps_the_very_same_arrays() -> None:
    origin, direction = columns(4, 1)
    t_max = np.ones(4, np.float32)
    rays = Rays.unchecked(origin, direction * 7, t_max, 2, 2)
    assert rays.origin is origin and rays.t_max is t_max and (rays.width, rays.height) == (2, 2)
    with pytest.raises(InputError, match="not of unit length"):
        Rays(rays.origin, rays.direction, rays.t_max)


def test_scalar_limit_is_for_live_rays() -> None:
    origin, direction = columns(3, 2)
    direction[1] = 0.0
    np.testing.assert_array_equal(Rays(origin, direction).t_max, [np.inf, 0.0, np.inf])
    np.testing.assert_array_equal(Rays(origin, direction, 2.5).t_max, [2.5, 0.0, 2.5])
    np.testing.assert_array_equal(Rays(origin, direction).alive, [True, False, True])


def test_rows_can_be_chosen() -> None:
    origin, direction = columns(4, 3)
    rays = Rays(origin, direction, np.arange(4), 2, 2)
    for rows in (slice(1, 3), [1, 2], np.array([False, True, True, False])):
        chosen = rays[rows]
        np.testing.assert_array_equal(chosen.t_max, [1, 2])
        np.testing.assert_array_equal(chosen.origin, origin[1:3])
        assert chosen.width is None


def nan_origin(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    origin[row, 1] = np.nan


def infinite_origin(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    origin[row, 2] = 1e39  # finite as float64, not as float32


def infinite_direction(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    direction[row, 0] = np.inf


def long_direction(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    direction[row] *= 1.00011


def short_direction(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    direction[row] *= 0.99989


def negative_limit(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    t_max[row] = -1.0


def nan_limit(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    t_max[row] = np.nan


def dead_with_a_limit(origin: np.ndarray, direction: np.ndarray, t_max: np.ndarray, row: int) -> None:
    direction[row] = 0.0


FAULTS = {
    nan_origin: "origin that is not finite",
    infinite_origin: "origin that is not finite",
    infinite_direction: "direction that is not finite",
    long_direction: "not of unit length",
    short_direction: "not of unit length",
    negative_limit: "t_max that is negative",
    nan_limit: "t_max that is negative or not a number",
    dead_with_a_limit: "its t_max must be 0",
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
@given(st.integers(1, 20), st.integers(0, 2**32), st.data())
def test_a_wrong_row_is_named(fault, count: int, seed: int, data: st.DataObject) -> None:
    row = data.draw(st.integers(0, count - 1))
    origin, direction = (column.astype(np.float64) for column in columns(count, seed))
    t_max = np.full(count, 3.0)
    Rays(origin, direction, t_max)  # control
    fault(origin, direction, t_max, row)
    with pytest.raises(InputError, match=f"^ray {row} .*{FAULTS[fault]}"):
        Rays(origin, direction, t_max)


@pytest.mark.parametrize("factor", [1.0, 1.00009, 0.99991])
def test_unit_length_within_1e_4_is_accepted(factor: float) -> None:
    origin, direction = columns(50, 5)
    assert len(Rays(origin, direction.astype(np.float64) * factor)) == 50


ZEROS, UNITS = np.zeros((6, 3)), np.tile([0.0, 0.0, 1.0], (6, 1))
SHAPES = {
    "control": ((ZEROS, UNITS, np.ones(6), 3, 2), None),
    "control without a size": ((ZEROS, UNITS, np.ones(6)), None),
    "no rays": ((np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)), None),
    "flat origin": ((np.zeros(18), UNITS), "origin of rays must have shape"),
    "two components": ((ZEROS, np.zeros((6, 2))), "direction of rays must have shape"),
    "words": ((ZEROS, "up"), "direction of rays must be numbers"),
    "ragged": (([[0, 0, 0], [1]], UNITS), "origin of rays must be numbers"),
    "one direction too few": ((ZEROS, UNITS[:5]), "5 for 6"),
    "one limit too few": ((ZEROS, UNITS, np.ones(5)), r"t_max of rays must have shape \[6\]"),
    "limit in words": ((ZEROS, UNITS, "far"), "t_max of rays must be numbers"),
    "size of another image": ((ZEROS, UNITS, np.ones(6), 3, 3), "3 x 3 pixels cannot have 6 rays"),
    "negative size": ((ZEROS, UNITS, np.ones(6), -3, -2), "cannot have 6 rays"),
    "width alone": ((ZEROS, UNITS, np.ones(6), 6), "both width and height"),
}


@pytest.mark.parametrize("row", SHAPES)
def test_shapes(row: str) -> None:
    arguments, message = SHAPES[row]
    if message is None:
        assert len(Rays(*arguments)) == len(arguments[0])
        return
    with pytest.raises(InputError, match=message):
        Rays(*arguments)


def test_misses_hit_nothing() -> None:
    hits = Hits.misses(3)
    assert len(hits) == 3 and not hits.hit.any() and hits.triangle.dtype == np.int32
    assert np.isinf(hits.t).all() and not hits.u.any() and not hits.v.any()
