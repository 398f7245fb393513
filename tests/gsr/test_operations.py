"""Operations counted on device functions' own source.

Plan
- A number that counts what is done to it, run through the shaders' own Python: the same operations, kind by kind, for
  functions without a branch; for Phong's power, whatever the exponent.
- By hand: small functions for each rule (branches known and unknown, loops, early exits, texels, instrumentation); the
  triangle test.
- A function without a source, or with one that is not understood, is refused.
"""

from __future__ import annotations

import math
import types
from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.geometry import optics, triangle, vector
from refsim.papers.geometry_shader_rays import shading
from refsim.papers.geometry_shader_rays.costs import search_work
from refsim.papers.geometry_shader_rays.operations import Cost, Uncountable, Unknown
from refsim.papers.geometry_shader_rays.source_walk import walk

done: Counter[str] = Counter()


class Number:
    """A float that counts what is done to it."""

    __array_ufunc__ = None

    def __init__(self, worth: float) -> None:
        self.worth = float(worth)

    def __neg__(self) -> Number:
        return Number(-self.worth)

    def __bool__(self) -> bool:
        return bool(self.worth)


def _operation(kind: str, does: Any, turned: bool) -> Any:
    def operation(self: Number, other: Any) -> Number:
        done[kind] += 1
        pair = (self.worth, float(getattr(other, "worth", other)))
        return Number(does(*(pair[::-1] if turned else pair)))

    return operation


KINDS = {
    "add": ("add", lambda a, b: a + b), "sub": ("add", lambda a, b: a - b), "mul": ("multiply", lambda a, b: a * b),
    "truediv": ("divide", lambda a, b: a / b), "lt": ("compare", lambda a, b: a < b),
    "le": ("compare", lambda a, b: a <= b), "gt": ("compare", lambda a, b: a > b),
    "ge": ("compare", lambda a, b: a >= b), "eq": ("compare", lambda a, b: a == b),
    "and": ("logic", lambda a, b: bool(a) and bool(b)), "or": ("logic", lambda a, b: bool(a) or bool(b)),
}  # fmt: skip
for _name, (_kind, _does) in KINDS.items():
    setattr(Number, f"__{_name}__", _operation(_kind, _does, False))
    setattr(Number, f"__r{_name}__", _operation(_kind, _does, True))


class CountingMath:
    """`math` for such numbers."""

    @staticmethod
    def sqrt(x: Any) -> Number:
        done["root"] += 1
        return Number(math.sqrt(float(getattr(x, "worth", x))))


def in_python(function: Any) -> Any:
    """A device function, and all that it calls, as plain Python."""
    plain = function.py_func
    names = {name: in_python(value) if hasattr(value, "py_func") else value for name, value in plain.__globals__.items()
             if name in plain.__code__.co_names}  # fmt: skip
    if "math" in names:
        names["math"] = CountingMath
    return types.FunctionType(plain.__code__, names)


def counted(function: Any, *arguments: Any) -> Counter[str]:
    """What running a device function does, but for selects, which no number can see."""
    done.clear()
    in_python(function)(*arguments)
    return Counter(done)


def vec(*parts: float) -> tuple[Number, ...]:
    return tuple(Number(part) for part in parts)


def without_selects(cost: Cost) -> Counter[str]:
    return Counter({kind: n for kind, n in cost.counts.items() if kind != "select"})


A, B, C, ONE = vec(1, 2, 3), vec(0.25, -1, 2), vec(3, 1, -0.5), Number(1)
BRANCH_FREE = {
    "dot": (vector.dot, (A, B)),
    "cross": (vector.cross, (A, B)),
    "normalise": (vector.normalise, (A,)),
    "intersect": (triangle.intersect, (A, B, ONE, C, A, B, C)),
    "next_ray": (optics.next_ray, (A, B, ONE, C, vec(-1, -2, -3), ONE, ONE)),
    "shadow_ray": (shading.shadow_ray, (A, B, C, B, ONE, 0)),
    "ambient": (shading.ambient, (A, ONE)),
    "facing": (shading.facing, (A, B)),
}


@pytest.mark.parametrize("name", BRANCH_FREE)
def test_a_number_that_counts_agrees(name: str) -> None:
    function, arguments = BRANCH_FREE[name]
    unknown = [tuple(Unknown() for _ in part) if isinstance(part, tuple) else part if part == 0 else Unknown()
               for part in arguments]  # fmt: skip
    cost, _ = walk(function, *unknown)
    found = counted(function, *arguments)
    assert found and without_selects(cost) == found and not cost.loops


