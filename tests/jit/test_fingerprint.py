"""Plan: the fingerprint differs exactly when what is compiled may differ, and nothing is hashed by its type alone.

- Two constants have one fingerprint if and only if they are equal in type and content (1 and True differ).
- The same holds for the fields, annotations and defaults of NamedTuples and the members of enums of one name.
- `unchanged` holds until a name, cell, default, module attribute or array that was looked at changes, and not after.
- Names not read from a module, and attributes that share a global's name, do not count.
- Classes of one name in two modules differ; whether two equal tuples are one object does not matter.
- Circles of device functions end.
- An object of unknown kind, wherever it is reached, is refused by a sentence that names it.
- A typical draw (30 device functions) is fingerprinted in less than 5 ms, and recognised in less than 0.5 ms.
"""

import enum
import functools
import struct
import types
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.jit import DependencyError, func, specialise
from refsim.jit.fingerprint import fingerprint, unchanged


def template(x):
    return SLOT(x)  # noqa: F821


def key(value: Any) -> str:
    return fingerprint(template, {"SLOT": value}).key


floats = st.sampled_from([0.0, -0.0, 1.0, float("nan"), float("inf"), 0.1]) | st.floats(width=32)
scalars = (st.none() | st.booleans() | st.integers(-2, 2) | floats | st.sampled_from(["", "a", "1"])
           | floats.map(np.float64) | floats.map(np.float32) | st.integers(-1, 1).map(np.int32))
constants = st.recursive(scalars, lambda inner: st.lists(inner, max_size=3).map(tuple), max_leaves=6)


def exact(value: Any) -> Any:
    """`value` such that == means equal type and bits."""
    if isinstance(value, tuple):
        return tuple(map(exact, value))
    if isinstance(value, np.generic):
        return type(value), value.tobytes()
    return type(value), struct.pack("d", value) if isinstance(value, float) and value == value else repr(value)


@given(constants, constants)
def test_constants_agree_exactly_when_equal_in_type_and_content(one: Any, other: Any) -> None:
    assert (key(one) == key(other)) == (exact(one) == exact(other))


@given(st.tuples(floats, st.lists(scalars, min_size=1, max_size=3)))
def test_a_copy_of_a_constant_agrees(value: Any) -> None:
    copy = (value[0], tuple(value[1]))
    assert key((value[0], tuple(value[1]))) == key(copy)
    shared = (1.5, 2.5)
    assert key((shared, shared)) == key((shared, tuple([1.5, 2.5])))


names = st.sampled_from(["a", "b"])
fields = st.dictionaries(names, st.tuples(st.sampled_from([int, float, np.float32, "f32", tuple[int, float]]),
                                          st.none() | st.integers(0, 2)), min_size=1, max_size=2)


def record(description: dict[str, Any]) -> Any:
    ordered = sorted(description.items(), key=lambda item: item[1][1] is not None)  # defaults last
    made = NamedTuple("Record", [(name, kind) for name, (kind, _) in ordered])  # type: ignore[misc]
    made.__new__.__defaults__ = tuple(default for _, (_, default) in ordered if default is not None)
    made._field_defaults = {name: default for name, (_, default) in ordered if default is not None}
    return made


@given(fields, fields)
def test_records_agree_exactly_when_their_fields_do(one: Any, other: Any) -> None:
    def described(description: Any) -> Any:
        return sorted(description.items(), key=lambda item: item[1][1] is not None)
    assert (key(record(one)) == key(record(other))) == (described(one) == described(other))


members = st.dictionaries(st.sampled_from(["ADD", "KEEP", "ZERO"]), st.integers(0, 3), min_size=1)


