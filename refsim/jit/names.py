"""Which outside names a code object reads, and which attributes it takes from them.

Byte code says more than ``co_names``: ``state.CompareFunction.LESS`` loads the global ``state`` and takes
``CompareFunction`` from it, so of a module only what is used counts, and a global that merely shares its name with an
attribute does not.
"""

import dis
import functools
import hashlib
import types
from collections.abc import Iterator
from typing import Any, NamedTuple

SCALARS = frozenset({bool, int, float, complex, str, bytes, type(None), type(...)})
Chains = tuple[tuple[str, ...], ...]


class Names(NamedTuple):
    """Digest of a code object and what it looks up outside: name → attribute chains (``()`` is the bare value)."""

    digest: str
    globals: dict[str, Chains]
    free: dict[str, Chains]


@functools.lru_cache(maxsize=8192)
def names_of(code: types.CodeType) -> Names:
    """Digest and outside names of `code`, nested code objects included; line numbers and file do not count."""
    found: dict[str, dict[str, set[tuple[str, ...]]]] = {"global": {}, "free": {}}
    for kind, name, chain in _reads(code):
        found[kind].setdefault(name, set()).add(chain)
    constants = []
    for constant in code.co_consts:
        if not isinstance(constant, types.CodeType):
            constants.append(spell(constant))
            continue
        inner = names_of(constant)
        constants.append(inner.digest)
        for name, chains in inner.globals.items():
            found["global"].setdefault(name, set()).update(chains)
        for name, chains in inner.free.items():
            if name in code.co_freevars:  # else a local of `code` itself
                found["free"].setdefault(name, set()).update(chains)
    text = (code.co_code, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars, code.co_flags,
            code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_exceptiontable, constants)
    digest = hashlib.sha256(repr(text).encode("utf-8", "surrogatepass")).hexdigest()
    return Names(digest, _ordered(found["global"]), _ordered(found["free"]))


def spell(constant: Any) -> str:
    """A constant of known kind as text; the order within a frozenset, which differs by process, does not matter."""
    if isinstance(constant, tuple):
        return f"({','.join(map(spell, constant))})"
    if isinstance(constant, frozenset):
        return f"{{{','.join(sorted(map(spell, constant)))}}}"
    return repr(constant)


def _ordered(found: dict[str, set[tuple[str, ...]]]) -> dict[str, Chains]:
    return {name: tuple(sorted(chains)) for name, chains in sorted(found.items())}


def _reads(code: types.CodeType) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    steps = [step for step in dis.get_instructions(code) if step.opname not in ("EXTENDED_ARG", "CACHE", "PUSH_NULL")]
    for at, step in enumerate(steps):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            kind = "global"
        elif step.opname in ("LOAD_DEREF", "LOAD_CLASSDEREF") and step.argval in code.co_freevars:
            kind = "free"
        else:
            continue
        chain = []
        for later in steps[at + 1:]:
            if later.opname not in ("LOAD_ATTR", "LOAD_METHOD"):
                break
            chain.append(later.argval)
        yield kind, step.argval, tuple(chain)
