"""Everything a draw can refuse, refused before anything runs: one sentence naming the field."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.layout import Layout
from refsim.pipeline.resources import Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import DynamicState, Pipeline, PrimitiveTopology, VertexStepMode, Viewport


@dataclass(frozen=True)
class Call:
    """The arguments of a draw as the kernels take them."""

    framebuffer: Framebuffer
    buffers: tuple[tuple[np.ndarray, np.ndarray], ...]
    indices: np.ndarray
    vertex_count: int
    viewport: tuple[np.float32, ...]
    bounds: tuple[np.float32, ...]
    stencil_values: tuple[np.int32, np.int32, np.int32]
    input_floats: tuple[np.ndarray, ...]
    input_ints: tuple[np.ndarray, ...]


def checked_draw(
    pipeline: Pipeline,
    framebuffer: Framebuffer,
    vertices: VertexBuffer | tuple[VertexBuffer, ...],
    uniforms: Any,
    textures: Any,
    indices: np.ndarray | None,
    instances: int,
    vertex_count: int | None,
    dynamic: DynamicState,
    loop: str,
) -> Call:
    """The checked call. Raises `InputError`."""
    for name, value, kind in (
        ("pipeline", pipeline, Pipeline), ("framebuffer", framebuffer, Framebuffer), ("dynamic", dynamic, DynamicState)
    ):  # fmt: skip
        if not isinstance(value, kind):
            raise InputError(f"{name} must be a {kind.__name__}, not {type(value).__name__}.")
    if loop not in ("auto", "dense", "list"):
        raise InputError(f"{pipeline.label}: loop must be 'auto', 'dense' or 'list', not {loop!r}.")
    buffers = vertices if isinstance(vertices, tuple) else (vertices,)
    if not all(isinstance(buffer, VertexBuffer) for buffer in buffers):
        raise InputError(f"{pipeline.label}: vertices must be a VertexBuffer or a tuple of them.")
    count, indices_array = _vertex_count(pipeline, buffers, indices, instances, vertex_count)
    _check_targets(pipeline, framebuffer)
    input_floats, input_ints = _inputs(pipeline, framebuffer, textures)
    _check_feedback(pipeline, framebuffer, "uniform", uniforms)
    _check_feedback(pipeline, framebuffer, "texture", textures)
    viewport = dynamic.viewport or Viewport(0, 0, framebuffer.width, framebuffer.height)
    sized = np.isfinite(viewport).all() and viewport.width > 0 and viewport.height > 0
    if not (sized and 0 <= viewport.min_depth <= viewport.max_depth <= 1):
        raise InputError(
            f"{pipeline.label}: {viewport} needs finite numbers, a positive size and 0 ≤ min_depth ≤ max_depth ≤ 1."
        )
    values = (dynamic.stencil_reference, dynamic.stencil_read_mask, dynamic.stencil_write_mask)
    if not all(_is_whole(value) and 0 <= value <= 255 for value in values):
        raise InputError(f"{pipeline.label}: stencil reference and masks are 8-bit values, not {values}.")
    return Call(
        framebuffer,
        tuple((buffer.floats, buffer.ints) for buffer in buffers),
        indices_array,
        count,
        tuple(np.float32(part) for part in viewport),
        _bounds(pipeline, framebuffer, dynamic),
        (np.int32(values[0]), np.int32(values[1]), np.int32(values[2])),
        input_floats,
        input_ints,
    )


def _vertex_count(
    pipeline: Pipeline,
    buffers: tuple[VertexBuffer, ...],
    indices: np.ndarray | None,
    instances: int,
    vertex_count: int | None,
) -> tuple[int, np.ndarray]:
    """Vertices an instance, and the index array (empty without indices)."""
    if not _is_whole(instances) or instances < 0:
        raise InputError(f"{pipeline.label}: instances must be a whole number of at least 0, not {instances!r}.")
    layouts = pipeline.vertex.buffers
    if len(buffers) != len(layouts):
        raise InputError(f"{pipeline.label}: {len(layouts)} vertex buffers are declared, {len(buffers)} were given.")
    for buffer, layout in zip(buffers, layouts, strict=True):
        if buffer.attributes is not layout.attributes:
            expected, got = layout.attributes.__name__, buffer.attributes.__name__
            raise InputError(f"{pipeline.label}: a vertex buffer of {expected} is declared, one of {got} was given.")
        if layout.step_mode == VertexStepMode.INSTANCE and buffer.count < instances:
            raise InputError(f"{pipeline.label}: {instances} instances need more than {buffer.count} rows.")
    pairs = zip(buffers, layouts, strict=True)
    per_vertex = [buffer.count for buffer, layout in pairs if layout.step_mode == VertexStepMode.VERTEX]
    available = min(per_vertex) if per_vertex else None
    corners = 4 if pipeline.topology == PrimitiveTopology.QUAD_LIST else 1
    if indices is not None:
        if vertex_count is not None:
            raise InputError(f"{pipeline.label}: vertex_count is for draws without indices; leave one of them out.")
        given = np.asarray(indices)
        if given.size and given.dtype.kind not in "iu":
            raise InputError(f"{pipeline.label}: indices must be whole numbers, not {given.dtype}.")
        array = np.ascontiguousarray(given, np.int64).ravel()
        outside = (array < 0) | (array >= (available if available is not None else np.iinfo(np.int32).max))
        if outside.any():
            place = int(np.argmax(outside))
            value = given.ravel()[place]
            raise InputError(f"{pipeline.label}: index {place} is {value}, but there are {available} vertices.")
        return len(array), array
    count = vertex_count if vertex_count is not None else (available if available is not None else corners)
    if not _is_whole(count) or count < 0:
        raise InputError(f"{pipeline.label}: vertex_count must be a whole number of at least 0, not {count!r}.")
    if available is not None and count > available:
        raise InputError(f"{pipeline.label}: vertex_count is {count}, but there are {available} vertices.")
    return int(count), np.empty(0, np.int64)


def _check_targets(pipeline: Pipeline, framebuffer: Framebuffer) -> None:
    """Outputs and targets must agree in name, order and type."""
    fields = Layout.of(pipeline.fragment.outputs).fields
    made = [(field.name, field.size, field.kind) for field in fields]
    wanted = [(name, form.components, "f" if form.is_float else "i") for name, form in framebuffer.targets.items()]
    if made != wanted:
        odd = next((a or b for a, b in zip_longest(made, wanted) if a != b), None)
        name = odd[0] if odd else "?"
        raise InputError(f"{pipeline.label}: fragment output and colour target {name!r} do not agree.")
    if pipeline.depth_stencil.format != framebuffer.depth_format:
        raise InputError(
            f"{pipeline.label}: depth_stencil.format is {pipeline.depth_stencil.format.name}, "
            f"the framebuffer's is {framebuffer.depth_format.name}."
        )


def _inputs(
    pipeline: Pipeline, framebuffer: Framebuffer, textures: Any
) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Planes of the input attachments; a dummy plane where there are none of a kind."""
    planes: dict[str, list[np.ndarray]] = {"f": [], "i": []}
    if pipeline.fragment.inputs is not None:
        for field in Layout.of(pipeline.fragment.inputs).fields:
            texture = getattr(textures, field.name, None)
            if not isinstance(texture, Texture):
                raise InputError(f"{pipeline.label}: input attachment {field.name!r} is no texture of this draw.")
            data = texture.data
            dtype = np.float32 if field.kind == "f" else np.int32
            if data.dtype != dtype or data.ndim != 3 or data.shape[0] < field.size:
                wanted = f"{field.size} {dtype.__name__}"
                raise InputError(f"{pipeline.label}: texture {field.name!r} does not hold {wanted}.")
            if data.shape[1:] != (framebuffer.height, framebuffer.width):
                raise InputError(f"{pipeline.label}: texture {field.name!r} is not of the framebuffer's size.")
            planes[field.kind] += list(data[: field.size])
    return (
        tuple(planes["f"]) or (np.zeros((1, 1), np.float32),),
        tuple(planes["i"]) or (np.zeros((1, 1), np.int32),),
    )


