"""Blending in NumPy: factors, operations and 8-bit storage, one function each (OpenGL 4.6 section 17.3.6, 2.3.5).

Keeps the dtype of its inputs: float32 gives the bits of the device function, float64 shows what float32 rounds away.
Factors and operations are named as in WebGPU. An `Operands` holds one component of many fragments.
"""

from typing import NamedTuple

import numpy as np


class Operands(NamedTuple):
    """One component [n] of source, destination, second source and constant, and the alphas [n] that go with it.

    `alpha`: the component is alpha itself.
    """

    source: np.ndarray
    destination: np.ndarray
    second: np.ndarray
    constant: np.ndarray
    source_alpha: np.ndarray
    destination_alpha: np.ndarray
    second_alpha: np.ndarray
    alpha: bool = False


def clamp(x: np.ndarray) -> np.ndarray:
    """`x` in [0, 1]; NaN and −0 become 0."""
    return np.where(x > 0, np.where(x < 1, x, x.dtype.type(1)), x.dtype.type(0))


def to_unorm8(x: np.ndarray) -> np.ndarray:
    """The nearest k / 255 (ties to even k)."""
    levels = x.dtype.type(255)
    return np.rint(clamp(x) * levels) / levels


def clamped(x: Operands) -> Operands:
    """The operands as a fixed-point target takes them; what it stores is in [0, 1] as it is."""
    return x._replace(
        source=clamp(x.source),
        second=clamp(x.second),
        constant=clamp(x.constant),
        source_alpha=clamp(x.source_alpha),
        second_alpha=clamp(x.second_alpha),
    )


def saturated(x: Operands) -> np.ndarray:
    """min(source alpha, 1 − destination alpha) for colours, 1 for alpha."""
    one = np.ones_like(x.source)
    left = one - x.destination_alpha
    return one if x.alpha else np.where(x.source_alpha < left, x.source_alpha, left)


def factor(name: str, x: Operands) -> np.ndarray:
    """The value of a blend factor."""
    if name.startswith("one-minus-"):
        return x.source.dtype.type(1) - factor(name.removeprefix("one-minus-"), x)
    plain = {
        "src": x.source,
        "dst": x.destination,
        "src1": x.second,
        "constant": x.constant,
        "src-alpha": x.source_alpha,
        "dst-alpha": x.destination_alpha,
        "src1-alpha": x.second_alpha,
    }
    if name in plain:
        return plain[name]
    return {"zero": np.zeros_like, "one": np.ones_like}[name](x.source) if name in ("zero", "one") else saturated(x)


def term(name: str, value: np.ndarray, x: Operands) -> np.ndarray:
    """`value` · factor; 0 where the factor is zero, whatever `value` is."""
    return np.zeros_like(value) if name == "zero" else value * factor(name, x)


def blend(operation: str, src: str, dst: str, x: Operands) -> np.ndarray:
    """Source · source factor joined with destination · destination factor."""
    a, b = term(src, x.source, x), term(dst, x.destination, x)
    if operation == "add":
        return b if src == "zero" else (a if dst == "zero" else a + b)
    if operation in ("subtract", "reverse-subtract"):
        return a - b if operation == "subtract" else b - a
    smaller = x.source < x.destination if operation == "min" else x.source > x.destination
    return np.where(smaller, x.source, x.destination)
