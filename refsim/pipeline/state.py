"""Pipeline state as values: WebGPU's names and defaults, OpenGL's where WebGPU has none (quads, point size).

Nothing here runs. Operations, comparisons and formats are constants of a compiled draw; masks, references, viewport
and scissor are run-time values (`DynamicState`), so that changing them between draws compiles nothing.

What the pipeline does not draw yet has no name here: triangles, lines, blending.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum, StrEnum
from typing import Any, NamedTuple

from refsim.errors import InputError


class CompareFunction(IntEnum):
    """A comparison of the new value with the stored one (stencil: of the masked reference with the masked value)."""

    NEVER = 0
    LESS = 1
    EQUAL = 2
    LESS_EQUAL = 3
    GREATER = 4
    NOT_EQUAL = 5
    GREATER_EQUAL = 6
    ALWAYS = 7


class StencilOperation(IntEnum):
    """What becomes of a stencil value (8 bits) after the tests."""

    KEEP = 0
    ZERO = 1
    REPLACE = 2
    INVERT = 3
    INCREMENT_CLAMP = 4
    DECREMENT_CLAMP = 5
    INCREMENT_WRAP = 6
    DECREMENT_WRAP = 7


class DepthStencilFormat(IntEnum):
    """`DEPTH32FLOAT_STENCIL8` keeps float32; `DEPTH24UNORM_STENCIL8` rounds to 24 bits fixed point, then compares."""

    DEPTH32FLOAT_STENCIL8 = 0
    DEPTH24UNORM_STENCIL8 = 1


class EarlyTests(StrEnum):
    """When stencil and depth are tested before the fragment shader. All but `FORCED` give the same picture.

    `IDEAL` rejects early whenever that cannot be seen in the result. `MESA` does so only if the shader neither writes
    depth nor discards (what Mesa's software rasterisers do). `NONE` never does. `FORCED` is GLSL's
    ``early_fragment_tests``: tests *and updates* come first, and a depth that the shader writes is ignored.
    """

    IDEAL = "ideal"
    MESA = "mesa"
    NONE = "none"
    FORCED = "forced"


class PrimitiveTopology(StrEnum):
    """`POINT_LIST`: square sprites of the vertex shader's size. `QUAD_LIST`: four vertices span a rectangle of the
    screen (OpenGL's ``GL_QUADS``, axis-aligned only), each pixel of it once."""

    POINT_LIST = "point-list"
    QUAD_LIST = "quad-list"


class VertexStepMode(StrEnum):
    """Whether a vertex buffer advances with the vertex or with the instance."""

    VERTEX = "vertex"
    INSTANCE = "instance"


class TextureFormat(StrEnum):
    """Formats of colour targets and textures; 32 bits a component, stored as planes."""

    R32FLOAT = "r32float"
    RG32FLOAT = "rg32float"
    RGB32FLOAT = "rgb32float"
    RGBA32FLOAT = "rgba32float"
    R32SINT = "r32sint"
    RG32SINT = "rg32sint"
    RGB32SINT = "rgb32sint"
    RGBA32SINT = "rgba32sint"

    @property
    def components(self) -> int:
        """Number of planes."""
        return self.value.index("32")

    @property
    def is_float(self) -> bool:
        """True for float32, False for int32."""
        return self.value.endswith("float")


class StencilFaceState(NamedTuple):
    """One face's stencil test (WebGPU ``GPUStencilFaceState``)."""

    compare: CompareFunction = CompareFunction.ALWAYS
    fail_op: StencilOperation = StencilOperation.KEEP
    depth_fail_op: StencilOperation = StencilOperation.KEEP
    pass_op: StencilOperation = StencilOperation.KEEP


class DepthStencilState(NamedTuple):
    """Depth and stencil state (WebGPU ``GPUDepthStencilState``). Points and quads face the front."""

    format: DepthStencilFormat = DepthStencilFormat.DEPTH32FLOAT_STENCIL8
    depth_write_enabled: bool = False
    depth_compare: CompareFunction = CompareFunction.ALWAYS
    stencil_front: StencilFaceState = StencilFaceState()


class Viewport(NamedTuple):
    """Pixels; depth range within [0, 1]."""

    x: float
    y: float
    width: float
    height: float
    min_depth: float = 0.0
    max_depth: float = 1.0


class ScissorRect(NamedTuple):
    """Pixels; fragments outside are never made."""

    x: int
    y: int
    width: int
    height: int


class DynamicState(NamedTuple):
    """Run-time values of a draw. `None`: the whole framebuffer."""

    viewport: Viewport | None = None
    scissor: ScissorRect | None = None
    stencil_reference: int = 0
    stencil_read_mask: int = 0xFF
    stencil_write_mask: int = 0xFF


@dataclass(frozen=True)
class VertexBufferLayout:
    """The NamedTuple whose fields are a buffer's attributes, and how the buffer advances."""

    attributes: type
    step_mode: VertexStepMode = VertexStepMode.VERTEX


@dataclass(frozen=True)
class VertexState:
    """Vertex stage.

    ``shader(uniforms, textures, attributes, vertex_index, instance_index)`` returns ``(position vec4, point_size f32,
    varyings)``, where ``attributes`` is a tuple with one NamedTuple per buffer.
    """

    shader: Callable[..., Any]
    varyings: type
    buffers: tuple[VertexBufferLayout, ...] = ()


@dataclass(frozen=True)
class FragmentState:
    """Fragment stage.

    ``shader(uniforms, textures, varyings, inputs, pixel) -> (keep bool, depth f32, outputs)``; ``inputs`` holds the
    texels of the fragment's own pixel (Vulkan's input attachments: each field of `inputs` names a texture of the
    draw), ``pixel`` is (x, y) int32, and ``outputs`` is a NamedTuple whose fields are the framebuffer's targets.
    `writes_depth` and `discards` say whether the returned depth and keep are used.
    """

    shader: Callable[..., Any]
    outputs: type
    inputs: type | None = None
    writes_depth: bool = False
    discards: bool = False


NO_DEPTH_STENCIL = DepthStencilState()


@dataclass(frozen=True)
class Pipeline:
    """All state that a draw is compiled from. A value: make it once, draw with it often."""

    vertex: VertexState
    fragment: FragmentState
    topology: PrimitiveTopology = PrimitiveTopology.POINT_LIST
    depth_stencil: DepthStencilState = NO_DEPTH_STENCIL
    early_tests: EarlyTests = EarlyTests.IDEAL
    label: str = "draw"

    def __post_init__(self) -> None:
        for name, enum in (("topology", PrimitiveTopology), ("early_tests", EarlyTests)):
            object.__setattr__(self, name, member(self.label, name, enum, getattr(self, name)))
        state, face = self.depth_stencil, self.depth_stencil.stencil_front
        member(self.label, "depth_stencil.format", DepthStencilFormat, state.format)
        member(self.label, "depth_stencil.depth_compare", CompareFunction, state.depth_compare)
        member(self.label, "stencil_front.compare", CompareFunction, face.compare)
        for name in ("fail_op", "depth_fail_op", "pass_op"):
            member(self.label, f"stencil_front.{name}", StencilOperation, getattr(face, name))
        for stage, shader in (("vertex", self.vertex.shader), ("fragment", self.fragment.shader)):
            if not hasattr(shader, "py_func"):
                raise InputError(f"{self.label}: the {stage} shader {shader!r} is not marked with @refsim.func.")


def member(label: str, name: str, enum: type[Enum], value: object) -> Enum:
    """The member of `enum` that `value` is or spells; `InputError` names the field and what it may be."""
    try:
        return enum(value)
    except ValueError:
        known = ", ".join(f"{part.name} ({part.value})" for part in enum)
        raise InputError(f"{label}: {name} is {value!r}; it must be one of {known}.") from None
