"""How a varying is spread over a triangle: said in its annotation, as GLSL says it before a declaration.

    class Surface(NamedTuple):
        normal: vec3                                        # perspective-correct, the default of float varyings
        screen: Annotated[vec2, Interpolation.LINEAR]       # linear in screen space
        material: Annotated[f32, Interpolation.FLAT]        # the first vertex's; integers are always flat

The provoking vertex of flat varyings is the primitive's first (WebGPU). Points and quads take their first vertex's
values for everything. A fragment's value is v₀ + w₁·(v₁−v₀) + w₂·(v₂−v₀) in float32, where w are the linear or the
perspective weights of corners 1 and 2 (`refsim.pipeline.triangle`); a constant therefore stays exactly that constant.
"""

from __future__ import annotations

import typing
from enum import StrEnum
from functools import cache, cached_property
from typing import Any

from refsim.errors import InputError
from refsim.pipeline.layout import Layout, device_function


class Interpolation(StrEnum):
    """WebGPU's ``@interpolate`` types."""

    PERSPECTIVE = "perspective"
    LINEAR = "linear"
    FLAT = "flat"


def interpolation_of(cls: type, prefix: str = "", inherited: Interpolation | None = None) -> dict[str, Interpolation]:
    """The interpolation of every leaf of a NamedTuple class, by dotted name. Raises `InputError` for integers that
    are said to be anything but flat."""
    found: dict[str, Interpolation] = {}
    for name, annotation in typing.get_type_hints(cls, include_extras=True).items():
        said = [part for part in getattr(annotation, "__metadata__", ()) if isinstance(part, Interpolation)]
        wanted = said[0] if said else inherited
        bare = typing.get_args(annotation)[0] if hasattr(annotation, "__metadata__") else annotation
        if hasattr(bare, "_fields"):
            found |= interpolation_of(bare, f"{prefix}{name}.", wanted)
            continue
        is_float = next(field.kind for field in Layout.of(cls).fields if field.name == name) == "f"
        if not is_float and wanted not in (None, Interpolation.FLAT):
            raise InputError(f"varying {name!r} of {cls.__name__} is {wanted}; integers can only be flat.")
        found[prefix + name] = (wanted or Interpolation.PERSPECTIVE) if is_float else Interpolation.FLAT
    return found


class Spread:
    """Columns of a triangle's varyings: v₀, v₁−v₀ and v₂−v₀ of what is smooth, v₀ of what is flat.

    `floats` and `ints` are their numbers. The device functions: ``put(F, I, row, a, b, c)`` stores the varyings of
    three corners; ``take(F, I, row)`` loads them as a plain tuple; ``at(taken, b1, b2, p1, p2)`` is a fragment's
    NamedTuple from linear weights b and perspective weights p; ``mix(a, b, c, b1, b2, p1, p2)`` the same from three
    NamedTuples.
    """

    def __init__(self, cls: type) -> None:
        self.layout = Layout.of(cls)
        kinds = interpolation_of(cls)
        self._weights: dict[tuple[str, int], str] = {}  # of a column: "p", "b", or "" where it is flat
        for field in self.layout.fields:
            weight = {Interpolation.PERSPECTIVE: "p", Interpolation.LINEAR: "b"}.get(kinds[field.name], "")
            for column in range(field.first, field.first + field.size):
                self._weights[field.kind, column] = weight
        self._place: dict[int, int] = {}
        self.floats = 0
        for column in range(self.layout.floats):
            self._place[column] = self.floats
            self.floats += 3 if self._weights["f", column] else 1
        self.ints = self.layout.ints

    @staticmethod
    @cache
    def of(cls: type) -> Spread:
        """The spread of `cls`, made once."""
        return Spread(cls)

    @cached_property
    def put(self) -> Any:
        """Stores three corners' varyings in a row."""
        lines = []
        for path, kind, column in self.layout.leaves("a"):
            if kind == "i":
                lines.append(f"I[i, {column}] = {path}")
                continue
            place = self._place[column]
            lines.append(f"F[i, {place}] = {path}")
            if self._weights[kind, column]:
                lines.append(f"F[i, {place + 1}] = b{path[1:]} - {path}")
                lines.append(f"F[i, {place + 2}] = c{path[1:]} - {path}")
        body = "\n".join(f"    {line}" for line in lines or ["pass"])
        return device_function(f"def put(F, I, i, a, b, c):\n{body}\n", "put", {})

    @cached_property
    def take(self) -> Any:
        """Loads a row as a plain tuple, floats first."""
        cells = [f"F[i, {k}]" for k in range(self.floats)] + [f"I[i, {k}]" for k in range(self.ints)]
        result = f"({', '.join(cells)},)" if cells else "()"
        return device_function(f"def take(F, I, i):\n    return {result}\n", "take", {})

    @cached_property
    def at(self) -> Any:
        """A fragment's varyings from what `take` loaded."""

        def leaf(kind: str, column: int, path: str) -> str:
            if kind == "i":
                return f"t[{self.floats + column}]"
            place, weight = self._place[column], self._weights[kind, column]
            if not weight:
                return f"t[{place}]"
            return f"t[{place}] + {weight}1 * t[{place + 1}] + {weight}2 * t[{place + 2}]"

        source, classes = self.layout.rebuilt(leaf)
        return device_function(f"def at(t, b1, b2, p1, p2):\n    return {source}\n", "at", classes)

    @cached_property
    def mix(self) -> Any:
        """Varyings of a point inside a triangle from those of its corners."""

        def leaf(kind: str, column: int, path: str) -> str:
            weight = self._weights[kind, column]
            if not weight:
                return f"a{path}"
            return f"a{path} + {weight}1 * (b{path} - a{path}) + {weight}2 * (c{path} - a{path})"

        source, classes = self.layout.rebuilt(leaf)
        return device_function(f"def mix(a, b, c, b1, b2, p1, p2):\n    return {source}\n", "mix", classes)
