"""What a pixel of a triangle may hold, from the triangle's own vertices: no clipping, no snapping, float64.

The pipeline interpolates between corners that moved by up to `slack` pixels, so at a pixel it finds the exact value of
some point that near. Values are quotients of two functions that are linear on the screen; over a square they are
largest and smallest at its corners, as long as the divisor keeps its sign.
"""

from typing import NamedTuple

import numpy as np

from refsim.reference import interpolation
from refsim.reference.raster import Viewport


class Bounded(NamedTuple):
    """Lowest and highest value at n pixels, and where a bound exists."""

    low: np.ndarray
    high: np.ndarray
    exists: np.ndarray

    def excess(self, found: np.ndarray) -> np.ndarray:
        """By how much values leave the bounds; 0 where there are none."""
        beyond = np.maximum(np.maximum(self.low - found, found - self.high), 0)
        return np.where(self.exists, beyond, 0)


def weights_around(position: np.ndarray, viewport: Viewport, x: np.ndarray, y: np.ndarray, slack: float) -> np.ndarray:
    """Homogeneous weights [4, n, 3] at the corners of squares around the centres of pixels (x, y)."""
    vx, vy, width, height = (float(part) for part in viewport[:4])
    around = [(-slack, -slack), (slack, -slack), (-slack, slack), (slack, slack)]
    found = []
    for dx, dy in around:
        ndc_x = 2 * (x + 0.5 + dx - vx) / width - 1
        ndc_y = 1 - 2 * (y + 0.5 + dy - vy) / height
        found.append(interpolation.homogeneous(position, ndc_x, ndc_y))
    return np.array(found)


def quotient(weights: np.ndarray, above: np.ndarray, below: np.ndarray) -> Bounded:
    """Bounds of Σ q above / Σ q below over the squares of `weights_around`."""
    divisor = weights @ below.astype(np.float64)
    exists = (divisor > 0).all(axis=0) | (divisor < 0).all(axis=0)
    with np.errstate(all="ignore"):
        value = (weights @ above.astype(np.float64)) / divisor
    return Bounded(value.min(axis=0), value.max(axis=0), exists)


def smooth_values(weights: np.ndarray, values: np.ndarray) -> Bounded:
    """Perspective-correct values."""
    return quotient(weights, values, np.ones(3))


def straight_values(weights: np.ndarray, position: np.ndarray, values: np.ndarray) -> Bounded:
    """Values that are linear on the screen; behind the eye they go on as the same function."""
    return quotient(weights, position[:, 3].astype(np.float64) * values, position[:, 3])


def depths(weights: np.ndarray, position: np.ndarray, viewport: Viewport) -> Bounded:
    """Window depths, kept in the depth range."""
    near, far = viewport[4:]
    found = quotient(weights, position[:, 2], position[:, 3])
    low, high = (np.clip(near + part * (far - near), near, far) for part in (found.low, found.high))
    return Bounded(low, high, found.exists)
