"""Three-vectors in NumPy: arrays ``[..., 3]`` of float32 or float64, every sum taken from left to right.

``np.dot``, ``np.sum`` and ``einsum`` may add in any order and so cannot give the bits of a shader; the sums here are
spelt out.
"""

import numpy as np


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar product over the last axis, ``[..., 3] -> [...]``."""
    x = a[..., 0] * b[..., 0]
    x = x + a[..., 1] * b[..., 1]
    return x + a[..., 2] * b[..., 2]


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product over the last axis, ``[..., 3] -> [..., 3]``."""
    a0, a1, a2 = np.moveaxis(a, -1, 0)
    b0, b1, b2 = np.moveaxis(b, -1, 0)
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)


def length(a: np.ndarray) -> np.ndarray:
    """Euclidean length over the last axis."""
    return np.sqrt(dot(a, a))


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between vectors in radians, ``[...]``, exact near 0 and 180 degrees; float64, whose arc tangent agrees on
    all processors by far more digits than anyone prints: NumPy's of float32 does not."""
    return np.asarray(np.arctan2(length(cross(a, b)), dot(a, b), dtype=np.float64))


def normalise(a: np.ndarray) -> np.ndarray:
    """Unit vector: each component divided by the length; NaN where the length is zero."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return a / length(a)[..., None]
