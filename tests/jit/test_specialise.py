"""Plan: within one process a kernel is found again while nothing changed, and is a new one as soon as something did.

- The same template, slots and options give the same dispatcher; so do device functions of equal content.
- After a constant, cell, array, module attribute or default has changed, the new kernel computes with the new value,
  though the device function was compiled before; the earlier kernel keeps the value it was made for, even if it is
  first called after the change. Random sequences of constants show it.
- A class defined twice alike (a notebook cell run again) does not mix with itself.
- Recursion works; a circle of functions works too, without the disk.
- Templates keep closures and defaults; constants of all kinds can be slots.
- `func` keeps `.py_func`, takes plain functions only, and is strict: no fused operations, division by zero is infinite.
- Code that would be slow without a word (function pointers, hidden copies) is an error.
- Options that are not the caller's, and templates that are not plain functions, are refused.
"""

import enum
import types
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.jit import func, specialise


def stage(columns):
    for i in range(columns.size):
        columns[i] = shader(columns[i])  # noqa: F821


def value(kernel: Any) -> float:
    columns = np.array([1.0])
    kernel(columns)
    return float(columns[0])


def factory(k: Any) -> Any:
    @func
    def shader(x):
        return x + k
    return shader


def program(text: str, **names: Any) -> dict[str, Any]:
    scope = {"func": func, "np": np, "__name__": "program", **names}
    exec(text, scope)
    return scope


@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from([1.0, 2.0, 3.5]), min_size=2, max_size=5))
def test_kernels_follow_a_global_and_stay_what_they_were(constants: list[float]) -> None:
    scope = program("@func\ndef inner(x): return x + K\n@func\ndef shader(x): return inner(x)", K=0.0)
    kernels = []
    for constant in constants:
        scope["K"] = constant
        kernels.append(specialise(stage, {"shader": scope["shader"]}))
    # all are first called now, when K is the last constant
    assert [value(kernel) for kernel in kernels] == [1.0 + constant for constant in constants]
    for constant, kernel in zip(constants, kernels, strict=True):
        scope["K"] = constant
        assert specialise(stage, {"shader": scope["shader"]}) is kernel


def test_equal_content_gives_the_same_dispatcher() -> None:
    kernel = specialise(stage, {"shader": factory(2.0)})
    assert specialise(stage, {"shader": factory(2.0)}) is kernel
    assert specialise(stage, {"shader": factory(2.5)}) is not kernel
    assert specialise(stage, {"shader": factory(2.0)}, boundscheck=True) is not kernel
    assert specialise(stage, {"shader": factory(2.0), "unused": 1}) is not kernel


def test_constants_that_compare_equal_do_not_share_a_kernel() -> None:
    slots = [1, 1.0, True, np.float32(1), np.float64(1), 0, 0.0, -0.0, (1,), (1.0,), Mode.ADD, "1", None]
    kernels = [specialise(stage, {"shader": slot}) for slot in slots]
    assert len(set(map(id, kernels))) == len(slots)


def test_every_kind_of_change_is_compiled_after_the_old_value_was(cache: Any) -> None:
    own = types.ModuleType("own")
    vars(own)["LEVEL"] = 3.0
    scope = program("""
def factory(k):
    @func
    def add(x): return x + k
    def change(value):
        nonlocal k
        k = value
    return add, change
add, change = factory(1.0)
@func
def by_default(x, y=1.0): return x + y
@func
def shader(x): return add(x) + 10.0 * by_default(x) + 100.0 * own.LEVEL + 1000.0 * TABLE[0] + 10000.0 * PAIR[1][0]
""", own=own, TABLE=np.array([1.0]), PAIR=(0.0, (1.0,)))
    first = specialise(stage, {"shader": scope["shader"]})
    assert value(first) == 11322.0
    scope["change"](2.0)
    assert value(specialise(stage, {"shader": scope["shader"]})) == 11323.0
    scope["by_default"].py_func.__defaults__ = (2.0,)
    assert value(specialise(stage, {"shader": scope["shader"]})) == 11333.0
    own.LEVEL = 4.0  # type: ignore[attr-defined]
    assert value(specialise(stage, {"shader": scope["shader"]})) == 11433.0
    scope["TABLE"][0] = 2.0
    assert value(specialise(stage, {"shader": scope["shader"]})) == 12433.0
    scope["PAIR"] = (0.0, (2.0,))
    assert value(specialise(stage, {"shader": scope["shader"]})) == 22433.0
    assert value(first) == 11322.0


def test_an_array_and_a_module_are_frozen_before_the_first_call() -> None:
    own = types.ModuleType("own")
    vars(own)["LEVEL"] = 3.0
    table = np.array([1.0])
    scope = program("@func\ndef shader(x): return own.LEVEL + TABLE[0]", own=own, TABLE=table)
    kernel = specialise(stage, {"shader": scope["shader"]})
    own.LEVEL, table[0] = 5.0, 7.0  # type: ignore[attr-defined]
    assert value(kernel) == 4.0