@given(members, members, st.sampled_from([enum.Enum, enum.IntEnum]))
def test_enums_agree_exactly_when_their_members_do(one: Any, other: Any, base: Any) -> None:
    first, second = base("Mode", one, module="m"), base("Mode", other, module="m")
    same = list(one.items()) == list(other.items())
    assert (key(first) == key(second)) == same
    # a member brings its class along: numba compiles comparisons with the others
    a, b = next(iter(first)), next(iter(second))
    assert (key(a) == key(b)) == same


def test_classes_of_one_name_in_two_modules_differ() -> None:
    def record(module: str, kind: Any = float) -> Any:
        return type("Light", (), {"__module__": module, "__annotations__": {"power": kind}})
    assert key(enum.IntEnum("Mode", {"ADD": 1}, module="one")) != key(enum.IntEnum("Mode", {"ADD": 1}, module="two"))
    assert key(record("one")) != key(record("two"))
    assert key(record("one")) == key(record("one"))
    # as an annotation, too
    assert key(record("m", record("one"))) != key(record("m", record("two")))


@pytest.mark.parametrize(("one", "other"), [
    (np.arange(3.0), np.array([0.0, 1.0, 3.0])),
    (np.arange(3), np.arange(3, dtype=np.int32)),
    (np.zeros((2, 3)), np.zeros((3, 2))),
    (np.zeros((2, 3)), np.zeros((2, 3), order="F")),
    (np.dtype("f4"), np.dtype("f8")),
    (numba.float32, numba.float64),
    (np.sin, np.cos),
    (np.float32, np.float64),
    (len, abs),
])
def test_what_libraries_and_arrays_hold_counts(one: Any, other: Any) -> None:
    assert key(one) != key(other)
    assert key(one) == key(one.copy(order="K") if isinstance(one, np.ndarray) else one)


def module(name: str, **content: Any) -> Any:
    made = types.ModuleType(name)
    vars(made).update(content)
    return made


def world() -> dict[str, Any]:
    """A small program: everything a shader can depend on, to be changed piece by piece."""
    names: dict[str, Any] = {
        "func": func, "K": 2.0, "TABLE": np.arange(4.0), "scale": 9.0,
        "own": module("own", LEVEL=3.0, unused=1.0, deep=module("deep", HEIGHT=4.0)), "__name__": "world"}
    exec("""
def factory(k):
    cell = [k]
    @func
    def add(x): return x + k
    def change(value):
        nonlocal k
        k = value
    return add, change
add, change = factory(5.0)
@func
def inner(x, y=1.0): return x * K + y
@func
def shader(x): return inner(x.scale) + add(x) + TABLE[1] + own.LEVEL + own.deep.HEIGHT
""", names)
    return names


def set_item(name: str, value: Any) -> Any:
    return lambda w: w.__setitem__(name, value)


CHANGES = {
    "a global of a callee": set_item("K", 2.5),
    "the type of a global": set_item("K", 2),
    "a callee": set_item("inner", func(lambda x, y=1.0: x)),
    "a closure cell": lambda w: w["change"](6.0),
    "a default": lambda w: setattr(w["inner"].py_func, "__defaults__", (2.0,)),
    "a module attribute": lambda w: setattr(w["own"], "LEVEL", 4.0),
    "an attribute of a module in a module": lambda w: setattr(w["own"].deep, "HEIGHT", 5.0),
    "a whole module": lambda w: w.__setitem__("own", module("own", LEVEL=4.0, deep=w["own"].deep)),
    "an array in place": lambda w: w["TABLE"].__setitem__(1, 7.0),
    "an array's shape": set_item("TABLE", np.arange(4.0).reshape(2, 2)),
    "a builtin that is shadowed": set_item("abs", func(lambda x: x)),
}
SAME = {
    "nothing": lambda w: None,
    "an unused attribute": lambda w: setattr(w["own"], "unused", 2.0),
    "a global that only shares an attribute's name": set_item("scale", object()),
    "a name nobody reads": set_item("stranger", object()),
}


