"""The one home of numba options: how device functions and stage kernels are compiled.

Strict float32 everywhere: no ``fastmath``, which would change hits and counters with the compiler's mood.
"""

import types
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numba
from numba.core.compiler import Compiler
from numba.core.errors import NumbaExperimentalFeatureWarning, NumbaPerformanceWarning
from numba.core.registry import CPUDispatcher

from refsim.errors import InputError
from refsim.jit.names import SCALARS, spell
from refsim.jit.turns import ended_on_error


class StrictCompiler(Compiler):  # type: ignore[misc]
    """numba's compiler, for which code that would run an order of magnitude slower than it looks is an error.

    A performance warning means a hidden copy or a loop that did not parallelise; an experimental one that a function is
    handled as a value, which may make it a pointer (13 times slower). Object mode numba refuses by itself.
    """

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        with ended_on_error(), warnings.catch_warnings():
            warnings.simplefilter("error", NumbaPerformanceWarning)
            warnings.simplefilter("error", NumbaExperimentalFeatureWarning)
            try:
                return super().compile_extra(func)
            except NumbaExperimentalFeatureWarning as warning:
                raise InputError(f"{func.__code__.co_name} has a function in a tuple or chooses one while running; "
                                 "call each by a name of its own") from warning
            except NumbaPerformanceWarning as warning:
                raise InputError(f"{func.__code__.co_name} would run slowly: {warning}") from warning


# forceinline: the body must be inside the stage's loop or LLVM does not vectorise it; error_model: a division must not
# branch to raise; no wrappers: only kernels call device functions, and the wrappers are a quarter of a cold compile
FUNC: dict[str, Any] = {"error_model": "numpy", "forceinline": True, "no_cpython_wrapper": True,
                        "no_cfunc_wrapper": True, "pipeline_class": StrictCompiler}
# nogil: the thread pool runs one kernel per tile. The disk cache is attached by `specialise`.
STAGE: dict[str, Any] = {"error_model": "numpy", "nogil": True, "pipeline_class": StrictCompiler}


def func(function: Callable[..., Any]) -> Any:
    """Mark `function` as a device function: a shader, or a piece of one, compiled into the kernels that call it.

    It is no Python callable afterwards; ``.py_func`` is the function as written (for reading: plain Python promotes
    types differently, so it is no oracle). Raises :class:`~refsim.errors.InputError` for anything but a function.
    """
    if not isinstance(function, types.FunctionType) or hasattr(function, "py_func"):
        raise InputError(f"@func decorates a plain Python function, not {function!r}")
    return jit(function, FUNC)


def stage_options(options: dict[str, Any]) -> dict[str, Any]:
    """The stage's options with a caller's `options` over them; refuses those that are not the caller's to set."""
    for name in ("fastmath", "cache", "forceobj"):
        if options.get(name):
            raise InputError(f"specialise takes no numba option {name}: kernels are strict and cache themselves")
    return {**STAGE, **options}


def jit(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """``numba.jit``; under NUMBA_DISABLE_JIT the function itself, which then is its own ``py_func``."""
    compiled = numba.jit(**options)(function)
    if compiled is function:
        compiled.py_func = function  # type: ignore[attr-defined]
    return compiled


def options_of(device: Any) -> dict[str, Any]:
    """The options that a device function was made with, whoever made it, as keywords for ``numba.jit``."""
    if not isinstance(device, CPUDispatcher):
        return {}
    compiler: Any = device._compiler
    options = {**device.targetoptions, "pipeline_class": compiler.pipeline_class}
    return {**options, "locals": device.locals} if device.locals else options


def spell_options(options: Mapping[str, Any]) -> list[str]:
    """Options as text that is the same in every process."""
    return [f"{name}={_spell_option(name, value)}" for name, value in sorted(options.items())]


def _spell_option(name: str, value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ",".join(spell_options(value)) + "}"
    if isinstance(value, set | frozenset):
        return "{" + ",".join(sorted(map(repr, value))) + "}"
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__}"
    if type(value) in SCALARS or isinstance(value, numba.types.Type):
        return spell(value)
    raise InputError(f"numba option {name}={value!r} cannot be hashed; use a number, string, set or dict")
