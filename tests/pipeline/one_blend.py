"""One fragment's write to one colour target, restated from the specifications; nothing of refsim's arithmetic inside.

Sources: OpenGL 4.6 17.3.6 (blending, tables 17.1 and 17.2; clamping for fixed-point targets), 2.3.5.2 (conversion to
8 bits), WebGPU "blend state" and "color write mask". Arithmetic is that of the numbers that come in: float32 scalars
are rounded after every step, `Fraction` is exact. Factors, operations and formats are named by their text.
"""

from fractions import Fraction
from math import floor
from typing import Any

import numpy as np

from refsim.pipeline.state import ColorTargetState


def clamp(x: Any) -> Any:
    """`x` in [0, 1], 0 if it is no number."""
    kind = type(x)
    if not x > 0:
        return kind(0)
    return x if x < 1 else kind(1)


def in_8_bits(x: Any) -> int:
    """The whole number nearest to 255 · x, of two the even one."""
    scaled = x * type(x)(255)
    low = floor(scaled)
    above = Fraction(float(scaled)) - low if not isinstance(x, Fraction) else scaled - low
    return low + (1 if above > Fraction(1, 2) or (above == Fraction(1, 2) and low % 2) else 0)


def factor_of(name: str, k: int, s: tuple, d: tuple, s1: tuple | None, c: tuple) -> Any:
    """Tables 17.2: the factor that component `k` (3: alpha) is multiplied by. Colours are (r, g, b, alpha)."""
    one = type(s[k])(1)
    if name == "zero":
        return one - one
    if name == "one":
        return one
    if name == "src-alpha-saturated":
        return one if k == 3 else min(one - d[3], s[3])
    base, minus = (name.removeprefix("one-minus-"), True) if name.startswith("one-minus-") else (name, False)
    color = {"src": s, "dst": d, "src1": s1, "constant": c}[base.split("-")[0]]
    value = color[3 if base.endswith("-alpha") else k]
    return one - value if minus else value


def joined(operation: str, src: str, dst: str, k: int, s: tuple, d: tuple, s1: tuple | None, c: tuple) -> Any:
    """Table 17.1. What a factor of zero would multiply is left out of the equation."""
    if operation == "min":
        return s[k] if s[k] < d[k] else d[k]
    if operation == "max":
        return s[k] if s[k] > d[k] else d[k]
    zero = type(s[k])(0)
    left = None if src == "zero" else s[k] * factor_of(src, k, s, d, s1, c)
    right = None if dst == "zero" else d[k] * factor_of(dst, k, s, d, s1, c)
    if operation == "reverse-subtract":
        left, right = right, left
    if left is None:
        return zero if right is None else (right if operation == "add" else zero - right)
    if right is None:
        return left
    return left + right if operation == "add" else left - right


def whole(color: Any) -> tuple:
    """A colour of up to four float32 components as four; a missing alpha is 1."""
    given = tuple(np.float32(part) for part in color)
    return given if len(given) == 4 else (*given, *(np.float32(0),) * (3 - len(given)), np.float32(1))


def written(state: Any, form: Any, source: Any, second: Any, constant: Any, stored: Any) -> tuple:
    """What a target of format `form` holds after a fragment: components as it stores them.

    `state` is a ColorTargetState; `source`, `second` (or None), `stored` hold the format's components, `constant` four.
    """
    if form.value.endswith("sint"):
        new = tuple(source)
    else:
        with np.errstate(all="ignore"):
            new = float_components(state.blend, form.value.endswith("8unorm"), source, second, constant, stored)
    return tuple(new[k] if int(state.write_mask) >> k & 1 else old for k, old in enumerate(stored))


def float_components(blend: Any, fixed: bool, source: Any, second: Any, constant: Any, stored: Any) -> list:
    """What a fragment leaves in the components that it may write; `blend` is a BlendState or None."""
    s, d, c = whole(source), whole(stored), whole(constant)
    s1 = whole(second) if second is not None else None
    if fixed:
        s, c = tuple(map(clamp, s)), tuple(map(clamp, c))
        s1 = tuple(map(clamp, s1)) if s1 is not None else None
    result = []
    for k in range(len(stored)):
        new = s[k]
        if blend is not None:
            part = blend.alpha if k == 3 else blend.color
            new = joined(str(part.operation), str(part.src_factor), str(part.dst_factor), k, s, d, s1, c)
        result.append(np.float32(in_8_bits(clamp(new))) / np.float32(255) if fixed else new)
    return result


def states_of(pipe: Any, framebuffer: Any) -> list[tuple]:
    """(name, format, state) of every target; without states all are replaced."""
    states = pipe.fragment.targets or (ColorTargetState(),) * len(framebuffer.targets)
    return [(name, form, state) for (name, form), state in zip(framebuffer.targets.items(), states, strict=True)]


def blends(pipe: Any, framebuffer: Any) -> bool:
    """Whether a written fragment is blended in a target of which it writes something."""
    return any(
        state.blend is not None and int(state.write_mask) % 2 ** len(framebuffer.color(name))
        for name, _, state in states_of(pipe, framebuffer)
    )


def write_colors(pipe: Any, framebuffer: Any, constant: Any, y: int, x: int, outputs: dict[str, Any]) -> None:
    """Writes a fragment's outputs to all targets."""
    for name, form, state in states_of(pipe, framebuffer):
        planes = framebuffer.color(name)[:, y, x]
        planes[:] = written(state, form, outputs[name], outputs.get("src1"), constant, planes.copy())
