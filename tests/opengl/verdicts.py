"""Judging one outcome against another, and keeping count of what was judged.

`VERDICTS` counts, a room at a time: draws, values compared, values that were the same, values that differed within a
named bound. A value beyond its bound fails the test. The counts depend on seeds and driver alone.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

VERDICTS: dict[str, Counter] = {}


def note(room: str, **counts: int) -> None:
    """Adds to the counts of `room` (the name of a test file)."""
    VERDICTS.setdefault(room, Counter()).update({name: int(count) for name, count in counts.items()})


def same(room: str, what: str, ours: Any, theirs: Any) -> None:
    """Asserts equal bits: −0 is not 0. Only what is no number may be so in other bits, which OpenGL leaves open."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    if ours.dtype == theirs.dtype == np.float32 and ours.shape == theirs.shape:
        signs = (np.signbit(ours) != np.signbit(theirs)) & ~np.isnan(ours)
        assert not signs.any(), f"{what}: {int(signs.sum())} of {signs.size} values differ in sign, zeros perhaps"
    within(room, what, ours, theirs, 0)


def within(room: str, what: str, ours: Any, theirs: Any, bound: Any) -> None:
    """Asserts that no value differs by more than `bound` (a number, or an array of them)."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    assert ours.shape == theirs.shape, f"{what}: shape {ours.shape} and OpenGL's {theirs.shape}"
    a, b = ours.astype(np.float64), theirs.astype(np.float64)
    equal = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        near = equal | (np.abs(a - b) <= bound)
    if not near.all():
        place = tuple(int(k) for k in np.argwhere(~near)[0])
        limit = np.broadcast_to(bound, a.shape)[place]
        raise AssertionError(
            f"{what}: {int((~near).sum())} of {near.size} values differ by more than the bound; the first at {place}: "
            f"{ours[place]!r} and {theirs[place]!r}, bound {limit!r}; largest difference {np.nanmax(np.abs(a - b))!r}"
        )
    note(room, values=equal.size, same=equal.sum(), within_bound=equal.size - equal.sum())
