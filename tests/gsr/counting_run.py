"""Device functions run as plain Python, their operations counted as they are done.

A copy of the function's syntax tree in which every operation that `operations` prices reports itself, executed with
numbers: what `source_walk` says without running must be what happens. Both sides of a select are evaluated, as there.
Given: a device function and the names that are to stand for others (a search that is counted elsewhere).
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from refsim.pipeline.resources import slice4

BINARY = {"Add": "add", "Sub": "add", "Mult": "multiply", "Div": "divide", "Mod": "divide", "FloorDiv": "divide",
          "BitAnd": "logic", "BitOr": "logic", "RShift": "logic"}  # fmt: skip
BUILT_IN = {math.sqrt: ("root", np.sqrt), min: ("select", min), max: ("select", max), np.rint: ("select", np.rint)}


class CountedRun:
    """`done`: what has been done since it was cleared; `run(function)` gives the Python function."""

    def __init__(self, stubs: dict[Any, Callable[..., Any]]) -> None:
        self.done: Counter[str] = Counter()
        self._ready: dict[Any, Callable[..., Any]] = {**stubs, slice4: self._texel}
        for function, (kind, does) in BUILT_IN.items():
            self._ready[function] = self._counted(kind, does)

    def _texel(self, texture: Any, x: Any, y: Any, z: Any) -> Any:
        self.done["fetch"] += 1
        return tuple(texture.data[y, x, z])

    def _counted(self, kind: str, does: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *arguments: self._did(kind, does(*arguments))

    def _did(self, kind: str, value: Any) -> Any:
        self.done[kind] += 1
        return value

    def _pick(self, test: Any, one: Any, other: Any) -> Any:
        self.done["select"] += len(one) if isinstance(one, tuple) else 1
        return one if test else other

    def run(self, function: Any) -> Callable[..., Any]:
        """The counted copy; those of the functions that it calls are made with it."""
        if function in self._ready:
            return self._ready[function]
        plain = function.py_func
        tree = ast.parse(textwrap.dedent(inspect.getsource(plain)))
        definition = tree.body[0]
        assert isinstance(definition, ast.FunctionDef)
        definition.decorator_list = []
        _Reporting({*plain.__code__.co_varnames}).visit(definition)
        code = compile(ast.fix_missing_locations(tree), "counted", "exec")
        cells = [cell.cell_contents for cell in plain.__closure__ or ()]
        outside = {**plain.__globals__, **dict(zip(plain.__code__.co_freevars, cells, strict=True))}
        names: dict[str, Any] = {"_did": self._did, "_pick": self._pick, "min": self.run(min), "max": self.run(max)}
        for name in (*plain.__code__.co_names, *plain.__code__.co_freevars):
            value = outside.get(name)
            device = hasattr(value, "py_func") or value in self._ready if callable(value) else False
            if name in outside:
                names[name] = self.run(value) if device else value
        if "math" in names:
            names["math"] = type("Math", (), {"sqrt": self.run(math.sqrt)})
        exec(code, names)
        self._ready[function] = names[plain.__name__]
        return self._ready[function]


class _Reporting(ast.NodeTransformer):
    """Wraps operations; those between constants and names from outside are free."""

    def __init__(self, local: set[str]) -> None:
        self._local = local

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        free = not any(isinstance(part, ast.Call) or (isinstance(part, ast.Name) and part.id in self._local)
                       for part in ast.walk(node))  # fmt: skip
        self.generic_visit(node)
        return node if free else _call("_did", ast.Constant(BINARY[type(node.op).__name__]), node)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        assert isinstance(node.target, ast.Name)
        whole = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
        return ast.Assign([node.target], self.visit_BinOp(whole))

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        assert len(node.ops) == 1
        self.generic_visit(node)
        return _call("_did", ast.Constant("compare"), node)

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        self.generic_visit(node)
        return _call("_pick", node.test, node.body, node.orelse)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        raise AssertionError("`and` and `or` run what they need alone; no shader that is counted here has them")


def _call(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])
