"""From clip space to the screen: perspective divide, viewport transform, and the 8-bit sub-pixel grid.

A vertex is rounded to the nearest 1/256 pixel (halves to even) before anything asks what it covers: two primitives that
share a vertex share it exactly, and every edge function after is exact. Source: WebGPU "rasterization"; OpenGL 4.6
section 13.8 with the clip control of Direct3D (origin top-left, depth 0 to 1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.jit import func

SUBPIXEL_BITS = 8
SUBPIXELS = np.float32(2**SUBPIXEL_BITS)
REACH = 2**15 - 1  # pixels that a vertex may lie away from the origin; the guard band
LEAST_W = np.float32(2.0**-100)  # a vertex with less counts as behind the eye


class ScreenMap(NamedTuple):
    """The viewport as the kernels take it, float32: half its size and its centre in pixels, first depth and depth
    range, how many times the clip volume the guard band is."""

    half_x: np.float32
    half_y: np.float32
    centre_x: np.float32
    centre_y: np.float32
    near: np.float32
    depth: np.float32
    guard_x: np.float32
    guard_y: np.float32


def screen_map(x: float, y: float, width: float, height: float, near: float, far: float) -> ScreenMap:
    """The map of a viewport in pixels (see `refsim.pipeline.state.Viewport`), which lies within the guard band."""
    half_x, half_y = np.float32(width) / np.float32(2), np.float32(height) / np.float32(2)
    centre_x, centre_y = np.float32(x) + half_x, np.float32(y) + half_y
    guard_x, guard_y = (REACH - abs(centre_x)) / half_x, (REACH - abs(centre_y)) / half_y
    values = (half_x, half_y, centre_x, centre_y, near, np.float32(far) - np.float32(near), guard_x, guard_y)
    return ScreenMap(*(np.float32(value) for value in values))


@func
def to_screen(x, y, inverse_w, view):
    """Window coordinates in pixels, y down, of clip-space x and y; ``inverse_w`` = 1 / w."""
    return x * inverse_w * view[0] + view[2], view[3] - y * inverse_w * view[1]


@func
def to_depth(z, inverse_w, view):
    """Window depth of clip-space z."""
    return z * inverse_w * view[5] + view[4]


@func
def snapped(pixels):
    """The nearest point of the sub-pixel grid, counted in 1/256 pixel; float32, whole."""
    return np.rint(pixels * SUBPIXELS)
