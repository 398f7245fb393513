"""Compile this room's kernels so that a cached binary can never be stale.

Numba's disk cache looks at the file of the kernel alone; a change in a device function of a sibling file goes unseen.
Every kernel is therefore jitted under a name that carries a hash of all sources of this room.
"""

from __future__ import annotations

import hashlib
import types
from pathlib import Path
from typing import Any

from numba import njit


def _stamp() -> str:
    """Return 16 hex digits of a hash over the sources of this room, in name order."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


_STAMP = _stamp()


def device(function: Any) -> Any:
    """Mark a function that only kernels call: float64, no fused operations, inlined."""
    return njit(error_model="numpy", forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


def routine(function: Any) -> Any:
    """Mark a function that kernels call and that is too large to be inlined in several places."""
    return njit(error_model="numpy", nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


def kernel(function: Any) -> Any:
    """Compile a kernel: cached on disk, without the interpreter lock, strict float64."""
    name = f"{function.__name__}_{_STAMP}"
    clone = types.FunctionType(function.__code__, function.__globals__, name, function.__defaults__)
    clone.__qualname__ = name
    clone.__module__ = function.__module__
    clone.__doc__ = function.__doc__
    return njit(cache=True, nogil=True, error_model="numpy")(clone)
