"""How far inside or outside a primitive a pixel's centre lies, exactly: float64 from clip positions, nothing snapped.

A rasteriser that snaps corners to a grid may be wrong only about centres nearer to an edge than its precision; with
these margins that is judged pixel by pixel, for refsim and for OpenGL alike.
"""

from __future__ import annotations

import numpy as np


def triangle_margins(position: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """float64 [n, h, w], in pixels, of clip positions [3n, 4]: positive inside, negative outside.

    The least signed distance to the lines of the three edges, of the near and of the far plane. In homogeneous window
    coordinates a centre p = Σ q h of the corners h lies inside where all q are positive, whatever the corners' w; q, z
    and w − z are linear in p (Olano and Greer, Triangle scan conversion using 2D homogeneous coordinates, 1997).
    """
    width, height = size
    corners = position.astype(np.float64).reshape(-1, 3, 4)
    x, y, z, w = np.moveaxis(corners, -1, 0)
    rows = np.stack([(x + w) * (width / 2), (w - y) * (height / 2), w], axis=-1)
    with np.errstate(all="ignore"):
        weights = np.linalg.inv(rows)
        lines = [weights[..., k] for k in range(3)]
        lines += [np.einsum("nik,nk->ni", weights, z), np.einsum("nik,nk->ni", weights, w - z)]
        distance = np.full((len(corners), height, width), np.inf)
        for line in lines:
            steepness = np.hypot(line[:, 0], line[:, 1])
            # A plane that the whole triangle is as far from has no line on the screen
            level = steepness <= 1e-12 * np.abs(line).max(axis=1)
            scaled = line / np.where(level, 1e-12 * np.abs(line).max(axis=1), steepness)[:, None]
            distance = np.minimum(distance, _at_centres(scaled, width, height))
    return distance


def _at_centres(line: np.ndarray, width: int, height: int) -> np.ndarray:
    """Values [n, h, w] of lines [n, 3] at pixel centres."""
    column, row = np.arange(width) + 0.5, np.arange(height) + 0.5
    across, down, constant = (line[:, k, None, None] for k in range(3))
    return across * column + down * row[:, None] + constant


def point_margins(position: np.ndarray, point_size: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """float64 [n, h, w], in pixels: how far centres lie within squares of `point_size` around clip positions [n, 4]."""
    width, height = size
    x, y, _, w = position.astype(np.float64).T
    across = (x / w + 1) * (width / 2), width
    down = (1 - y / w) * (height / 2), height
    half = point_size.astype(np.float64)[:, None] / 2
    beside, below = (half - np.abs(np.arange(n) + 0.5 - centre[:, None]) for centre, n in (across, down))
    return np.minimum(beside[:, None, :], below[:, :, None])
