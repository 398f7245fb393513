"""Everything a draw can refuse, refused before anything runs: one sentence naming the field."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.pipeline.arguments import check_targets, check_textures, with_rectangles
from refsim.pipeline.assembly import Assembly, assembled, restart_places
from refsim.pipeline.layout import Layout
from refsim.pipeline.resources import Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import DepthStencilFormat, DynamicState, Pipeline, VertexStepMode, Viewport
from refsim.pipeline.viewport import screen_map

MAX_PIXELS = 2**14
_NO_FLOATS = (np.zeros((1, 1), np.float32),)
_NO_INTS = (np.zeros((1, 1), np.int32),)


@dataclass(frozen=True)
class Call:
    """The arguments of a draw as the kernels take them."""

    framebuffer: Framebuffer | None
    buffers: tuple[tuple[np.ndarray, np.ndarray], ...]
    indices: np.ndarray
    assembly: Assembly
    instances: int
    view: tuple[np.float32, ...]
    bounds: tuple[np.float32, ...]
    bias: tuple[np.float32, ...]
    test_values: tuple[Any, ...]
    blend_constant: tuple[np.float32, ...]
    input_floats: tuple[np.ndarray, ...]
    input_ints: tuple[np.ndarray, ...]


def checked_draw(
    pipeline: Pipeline,
    framebuffer: Framebuffer | None,
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
    for name, value, kind in (("pipeline", pipeline, Pipeline), ("dynamic", dynamic, DynamicState)):
        if not isinstance(value, kind):
            raise InputError(f"{name} must be a {kind.__name__}, not {type(value).__name__}.")
    if not isinstance(framebuffer, Framebuffer) and not (framebuffer is None and pipeline.rasterizer_discard):
        raise InputError(f"framebuffer must be a Framebuffer, not {type(framebuffer).__name__}.")
    if loop not in ("auto", "dense", "list"):
        raise InputError(f"{pipeline.label}: loop must be 'auto', 'dense' or 'list', not {loop!r}.")
    buffers = vertices if isinstance(vertices, tuple) else (vertices,)
    if not all(isinstance(buffer, VertexBuffer) for buffer in buffers):
        raise InputError(f"{pipeline.label}: vertices must be a VertexBuffer or a tuple of them.")
    assembly, indices_array = _assembly(pipeline, buffers, indices, instances, vertex_count)
    input_floats: tuple[np.ndarray, ...] = _NO_FLOATS
    input_ints: tuple[np.ndarray, ...] = _NO_INTS
    check_textures(pipeline.label, textures)
    dynamic = with_rectangles(pipeline.label, dynamic)
    viewport = dynamic.viewport or Viewport(0, 0, 1, 1)
    bounds: tuple[np.float32, ...] = (np.float32(0),) * 4
    if framebuffer is not None:
        _check_targets(pipeline, framebuffer)
        input_floats, input_ints = _inputs(pipeline, framebuffer, textures)
        _check_feedback(pipeline, framebuffer, "uniform", uniforms)
        _check_feedback(pipeline, framebuffer, "texture", textures)
        viewport = dynamic.viewport or Viewport(0, 0, framebuffer.width, framebuffer.height)
        _check_viewport(pipeline, framebuffer, viewport)
        bounds = _bounds(pipeline, framebuffer, dynamic, viewport)
    values = (dynamic.stencil_reference, dynamic.stencil_read_mask, dynamic.stencil_write_mask)
    if not all(_is_whole(value) and 0 <= value <= 255 for value in values):
        raise InputError(f"{pipeline.label}: stencil reference and masks are 8-bit values, not {values}.")
    constant = dynamic.blend_constant
    if not (isinstance(constant, tuple) and len(constant) == 4 and all(_is_finite(part) for part in constant)):
        raise InputError(f"{pipeline.label}: blend_constant must be four finite numbers, not {constant!r}.")
    return Call(
        framebuffer,
        tuple((buffer.floats, buffer.ints) for buffer in buffers),
        indices_array,
        assembly,
        int(instances),
        tuple(screen_map(*viewport)),
        bounds,
        _bias(pipeline),
        (*(np.int32(value) for value in values), np.float32(viewport.min_depth), np.float32(viewport.max_depth)),
        tuple(np.float32(part) for part in constant),
        input_floats,
        input_ints,
    )


def _assembly(
    pipeline: Pipeline,
    buffers: tuple[VertexBuffer, ...],
    indices: np.ndarray | None,
    instances: int,
    vertex_count: int | None,
) -> tuple[Assembly, np.ndarray]:
    """How vertices make primitives, and the index array without restarts (empty without indices)."""
    if not _is_whole(instances) or instances < 0:
        raise InputError(f"{pipeline.label}: instances must be a whole number of at least 0, not {instances!r}.")
    layouts = pipeline.vertex.buffers
    if len(buffers) != len(layouts):
        raise InputError(f"{pipeline.label}: {len(layouts)} vertex buffers are declared, {len(buffers)} were given.")
    for buffer, layout in zip(buffers, layouts, strict=True):
        if buffer.attributes is not layout.attributes:
            expected, got = layout.attributes.__name__, buffer.attributes.__name__
            raise InputError(f"{pipeline.label}: a vertex buffer of {expected} is declared, one of {got} was given.")
        if layout.step_mode == VertexStepMode.INSTANCE and buffer.rows < instances:
            raise InputError(f"{pipeline.label}: {instances} instances need more than {buffer.rows} rows.")
    pairs = zip(buffers, layouts, strict=True)
    per_vertex = [buffer.rows for buffer, layout in pairs if layout.step_mode == VertexStepMode.VERTEX]
    available = min(per_vertex) if per_vertex else None
    corners = pipeline.topology.corners
    if indices is not None:
        if vertex_count is not None:
            raise InputError(f"{pipeline.label}: vertex_count is for draws without indices; leave one of them out.")
        given = np.asarray(indices)
        if given.size and given.dtype.kind not in "iu":
            raise InputError(f"{pipeline.label}: indices must be whole numbers, not {given.dtype}.")
        places = restart_places(pipeline.topology, given.ravel())
        assembly = assembled(pipeline.topology, given.size, places)
        array = np.delete(np.ascontiguousarray(given, np.int64).ravel(), places)
        outside = (array < 0) | (array >= (available if available is not None else np.iinfo(np.int32).max))
        if outside.any():
            place = int(np.argmax(outside))
            value = given.ravel()[place]
            raise InputError(f"{pipeline.label}: index {place} is {value}, but there are {available} vertices.")
        return assembly, array
    count = vertex_count if vertex_count is not None else (available if available is not None else corners)
    if not _is_whole(count) or count < 0:
        raise InputError(f"{pipeline.label}: vertex_count must be a whole number of at least 0, not {count!r}.")
    if available is not None and count > available:
        raise InputError(f"{pipeline.label}: vertex_count is {count}, but there are {available} vertices.")
    return assembled(pipeline.topology, int(count)), np.empty(0, np.int64)


def _check_targets(pipeline: Pipeline, framebuffer: Framebuffer) -> None:
    """Outputs and targets must agree, and the formats of depth and stencil."""
    check_targets(pipeline, framebuffer)
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
    if pipeline.fragment is not None and pipeline.fragment.inputs is not None:
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
    return tuple(planes["f"]) or _NO_FLOATS, tuple(planes["i"]) or _NO_INTS


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


def _is_finite(value: Any) -> bool:
    """Whether float32 holds `value` as a finite number."""
    is_number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return is_number and abs(float(value)) <= float(np.finfo(np.float32).max)


def _is_whole(value: Any) -> bool:
    """Whether `value` is an integer, Python's or NumPy's, and no truth value."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _check_viewport(pipeline: Pipeline, framebuffer: Framebuffer, viewport: Viewport) -> None:
    sized = np.isfinite(viewport).all() and viewport.width > 0 and viewport.height > 0
    if not (sized and 0 <= viewport.min_depth <= viewport.max_depth <= 1):
        raise InputError(
            f"{pipeline.label}: {viewport} needs finite numbers, a positive size and 0 ≤ min_depth ≤ max_depth ≤ 1."
        )
    ends = (viewport.x, viewport.y, viewport.x + viewport.width, viewport.y + viewport.height)
    if pipeline.rasterized.is_triangles and (min(ends) < -MAX_PIXELS or max(ends) > MAX_PIXELS):
        raise InputError(f"{pipeline.label}: {viewport} leaves ±{MAX_PIXELS} pixels, as far as triangles are drawn.")
    if pipeline.rasterized.is_triangles and max(framebuffer.width, framebuffer.height) > MAX_PIXELS:
        raise InputError(
            f"{pipeline.label}: a framebuffer of {framebuffer.width} × {framebuffer.height} pixels is too large for "
            f"triangles; {MAX_PIXELS} is the most."
        )


