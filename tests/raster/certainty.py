"""Which pixels a polygon covers beyond doubt, if each of its corners may have moved by so much; in float64.

The pipeline rounds corners to the sub-pixel grid, and computes them in float32. A pixel centre that is farther from
the polygon's border than the border can have moved is covered, or not, whatever was rounded: its winding number cannot
have changed. Everything nearer is left open, pixel by pixel.
"""

import numpy as np

from refsim.reference import raster
from refsim.reference.raster import SUBPIXELS, Viewport

UNIT = 2.0**-24  # of a float32 rounding, relative
HALF_STEP = 0.5 / SUBPIXELS


def movement(screen: np.ndarray, viewport: Viewport) -> np.ndarray:
    """How far, in pixels, corners at exact places [m, 2] can lie from where the pipeline puts them.

    Half a sub-pixel step an axis, and roundings of x, w, 1 / w, the product, its scaling, the sum and the centre: seven
    of them, of numbers no larger than |screen − centre| + |centre|; √2 for both axes together.
    """
    x, y, width, height = (float(part) for part in viewport[:4])
    centre = np.array([x + width / 2, y + height / 2])
    largest = (np.abs(screen - centre) + np.abs(centre)).max(axis=1)
    return np.sqrt(2) * (HALF_STEP + 7 * UNIT * largest)


def to_screen(position: np.ndarray, viewport: Viewport) -> np.ndarray:
    """Exact places [m, 2] of clip positions [m, 4]."""
    ndc, _ = raster.divide(position.astype(np.float64))
    return raster.to_screen(ndc, viewport)


def doubtful(corners: np.ndarray, moved: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Whether points [..., 2] lie so near to the border of a polygon [m, 2] that moving corners could decide them."""
    near = np.zeros(point.shape[:-1], bool)
    for k in range(len(corners)):
        after = (k + 1) % len(corners)
        a, step = corners[k], corners[after] - corners[k]
        length2 = step @ step
        s = np.clip((point - a) @ step / length2, 0, 1) if length2 > 0 else np.zeros(point.shape[:-1])
        distance = np.linalg.norm(point - (a + s[..., None] * step), axis=-1)
        # The movement changes along the edge; where it does so quickly the larger one is taken for the whole edge
        gradual = abs(moved[after] - moved[k]) <= 0.1 * np.sqrt(length2)
        tolerance = moved[k] + s * (moved[after] - moved[k]) if gradual else max(moved[k], moved[after])
        near |= distance <= 1.01 * tolerance
    return near


def inside(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Whether points [..., 2] lie inside a convex polygon [m, 2], whichever way round it goes."""
    left, right = np.ones(point.shape[:-1], bool), np.ones(point.shape[:-1], bool)
    for k in range(len(corners)):
        a, b = corners[k], corners[(k + 1) % len(corners)]
        edge = raster.edge_function(a, b, point)
        left, right = left & (edge <= 0), right & (edge >= 0)
    return left | right


def certain_coverage(
    position: np.ndarray, viewport: Viewport, bounds: raster.Bounds, more: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(covered, doubtful), bool [h, w], of a convex polygon of clip positions [m, 4] with w > 0; corners may have moved
    by `more` pixels beyond what the pipeline does."""
    point = raster.centres(bounds) / SUBPIXELS
    if len(position) < 3:
        return np.zeros(point.shape[:2], bool), np.zeros(point.shape[:2], bool)
    corners = to_screen(position, viewport)
    return inside(corners, point), doubtful(corners, movement(corners, viewport) + more, point)
