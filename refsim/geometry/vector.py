"""Three-vectors on the device: tuples of three float32, every sum taken from left to right.

The order of operations is part of the contract: ``refsim.reference.vector`` does the same in NumPy and the
bits agree. Nothing here contracts a multiply and an add, and nothing divides where a caller asked to multiply.
"""

import math

from refsim.jit import func


@func
def dot(a, b):
    """Scalar product, ``a0 b0 + a1 b1 + a2 b2`` from left to right."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@func
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@func
def add(a, b):
    """Sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@func
def sub(a, b):
    """Difference ``a - b``."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@func
def scale(a, s):
    """Vector times scalar."""
    return a[0] * s, a[1] * s, a[2] * s


@func
def divide(a, s):
    """Vector over scalar: three divisions, each rounded once."""
    return a[0] / s, a[1] / s, a[2] / s


@func
def add_scaled(a, b, s):
    """``a + b s``, the product rounded before the sum."""
    return a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s


@func
def length(a):
    """Euclidean length, ``sqrt(a . a)``."""
    return math.sqrt(dot(a, a))


@func
def normalise(a):
    """``a`` divided by its length; NaN where the length is zero."""
    return divide(a, math.sqrt(dot(a, a)))


@func
def select(condition, a, b):
    """``a`` where the condition holds, else ``b``: both are there already, so nothing branches."""
    return (
        a[0] if condition else b[0],
        a[1] if condition else b[1],
        a[2] if condition else b[2],
    )
