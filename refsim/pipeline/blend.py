"""The blend stage: what a written fragment makes of the colour that a target holds, one component at a time.

In: the shader's colour (source), the stored colour (destination), the second source and the blend constant, each with
its alpha; out: the component to store. Float32 without fused operations, in this order: the factors, source · factor
and destination · factor, their sum or difference. A term whose factor is `ZERO` is dropped, so that what it would have
multiplied (infinity, NaN) is not read, as on hardware. A component of an 8-bit target then becomes k / 255; there
source, second source and constant are clamped to [0, 1] first.

Operations and factors are constants of the compiled draw (the chains of selects fold away); the same source compiles
state-generic when they are run-time integers. Source: OpenGL 4.6 section 17.3.6, WebGPU "blend state"; conversion to 8
bits: OpenGL 4.6 section 2.3.5.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import BlendFactor, BlendOperation, TextureFormat
from refsim.pipeline.packet import BLOCK, OFF

U = np.uintp
F0 = np.float32(0)
F1 = np.float32(1)
LEVELS = np.float32(255)
# 1 / 255 in two parts: k · HIGH is exact for 8-bit k, and adding k · LOW rounds to the float32 nearest to k / 255
HIGH = np.float32(0x8080 / 2**23)
LOW = np.float32(1 / 255 - 0x8080 / 2**23)

# Codes of the enumerations, in their order: device code compares whole numbers
(ZERO, ONE, SRC, ONE_MINUS_SRC, SRC_ALPHA, ONE_MINUS_SRC_ALPHA, DST, ONE_MINUS_DST, DST_ALPHA, ONE_MINUS_DST_ALPHA,
 SRC_ALPHA_SATURATED, CONSTANT, ONE_MINUS_CONSTANT, SRC1, ONE_MINUS_SRC1, SRC1_ALPHA, ONE_MINUS_SRC1_ALPHA) = range(17)
ADD, SUBTRACT, REVERSE_SUBTRACT, MIN, MAX = range(5)
FACTOR_CODE = {factor: code for code, factor in enumerate(BlendFactor)}
OPERATION_CODE = {operation: code for code, operation in enumerate(BlendOperation)}


class Channel(NamedTuple):
    """What a draw does to one plane of a colour target: all constants.

    `operation`, `src`, `dst` are codes. `is_alpha`: the plane is the target's alpha. `has_alpha`: the target has one
    (else its alpha is 1).
    """

    operation: int
    src: int
    dst: int
    blended: bool
    unorm8: bool
    is_alpha: bool
    has_alpha: bool


@func
def clamped(x):
    """`x` clamped to [0, 1]; NaN and −0 become 0."""
    return min(F1, max(F0, x))  # in this order and with these functions: two instructions a packet, and NaN is settled


@func
def to_unorm8(x):
    """The float32 nearest to k / 255, where k is the 8-bit value nearest to `x` (ties to even)."""
    k = np.rint(clamped(x) * LEVELS)
    return k * HIGH + k * LOW


@func
def factor(code, s, d, s1, c, s_alpha, d_alpha, s1_alpha, is_alpha):
    """The value of a blend factor for one component; `s`, `d`, `s1`, `c` are source, destination, second source and
    constant."""
    left = F1 - d_alpha
    value = F0
    value = F1 if code == ONE else value
    value = s if code == SRC else value
    value = F1 - s if code == ONE_MINUS_SRC else value
    value = s_alpha if code == SRC_ALPHA else value
    value = F1 - s_alpha if code == ONE_MINUS_SRC_ALPHA else value
    value = d if code == DST else value
    value = F1 - d if code == ONE_MINUS_DST else value
    value = d_alpha if code == DST_ALPHA else value
    value = left if code == ONE_MINUS_DST_ALPHA else value
    value = (F1 if is_alpha else (s_alpha if s_alpha < left else left)) if code == SRC_ALPHA_SATURATED else value
    value = c if code == CONSTANT else value
    value = F1 - c if code == ONE_MINUS_CONSTANT else value
    value = s1 if code == SRC1 else value
    value = F1 - s1 if code == ONE_MINUS_SRC1 else value
    value = s1_alpha if code == SRC1_ALPHA else value
    value = F1 - s1_alpha if code == ONE_MINUS_SRC1_ALPHA else value
    return value


@func
def joined(operation, src, dst, s, d, s_factor, d_factor):
    """The blend operation. With NaN, `MIN` and `MAX` give the destination."""
    a = F0 if src == ZERO else s * s_factor
    b = F0 if dst == ZERO else d * d_factor
    value = b if src == ZERO else (a if dst == ZERO else a + b)  # −0 + 0 is 0: a dropped term must not be added
    value = a - b if operation == SUBTRACT else value
    value = b - a if operation == REVERSE_SUBTRACT else value
    value = (s if s < d else d) if operation == MIN else value
    value = (s if s > d else d) if operation == MAX else value
    return value


@func
def component(channel, s, d, s1, c, s_alpha, d_alpha, s1_alpha):
    """What a written fragment leaves in one component of a target: the whole stage for one lane."""
    if channel.unorm8:
        s, s1, c = clamped(s), clamped(s1), clamped(c)
        s_alpha, s1_alpha = clamped(s_alpha), clamped(s1_alpha)
    d_alpha = d_alpha if channel.has_alpha else F1
    s_factor = factor(channel.src, s, d, s1, c, s_alpha, d_alpha, s1_alpha, channel.is_alpha)
    d_factor = factor(channel.dst, s, d, s1, c, s_alpha, d_alpha, s1_alpha, channel.is_alpha)
    blended = joined(channel.operation, channel.src, channel.dst, s, d, s_factor, d_factor)
    value = blended if channel.blended else s
    return to_unorm8(value) if channel.unorm8 else value


@func
def blend_plane(channel, write, new, stored, second, new_alpha, stored_alpha, second_alpha, c, first):
    """One plane of a target over a block of lanes, in working columns; lanes that write nothing keep what they hold.

    `new`, `second`: the shader's outputs for the plane; the alpha columns are read where the target has alpha. Alpha is
    the last plane of its target, so the planes before it still find the alpha that was stored.
    """
    for j in range(BLOCK):
        i = U(first + j)
        s, s1, d = new[i], second[i], stored[i]
        s_alpha, s1_alpha, d_alpha = s, s1, d  # a column that is written must not be read twice, or SIMD is lost
        if channel.has_alpha and not channel.is_alpha:
            s_alpha, s1_alpha, d_alpha = new_alpha[i], second_alpha[i], stored_alpha[i]
        value = component(channel, s, d, s1, c, s_alpha, d_alpha, s1_alpha)
        stored[i] = value if write[i] != OFF else d


def clear_values(form: TextureFormat, values: np.ndarray) -> np.ndarray:
    """`values` as a target of `form` stores them; for 8 bits the NumPy twin of `to_unorm8`."""
    if not form.is_unorm8:
        return values
    wide = np.asarray(values, np.float32)
    with np.errstate(invalid="ignore"):
        unit = np.where(wide > 0, np.where(wide < 1, wide, np.float32(1)), np.float32(0)).astype(np.float32)
    return np.rint(unit * LEVELS) / LEVELS
