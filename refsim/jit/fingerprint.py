"""What a device function depends on, as one hash: two of equal fingerprint compile to the same machine code.

A compiled kernel freezes everything it can reach: byte code and constants, defaults, closure cells, the globals it
names, the device functions it calls and theirs, the options they are compiled with. :func:`fingerprint` walks all of
that, and nothing is hashed by the name of its type alone: what the walk does not know is refused with a
:class:`DependencyError`, since guessing would let a stale kernel be loaded from disk.

Known kinds
    - device functions (``@refsim.func``, ``numba.njit`` without explicit signatures): code, options, and all below;
    - scalars, strings, None, tuples and NamedTuples of known kinds, NumPy scalars, arrays and dtypes, by content;
    - enum classes and members: every member's name and value;
    - classes: module, name, bases, annotations (nested classes included), plain class attributes; of a NamedTuple the
      fields and defaults. Methods are left out: compiled code cannot call them;
    - modules, where the byte code says ``module.attribute``: the attributes used, followed to their values;
    - whatever numpy, numba, math, cmath, operator and builtins define, and `borrowed`: by name, versions being hashed.

Since a walk costs about a millisecond, it also notes every place it looked at. While none of them holds another object
the fingerprint still stands, and :func:`unchanged` says so at little cost. Classes are taken to be immutable
once made; names, cells, defaults and arrays are not.
"""

import dataclasses
import enum
import hashlib
import sys
import types
import typing
from collections.abc import Mapping
from typing import Any, NamedTuple

import llvmlite
import numba
import numpy as np
from numba.core.registry import CPUDispatcher

from refsim.errors import InputError
from refsim.jit.borrowed import borrowed
from refsim.jit.names import SCALARS, Chains, names_of, spell
from refsim.jit.options import options_of, spell_options

TRUSTED = frozenset({"builtins", "cmath", "llvmlite", "math", "numba", "numpy", "operator"})
CONFIGURATION = ("OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "ENABLE_AVX",
                 "DISABLE_INTEL_SVML", "USING_SVML", "NRT_STATS", "ENABLE_PROFILING", "DISABLE_JIT")
MISSING = object()

# the CPU's name and features are in numba's own index key
_VERSIONS = (sys.implementation.cache_tag or "", sys.version, numba.__version__, llvmlite.__version__, np.__version__)


class DependencyError(InputError, TypeError):
    """A device function reaches an object whose content cannot be hashed, so its compiled form could go stale."""


class Fingerprint(NamedTuple):
    """``places``: (read, holder, name, value found); ``arrays``: (array, digest of its content)."""

    key: str  # 20 hex digits
    loops: bool  # device functions call each other in a circle of two or more
    places: list[tuple[Any, Any, Any, Any]]
    arrays: list[tuple[np.ndarray, bytes]]


def fingerprint(
    root: Any, slots: Mapping[str, Any] | None = None, options: Mapping[str, Any] | None = None
) -> Fingerprint:
    """Hash `root` (a plain function serving as template, a device function or a class) with everything it reaches.

    `slots` stand in for globals of `root` and are hashed whether it uses them or not; `options` are numba's.
    Raises :class:`DependencyError` naming the function and the object that cannot be hashed.
    """
    walk = _Walk()
    walk.put("refsim 1", *_VERSIONS, *map(str, configuration()))
    walk.options(options or {})
    for name in sorted(slots or {}):
        walk.put("slot", name)
        walk.value((slots or {})[name], f"slot {name}")
    if isinstance(root, types.FunctionType) and not is_device(root):
        walk.function(root, slots or {})
    else:
        walk.value(root, "the root")
    return Fingerprint(walk.key(), walk.loops, walk.places, walk.arrays)


def unchanged(seen: Fingerprint) -> bool:
    """Whether every place `seen` depends on still holds what it held then."""
    for read, holder, name, value in seen.places:
        if read(holder, name) is not value:
            return False
    return all(_content(array) == digest for array, digest in seen.arrays)


def configuration() -> tuple[Any, ...]:
    """numba's settings of the moment, as far as they change machine code."""
    return tuple([getattr(numba.config, name, None) for name in CONFIGURATION])


