"""Pipeline state as values: WebGPU's names and defaults, OpenGL's and Direct3D's where WebGPU has none (quads, point
size, geometry shader, stream output).

Nothing here runs. Operations, comparisons and formats are constants of a compiled draw; masks, references, constants,
viewport and scissor are run-time values (`DynamicState`), so that changing them between draws compiles nothing.
Lines, adjacency, multisampling and logic operations are left out. What cannot be combined is refused when a
`Pipeline` is made (`refsim.pipeline.legality`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from refsim.pipeline.enums import (
    BlendFactor as BlendFactor,
)
from refsim.pipeline.enums import (
    BlendOperation as BlendOperation,
)
from refsim.pipeline.enums import (
    ColorWrite as ColorWrite,
)
from refsim.pipeline.enums import (
    CompareFunction as CompareFunction,
)
from refsim.pipeline.enums import (
    CullMode as CullMode,
)
from refsim.pipeline.enums import (
    DepthStencilFormat as DepthStencilFormat,
)
from refsim.pipeline.enums import (
    EarlyTests as EarlyTests,
)
from refsim.pipeline.enums import (
    FrontFace as FrontFace,
)
from refsim.pipeline.enums import (
    PrimitiveTopology as PrimitiveTopology,
)
from refsim.pipeline.enums import (
    StencilOperation as StencilOperation,
)
from refsim.pipeline.enums import (
    TextureFormat as TextureFormat,
)
from refsim.pipeline.enums import (
    VertexStepMode as VertexStepMode,
)
from refsim.pipeline.enums import (
    member as member,
)


class StencilFaceState(NamedTuple):
    """One face's stencil test (WebGPU ``GPUStencilFaceState``)."""

    compare: CompareFunction = CompareFunction.ALWAYS
    fail_op: StencilOperation = StencilOperation.KEEP
    depth_fail_op: StencilOperation = StencilOperation.KEEP
    pass_op: StencilOperation = StencilOperation.KEEP


class DepthStencilState(NamedTuple):
    """Depth and stencil state (WebGPU ``GPUDepthStencilState``). Points and quads face the front.

    The bias of a triangle's depth is ``depth_bias`` · r + ``depth_bias_slope_scale`` · (its steepest depth change a
    pixel), where r is the smallest step of the format; ``depth_bias_clamp`` bounds it if not 0.
    """

    format: DepthStencilFormat = DepthStencilFormat.DEPTH32FLOAT_STENCIL8
    depth_write_enabled: bool = False
    depth_compare: CompareFunction = CompareFunction.ALWAYS
    stencil_front: StencilFaceState = StencilFaceState()
    stencil_back: StencilFaceState = StencilFaceState()
    depth_bias: int = 0
    depth_bias_slope_scale: float = 0.0
    depth_bias_clamp: float = 0.0


class BlendComponent(NamedTuple):
    """source · source factor (operation) destination · destination factor, for colour or alpha."""

    operation: BlendOperation = BlendOperation.ADD
    src_factor: BlendFactor = BlendFactor.ONE
    dst_factor: BlendFactor = BlendFactor.ZERO


class BlendState(NamedTuple):
    """How a fragment's colour is joined with the one stored (WebGPU ``GPUBlendState``)."""

    color: BlendComponent = BlendComponent()
    alpha: BlendComponent = BlendComponent()


class ColorTargetState(NamedTuple):
    """What a fragment does to one colour target. `blend` None: it replaces what is stored."""

    blend: BlendState | None = None
    write_mask: ColorWrite = ColorWrite.ALL


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
    blend_constant: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class VertexBufferLayout:
    """The NamedTuple whose fields are a buffer's attributes, and how the buffer advances."""

    attributes: type
    step_mode: VertexStepMode = VertexStepMode.VERTEX


@dataclass(frozen=True)
class VertexState:
    """Vertex stage.

    ``shader(uniforms, textures, attributes, vertex_index, instance_index)`` returns ``(position vec4, point_size f32,
    varyings)``, where ``attributes`` is a tuple with one NamedTuple per buffer. Over a triangle a varying is
    interpolated as its annotation says (`refsim.pipeline.interpolation`): perspective-correct by default.
    """

    shader: Callable[..., Any]
    varyings: type
    buffers: tuple[VertexBufferLayout, ...] = ()


@dataclass(frozen=True)
class GeometryState:
    """Geometry stage (Direct3D 10, OpenGL 3.2; WebGPU has none).

    ``shader(uniforms, textures, vertices, primitive_index)`` returns a tuple of `max_vertices` entries ``(emission,
    position vec4, point_size f32, varyings)``, taken in order. `emission` is `SKIP`, `EMIT` or `EMIT_AND_END` (of
    `refsim.pipeline.geometry`): nothing, a vertex, or a vertex that ends its strip. ``vertices`` has one ``(position,
    point_size, varyings)`` per corner of the primitive; ``primitive_index`` counts within an instance. `output` is
    `POINT_LIST` or `TRIANGLE_STRIP`.
    """

    shader: Callable[..., Any]
    varyings: type
    output: PrimitiveTopology
    max_vertices: int


@dataclass(frozen=True)
class StreamOutputState:
    """What is captured of every primitive before it is rasterised: records of the NamedTuple class `record`.

    A field is ``position`` (vec4), ``point_size`` (f32) or a varying of the last stage before the rasteriser, of the
    same name and type. Points are captured as one record, triangles (strips too) as three.
    """

    record: type


@dataclass(frozen=True)
class FragmentState:
    """Fragment stage.

    ``shader(uniforms, textures, varyings, inputs, pixel) -> (keep bool, depth f32, outputs)``; ``inputs`` holds the
    texels of the fragment's own pixel (Vulkan's input attachments: each field of `inputs` names a texture of the
    draw), ``pixel`` is (x, y) int32, and ``outputs`` is a NamedTuple whose fields are the framebuffer's targets.
    `writes_depth` and `discards` say whether the returned depth and keep are used. `targets` has one state for each
    field of `outputs`, in order; empty: every target is replaced. A blend factor `SRC1…` reads the second source, the
    field named ``src1`` that then stands last in `outputs` and is no target.
    """

    shader: Callable[..., Any]
    outputs: type
    inputs: type | None = None
    writes_depth: bool = False
    discards: bool = False
    targets: tuple[ColorTargetState, ...] = ()


NO_DEPTH_STENCIL = DepthStencilState()


@dataclass(frozen=True)
class Pipeline:
    """All state that a draw is compiled from. A value: make it once, draw with it often.

    `fragment` None: depth and stencil only. `rasterizer_discard`: nothing is rasterised; what the stages before made
    is seen by stream output and taps.
    """

    vertex: VertexState
    fragment: FragmentState | None = None
    topology: PrimitiveTopology = PrimitiveTopology.POINT_LIST
    depth_stencil: DepthStencilState = NO_DEPTH_STENCIL
    early_tests: EarlyTests = EarlyTests.IDEAL
    label: str = "draw"
    front_face: FrontFace = FrontFace.CCW
    cull_mode: CullMode = CullMode.NONE
    geometry: GeometryState | None = None
    stream_output: StreamOutputState | None = None
    rasterizer_discard: bool = False

    def __post_init__(self) -> None:
        from refsim.pipeline.legality import check_pipeline

        check_pipeline(self)

    @property
    def rasterized(self) -> PrimitiveTopology:
        """The topology that reaches the rasteriser: the geometry stage's, if there is one."""
        return self.geometry.output if self.geometry else self.topology

    @property
    def last_varyings(self) -> type:
        """The varyings of the last stage before the rasteriser."""
        return self.geometry.varyings if self.geometry else self.vertex.varyings
