"""Compiled kernels from stage templates and user shaders, with a disk cache that hits and is never stale.

    from refsim.jit import func, specialise

    @func                                     # a device function: shader, or a piece of one
    def shade(x): return x * GAIN

    def stage(columns):                       # a template: plain Python, in a file, with a free global `shader`
        for i in range(columns.size):
            columns[i] = shader(columns[i])

    kernel = specialise(stage, {"shader": shade})
    kernel(columns)

**What.** A kernel is a copy of its template whose globals hold the slots, under a name with a hash of everything it
depends on, compiled with numba's disk cache. A later process makes the same name and finds the machine code; whatever
changes, changes the name.

**Why not** a shader as closure or argument: it runs as fast, but numba's cache never hits (a dispatcher's identity is
part of its key) and leaks a file a run. Function pointers hit, and run 13 times slower. ``njit(cache=True)`` on a
kernel that imports its shader goes silently stale: numba's key sees the kernel's own file alone.

**What is in the hash** (:mod:`~refsim.jit.fingerprint` has it in full): byte code, constants and names, with nested
code; defaults, keyword defaults, closure cells; the globals named, and of modules the attributes used; device functions
reached, recursively, with their numba options; every member of an enum; fields, annotations and defaults of a
NamedTuple; content of arrays; options of the kernel; versions of Python, NumPy, numba, llvmlite and numba's settings.
The CPU and the argument types are in numba's own index. An object of another kind is refused
(:class:`DependencyError`).

**What the name is for.** The copy is deep: device functions are copied under hashes of their own, with the globals,
cells and arrays of the moment (:mod:`~refsim.jit.clones` says why). So a constant changed between two calls in one
process makes another kernel, and the earlier one stays what it was.

Kernels must be called with (nested) tuples of arrays and scalars: an argument of a class that a user defined in
``__main__`` is another type in every process. Nobody else decorates with numba: the options live in
:mod:`~refsim.jit.options`. Clones unused for a month are removed (:mod:`~refsim.jit.disk`).
"""

from refsim.jit.borrowed import borrowed
from refsim.jit.clones import specialise
from refsim.jit.fingerprint import DependencyError
from refsim.jit.options import func

__all__ = ["DependencyError", "borrowed", "func", "specialise"]
