"""The depth stage: a fragment's depth as its format stores it.

depth32float keeps the float32. depth24unorm holds round(z · (2²⁴ − 1)), a whole number that float32 represents
exactly, so both formats are compared as float32; the product is formed in float64, where it is exact.
Source: WebGPU "depth test", OpenGL 4.6 section 2.3.5 (conversion to normalised fixed point).
"""

from __future__ import annotations

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import DepthStencilFormat

F = np.float32
HALF = np.float64(0.5)
UNORM24 = np.float64(2**24 - 1)


@func
def stored_depth(depth_format, z, low, high):
    """`z` clamped to the viewport's depths [low, high] (NaN becomes the far end) in the units of `depth_format`."""
    z = max(low, min(high, z))  # in this order and with these functions: two instructions a packet, and NaN is settled
    fixed = F(np.floor(np.float64(z) * UNORM24 + HALF))
    return fixed if depth_format == DepthStencilFormat.DEPTH24UNORM_STENCIL8 else z


def clear_value(depth_format: DepthStencilFormat, z: float) -> np.float32:
    """The stored value of a clear to depth `z`; the NumPy twin of `stored_depth`."""
    z = z if z < 1.0 else 1.0
    z32 = np.float32(z if z > 0.0 else 0.0)
    if depth_format == DepthStencilFormat.DEPTH24UNORM_STENCIL8:
        return np.float32(np.floor(np.float64(z32) * UNORM24 + 0.5))
    return z32