def _check_feedback(pipeline: Pipeline, framebuffer: Framebuffer, what: str, value: Any, path: str = "") -> None:
    """An array that is also a target, depth or stencil would be read while it is written."""
    if isinstance(value, Texture):
        value = value.data
    if isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        for name, part in zip(names, value, strict=True):
            _check_feedback(pipeline, framebuffer, what, part, f"{path}.{name}" if path else f"{name}")
    targets = (framebuffer.floats, framebuffer.ints, framebuffer.depth, framebuffer.stencil, framebuffer.invocations)
    if isinstance(value, np.ndarray) and any(np.may_share_memory(value, target) for target in targets):
        raise InputError(f"{pipeline.label}: {what} {path!r} is also a target of the framebuffer (feedback loop).")


def _is_whole(value: Any) -> bool:
    """Whether `value` is an integer, Python's or NumPy's, and no truth value."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _bounds(pipeline: Pipeline, framebuffer: Framebuffer, dynamic: DynamicState) -> tuple[np.float32, ...]:
    """Pixels that may be drawn, [x0, x1) × [y0, y1): the scissor within the framebuffer."""
    x, y, width, height = dynamic.scissor or (0, 0, framebuffer.width, framebuffer.height)
    if not all(_is_whole(part) for part in (x, y, width, height)):
        raise InputError(f"{pipeline.label}: scissor {dynamic.scissor} must be whole pixels.")
    if min(x, y, width, height) < 0 or x + width > framebuffer.width or y + height > framebuffer.height:
        raise InputError(f"{pipeline.label}: scissor {dynamic.scissor} leaves the framebuffer.")
    return np.float32(x), np.float32(y), np.float32(x + width), np.float32(y + height)
