"""How NamedTuples of scalars and short tuples travel: as columns of float32 and int32, and as plain nested tuples.

Varyings, attributes and outputs are NamedTuples whose fields are `f32`, `i32`, `vec2`…`vec4`, `ivec2`…`ivec4` or such
NamedTuples again. `Layout.of(cls)` lists their leaves and makes the small device functions that move a value between
its NamedTuple and its columns. Uniforms and textures hold arrays too: `plain` turns them into nested plain tuples
before a kernel is called and `rebuilder` makes the function that puts the NamedTuples together again inside, because a
class that lives in a user's script must not be part of a compiled signature (it would never hit the disk cache).
"""

from __future__ import annotations

import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.jit import func

f32 = np.float32
i32 = np.int32
vec2 = tuple[f32, f32]
vec3 = tuple[f32, f32, f32]
vec4 = tuple[f32, f32, f32, f32]
ivec2 = tuple[i32, i32]
ivec3 = tuple[i32, i32, i32]
ivec4 = tuple[i32, i32, i32, i32]


@dataclass(frozen=True)
class Field:
    """A named run of columns: `kind` "f" or "i", `first` column of that kind, `size` columns."""

    name: str
    kind: str
    first: int
    size: int


def _is_namedtuple(cls: Any) -> bool:
    return isinstance(cls, type) and issubclass(cls, tuple) and hasattr(cls, "_fields")


def _scalar_kinds(cls: type, name: str, annotation: Any) -> str:
    """Kinds of one field's scalars, as "fff" or "i"; refuses what has no columns."""
    if annotation is f32 or annotation is float:
        return "f"
    if annotation is i32 or annotation is int:
        return "i"
    parts = typing.get_args(annotation) if typing.get_origin(annotation) is tuple else ()
    kinds = "".join({f32: "f", i32: "i"}.get(part, "?") for part in parts)
    if not kinds or set(kinds) not in ({"f"}, {"i"}):
        raise InputError(
            f"field {name!r} of {cls.__name__} has type {annotation!r}; give f32, i32, a vec2…vec4 or ivec2…ivec4."
        )
    return kinds


