"""Names of everything a pipeline can be set to: WebGPU's enumerations, OpenGL's or Direct3D's where WebGPU has none.

Operations, comparisons and formats are constants of a compiled draw. Values of string enumerations are WebGPU's own.
"""

from __future__ import annotations

from enum import Enum, IntEnum, IntFlag, StrEnum

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
    screen (OpenGL's ``GL_QUADS``, axis-aligned only), each pixel of it once. `TRIANGLE_LIST`: three vertices each.
    `TRIANGLE_STRIP`: every vertex after the first two makes a triangle with the two before it; triangle i has the
    vertices (i, i + 1, i + 2), or (i, i + 2, i + 1) if i is odd, so that all wind alike and i provokes (Vulkan)."""

    POINT_LIST = "point-list"
    QUAD_LIST = "quad-list"
    TRIANGLE_LIST = "triangle-list"
    TRIANGLE_STRIP = "triangle-strip"

    @property
    def corners(self) -> int:
        """Vertices of one primitive."""
        return {"point-list": 1, "quad-list": 4}.get(self.value, 3)

    @property
    def is_triangles(self) -> bool:
        """Whether its primitives are triangles."""
        return self.corners == 3


# What exists elsewhere and is left out here, with the reason that an error gives
LEFT_OUT = {
    "line-list": "lines are left out: no method of the papers draws one",
    "line-strip": "lines are left out: no method of the papers draws one",
    "line-list-with-adjacency": "adjacency is left out: no method of the papers reads a neighbour",
    "line-strip-with-adjacency": "adjacency is left out: no method of the papers reads a neighbour",
    "triangle-list-with-adjacency": "adjacency is left out: no method of the papers reads a neighbour",
    "triangle-strip-with-adjacency": "adjacency is left out: no method of the papers reads a neighbour",
}


class FrontFace(StrEnum):
    """Which way round the vertices of a front-facing triangle stand on the screen."""

    CCW = "ccw"
    CW = "cw"


class CullMode(StrEnum):
    """Which triangles are dropped by the way they face."""

    NONE = "none"
    FRONT = "front"
    BACK = "back"


class BlendFactor(StrEnum):
    """What a colour is multiplied by before the blend operation (WebGPU ``GPUBlendFactor``). The four `SRC1` factors
    read the fragment's second source (dual-source blending)."""

    ZERO = "zero"
    ONE = "one"
    SRC = "src"
    ONE_MINUS_SRC = "one-minus-src"
    SRC_ALPHA = "src-alpha"
    ONE_MINUS_SRC_ALPHA = "one-minus-src-alpha"
    DST = "dst"
    ONE_MINUS_DST = "one-minus-dst"
    DST_ALPHA = "dst-alpha"
    ONE_MINUS_DST_ALPHA = "one-minus-dst-alpha"
    SRC_ALPHA_SATURATED = "src-alpha-saturated"
    CONSTANT = "constant"
    ONE_MINUS_CONSTANT = "one-minus-constant"
    SRC1 = "src1"
    ONE_MINUS_SRC1 = "one-minus-src1"
    SRC1_ALPHA = "src1-alpha"
    ONE_MINUS_SRC1_ALPHA = "one-minus-src1-alpha"


class BlendOperation(StrEnum):
    """How the two products are joined (WebGPU ``GPUBlendOperation``); `MIN` and `MAX` ignore the factors."""

    ADD = "add"
    SUBTRACT = "subtract"
    REVERSE_SUBTRACT = "reverse-subtract"
    MIN = "min"
    MAX = "max"


class ColorWrite(IntFlag):
    """Which components of a target are written (WebGPU ``GPUColorWrite``)."""

    NONE = 0
    RED = 1
    GREEN = 2
    BLUE = 4
    ALPHA = 8
    ALL = 15


class VertexStepMode(StrEnum):
    """Whether a vertex buffer advances with the vertex or with the instance."""

    VERTEX = "vertex"
    INSTANCE = "instance"


class PrimitiveFate(IntEnum):
    """What became of a primitive that reached the rasteriser (`RasterTap.fate`; counters ``raster.…`` count them).

    `DRAWN`: it went on to the fragment stage, whole or in pieces. `CLIPPED`: a triangle beyond one side of the clip
    volume, of which clipping left nothing or a position is no number; a point or quad with a vertex outside. `EMPTY`:
    without area, or no pixel centre of scissor and viewport lies in its bounding box. `CROOKED`: a quad that is no
    axis-aligned rectangle of the screen (the draw is refused, so no tap holds it). `CULLED`: a triangle dropped for its
    facing, whether or not it would have met a pixel.
    """

    DRAWN = 0
    CLIPPED = 1
    EMPTY = 2
    CROOKED = 3
    CULLED = 4


class FragmentFate(IntEnum):
    """What became of a fragment, a covered pixel of a primitive (`FragmentTap.fate`).

    `EARLY_STENCIL`, `EARLY_DEPTH`: failed the test before the shader was due (counters ``….failed_early``).
    `DISCARDED`: the shader did not keep it. `STENCIL_FAILED`, `DEPTH_FAILED`: failed the test after the shader.
    `WRITTEN`: passed everything.
    """

    EARLY_STENCIL = 1
    EARLY_DEPTH = 2
    DISCARDED = 3
    STENCIL_FAILED = 4
    DEPTH_FAILED = 5
    WRITTEN = 6


class TextureFormat(StrEnum):
    """Formats of colour targets and textures, stored as planes of 32 bits a component.

    A plane of an 8-bit format holds k / 255, rounded to float32, for whole k from 0 to 255 and nothing else.
    """

    R8UNORM = "r8unorm"
    RG8UNORM = "rg8unorm"
    RGBA8UNORM = "rgba8unorm"
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
        return len(self.value) - len(self.value.lstrip("rgba"))

    @property
    def is_float(self) -> bool:
        """True where shaders see float32, False for int32."""
        return not self.value.endswith("sint")

    @property
    def is_unorm8(self) -> bool:
        """Whether a component is stored in 8 bits, 0 to 1."""
        return self.value.endswith("8unorm")


def member(label: str, name: str, enum: type[Enum], value: object) -> Enum:
    """The member of `enum` that `value` is or spells; `InputError` names the field and what it may be."""
    try:
        return enum(value)
    except ValueError:
        if isinstance(value, str) and value in LEFT_OUT:
            raise InputError(f"{label}: {name} is {value!r}; {LEFT_OUT[value]}.") from None
        known = ", ".join(f"{part.name} ({part.value})" for part in enum)
        raise InputError(f"{label}: {name} is {value!r}; it must be one of {known}.") from None
