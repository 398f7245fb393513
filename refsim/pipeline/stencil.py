"""The stencil stage: one comparison and one operation per fragment, on 8-bit values held in int32.

Source: WebGPU "stencil test" / OpenGL 4.6 section 17.3.3. Operations are constants of the compiled draw (the chains of
selects fold away); the same source compiles state-generic when they are run-time integers.
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.pipeline.state import CompareFunction as C
from refsim.pipeline.state import StencilOperation as S

I = np.int32  # noqa: E741
FULL = np.int32(255)
ONE = np.int32(1)
ZERO = np.int32(0)


@func
def compare(function, new, stored):
    """Whether `new` stands in the relation `function` to `stored`; NaN satisfies only NOT_EQUAL and ALWAYS."""
    return (
        (function == C.ALWAYS)
        | ((function == C.LESS) & (new < stored))
        | ((function == C.EQUAL) & (new == stored))
        | ((function == C.LESS_EQUAL) & (new <= stored))
        | ((function == C.GREATER) & (new > stored))
        | ((function == C.NOT_EQUAL) & (new != stored))
        | ((function == C.GREATER_EQUAL) & (new >= stored))
    )


@func
def stencil_operation(operation, value, reference):
    """The value after `operation`, before the write mask; int32 in [0, 255]."""
    result = value
    result = ZERO if operation == S.ZERO else result
    result = reference & FULL if operation == S.REPLACE else result
    result = ~value & FULL if operation == S.INVERT else result
    result = I(min(value + ONE, FULL)) if operation == S.INCREMENT_CLAMP else result
    result = I(max(value - ONE, ZERO)) if operation == S.DECREMENT_CLAMP else result
    result = I(value + ONE) & FULL if operation == S.INCREMENT_WRAP else result
    result = I(value - ONE) & FULL if operation == S.DECREMENT_WRAP else result
    return result


@func
def stencil_passes(face, value, reference, read_mask):
    """The stencil test: masked reference against masked value."""
    return compare(face.compare, reference & read_mask, value & read_mask)


@func
def stencil_update(face, value, reference, write_mask, stencil_ok, depth_ok):
    """The stored value after the tests' outcome, through the write mask."""
    passed = stencil_operation(face.pass_op, value, reference)
    depth_failed = stencil_operation(face.depth_fail_op, value, reference)
    failed = stencil_operation(face.fail_op, value, reference)
    result = passed if depth_ok else depth_failed
    result = result if stencil_ok else failed
    return (value & ~write_mask) | (result & write_mask)