class Layout:
    """Columns of a NamedTuple class. `floats` and `ints` are the numbers of float32 and int32 columns."""

    def __init__(self, cls: type) -> None:
        if not _is_namedtuple(cls):
            raise InputError(f"{cls!r} is not a NamedTuple class, so it has no columns.")
        self.cls = cls
        self.fields: list[Field] = []
        self.floats = self.ints = 0
        self._expression = self._walk(cls, "")

    @staticmethod
    @cache
    def of(cls: type) -> Layout:
        """The layout of `cls`, made once."""
        return Layout(cls)

    def _walk(self, cls: type, prefix: str) -> list[Any]:
        """Leaves in order, as a tree (cls, [(name, "fff", first) | subtree]); fills `fields`."""
        tree: list[Any] = [cls]
        for name, annotation in typing.get_type_hints(cls).items():
            if _is_namedtuple(annotation):
                tree.append((name, self._walk(annotation, f"{prefix}{name}.")))
                continue
            kinds = _scalar_kinds(cls, name, annotation)
            first = self.floats if kinds[0] == "f" else self.ints
            self.fields.append(Field(prefix + name, kinds[0], first, len(kinds)))
            if kinds[0] == "f":
                self.floats += len(kinds)
            else:
                self.ints += len(kinds)
            is_scalar = typing.get_origin(annotation) is not tuple
            tree.append((name, (kinds[0], first, len(kinds), is_scalar)))
        return tree

    def rebuilt(self, leaf: Callable[[str, int, str], str]) -> tuple[str, dict[str, type]]:
        """An expression that builds the NamedTuple from ``leaf(kind, column, path)`` a scalar, and its classes."""
        classes: dict[str, type] = {}

        def expression(tree: list[Any], path: str) -> str:
            name = f"C{len(classes)}"
            classes[name] = tree[0]
            parts = []
            for field, node in tree[1:]:
                if isinstance(node, list):
                    parts.append(expression(node, f"{path}.{field}"))
                    continue
                kind, first, size, is_scalar = node
                paths = [f"{path}.{field}" + ("" if is_scalar else f"[{j}]") for j in range(size)]
                cells = [leaf(kind, first + j, paths[j]) for j in range(size)]
                parts.append(cells[0] if is_scalar else f"({', '.join(cells)},)")
            return f"{name}({', '.join(parts)})"

        return expression(self._expression, ""), classes

    def leaves(self, root: str) -> list[tuple[str, str, int]]:
        """(path of the scalar from `root`, kind, column) of every leaf."""
        found: list[tuple[str, str, int]] = []

        def note(kind: str, column: int, path: str) -> str:
            found.append((root + path, kind, column))
            return ""

        self.rebuilt(note)
        return found

    def _getter(self, cell: str) -> Any:
        source, classes = self.rebuilt(lambda kind, column, _: cell.format(a="F" if kind == "f" else "I", k=column))
        return device_function(f"def get(F, I, i):\n    return {source}\n", "get", classes)

    def _putter(self, cell: str) -> Any:
        lines = []
        for path, kind, column in self.leaves("value"):
            target = cell.format(a="F" if kind == "f" else "I", k=column)
            if path.endswith("]"):  # a vector is taken apart as a whole, so that one of another length does not compile
                vector, _, j = path[:-1].rpartition("[")
                if j == "0":
                    size = sum(other.startswith(f"{vector}[") for other, _, _ in self.leaves("value"))
                    lines.append(f"    {''.join(f'p{n}, ' for n in range(size))}= {vector}")
                path = f"p{j}"
            lines.append(f"    {target} = {path}")
        return device_function("def put(F, I, i, value):\n" + "\n".join(lines or ["    pass"]) + "\n", "put", {})

    @cached_property
    def get(self) -> Any:
        """``get(F[k, n], I[k, n], i)``: the value in column i (structure of arrays)."""
        return self._getter("{a}[{k}, i]")

    @cached_property
    def put(self) -> Any:
        """``put(F[k, n], I[k, n], i, value)``: stores a value in column i."""
        return self._putter("{a}[{k}, i]")

    @cached_property
    def get_row(self) -> Any:
        """``get_row(F[n, k], I[n, k], i)``: the value in row i (array of structures)."""
        return self._getter("{a}[i, {k}]")

    @cached_property
    def put_row(self) -> Any:
        """``put_row(F[n, k], I[n, k], i, value)``: stores a value in row i."""
        return self._putter("{a}[i, {k}]")


def device_function(source: str, name: str, names: dict[str, Any]) -> Any:
    """Device function `name` of a one-line generated source, with `names` as its globals."""
    scope: dict[str, Any] = dict(names)
    exec(source, scope)  # glue only: the text is made above from field names and column numbers
    return func(scope[name])


def plain(value: Any) -> Any:
    """`value` as nested plain tuples of arrays and sized scalars; what a kernel takes."""
    if value is None:
        return ()
    if isinstance(value, tuple):
        return tuple(plain(part) for part in value)
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, np.generic | np.ndarray):
        return value
    if isinstance(value, float):
        return np.float32(value)
    if isinstance(value, int):
        if not -(2**31) <= value < 2**31:
            raise InputError(f"a uniform is {value}, which int32 does not hold.")
        return np.int32(value)
    raise InputError(f"a uniform of type {type(value).__name__} cannot be passed; give scalars, tuples and arrays.")


def shape_of(value: Any) -> Any:
    """The nesting of NamedTuple classes in `value`: hashable, and all that `rebuilder` needs."""
    if isinstance(value, tuple):
        return (type(value) if _is_namedtuple(type(value)) else None, tuple(shape_of(part) for part in value))
    return None


@cache
def rebuilder(shape: Any) -> Any:
    """Device function that turns ``plain(value)`` back into `value`'s NamedTuples, for ``shape_of(value) == shape``."""
    classes: dict[str, Any] = {}

    def expression(node: Any, path: str) -> str:
        if node is None:
            return path
        cls, parts = node
        inner = ", ".join(expression(part, f"{path}[{k}]") for k, part in enumerate(parts))
        if cls is None:
            return f"({inner},)" if parts else "()"
        name = f"C{len(classes)}"
        classes[name] = cls
        return f"{name}({inner})"

    return device_function(f"def rebuild(value):\n    return {expression(shape, 'value')}\n", "rebuild", classes)
