"""The shaders, pipelines and draws that the tests of triangles share, so that few are compiled.

One vertex shader hands positions and four varyings through (perspective, linear, flat, a number), one fragment shader
writes them. A draw starts on an empty target; the plane of shader invocations counts how often a pixel is covered.
"""

from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.interpolation import Interpolation
from refsim.pipeline.layout import f32, i32, vec3, vec4
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import (
    CompareFunction,
    CullMode,
    DepthStencilFormat,
    DepthStencilState,
    DynamicState,
    FragmentState,
    FrontFace,
    Pipeline,
    PrimitiveTopology,
    ScissorRect,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
    Viewport,
)
from refsim.pipeline.taps import FragmentTap, Taps

TARGETS = {"values": TextureFormat.RGB32FLOAT, "id": TextureFormat.R32SINT}
D32, D24 = DepthStencilFormat
NOTHING = -7


class Corner(NamedTuple):
    """A vertex: clip position, three values to spread, a number."""

    position: vec4
    smooth: f32
    straight: f32
    first: f32
    id: i32


class Spread(NamedTuple):
    """What a fragment knows: one value of each interpolation, and the number."""

    smooth: f32
    straight: Annotated[f32, Interpolation.LINEAR]
    first: Annotated[f32, Interpolation.FLAT]
    id: i32


class Outputs(NamedTuple):
    """Colour targets."""

    values: vec3
    id: i32


@func
def corner_vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Corner` on; instances move its number up by a million."""
    a = attributes[0]
    number = np.int32(a.id + np.int32(1000000) * instance_index)
    return a.position, np.float32(1), Spread(a.smooth, a.straight, a.first, number)


@func
def spread_fragment(u, t, v, inputs, pixel):
    """Writes what it is given."""
    return True, np.float32(0), Outputs((v.smooth, v.straight, v.first), v.id)


def with_depth(compare=CompareFunction.ALWAYS, form=D32, **bias) -> DepthStencilState:
    """A depth state that writes."""
    return DepthStencilState(form, True, compare, **bias)


LIST = Pipeline(
    VertexState(corner_vertex, Spread, (VertexBufferLayout(Corner),)),
    FragmentState(spread_fragment, Outputs),
    PrimitiveTopology.TRIANGLE_LIST,
    with_depth(),
    label="triangles",
)
STRIP = replace(LIST, topology=PrimitiveTopology.TRIANGLE_STRIP, label="strip")
FRONTS = replace(LIST, cull_mode=CullMode.BACK, label="fronts")
BACKS = replace(LIST, cull_mode=CullMode.FRONT, label="backs")
NEAREST = replace(LIST, depth_stencil=with_depth(CompareFunction.LESS), label="nearest")
CLOCKWISE = {
    mode: replace(LIST, cull_mode=mode, front_face=FrontFace.CW, label=f"clockwise, {mode}") for mode in CullMode
}


class Drawn(NamedTuple):
    """What a draw left: target, counters, and the fragment tap if there was one."""

    framebuffer: Framebuffer
    counters: Counters
    fragments: FragmentTap | None

    @property
    def coverage(self) -> np.ndarray:
        """How often each pixel is covered, int32 [h, w]; only if nothing is rejected early."""
        return self.framebuffer.invocations

    def covered_by(self, primitive: int) -> np.ndarray:
        """How often each pixel is covered by one primitive, from the fragment tap."""
        assert self.fragments is not None
        count = np.zeros(self.framebuffer.depth.shape, np.int32)
        mine = self.fragments.primitive == primitive
        np.add.at(count, (self.fragments.y[mine], self.fragments.x[mine]), 1)
        return count


class Screen(NamedTuple):
    """Size of the target; viewport (x, y, width, height, min and max depth) and scissor (x, y, width, height)."""

    width: int
    height: int
    view: tuple[float, ...] | None = None
    cut: tuple[int, ...] | None = None

    @property
    def viewport(self) -> tuple[float, float, float, float, float, float]:
        """The viewport with its defaults."""
        x, y, width, height, *depths = self.view or (0, 0, self.width, self.height)
        low, high = depths or (0, 1)
        return x, y, width, height, low, high

    @property
    def scissor(self) -> tuple[int, int, int, int]:
        """The scissor as bounds (x0, y0, x1, y1)."""
        x, y, width, height = self.cut or (0, 0, self.width, self.height)
        return x, y, x + width, y + height

    @property
    def dynamic(self) -> DynamicState:
        """As a draw takes it."""
        return DynamicState(
            Viewport(*self.view) if self.view else None, ScissorRect(*self.cut) if self.cut else None
        )


def clip_positions(screen: Screen, x, y, z=0.5, w=1.0) -> np.ndarray:
    """Clip positions f32 [..., 4] of pixel coordinates and depths in [0, 1] of the depth range."""
    vx, vy, vw, vh = screen.viewport[:4]
    x, y, z, w = np.broadcast_arrays(*(np.asarray(part, np.float64) for part in (x, y, z, w)))
    ndc = np.stack([2 * (x - vx) / vw - 1, 1 - 2 * (y - vy) / vh, z], axis=-1)
    return np.concatenate([ndc * w[..., None], w[..., None]], axis=-1).astype(np.float32)


def vertices_of(position: np.ndarray, **columns) -> VertexBuffer:
    """A vertex buffer of clip positions [n, 3, 4] or [n, 4]; by default a triangle's vertices have its number."""
    flat = np.asarray(position, np.float32).reshape(-1, 4)
    n = len(flat)
    values = {name: np.zeros(n, np.float32) for name in ("smooth", "straight", "first")}
    values["id"] = np.arange(n, dtype=np.int32) // 3
    values |= {name: np.asarray(column).reshape(-1) for name, column in columns.items()}
    return VertexBuffer.of(Corner, position=flat, **values)


def rasterise(screen: Screen, position, *, pipe=LIST, tap=True, threads=1, loop="auto", drawn=(), **columns) -> Drawn:
    """Draws triangles once on an empty target; `drawn`: more arguments of the draw, as a dict. Laws are checked."""
    framebuffer = Framebuffer(screen.width, screen.height, TARGETS, pipe.depth_stencil.format)
    framebuffer.floats[:], framebuffer.ints[:] = NOTHING, NOTHING
    counters, taps = Counters(), Taps("fragment") if tap else None
    draw(
        pipe, framebuffer=framebuffer, counters=counters, vertices=vertices_of(position, **columns), taps=taps,
        dynamic=screen.dynamic, threads=threads, loop=loop, **dict(drawn),
    )  # fmt: skip
    counters.check()
    return Drawn(framebuffer, counters, taps.fragment[0] if taps else None)


def planes(drawn: Drawn) -> dict[str, bytes]:
    """The bits of all that a draw may change."""
    target = drawn.framebuffer
    named = {"floats": target.floats, "ints": target.ints, "depth": target.depth, "invocations": target.invocations}
    return {name: plane.tobytes() for name, plane in named.items()}


def assert_same_bits(a: Drawn, b: Drawn) -> None:
    """Same bits in every plane and the same counters."""
    first, second = planes(a), planes(b)
    assert [name for name in first if first[name] != second[name]] == []
    assert dict(a.counters) == dict(b.counters)
