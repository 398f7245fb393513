"""Plan: what `borrowed` hands on is the same arrays and scalars, however they are nested; a loop over a device function
that branches counts no references then (and does without it, so that this test can fail); the arrays' own counts are
what they were; the intrinsic is part of what a kernel's name says.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from refsim.jit import borrowed, func, specialise


@func
def summed(arrays: Any, i: Any) -> Any:
    """A loop with a way out, which LLVM does not pair increments and decrements across."""
    first, (second, offset) = arrays
    total = offset
    for k in range(i + 1):
        if first[k] > np.float32(2):
            break
        for number in second[: k + 1]:
            total += number
            if total < np.float32(0):
                return total
    return total


@func
def picked(arrays: Any, i: Any) -> Any:
    """A device function that takes arrays out of a tuple, with branches between."""
    if arrays[0][i] > np.float32(2):
        return np.float32(0)
    return summed(arrays, i)


def counted(arrays: Any, out: Any) -> None:
    """A loop that passes its argument on as it is."""
    for i in range(out.size):
        out[i] = picked(arrays, i)


def uncounted(arrays: Any, out: Any) -> None:
    """The same with borrowed arrays."""
    own = borrowed(arrays)
    for i in range(out.size):
        out[i] = picked(own, i)


def arguments() -> tuple[Any, np.ndarray]:
    """Nested tuples of arrays and a scalar, and where the loop writes."""
    first = np.array([0, 1, 2, 3], np.float32)
    return (first, (np.array([10, 20, 30, 40], np.float32), np.float32(0.5))), np.zeros(4, np.float32)


def test_the_same_numbers_come_out() -> None:
    for template in (counted, uncounted):
        arrays, out = arguments()
        specialise(template, {})(arrays, out)
        np.testing.assert_array_equal(out, [10.5, 40.5, 100.5, 0])


def test_no_reference_is_counted_in_the_loop() -> None:
    calls = {}
    for template in (counted, uncounted):
        kernel = specialise(template, {})
        kernel(*arguments())
        (code,) = kernel.inspect_llvm().values()
        calls[template.__name__] = sum(
            body.count("call void @NRT_incref")
            for head, _, body in (part.partition("\n") for part in code.split("\ndefine "))
            if template.__name__ in head and "cpython" not in head  # the wrapper for Python counts, once a call
        )
    assert calls["counted"] > 0
    assert calls["uncounted"] == 0


def test_the_caller_keeps_its_arrays() -> None:
    kernel = specialise(uncounted, {})
    arrays, out = arguments()
    kernel(arrays, out)
    before = sys.getrefcount(arrays[0]), sys.getrefcount(arrays[1][0])
    for _ in range(100):
        kernel(arrays, out)
    assert (sys.getrefcount(arrays[0]), sys.getrefcount(arrays[1][0])) == before
    np.testing.assert_array_equal(arrays[0], [0, 1, 2, 3])