def _bias(pipeline: Pipeline) -> tuple[np.float32, ...]:
    """Depth bias: constant, slope scale, clamp, and the step of a fixed-point format (0: float32)."""
    state = pipeline.depth_stencil
    step = 1 / (2**24 - 1) if state.format == DepthStencilFormat.DEPTH24UNORM_STENCIL8 else 0
    values = (state.depth_bias, state.depth_bias_slope_scale, state.depth_bias_clamp, step)
    return tuple(np.float32(value) for value in values)


def _bounds(
    pipeline: Pipeline, framebuffer: Framebuffer, dynamic: DynamicState, viewport: Viewport
) -> tuple[np.float32, ...]:
    """Pixels that may be drawn, [x0, x1) × [y0, y1): the scissor within the framebuffer; triangles stay within the
    viewport too, as they are not cut at its sides."""
    x, y, width, height = dynamic.scissor or (0, 0, framebuffer.width, framebuffer.height)
    if not all(_is_whole(part) for part in (x, y, width, height)):
        raise InputError(f"{pipeline.label}: scissor {dynamic.scissor} must be whole pixels.")
    if min(x, y, width, height) < 0 or x + width > framebuffer.width or y + height > framebuffer.height:
        raise InputError(f"{pipeline.label}: scissor {dynamic.scissor} leaves the framebuffer.")
    box = [x, y, x + width, y + height]
    if pipeline.rasterized.is_triangles:
        ends = (viewport.x, viewport.y, viewport.x + viewport.width, viewport.y + viewport.height)
        centres = [math.ceil(end - 0.5) for end in ends]
        box = [max(box[0], centres[0]), max(box[1], centres[1]), min(box[2], centres[2]), min(box[3], centres[3])]
    return tuple(np.float32(edge) for edge in box)
