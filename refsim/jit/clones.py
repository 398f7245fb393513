"""Making the clones: a template and all it calls, frozen as it was fingerprinted, under names that hold the hash.

Freezing matters as much as hashing. numba reads globals when it compiles, which is at the first call, and a device
function once compiled keeps the constants of that day; and the machine code of a device function has a symbol name
counted per process, so that two kernels loaded from the cache may each bring another function under one name, and the
linker silently takes the first. So every device function is copied too: under its own hash, with globals, cells,
defaults and arrays of the moment. What was hashed is then what is compiled, whenever that happens.
"""

import builtins
import enum
import functools
import threading
import types
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.jit import disk
from refsim.jit.fingerprint import (
    MISSING,
    Fingerprint,
    configuration,
    fingerprint,
    follow,
    is_device,
    is_trusted,
    unchanged,
)
from refsim.jit.names import Chains, names_of
from refsim.jit.options import jit, options_of, stage_options

# a module that always can be imported: numba imports it when it loads a clone, and must not run a user's script twice
_HOME = "refsim.jit"
_REMEMBERED = 4096

_lock = threading.RLock()
_kernels: dict[str, Any] = {}  # fingerprint -> dispatcher
_devices: dict[str, Any] = {}  # fingerprint -> frozen copy
_copies: dict[int, Any] = {}  # id of a device function -> its frozen copy, while one kernel is put together
_classes: dict[str, type] = {}
_calls: dict[Any, tuple[Any, Fingerprint, Any]] = {}  # arguments -> dispatcher, what it rests on, references


def specialise(template: Callable[..., Any], slots: Mapping[str, Any], **options: Any) -> Any:
    """The kernel that `template` becomes when its free globals are `slots`, compiled on first call and cached on disk.

    Args:
        template: plain Python function in a file, undecorated: the loop, whose free globals are shaders and constants.
        slots: name → device function (``@func``), number, enum member, tuple or NamedTuple of these, array, or class.
        options: numba options over those of a stage, e.g. ``boundscheck=True``; never ``fastmath``.

    Returns:
        A numba dispatcher; the same one as long as nothing it depends on has changed. It must be called with (nested)
        tuples of arrays and scalars: an argument of a user's own class would be of another type in every process.

    Raises:
        InputError: `template` is not a plain function, or an option is not the caller's to set.
        DependencyError: something is reached whose content cannot be hashed.
    """
    if not isinstance(template, types.FunctionType) or is_device(template):
        raise InputError(f"specialise takes an undecorated Python function as template, not {template!r}")
    chosen = stage_options(options)
    call = (id(template), *((name, _token(value)) for name, value in slots.items()), repr(options), configuration())
    with _lock:
        known = _calls.get(call)
        if known is not None and unchanged(known[1]):
            return known[0]
        found = fingerprint(template, slots, chosen)
        kernel = _kernels.get(found.key)
        if kernel is None:
            kernel = _kernels[found.key] = _kernel(template, slots, chosen, found)
        if len(_calls) >= _REMEMBERED:
            _calls.clear()
        # the references keep the ids in `call` from being given to other objects
        _calls[call] = kernel, found, (template, dict(slots))
        return kernel


def _kernel(template: types.FunctionType, slots: Mapping[str, Any], options: dict[str, Any], found: Fingerprint) -> Any:
    _copies.clear()
    clone = _clone(template, f"{template.__name__}{disk.MARK}{found.key}")
    kernel = jit(clone, options)
    _fill(clone, template, slots)
    # numba crashes when it loads functions that call each other in a circle: those compile in every process
    if kernel is not clone and not found.loops:
        disk.attach(kernel)
    return kernel


def _device(device: Any) -> Any:
    """The frozen copy of a device function; one per content, so that kernels share its compiled forms."""
    if id(device) in _copies:
        return _copies[id(device)]
    key, original = fingerprint(device).key, device.py_func
    known = key in _devices
    if not known:
        clone = _clone(original, f"{original.__name__}{disk.MARK}{key}")
        _devices[key] = jit(clone, options_of(device))
    _copies[id(device)] = _devices[key]  # before it is filled: it may call itself
    if not known:
        _fill(clone, original, {})
    return _devices[key]


def _clone(original: types.FunctionType, name: str) -> types.FunctionType:
    cells = tuple(types.CellType() for _ in original.__closure__ or ())
    table = {"__name__": _HOME, "__builtins__": builtins}
    # defaults are given at once since numba reads the signature when it decorates
    clone = types.FunctionType(original.__code__, table, name, _frozen(original.__defaults__), cells)
    if original.__kwdefaults__:
        clone.__kwdefaults__ = {name: _frozen(value) for name, value in original.__kwdefaults__.items()}
    clone.__qualname__, clone.__module__, clone.__doc__ = name, _HOME, original.__doc__
    return clone


def _fill(clone: types.FunctionType, original: types.FunctionType, slots: Mapping[str, Any]) -> None:
    names = names_of(original.__code__)
    for name, chains in names.globals.items():
        if name in slots:
            clone.__globals__[name] = _frozen(slots[name])
        elif name in original.__globals__:
            clone.__globals__[name] = _frozen(original.__globals__[name], chains)
    cells = zip(original.__code__.co_freevars, clone.__closure__ or (), original.__closure__ or (), strict=True)
    for name, cell, source in cells:
        try:
            cell.cell_contents = _frozen(source.cell_contents, names.free.get(name, ()))
        except ValueError:  # an empty cell stays one
            continue


def _frozen(value: Any, chains: Chains = ()) -> Any:
    """`value` as it is now, out of reach of later changes; of a module the attributes named by `chains`."""
    if is_trusted(value):
        return value
    if is_device(value):
        return _device(value)
    if isinstance(value, types.ModuleType):
        return _frozen_module(value, chains)
    if isinstance(value, type):
        return _frozen_class(value)
    if isinstance(value, enum.Enum):
        return _frozen_class(type(value))[value.name] if value.name in type(value).__members__ else value
    if isinstance(value, tuple):
        items = [_frozen(item) for item in value]
        return tuple(items) if type(value) is tuple else _frozen_class(type(value))._make(items)
    if isinstance(value, np.ndarray):
        copy = value.copy(order="K")
        copy.flags.writeable = value.flags.writeable
        return copy
    return value


def _frozen_module(module: types.ModuleType, chains: Chains) -> types.ModuleType:
    frozen = types.ModuleType(module.__name__)
    for chain in chains:
        value, used = follow(module, chain)
        if value is MISSING or not used:
            continue
        holder = frozen
        for name in used[:-1]:
            holder = vars(holder).setdefault(name, types.ModuleType(name))
        setattr(holder, used[-1], _frozen(value))
    return frozen


def _frozen_class(cls: Any) -> Any:
    # a notebook cell run twice makes a second class of the same content: one kernel must not mix the two
    if issubclass(cls, enum.Enum | tuple):
        return _classes.setdefault(fingerprint(cls).key, cls)
    return cls


@functools.singledispatch
def _token(value: Any) -> Any:
    """What tells `value` from another in a call: content where that is quick, else identity."""
    return id(value)


@_token.register(int | float | complex | str | bytes | types.NoneType)
def _(value: Any) -> Any:
    return id(value) if isinstance(value, enum.Enum) else (type(value), repr(value))


@_token.register
def _(value: np.generic) -> Any:
    return type(value), value.tobytes()


@_token.register
def _(value: tuple) -> Any:
    return type(value), *map(_token, value)
