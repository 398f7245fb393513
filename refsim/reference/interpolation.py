"""What a triangle's pixels hold, in NumPy: barycentric weights, varyings, depth and its bias.

In: snapped corners int64 ``[3, 2]`` (1/256 pixel), pixels (columns, rows), vertex values. Out: float64, or the values'
dtype in `spread`. Edges are whole numbers below 2^53, so the weights are right to their last division.
Sources: WebGPU 23.2.4.1 and 23.2.4.2 (interpolation), OpenGL 4.6 14.6.1 (equation 14.9), 14.6.5 (polygon offset).
"""

from __future__ import annotations

import numpy as np

from refsim.reference.raster import SUBPIXELS, Viewport, doubled_area, edge_function

UNORM24_STEP = 1 / (2.0**24 - 1)


def barycentrics(corners: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Weights float64 ``[n, 3]`` of the corners at the centres of pixels (x, y), linear in screen space."""
    point = np.stack([x, y], axis=-1).astype(np.int64) * SUBPIXELS + SUBPIXELS // 2
    edges = [edge_function(corners[(k + 1) % 3], corners[(k + 2) % 3], point) for k in range(3)]
    return np.stack(edges, axis=-1) / np.float64(doubled_area(corners))


def perspective(weights: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Weights ``[n, 3]`` that are linear in space from those that are linear on the screen; w ``[3]``."""
    over_w = weights / w.astype(np.float64)
    return over_w / over_w.sum(axis=-1, keepdims=True)


def spread(weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """v0 + b1 (v1 − v0) + b2 (v2 − v0) for values ``[3]``, ``[n]``: constant values come out as they are."""
    b1, b2 = (weights[..., k].astype(values.dtype) for k in (1, 2))
    return values[0] + b1 * (values[1] - values[0]) + b2 * (values[2] - values[0])


def homogeneous(position: np.ndarray, ndc_x: np.ndarray, ndc_y: np.ndarray) -> np.ndarray:
    """Weights float64 ``[..., 3]``, up to a factor, of clip positions ``[3, 4]`` at points of the screen.

    The point of the triangle's plane that projects there is the weighted sum of the vertices, whatever their w: no
    clipping is involved. Smooth varyings are Σ q v / Σ q; depth is Σ q z / Σ q w; linear ones Σ q w v / Σ q w.
    """
    vertices = position.astype(np.float64)
    a = vertices[:, 0] - ndc_x[..., None] * vertices[:, 3]
    b = vertices[:, 1] - ndc_y[..., None] * vertices[:, 3]
    return np.cross(a, b)


def steepest(corners: np.ndarray, z: np.ndarray) -> float:
    """The larger of |dz/dx| and |dz/dy| of depths ``[3]`` at snapped corners, in depth a pixel."""
    (x1, y1), (x2, y2) = (corners[1:] - corners[0]) / np.float64(SUBPIXELS)
    z1, z2 = z[1:].astype(np.float64) - np.float64(z[0])
    area = x1 * y2 - x2 * y1
    return float(max(abs(z1 * y2 - z2 * y1), abs(z2 * x1 - z1 * x2)) / abs(area))


def smallest_step(depth_format: str, z: np.ndarray) -> float:
    """What one unit of depth bias adds: a step of 24 bits; in float32 a unit in the last place of the largest |z|, at
    least the smallest normal number."""
    if depth_format == "depth24unorm-stencil8":
        return UNORM24_STEP
    _, exponent = np.frexp(max(float(np.abs(z).max()), 2.0**-126))
    return float(2.0 ** max(int(exponent) - 1 - 23, -126))


def depth_bias(constant: int, slope_scale: float, clamp: float, step: float, slope: float) -> float:
    """The bias of a triangle's depth; `clamp` bounds it on its own side of zero, 0 means no bound."""
    bias = constant * step + slope_scale * slope
    if clamp > 0:
        return min(bias, clamp)
    return max(bias, clamp) if clamp < 0 else bias


def depth(weights: np.ndarray, z: np.ndarray, bias: float, viewport: Viewport) -> np.ndarray:
    """Depths float32 ``[n]`` of pixels with screen-space weights, kept in the viewport's depth range."""
    exact = spread(weights, z.astype(np.float64)) + bias
    return np.clip(exact, viewport[4], viewport[5]).astype(np.float32)
