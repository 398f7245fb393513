"""What device functions cost: operations by kind, and those of an expression (`source_walk` follows the statements).

    one operation each    + − × ÷ mod, √, min, max, abs, copysign, rint, comparisons, logic and bits, and a
                          select (``a if c else b``) of each component
    free                  constants and arithmetic between them, conversions, moves, negation, `not`
    one fetch each        a texel read from what lies under "t" (textures): components of one texel, read in one body of
                          a function, are one fetch. Uniforms and attributes are in registers
    instrumentation       what only counts (`cells`, `tests`, …) and what is stored is free

A select evaluates both its sides, and `and` all its operands, as lanes of a warp do.
"""

from __future__ import annotations

import ast
import math
import operator
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

U = np.uintp
FETCH = "fetch"
INSTRUMENTS = {"cells", "tests", "searched", "rejected"}
BINARY: dict[type, tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("add", operator.add),
    ast.Sub: ("add", operator.sub),
    ast.Mult: ("multiply", operator.mul),
    ast.Div: ("divide", operator.truediv),
    ast.FloorDiv: ("divide", operator.floordiv),
    ast.Mod: ("divide", operator.mod),
    ast.BitAnd: ("logic", operator.and_),
    ast.BitOr: ("logic", operator.or_),
    ast.BitXor: ("logic", operator.xor),
    ast.LShift: ("logic", operator.lshift),
    ast.RShift: ("logic", operator.rshift),
}
COMPARE: dict[type, Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
BUILT_IN: dict[Any, str] = {
    math.sqrt: "root",
    math.floor: "select",
    np.rint: "select",
    math.copysign: "select",
    abs: "select",
    min: "select",
    max: "select",
}


class Uncountable(Exception):
    """A source that cannot be read, or that says something which is not understood here."""


@dataclass(frozen=True)
class Unknown:
    """A value that is not known, and where it comes from."""

    path: str = "?"


@dataclass
class Cost:
    """Operations by kind; `loops`: unknown loops, the cost of an iteration each; `exits`: all up to each early return.

    `tests` and `cells`: ray–triangle tests made and places where `cells` is counted up, those of loops apart.
    `walking`: the part of `counts` that lies in a branch around a loop that counts cells.
    """

    counts: Counter[str] = field(default_factory=Counter)
    loops: list[Cost] = field(default_factory=list)
    exits: list[Cost] = field(default_factory=list)
    tests: int = 0
    cells: int = 0
    walking: Counter[str] = field(default_factory=Counter)

    @property
    def arithmetic(self) -> int:
        """Operations that are not fetches."""
        return self.counts.total() - self.counts[FETCH]

    @property
    def fetches(self) -> int:
        """Texels read."""
        return self.counts[FETCH]

    def plus(self, other: Cost) -> Cost:
        """Both, one after the other."""
        return Cost(
            self.counts + other.counts,
            self.loops + other.loops,
            self.exits + other.exits,
            self.tests + other.tests,
            self.cells + other.cells,
            self.walking + other.walking,
        )

    def deep(self) -> int:
        """All operations, an iteration of each loop among them."""
        return self.counts.total() + sum(loop.deep() for loop in self.loops)


@dataclass
class Frame:
    """A function that is being walked: its names, those around it, and the texels that it has read."""

    names: dict[str, Any]
    outside: dict[str, Any]
    read: set[tuple[str, ...]] = field(default_factory=set)

    def find(self, name: str) -> Any:
        """The value of a name."""
        if name in self.names:
            return self.names[name]
        if name in self.outside:
            return self.outside[name]
        builtin = {"abs": abs, "min": min, "max": max, "int": int, "float": float, "bool": bool, "len": len}
        if name not in builtin:
            raise Uncountable(f"name {name!r} is not known.")
        return builtin[name]


def known(*values: Any) -> bool:
    """Whether all are numbers that are known."""
    return all(isinstance(value, int | float | np.generic) for value in values)


def truth(value: Any) -> bool | None:
    """Whether a condition holds; None if that is not known."""
    return bool(value) if known(value) else None


class Expressions:
    """Evaluates expressions and adds what they cost to `cost`."""

    def __init__(self, facts: dict[str, Any]) -> None:
        self.facts, self.cost = facts, Cost()

    def call(self, function: Any, arguments: list[Any]) -> Any:
        """Walks a function; `source_walk.Walker` does."""
        raise NotImplementedError

    def value(self, node: ast.expr, frame: Frame) -> Any:
        """What an expression is worth."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise Uncountable(f"{ast.unparse(node)} cannot be counted.")
        return method(node, frame)

    def _count(self, kind: str, *nodes: ast.expr) -> None:
        """One operation, unless it is instrumentation."""
        if not any(isinstance(node, ast.Name) and node.id in INSTRUMENTS for node in nodes):
            self.cost.counts[kind] += 1

    def _fact(self, path: str) -> Any:
        return self.facts.get(path, Unknown(path))

    def _constant(self, node: ast.Constant, frame: Frame) -> Any:
        return node.value

    def _name(self, node: ast.Name, frame: Frame) -> Any:
        return frame.find(node.id)

    def _tuple(self, node: ast.Tuple, frame: Frame) -> Any:
        return tuple(self.value(part, frame) for part in node.elts)

    def _attribute(self, node: ast.Attribute, frame: Frame) -> Any:
        base = self.value(node.value, frame)
        return self._fact(f"{base.path}.{node.attr}") if isinstance(base, Unknown) else getattr(base, node.attr)

    def _subscript(self, node: ast.Subscript, frame: Frame) -> Any:
        base = self.value(node.value, frame)
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        indices = [self.value(part, frame) for part in parts]
        if not isinstance(base, Unknown):
            if known(*indices) and isinstance(base, tuple):
                return base[int(indices[0])]
            return base[tuple(int(i) for i in indices)] if known(*indices) else Unknown()
        computed = [not isinstance(part, ast.Constant) for part in parts]
        if any(computed) and base.path.startswith("t."):
            texts = [str(i) if known(i) else ast.unparse(part) for i, part in zip(indices, parts, strict=True)]
            texel = base.path, *(text for text, own in zip(texts, computed, strict=True) if own)
            if texel not in frame.read:
                frame.read.add(texel)
                self.cost.counts[FETCH] += 1
        place = ", ".join(str(int(i)) if known(i) else "·" for i in indices)
        return self._fact(f"{base.path}[{place}]")

    def _binop(self, node: ast.BinOp, frame: Frame) -> Any:
        left, right = self.value(node.left, frame), self.value(node.right, frame)
        if is_constant(node, frame):
            return BINARY[type(node.op)][1](left, right)
        return self.apply(node.op, left, right, node.left, node.right)

    def apply(self, kind: ast.operator, left: Any, right: Any, *nodes: ast.expr) -> Any:
        """One operation between two values."""
        if type(kind) not in BINARY:
            raise Uncountable(f"{type(kind).__name__} cannot be counted.")
        name, does = BINARY[type(kind)]
        self._count(name, *nodes)
        if not known(left, right):
            # What is false stays false whatever the rest is
            decided = name == "logic" and [each for each in (left, right) if truth(each) is not None]
            if decided and isinstance(kind, ast.BitAnd) and not truth(decided[0]):
                return False
            if decided and isinstance(kind, ast.BitOr) and decided[0] is True:
                return True
            return Unknown()
        return does(left, right) if name != "divide" or right != 0 else Unknown()

    def _unaryop(self, node: ast.UnaryOp, frame: Frame) -> Any:
        value = self.value(node.operand, frame)
        if not known(value):
            return Unknown()
        return not value if isinstance(node.op, ast.Not) else -value if isinstance(node.op, ast.USub) else value

    def _compare(self, node: ast.Compare, frame: Frame) -> Any:
        nodes = [node.left, *node.comparators]
        values = [self.value(each, frame) for each in nodes]
        found: bool | Unknown = True
        for k, kind in enumerate(node.ops):
            self._count("compare", nodes[k], nodes[k + 1])
            if not known(values[k], values[k + 1]):
                found = Unknown() if found is not False else False
            elif not COMPARE[type(kind)](values[k], values[k + 1]):
                found = False
        return found

    def _boolop(self, node: ast.BoolOp, frame: Frame) -> Any:
        truths = [truth(self.value(each, frame)) for each in node.values]
        for each in node.values[1:]:
            self._count("logic", each)
        deciding = isinstance(node.op, ast.Or)
        if deciding in truths:
            return deciding
        return Unknown() if None in truths else not deciding

    def _ifexp(self, node: ast.IfExp, frame: Frame) -> Any:
        which = truth(self.value(node.test, frame))
        sides = self.value(node.body, frame), self.value(node.orelse, frame)
        width = len(sides[0]) if isinstance(sides[0], tuple) else 1
        for _ in range(width):
            self._count("select")
        return merged(*sides) if which is None else sides[0] if which else sides[1]

    def _call(self, node: ast.Call, frame: Frame) -> Any:
        function = self.value(node.func, frame)
        arguments = [self.value(each, frame) for each in node.args]
        if node.keywords:
            raise Uncountable(f"{ast.unparse(node)}: keywords cannot be counted.")
        if isinstance(function, type) and hasattr(function, "_fields"):
            return function(*arguments)
        if isinstance(function, type) and len(arguments) == 1:  # a conversion
            fits = known(*arguments) and bool(np.isfinite(arguments[0]) and (arguments[0] >= 0 or function is not U))
            return function(arguments[0]) if fits else Unknown(getattr(arguments[0], "path", "?"))
        if callable(function) and function in BUILT_IN:
            self._count(BUILT_IN[function])
            return Unknown()
        return self.call(getattr(function, "py_func", function), arguments)


def is_constant(node: ast.expr, frame: Frame) -> bool:
    """Whether an expression is made of literals and a module's names alone."""
    names = [part.id for part in ast.walk(node) if isinstance(part, ast.Name)]
    plain = all(isinstance(part, ast.expr | ast.operator | ast.expr_context | ast.unaryop) for part in ast.walk(node))
    return plain and not any(name in frame.names for name in names)


def merged(a: Any, b: Any) -> Any:
    """What is known of a value that is one of two."""
    if isinstance(a, tuple) and isinstance(b, tuple) and type(a) is type(b) and len(a) == len(b):
        parts = [merged(x, y) for x, y in zip(a, b, strict=True)]
        return type(a)(*parts) if hasattr(a, "_fields") else tuple(parts)
    if a is b or (isinstance(a, Unknown) and a == b):
        return a
    return a if known(a, b) and bool(a == b) else Unknown()
