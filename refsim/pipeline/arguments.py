"""Arguments of a draw looked at one by one: colour targets against fragment outputs, textures, viewport and scissor.

In: what the caller gave; out: the same, rectangles as `Viewport` and `ScissorRect`. Raises `InputError`: one sentence
that names the argument and says what it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.color_writes import target_fields
from refsim.pipeline.resources import Framebuffer, Texture
from refsim.pipeline.state import DynamicState, Pipeline, ScissorRect, Viewport

_DTYPES = {"f": "float32", "i": "int32"}


def check_targets(pipeline: Pipeline, framebuffer: Framebuffer) -> None:
    """Outputs and targets must agree in name, order and type."""
    label, targets = pipeline.label, framebuffer.targets
    fields = {field.name: field for field in (target_fields(pipeline.fragment) if pipeline.fragment else [])}
    for name, field in fields.items():
        if name not in targets:
            raise InputError(
                f"{label}: fragment output {name!r} has no colour target; the framebuffer has {_listed(targets)}."
            )
        form = targets[name]
        if (field.size, field.kind) != (form.components, "f" if form.is_float else "i"):
            made = f"{field.size} component{'s' if field.size > 1 else ''} of {_DTYPES[field.kind]}"
            raise InputError(f"{label}: fragment output {name!r} has {made}, its colour target is {form.value}.")
    for name in targets:
        if name not in fields:
            raise InputError(f"{label}: colour target {name!r} is no fragment output; there are {_listed(fields)}.")
    if list(fields) != list(targets):
        raise InputError(
            f"{label}: fragment outputs and colour targets differ in order: {_listed(fields)} and {_listed(targets)}."
        )


def _listed(names: Any) -> str:
    return ", ".join(map(str, names)) or "none"


def check_textures(label: str, textures: Any) -> None:
    """Every texture holds planes [component, y, x] of float32 or int32."""
    for path, data in _textures(textures, ""):
        if not isinstance(data, np.ndarray):
            what = type(data).__name__
        elif data.dtype not in (np.float32, np.int32) or data.ndim != 3:
            what = f"{data.dtype} of shape {data.shape}"
        else:
            continue
        raise InputError(
            f"{label}: texture {path!r} is {what}; a texture is a float32 or int32 array [component, y, x]."
        )


def _textures(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """(path, data) of every texture in the nested tuple `value`."""
    if isinstance(value, Texture):
        yield path, value.data
    elif isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        for name, part in zip(names, value, strict=True):
            yield from _textures(part, f"{path}.{name}" if path else f"{name}")


def with_rectangles(label: str, dynamic: DynamicState) -> DynamicState:
    """`dynamic` with a viewport or scissor that was given as a plain tuple turned into its class."""
    viewport, scissor = dynamic.viewport, dynamic.scissor
    if viewport is not None:
        viewport = Viewport(*_numbers(label, "viewport", viewport, 4, 6))
    if scissor is not None:
        scissor = ScissorRect(*_numbers(label, "scissor", scissor, 4, 4))
    return dynamic._replace(viewport=viewport, scissor=scissor)


def _numbers(label: str, name: str, value: Any, least: int, most: int) -> tuple[Any, ...]:
    if not isinstance(value, tuple) or not least <= len(value) <= most:
        wanted = "(x, y, width, height)" if most == 4 else "(x, y, width, height, min_depth, max_depth)"
        raise InputError(f"{label}: {name} must be {wanted}, not {value!r}.")
    if not all(isinstance(part, int | float | np.integer | np.floating) for part in value):
        raise InputError(f"{label}: {name} must be made of numbers, not {tuple(value)!r}.")
    return value
