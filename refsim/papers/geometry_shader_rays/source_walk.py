"""Counts a device function's operations by walking its source: no number is typed, so a changed shader counts anew.

In: the function and its arguments, of which some are known (a ray's state, a flag, a Phong exponent) and most are
`Unknown`. Out: an `operations.Cost`.

    a known branch      the side taken
    an unknown branch   the costlier side; but a side that leaves the function or the loop is not the main path
    a known loop        its iterations
    an unknown loop     one iteration, kept apart in `Cost.loops`; of `for`, a sum and a comparison with it

Calls of other device functions are walked in their turn.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from refsim.papers.geometry_shader_rays.operations import (
    INSTRUMENTS,
    Cost,
    Expressions,
    Frame,
    Uncountable,
    Unknown,
    known,
    merged,
    truth,
)

MOST_ITERATIONS = 4096
TEST = "intersect"  # the ray–triangle test, `refsim.geometry.triangle.intersect`, or another one of that name


def walk(
    function: Any, *arguments: Any, facts: Mapping[str, Any] | None = None, free: tuple[Any, ...] = ()
) -> tuple[Cost, Any]:
    """Cost and value of a call. Arguments are values, tuples of them, or `Unknown(path)`.

    `facts`: the value found at a path, such as "t.triangles.data[0, 0, 3, 3]". `free`: functions whose calls cost
    nothing and return something unknown, as they are counted elsewhere.
    """
    walker = Walker(dict(facts or {}), {_python(each) for each in free})
    with np.errstate(all="ignore"):
        value = walker.call(_python(function), list(arguments))
    return walker.cost, value


def _python(function: Any) -> Any:
    return getattr(function, "py_func", function)


@cache
def definition(function: Any) -> ast.FunctionDef:
    """The syntax tree of a Python function."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, TypeError, SyntaxError) as error:
        raise Uncountable(f"the source of {function!r} cannot be read.") from error
    if not isinstance(tree, ast.FunctionDef):
        raise Uncountable(f"{function!r} is not a function with a source of its own.")
    return tree


@dataclass
class Ended:
    """A statement that leaves: "return" with a value, "break" or "continue"."""

    how: str
    value: Any = None


@dataclass
class Side:
    """A side of a branch that is not known: its cost, how it ends, and the names after it."""

    cost: Cost
    ended: Ended | None
    names: dict[str, Any]