def is_device(value: Any) -> bool:
    """Whether `value` is a jitted function (or the plain one that numba leaves under NUMBA_DISABLE_JIT)."""
    return isinstance(value, CPUDispatcher) or (
        isinstance(value, types.FunctionType) and getattr(value, "py_func", None) is value)


def is_trusted(value: Any) -> bool:
    """Whether `value` is what a trusted library calls by that name: then the name and the version say it all."""
    if isinstance(value, types.ModuleType):
        return value.__name__.partition(".")[0] in TRUSTED
    if isinstance(value, np.ufunc):
        return getattr(np, value.__name__, None) is value
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not isinstance(module, str) or not isinstance(name, str) or module.partition(".")[0] not in TRUSTED:
        return False
    return getattr(sys.modules.get(module), name, None) is value


def follow(module: Any, chain: tuple[str, ...]) -> tuple[Any, tuple[str, ...]]:
    """Read `chain` from `module` while it leads through modules of one's own: the value, and the attributes used."""
    value, used = module, 0
    while isinstance(value, types.ModuleType) and not is_trusted(value) and used < len(chain):
        value, used = getattr(value, chain[used], MISSING), used + 1
    return value, chain[:used]


class _Walk:
    """Depth first over the object graph; an object met again is its ordinal, so that recursion ends."""

    def __init__(self) -> None:
        self.words: list[str] = []
        self.seen: dict[int, int] = {}
        self.kept: list[Any] = []  # keeps temporaries alive, or their ids could be met again
        self.inside: list[int] = []  # ids of the device functions being walked, outermost first
        self.loops = False
        self.places: list[tuple[Any, Any, Any, Any]] = []
        self.arrays: list[tuple[np.ndarray, bytes]] = []

    def put(self, *words: str) -> None:
        self.words += words

    def key(self) -> str:
        # with their lengths, words run together in one way only
        text = "".join([f"{len(word)}:{word}" for word in self.words])
        return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:20]

    def watch(self, read: Any, holder: Any, name: Any) -> Any:
        value = read(holder, name)
        self.places.append((read, holder, name, value))
        return value

    def options(self, options: Mapping[str, Any]) -> None:
        self.put("options", *spell_options(options))

    def function(self, function: types.FunctionType, slots: Mapping[str, Any]) -> None:
        where = f"{function.__module__}.{function.__qualname__}"
        code = self.watch(getattr, function, "__code__")
        names = names_of(code)
        self.put("function", function.__name__, names.digest)
        self.value(self.watch(getattr, function, "__defaults__"), f"a default of {where}")
        keywords = self.watch(getattr, function, "__kwdefaults__") or {}
        for name in sorted(keywords):
            self.put(name)
            self.value(self.watch(_entry, keywords, name), f"default {name} of {where}")
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            self.put("cell", name)
            self.chains(self.watch(_cell, cell, None), names.free.get(name, ()), f"{name} in {where}")
        for name, chains in names.globals.items():
            if name in slots:
                continue
            self.put("global", name)
            value = self.watch(_entry, function.__globals__, name)
            if value is not MISSING:  # else a builtin, or undefined: numba then says so better than we can
                self.chains(value, chains, f"{name} in {where}")

    def chains(self, value: Any, chains: Chains, where: str) -> None:
        if not isinstance(value, types.ModuleType) or is_trusted(value):
            return self.value(value, where)
        for chain in chains:
            self.put("module", value.__name__, *chain)
            end, used = follow(value, chain)
            holder = value
            for name in used:
                holder = self.watch(_attribute, holder, name)
            self.value(end, f"{'.'.join((value.__name__, *used))} ({where})")

    def value(self, x: Any, where: str) -> None:
        kind = type(x)
        if kind in SCALARS:
            return self.put(spell(x))
        if x is MISSING or x is borrowed:
            return self.put("missing" if x is MISSING else "borrowed")
        if is_trusted(x):
            return self.put("trusted", kind.__name__, getattr(x, "__module__", None) or "", x.__name__)
        if isinstance(x, type) or is_device(x):
            # only these may recur; whether two equal tuples are one object differs from process to process
            if id(x) in self.seen:
                self.loops |= id(x) in self.inside[:-1]
                return self.put(f"again {self.seen[id(x)]}")
            self.seen[id(x)] = len(self.seen)
            self.kept.append(x)
        self.content(x, kind, where)

    def content(self, x: Any, kind: type, where: str) -> None:
        if is_device(x):
            if not getattr(x, "_can_compile", True):
                raise DependencyError(f"{where} has explicit signatures, which a copy would lose; use @refsim.func")
            self.put("device")
            self.options(options_of(x))
            self.inside.append(id(x))
            self.function(x.py_func, {})
            self.inside.pop()
        elif isinstance(x, enum.Enum):
            self.put("member", str(x.name))
            self.value(x.value, where)
            self.value(kind, where)
        elif isinstance(x, type):
            self.klass(x, where)
        elif isinstance(x, tuple) and (kind is tuple or hasattr(kind, "_fields")):
            self.value(kind, where)
            self.put(f"tuple {len(x)}")
            for item in x:
                self.value(item, where)
        elif isinstance(x, np.generic) and x.dtype.hasobject is False:
            self.put("scalar", repr(x.dtype), x.tobytes().hex())
        elif kind is np.ndarray and not x.dtype.hasobject:
            self.arrays.append((x, _content(x)))
            self.put("array", self.arrays[-1][1].hex())
        elif isinstance(x, np.dtype | numba.types.Type) and " at 0x" not in repr(x):
            self.put(kind.__name__, repr(x))
        elif dataclasses.is_dataclass(x) and not isinstance(x, type):
            self.value(kind, where)
            self.value(tuple(getattr(x, field.name) for field in dataclasses.fields(x)), where)
        elif isinstance(x, types.FunctionType):
            raise DependencyError(f"{where} is the plain Python function {x.__qualname__}; decorate it @refsim.func")
        elif isinstance(x, types.ModuleType):
            raise DependencyError(f"{where} is the module {x.__name__} itself; name the attribute where it is used")
        else:
            raise DependencyError(f"{where} is a {kind.__module__}.{kind.__qualname__}, which a kernel cannot be "
                                  "checked against; use a number, tuple, NamedTuple, enum, array or @refsim.func")

    def klass(self, x: type, where: str) -> None:
        self.put("class", x.__module__, x.__qualname__)
        if hasattr(x, "class_type"):
            raise DependencyError(f"{where} is the jitclass {x.__qualname__}; use a NamedTuple and @refsim.func")
        for base in x.__bases__:
            self.value(base, where)
        if issubclass(x, enum.Enum):
            for name, member in x.__members__.items():
                self.put(name)
                self.value(member.value, f"{name} of {where}")
            return
        for name, annotation in _annotations(x).items():
            self.put("field", name)
            self.annotation(annotation, f"the annotation of {name} in {where}")
        if issubclass(x, tuple):
            self.put("fields", *getattr(x, "_fields", ()))
            for name, default in getattr(x, "_field_defaults", {}).items():
                self.put("default", name)
                self.value(default, f"the default of {name} in {where}")
            return
        for name, item in sorted(vars(x).items()):
            if not name.startswith("_") and not callable(item) and not hasattr(item, "__get__"):
                self.put("attribute", name)
                self.value(item, f"{name} of {where}")

    def annotation(self, x: Any, where: str) -> None:
        origin = typing.get_origin(x)
        if origin is not None:  # tuple[f32, f32], Annotated[...], Literal[...]
            self.put("generic", repr(origin))
            for part in (*typing.get_args(x), *getattr(x, "__metadata__", ())):
                self.annotation(part, where)
        elif type(x).__module__ == "typing":
            self.put("typing", repr(x))
        else:
            self.value(x, where)


def _entry(table: dict[str, Any], name: str) -> Any:
    return table.get(name, MISSING)


def _attribute(module: Any, name: str) -> Any:
    return getattr(module, name, MISSING)


def _cell(cell: types.CellType, _: None) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not assigned yet
        return MISSING


def _content(array: np.ndarray) -> bytes:
    # numba types a global by its memory layout as well
    layout = (array.dtype.descr, array.shape, array.flags.c_contiguous, array.flags.f_contiguous, array.flags.aligned)
    return hashlib.sha256(repr(layout).encode() + np.ascontiguousarray(array).tobytes()).digest()


def _annotations(x: type) -> dict[str, Any]:
    try:
        return typing.get_type_hints(x, include_extras=True)
    except Exception:  # a name that cannot be resolved from here: what is written must do
        return dict(getattr(x, "__annotations__", {}))
