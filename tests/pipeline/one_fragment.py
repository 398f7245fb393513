"""One fragment's stencil and depth tests, restated from the specifications in plain Python; nothing of refsim inside.

Sources: WebGPU "stencil test" and "depth test" (23.2.7), OpenGL 4.6 17.3.3 (stencil test), 17.3.4 (depth buffer test),
2.3.5.2 (conversion of a number in [0, 1] to b-bit fixed point: the nearest of k / (2^b − 1)). Enumerations are named by
text, so that the codes of refsim are not taken on trust.
"""

from fractions import Fraction
from math import floor, isnan
from operator import eq, ge, gt, le, lt, ne

import numpy as np

BOUNDARY = (0, 1, 127, 128, 254, 255)  # of references, masks and stored values

COMPARISONS = {
    "NEVER": lambda new, stored: False,
    "LESS": lt,
    "EQUAL": eq,
    "LESS_EQUAL": le,
    "GREATER": gt,
    "NOT_EQUAL": ne,
    "GREATER_EQUAL": ge,
    "ALWAYS": lambda new, stored: True,
}

OPERATIONS = {
    "KEEP": lambda value, reference: value,
    "ZERO": lambda value, reference: 0,
    "REPLACE": lambda value, reference: reference,
    "INVERT": lambda value, reference: 255 - value,
    "INCREMENT_CLAMP": lambda value, reference: value if value == 255 else value + 1,
    "DECREMENT_CLAMP": lambda value, reference: value if value == 0 else value - 1,
    "INCREMENT_WRAP": lambda value, reference: (value + 1) % 256,
    "DECREMENT_WRAP": lambda value, reference: (value - 1) % 256,
}

STENCIL_FAILS, DEPTH_FAILS, PASSES = "stencil fails", "depth fails", "passes"


def through_mask(old: int, new: int, mask: int) -> int:
    """`old` with the bits set in `mask` taken from `new`, bit by bit."""
    bits = ((new if mask >> k & 1 else old) >> k & 1 for k in range(8))
    return sum(bit << k for k, bit in enumerate(bits))


def stored_depth(form: str, z: float) -> float:
    """A depth as its format stores it: clamped to [0, 1], NaN as 1; 24-bit fixed point as the whole number k."""
    z = 1.0 if isnan(z) else min(max(float(z), 0.0), 1.0)
    if form == "DEPTH24UNORM_STENCIL8":
        return float(floor(Fraction(z) * (2**24 - 1) + Fraction(1, 2)))
    assert form == "DEPTH32FLOAT_STENCIL8"
    return float(np.float32(z))


def one_fragment(state, reference, read_mask, write_mask, z, depth, stencil):
    """(outcome, new depth, new stencil) of a fragment of stored depth `z` over a pixel that holds `depth`, `stencil`.

    `state` is a DepthStencilState, of which only names of enumeration members are used.
    """
    face = state.stencil_front
    new_depth = depth
    if not COMPARISONS[face.compare.name](reference & read_mask, stencil & read_mask):
        outcome, operation = STENCIL_FAILS, face.fail_op
    elif not COMPARISONS[state.depth_compare.name](z, depth):
        outcome, operation = DEPTH_FAILS, face.depth_fail_op
    else:
        outcome, operation = PASSES, face.pass_op
        if state.depth_write_enabled:
            new_depth = z
    new_stencil = through_mask(stencil, OPERATIONS[operation.name](stencil, reference), write_mask)
    return outcome, new_depth, new_stencil