@given(st.integers(0, 2000))
def test_power_and_phong_at_every_exponent(exponent: int) -> None:
    cost, _ = walk(shading.power, Unknown(), exponent)
    assert cost.counts["multiply"] == counted(shading.power, Number(1.0), exponent)["multiply"]
    assert cost.counts["multiply"] == exponent.bit_count() + exponent.bit_length()
    # Seen along the mirrored ray: the highlight is on, which is the costlier side
    surface = (vec(0, 0, 0), vec(0, 0, -1), vec(0, 0, 1), vec(1, 1, 1), Number(0.5))
    seen = counted(shading.phong, *surface, exponent, vec(0, 0, 5), vec(1, 1, 1), ONE)
    three = tuple(Unknown() for _ in range(3))
    whole, _ = walk(shading.phong, three, three, three, three, np.float32(0.5), exponent, three, three, Unknown())
    assert [whole.counts[k] for k in ("add", "divide", "root")] == [seen[k] for k in ("add", "divide", "root")]
    assert whole.counts["multiply"] == seen["multiply"]


def test_the_triangle_test_by_hand() -> None:
    cost, _ = walk(triangle.intersect, *(Unknown(name) for name in "odtvnmm"))
    # v0 − o 3; three-term products 4 × (3 × and 2 +), one division; hit point 3 × and 3 −; u + v; five comparisons
    assert cost.counts == {"add": 3 + 4 * 2 + 3 + 1, "multiply": 4 * 3 + 3, "divide": 1, "compare": 5, "logic": 4}


def known_side(flag, x):
    if flag:
        return x * x
    return x + x + x


def costlier_side(x):
    y = x
    if x > 0:
        y = x + x
        y = y + 0
    else:
        y = x * x * x
        y = y * x
    return y


def early_exit(x):
    y = x + x
    if y > 1:
        return y * y
    return y + y + y


def loops(n, x):
    cells, tests = 0, 0
    for _ in range(3):
        x = x * x
    for _ in range(n):
        cells += 1
        x = x + x + x
        while x > 0:
            tests += 1
            x = triangle.intersect(x, x, x, x, x, x, x)
    return x, cells, tests


def texels(t, u, i):
    same = t.data[0, i] + t.data[1, i]
    other = t.data[0, i + 1]
    return same + other + u.lights[i, 0] + t.data[0, 5]


HALF = np.float32(0.5)


def constants(x):
    return x * (HALF + 2), -x, not x


def selects(x, y):
    return (x, y) if x > y else (y, x)


def test_rules_by_hand() -> None:
    x = Unknown("x")
    assert walk(known_side, 1, x)[0].counts == {"multiply": 1} and walk(known_side, 0, x)[0].counts == {"add": 2}
    assert walk(costlier_side, x)[0].counts == {"compare": 1, "multiply": 3}
    cost, value = walk(early_exit, x)
    assert cost.counts == {"add": 3, "compare": 1} and isinstance(value, Unknown)
    assert [exit.counts for exit in cost.exits] == [{"add": 1, "compare": 1, "multiply": 1}]
    cost, _ = walk(loops, Unknown("n"), x)
    (outer,) = cost.loops
    (inner,) = outer.loops
    assert cost.counts == {"multiply": 3} and (outer.cells, outer.tests, inner.tests) == (1, 0, 1)
    assert outer.counts == {"add": 1 + 2, "compare": 1} and inner.counts["compare"] == 1 + 5
    cost, _ = walk(texels, Unknown("t.one"), Unknown("u"), Unknown("i"))
    assert (cost.fetches, cost.counts["add"]) == (2, 1 + 1 + 3)
    assert walk(constants, x)[0].counts == {"multiply": 1}
    assert walk(selects, x, x)[0].counts == {"compare": 1, "select": 2}
    assert walk(known_side, Unknown(), x)[0].counts == {"add": 2}


@pytest.mark.parametrize("source", ["x = [1 for _ in o]", "import math", "for k in d:\n        pass", "x = unheard(o)"])
def test_what_cannot_be_counted_is_refused(source: str, tmp_path: Any) -> None:
    text = f"def traverse(s, triangles, o, d, t_max, any_hit, front_only):\n    {source}\n    return o\n"
    names: dict[str, Any] = {}
    exec(compile(text, "nowhere", "exec"), names)
    with pytest.raises(Uncountable, match="cannot be read"):
        search_work(names["traverse"])
    (tmp_path / "written.py").write_text(text)
    exec(compile(text, str(tmp_path / "written.py"), "exec"), names)
    with pytest.raises(Uncountable, match=r"cannot be counted|not known"):
        search_work(names["traverse"])