def test_a_class_defined_twice_does_not_mix_with_itself() -> None:
    text = """
from typing import NamedTuple
import enum
class Light(NamedTuple):
    power: float
class Mode(enum.Enum):
    BRIGHT = 1
    DARK = 2
"""
    one, two = program(text), program(text)
    shader = "@func\ndef shader(x): return Light(x + 1.0) if x > 5.0 else make(x)"
    make = "@func\ndef make(x): return Light(2.0 if MODE == Mode.BRIGHT else 3.0)"
    use = "@func\ndef shader(x): return inner(x).power"
    mode = {"MODE": one["Mode"].BRIGHT, "Mode": one["Mode"]}
    makes = program(make, Light=one["Light"], **mode)["make"]
    first = program(use, inner=program(shader, Light=one["Light"], make=makes)["shader"])["shader"]
    assert value(specialise(stage, {"shader": first})) == 2.0
    # the cell runs again: `make` is as before, the rest is of the new class
    mode = {"MODE": two["Mode"].BRIGHT, "Mode": one["Mode"]}
    makes = program(make, Light=one["Light"], **mode)["make"]
    again = program(shader.replace("5.0", "6.0"), Light=two["Light"], make=makes)["shader"]
    second = program(use, inner=again)["shader"]
    assert value(specialise(stage, {"shader": second})) == 2.0


def test_recursion_works_and_a_circle_stays_off_the_disk() -> None:
    scope = program("""
@func
def alone(n): return n if n < 1 else alone(n - 1)
@func
def even(n): return True if n < 1 else odd(n - 1)
@func
def odd(n): return False if n < 1 else even(n - 1)
""")
    alone, circle = (specialise(stage, {"shader": scope[name]}) for name in ("alone", "even"))
    columns = np.array([4.0, 3.0])
    alone(columns)
    assert columns.tolist() == [0.0, 0.0]
    columns = np.array([4.0, 3.0])
    circle(columns)
    assert columns.tolist() == [1.0, 0.0]
    assert alone.stats.cache_path is not None
    assert circle.stats.cache_path is None


def closed_template(k: float) -> Any:
    def stage(columns, add=10.0, factor=2.0):
        columns[0] = shader(columns[0]) * k * factor + add  # noqa: F821
    return stage


def test_a_template_keeps_closure_and_defaults() -> None:
    kernels = [specialise(closed_template(k), {"shader": factory(1.0)}) for k in (3.0, 4.0)]
    assert [value(kernel) for kernel in kernels] == [22.0, 26.0]


class Mode(enum.IntEnum):
    ADD = 1
    KEEP = 2


class Face(NamedTuple):
    compare: Mode
    mask: int


class State(NamedTuple):
    front: Face
    names: tuple[int, str]
    width: np.float32


def constants(out):
    out[0] = STATE.front.mask + STATE.names[0] + STATE.width  # noqa: F821
    out[1] = 1.0 if STATE.front.compare == Mode.KEEP else 2.0  # noqa: F821
    out[2] = TABLE[1, 0] + (5.0 if FLAG else 6.0)  # noqa: F821
    out[3] = Kind(out[0])  # noqa: F821


def test_constants_of_all_kinds_can_be_slots() -> None:
    slots = {"STATE": State(Face(Mode.KEEP, 3), (4, "name"), np.float32(0.5)), "TABLE": np.array([[1.0], [2.0]]),
             "FLAG": True, "Kind": np.float32}
    kernel = specialise(constants, slots)
    out = np.zeros(4)
    kernel(out)
    assert out.tolist() == [7.5, 1.0, 7.0, 7.5]
    changed = {**slots, "STATE": State(Face(Mode.ADD, 3), (4, "name"), np.float32(0.5)), "FLAG": False}
    other = specialise(constants, changed)
    other(out)
    assert out.tolist() == [7.5, 2.0, 8.0, 7.5]
    assert specialise(constants, dict(slots)) is kernel


def test_a_kernel_without_a_file_compiles_without_the_disk() -> None:
    template = program("def stage(columns): columns[0] = shader(columns[0])")["stage"]
    kernel = specialise(template, {"shader": factory(4.0)})
    assert value(kernel) == 5.0
    assert kernel.stats.cache_path is None


def test_func_is_strict_and_keeps_the_function_as_written() -> None:
    @func
    def divide(x):
        return x / (x - x)

    @func
    def product(x):
        y = x + np.float64(2**-27)
        return y * y - np.float64(1 + 2**-26)  # zero in two roundings, 2**-54 when fused

    assert divide.py_func.__name__ == "divide"
    assert value(specialise(stage, {"shader": divide})) == np.inf
    assert value(specialise(stage, {"shader": product})) == 0.0


@pytest.mark.parametrize("culprit", [int, 3, factory(1.0), numba.njit(lambda x: x), "text".join])
def test_func_takes_plain_functions_only(culprit: Any) -> None:
    with pytest.raises(InputError, match="plain Python function"):
        func(culprit)


def test_a_function_pointer_is_an_error() -> None:
    scope = program("@func\ndef shader(x):\n    f = one if x > 0.0 else two\n    return f(x)",
                    one=factory(1.0), two=factory(2.0))
    with pytest.raises(InputError, match="shader has a function"):
        value(specialise(stage, {"shader": scope["shader"]}))


def test_a_hidden_copy_is_an_error() -> None:
    scope = program("@func\ndef product(x): return np.dot(TABLE[:, ::2], TABLE[:, ::2])[0, 0]", TABLE=np.ones((2, 4)))
    with pytest.raises(InputError, match="product would run slowly"):
        value(specialise(stage, {"shader": scope["product"]}))


@pytest.mark.parametrize("option", ["fastmath", "cache", "forceobj"])
def test_options_that_are_not_the_callers_are_refused(option: str) -> None:
    with pytest.raises(InputError, match=option):
        specialise(stage, {"shader": factory(1.0)}, **{option: True})
    specialise(stage, {"shader": factory(1.0)}, **{option: False})


def test_templates_are_plain_functions() -> None:
    for culprit in (factory(1.0), numba.njit(lambda x: x), int):
        with pytest.raises(InputError, match="template"):
            specialise(culprit, {})
