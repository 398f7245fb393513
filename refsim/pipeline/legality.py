"""Which states can be combined: checked when a `Pipeline` is made, one sentence naming the field."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args

from refsim.errors import InputError
from refsim.pipeline.color_writes import READS_ALPHA, reads_second_source, second_source, target_fields
from refsim.pipeline.enums import (
    BlendFactor,
    BlendOperation,
    ColorWrite,
    CompareFunction,
    CullMode,
    DepthStencilFormat,
    EarlyTests,
    FrontFace,
    PrimitiveTopology,
    StencilOperation,
    VertexStepMode,
    member,
)
from refsim.pipeline.interpolation import interpolation_of
from refsim.pipeline.layout import Layout
from refsim.pipeline.state import (
    BlendComponent,
    BlendState,
    ColorTargetState,
    DepthStencilState,
    FragmentState,
    GeometryState,
    StencilFaceState,
    StreamOutputState,
    VertexBufferLayout,
    VertexState,
)

if TYPE_CHECKING:
    from refsim.pipeline.state import Pipeline

MAX_EMITTED = 1024
LARGEST_FLOAT32 = (2 - 2.0**-23) * 2.0**127


def check_pipeline(pipeline: Pipeline) -> None:
    """Raises `InputError` for a state that means nothing; puts enumeration members in the place of their values."""
    _check_classes(pipeline)
    fields = {
        "topology": PrimitiveTopology, "early_tests": EarlyTests, "front_face": FrontFace, "cull_mode": CullMode
    }  # fmt: skip
    for name, enum in fields.items():
        object.__setattr__(pipeline, name, member(pipeline.label, name, enum, getattr(pipeline, name)))
    _check_shaders(pipeline)
    _check_depth_stencil(pipeline)
    _check_color_targets(pipeline)
    _check_geometry(pipeline)
    _check_rasterizer(pipeline)
    if pipeline.rasterized.is_triangles:
        interpolation_of(pipeline.last_varyings)


def _check_classes(pipeline: Pipeline) -> None:
    """Every field holds an object of the class that it is for, before anything is read from it."""
    label: object = pipeline.label
    if not isinstance(label, str):
        raise InputError(f"label must be a str, not {label!r}.")
    classes = {
        "vertex": VertexState, "fragment": FragmentState | None, "depth_stencil": DepthStencilState,
        "geometry": GeometryState | None, "stream_output": StreamOutputState | None,
    }  # fmt: skip
    for name, wanted in classes.items():
        _check_class(label, name, wanted, getattr(pipeline, name))
    for side in ("stencil_front", "stencil_back"):
        _check_class(label, f"depth_stencil.{side}", StencilFaceState, getattr(pipeline.depth_stencil, side))
    buffers: object = pipeline.vertex.buffers
    if not isinstance(buffers, tuple):
        raise InputError(f"{label}: vertex.buffers must be a tuple of VertexBufferLayout, not {buffers!r}.")
    for number, layout in enumerate(buffers):
        name = f"vertex.buffers[{number}]"
        _check_class(label, name, VertexBufferLayout, layout)
        step_mode = member(label, f"{name}.step_mode", VertexStepMode, layout.step_mode)
        object.__setattr__(layout, "step_mode", step_mode)
        _check_columns(label, f"{name}.attributes", layout.attributes)
    _check_columns(label, "vertex.varyings", pipeline.vertex.varyings)
    if pipeline.geometry is not None:
        _check_columns(label, "geometry.varyings", pipeline.geometry.varyings)
    if pipeline.fragment is not None:
        _check_columns(label, "fragment.outputs", pipeline.fragment.outputs)
        if pipeline.fragment.inputs is not None:
            _check_columns(label, "fragment.inputs", pipeline.fragment.inputs)


def _check_class(label: str, name: str, wanted: Any, value: object) -> None:
    if not isinstance(value, wanted):
        names = " or ".join(part.__name__.replace("NoneType", "None") for part in get_args(wanted) or (wanted,))
        raise InputError(f"{label}: {name} must be a {names}, not {value!r}.")


def _check_columns(label: str, name: str, value: object) -> None:
    """Whether `value` is a NamedTuple class of numbers (`refsim.pipeline.layout`)."""
    if not isinstance(value, type):
        raise InputError(f"{label}: {name}: {value!r} is not a NamedTuple class, so it has no columns.")
    try:
        Layout.of(value)
    except InputError as error:
        raise InputError(f"{label}: {name}: {error}") from error


def _check_shaders(pipeline: Pipeline) -> None:
    stages = {"vertex": pipeline.vertex, "geometry": pipeline.geometry, "fragment": pipeline.fragment}
    for name, stage in stages.items():
        if stage is not None and not hasattr(stage.shader, "py_func"):
            raise InputError(f"{pipeline.label}: the {name} shader {stage.shader!r} is not marked with @refsim.func.")


def _check_depth_stencil(pipeline: Pipeline) -> None:
    label, state = pipeline.label, pipeline.depth_stencil
    member(label, "depth_stencil.format", DepthStencilFormat, state.format)
    member(label, "depth_stencil.depth_compare", CompareFunction, state.depth_compare)
    for side, face in (("stencil_front", state.stencil_front), ("stencil_back", state.stencil_back)):
        member(label, f"{side}.compare", CompareFunction, face.compare)
        for name in ("fail_op", "depth_fail_op", "pass_op"):
            member(label, f"{side}.{name}", StencilOperation, getattr(face, name))
    bias = (state.depth_bias, state.depth_bias_slope_scale, state.depth_bias_clamp)
    if not all(isinstance(part, int | float) and abs(part) <= LARGEST_FLOAT32 for part in bias):
        raise InputError(f"{label}: depth_bias, its slope scale and its clamp must be finite float32s, not {bias}.")
    if not isinstance(state.depth_bias, int) or isinstance(state.depth_bias, bool) or abs(state.depth_bias) >= 2**31:
        raise InputError(f"{label}: depth_bias counts steps of the format: an int32, not {state.depth_bias!r}.")
    if any(bias) and not pipeline.rasterized.is_triangles:
        raise InputError(f"{label}: depth_bias is for triangles; {pipeline.rasterized.value} has none.")


def _check_color_targets(pipeline: Pipeline) -> None:
    label, fragment = pipeline.label, pipeline.fragment
    if fragment is None or not fragment.targets:
        return
    if not isinstance(fragment.targets, tuple):
        raise InputError(f"{label}: fragment.targets must be a tuple, not {type(fragment.targets).__name__}.")
    for number, state in enumerate(fragment.targets):
        _check_color_target(label, f"fragment.targets[{number}]", state)
    fields, second = target_fields(fragment), second_source(fragment)
    if len(fragment.targets) != len(fields):
        raise InputError(f"{label}: fragment.targets has {len(fragment.targets)} states for {len(fields)} outputs.")
    for number, (field, state) in enumerate(zip(fields, fragment.targets, strict=True)):
        name, parts = f"{label}: fragment.targets[{number}].blend", state.blend
        if parts is None:
            continue
        if field.kind == "i":
            raise InputError(f"{name} must be None: the output {field.name!r} is a whole number.")
        factors = {parts.color.src_factor, parts.color.dst_factor}
        if factors & READS_ALPHA and field.size < 4:
            raise InputError(f"{name}.color reads the source's alpha, which the output {field.name!r} has not.")
        if not reads_second_source(state):
            continue
        if second is None or (second.kind, second.size) != (field.kind, field.size):
            raise InputError(f"{name} reads the second source: outputs needs a last field 'src1' like {field.name!r}.")
        if len(fields) != 1:
            raise InputError(f"{name} reads the second source, which only a lone target may; there are {len(fields)}.")


def _check_color_target(label: str, name: str, state: ColorTargetState) -> None:
    if not isinstance(state, ColorTargetState) or not isinstance(state.blend, BlendState | None):
        raise InputError(f"{label}: {name} must be a ColorTargetState of a BlendState or None, not {state!r}.")
    mask: object = state.write_mask
    if not isinstance(mask, int) or isinstance(mask, bool) or not 0 <= mask <= ColorWrite.ALL:
        raise InputError(f"{label}: {name}.write_mask is {mask!r}; it must be made of ColorWrite, 0 to 15.")
    for side in ("color", "alpha") if state.blend is not None else ():
        part, path = getattr(state.blend, side), f"{name}.blend.{side}"
        if not isinstance(part, BlendComponent):
            raise InputError(f"{label}: {path} must be a BlendComponent, not {part!r}.")
        operation = member(label, f"{path}.operation", BlendOperation, part.operation)
        for field in ("src_factor", "dst_factor"):
            factor = member(label, f"{path}.{field}", BlendFactor, getattr(part, field))
            if operation in (BlendOperation.MIN, BlendOperation.MAX) and factor != BlendFactor.ONE:
                raise InputError(f"{label}: {path}.{field} must be one with {operation.value}, not {factor.value}.")


def _check_geometry(pipeline: Pipeline) -> None:
    label, geometry = pipeline.label, pipeline.geometry
    if geometry is None:
        return
    output = member(label, "geometry.output", PrimitiveTopology, geometry.output)
    if output not in (PrimitiveTopology.POINT_LIST, PrimitiveTopology.TRIANGLE_STRIP):
        raise InputError(f"{label}: geometry.output is {output.value!r}; it must be point-list or triangle-strip.")
    object.__setattr__(geometry, "output", output)
    if pipeline.topology == PrimitiveTopology.QUAD_LIST:
        raise InputError(f"{label}: topology quad-list cannot feed a geometry shader; give points or triangles.")
    count = geometry.max_vertices
    if not isinstance(count, int) or isinstance(count, bool) or not 0 <= count <= MAX_EMITTED:
        raise InputError(f"{label}: geometry.max_vertices must be a whole number, 0 to {MAX_EMITTED}, not {count!r}.")


def _check_rasterizer(pipeline: Pipeline) -> None:
    label = pipeline.label
    if pipeline.rasterizer_discard and pipeline.fragment is not None:
        raise InputError(f"{label}: rasterizer_discard leaves no fragments, so fragment must be None.")
    if pipeline.cull_mode != CullMode.NONE and not pipeline.rasterized.is_triangles:
        raise InputError(f"{label}: cull_mode is for triangles; {pipeline.rasterized.value} always faces the front.")
    if pipeline.stream_output is not None and pipeline.topology == PrimitiveTopology.QUAD_LIST:
        raise InputError(f"{label}: stream_output captures points and triangles, not quad-list.")
    if pipeline.stream_output is not None:
        from refsim.pipeline.stream_output import check_record

        check_record(label, pipeline.stream_output.record, pipeline.last_varyings)