class Walker(Expressions):
    """Executes statements; `cost` is what they cost so far."""

    def __init__(self, facts: dict[str, Any], free: set[Any]) -> None:
        super().__init__(facts)
        self.free = free
        self.inside = 0  # calls and loops

    def call(self, function: Any, arguments: list[Any]) -> Any:
        """The value of a call of a function with a Python source."""
        if function in self.free:
            return Unknown(f"{function.__name__}()")
        tree = definition(function)
        self.cost.tests += function.__name__ == TEST
        names = [each.arg for each in tree.args.args]
        if len(names) != len(arguments):
            raise Uncountable(f"{function.__name__} takes {len(names)} arguments, {len(arguments)} were given.")
        cells = function.__closure__ or ()
        closure = dict(zip(function.__code__.co_freevars, (cell.cell_contents for cell in cells), strict=True))
        self.inside += 1
        frame = Frame(dict(zip(names, arguments, strict=True)), {**function.__globals__, **closure})
        ended = self._block(tree.body, frame)
        self.inside -= 1
        return ended.value if ended is not None else None

    def _block(self, body: list[ast.stmt], frame: Frame) -> Ended | None:
        for statement in body:
            ended = self._statement(statement, frame)
            if ended is not None:
                return ended
        return None

    def _statement(self, node: ast.stmt, frame: Frame) -> Ended | None:
        match node:
            case ast.Return():
                return Ended("return", None if node.value is None else self.value(node.value, frame))
            case ast.Break():
                return Ended("break")
            case ast.Continue():
                return Ended("continue")
            case ast.Assign():
                value = self.value(node.value, frame)
                for target in node.targets:
                    self._assign(target, value, frame)
            case ast.AugAssign():
                self._augment(node, frame)
            case ast.If():
                return self._branch(node, frame)
            case ast.For():
                return self._for(node, frame)
            case ast.While():
                return self._while(node, frame)
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                pass
            case ast.Expr():
                self.value(node.value, frame)
            case _:
                raise Uncountable(f"{type(node).__name__} in a device function cannot be counted.")
        return None

    def _assign(self, target: ast.expr, value: Any, frame: Frame) -> None:
        if isinstance(target, ast.Name):
            frame.names[target.id] = value
        elif isinstance(target, ast.Tuple):
            for k, part in enumerate(target.elts):
                own = value[k] if isinstance(value, tuple) else self._fact(f"{getattr(value, 'path', '?')}[{k}]")
                self._assign(part, own, frame)

    def _augment(self, node: ast.AugAssign, frame: Frame) -> None:
        name = node.target.id if isinstance(node.target, ast.Name) else ""
        if name in INSTRUMENTS:
            self.cost.cells += name == "cells"
            return
        right = self.value(node.value, frame)
        left = frame.names.get(name, Unknown())
        frame.names[name] = self.apply(node.op, left, right, node.value)

    def _branch(self, node: ast.If, frame: Frame) -> Ended | None:
        decided = truth(self.value(node.test, frame))
        if decided is not None:
            return self._block(node.body if decided else node.orelse, frame)
        sides = [self._side(body, frame) for body in (node.body, node.orelse)]
        staying = [side for side in sides if side.ended is None]
        if len(staying) == 1:
            chosen = staying[0]
            leaving = sides[0] if chosen is sides[1] else sides[1]
            leaves = self.inside == 1 and leaving.ended is not None and leaving.ended.how == "return"
            if leaves and not any(loop.cells for loop in self.cost.loops):
                self.cost.exits.append(Cost(self.cost.counts + leaving.cost.counts))
            frame.names = chosen.names
        else:
            chosen = max(sides, key=lambda side: side.cost.deep())
            every = {name for side in sides for name in side.names}
            frame.names = {n: merged(*(side.names.get(n, Unknown()) for side in sides)) for n in every}
            if chosen.ended is not None:
                chosen.ended.value = merged(*(side.ended.value for side in sides if side.ended is not None))
        if any(loop.cells for loop in chosen.cost.loops):
            chosen.cost.walking = Counter(chosen.cost.counts)
        self.cost = self.cost.plus(chosen.cost)
        return chosen.ended

    def _side(self, body: list[ast.stmt], frame: Frame) -> Side:
        """What a side of a branch would do; nothing of it is taken yet."""
        before, self.cost = self.cost, Cost()
        own = Frame(dict(frame.names), frame.outside, set(frame.read))
        ended = self._block(body, own)
        cost, self.cost = self.cost, before
        return Side(cost, ended, own.names)

    def _for(self, node: ast.For, frame: Frame) -> Ended | None:
        call = node.iter
        if not isinstance(call, ast.Call) or ast.unparse(call.func) != "range":
            raise Uncountable(f"{ast.unparse(node.iter)}: a loop that is not over a range cannot be counted.")
        bounds = [self.value(each, frame) for each in call.args]
        if not known(*bounds):
            self._once(node, frame)
            return None
        for k in range(*(int(bound) for bound in bounds)):
            self._assign(node.target, k, frame)
            ended = self._block(node.body, frame)
            if ended is not None and ended.how != "continue":
                return ended if ended.how == "return" else None
        return None

    def _while(self, node: ast.While, frame: Frame) -> Ended | None:
        if isinstance(node.test, ast.Constant):
            self._once(node, frame)
            return None
        for _ in range(MOST_ITERATIONS):
            before, self.cost = self.cost, Cost()
            goes_on = truth(self.value(node.test, frame))
            test, self.cost = self.cost, before
            if goes_on is None:
                self._once(node, frame)
                return None
            self.cost = self.cost.plus(test)
            if not goes_on:
                return None
            ended = self._block(node.body, frame)
            if ended is not None and ended.how != "continue":
                return ended if ended.how == "return" else None
        raise Uncountable(f"while {ast.unparse(node.test)}: does not end.")

    def _once(self, node: ast.For | ast.While, frame: Frame) -> None:
        """One iteration of a loop that runs nobody knows how often; after it nothing is known of what it assigns."""
        names = {
            part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
        }
        frame.names |= {name: Unknown() for name in names}
        before, self.cost = self.cost, Cost()
        self.inside += 1
        if isinstance(node, ast.For):
            self.cost.counts.update(("add", "compare"))
        elif not isinstance(node.test, ast.Constant):
            self.value(node.test, frame)
        self._block(node.body, Frame(frame.names, frame.outside, set(frame.read)))
        self.inside -= 1
        iteration, self.cost = self.cost, before
        self.cost.loops.append(iteration)
        frame.names |= {name: Unknown() for name in names}