@pytest.mark.parametrize("what", [*CHANGES, *SAME])
def test_a_change_is_seen_at_once_and_only_then(what: str) -> None:
    w = world()
    if "builtin" in what:
        exec("@func\ndef shader(x): return abs(x)", w)
    seen = fingerprint(template, {"SLOT": w["shader"]})
    assert unchanged(seen)
    {**CHANGES, **SAME}[what](w)
    again = fingerprint(template, {"SLOT": w["shader"]})
    assert (again.key == seen.key, unchanged(seen)) == ((what in SAME,) * 2)


def test_options_count() -> None:
    def plain(x):
        return x
    keys = [key(numba.njit(**options)(plain)) for options in
            ({}, {"fastmath": True}, {"fastmath": {"nnan", "ninf"}}, {"error_model": "numpy"}, {"boundscheck": True})]
    keys += [key(func(plain)), fingerprint(template, {"SLOT": 1}, {"nogil": True}).key, key(1)]
    assert len(set(keys)) == len(keys)


def test_numbas_settings_count(monkeypatch: pytest.MonkeyPatch) -> None:
    before = key(1)
    monkeypatch.setattr(numba.config, "BOUNDSCHECK", 1)
    assert key(1) != before


def test_circles_of_functions_end_and_are_told_from_plain_recursion() -> None:
    names: dict[str, Any] = {"func": func, "__name__": "circle"}
    exec("""
@func
def alone(n): return n if n < 1 else alone(n - 1)
@func
def even(n): return True if n == 0 else odd(n - 1)
@func
def odd(n): return False if n == 0 else even(n - 1)
@func
def twice(n): return alone(n) + alone(n + 1)
""", names)
    found = {name: fingerprint(names[name]) for name in ("alone", "even", "odd", "twice")}
    assert len({each.key for each in found.values()}) == 4
    assert [found[name].loops for name in ("alone", "even", "odd", "twice")] == [False, True, True, False]


class Odd:
    pass


def plain(x):
    return x


class Shouting(str):
    pass


def lookalike(x):
    return x


lookalike.__module__ = "math"


REFUSED = {
    "plain": plain, "lookalike": lookalike, "list": [1.0], "dict": {}, "set": {1}, "Odd": Odd(), "object": object(),
    "module m": module("m"), "Generator": np.random.default_rng(0), "DUFunc": numba.vectorize(plain),
    "explicit signatures": numba.njit("f8(f8)")(plain), "Shouting": Shouting("a"), "ndarray": np.array([object()]),
    "ufunc": np.frompyfunc(plain, 1, 1), "partial": functools.partial(plain), "memoryview": memoryview(b"1"),
    "method": "x".join,
}


@pytest.mark.parametrize("word", REFUSED)
@pytest.mark.parametrize("where", ["slot", "tuple", "global", "cell", "default", "module"])
def test_unknown_kinds_are_refused_by_name(word: str, where: str) -> None:
    culprit = REFUSED[word]
    names: dict[str, Any] = {"func": func, "CULPRIT": culprit, "own": module("own", culprit=culprit), "__name__": "w"}
    shader = {"cell": "def make(c):\n    @func\n    def shader(x): return c\n    return shader\nshader = make(CULPRIT)",
              "default": "@func\ndef shader(x, y=CULPRIT): return x",
              "module": "@func\ndef shader(x): return own.culprit"}
    exec(shader.get(where, "@func\ndef shader(x): return CULPRIT"), names)
    slot = {"slot": culprit, "tuple": (1, (culprit,))}.get(where, names["shader"])
    with pytest.raises(DependencyError) as caught:
        specialise(template, {"SLOT": slot})
    assert word in str(caught.value)
    assert {"slot": "slot SLOT", "tuple": "slot SLOT", "global": "CULPRIT in w.shader", "cell": "c in w.make",
            "default": "a default of w.shader", "module": "own.culprit"}[where] in str(caught.value)
    assert isinstance(caught.value, InputError)
    assert isinstance(caught.value, TypeError)
