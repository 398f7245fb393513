"""The tracer's pipelines: which shaders and which state each configuration binds."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from refsim.papers.geometry_shader_rays import shaders
from refsim.papers.geometry_shader_rays.fragment_shaders import (
    Picture,
    WhichTarget,
    blending_fragment,
    blending_vertex,
    layer_colors,
    shading_fragment,
)
from refsim.papers.geometry_shader_rays.record import PackedHit
from refsim.pipeline.layout import device_function, vec2
from refsim.pipeline.state import (
    BlendComponent,
    BlendFactor,
    BlendState,
    ColorTargetState,
    FragmentState,
    GeometryState,
    Pipeline,
    PrimitiveTopology,
    StreamOutputState,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)

COLOR_FORMATS = {"rgba32float": TextureFormat.RGBA32FLOAT, "rgba8unorm": TextureFormat.RGBA8UNORM}
STAGES = ("vertex", "vertex_only", "geometry")
# Order of what one invocation emits: p the ray passed on, s shadow rays, r reflected, t refracted (transmitted)
EMISSION_ORDERS = {"listed": "psrt", "reflected_first": "prts", "reversed": "trsp"}

# Eq. 1: RGB_out = 1.0 · RGB_src + α_src · RGB_dst
EQUATION_1 = BlendState(
    BlendComponent(src_factor=BlendFactor.ONE, dst_factor=BlendFactor.SRC_ALPHA),
    BlendComponent(src_factor=BlendFactor.ONE, dst_factor=BlendFactor.ZERO),
)
SUM = BlendState(
    BlendComponent(src_factor=BlendFactor.ONE, dst_factor=BlendFactor.ONE),
    BlendComponent(src_factor=BlendFactor.ONE, dst_factor=BlendFactor.ZERO),
)


def emitted_rays(lights: int) -> int:
    """Entries of the geometry shader: the ray itself, shadow rays, a reflected and a refracted one."""
    return lights + 3


@cache
def emitting_geometry(lights: int, order: str, shot: Any = None) -> Any:
    """Listing 4 for so many lights; with `shot` it intersects first, as section 4.1 rejects."""
    entries = {
        "p": "passed_on(u, r, s)",
        "s": ", ".join(f"shadow_entry(u, r, s, {k}, {lights})" for k in range(lights)),
        "r": "reflected_entry(u, r, s)",
        "t": "refracted_entry(u, r, s)",
    }
    record = "shot(u, t, vertices[0][2], primitive)" if shot is not None else "vertices[0][2]"
    listed = ", ".join(entries[letter] for letter in EMISSION_ORDERS[order] if entries[letter])
    source = (
        "def emit(u, t, vertices, primitive):\n"
        f"    r = {record}\n"
        f"    s = spawning(u, t, r, {max(lights, 1)})\n"
        f"    return ({listed})\n"
    )
    names = ("passed_on", "shadow_entry", "reflected_entry", "refracted_entry", "spawning")
    found = {name: getattr(shaders, name) for name in names}
    return device_function(source, "emit", found | ({"shot": shot} if shot is not None else {}))


@cache
def tracing_pass(traverse: Any, lights: int, stages: str, order: str) -> Pipeline:
    """One rendering pass of section 3: rays are points, all three shaders, stream output, Eq. 1."""
    shot = shaders.shooting(traverse)
    vertex, geometry, stream_output = shaders.intersecting_vertex(shot), None, None
    if stages == "vertex_only":
        vertex = shaders.finishing_vertex(shot)
    else:
        in_geometry = stages == "geometry"
        vertex = shaders.passing_vertex if in_geometry else vertex
        emit = emitting_geometry(lights, order, shot if in_geometry else None)
        geometry = GeometryState(emit, PackedHit, PrimitiveTopology.POINT_LIST, emitted_rays(lights))
        stream_output = StreamOutputState(PackedHit)
    targets = tuple(ColorTargetState(EQUATION_1) for _ in range(lights + 1))
    fragment = FragmentState(shading_fragment(lights), layer_colors(lights), discards=True, targets=targets)
    return Pipeline(
        VertexState(vertex, PackedHit, (VertexBufferLayout(PackedHit),)),
        fragment,
        PrimitiveTopology.POINT_LIST,
        label=f"rays in the {'geometry' if geometry else 'vertex'} shader",
        geometry=geometry,
        stream_output=stream_output,
    )


class Corner(NamedTuple):
    """A corner of the screen in clip space."""

    position: vec2


@cache
def blending_pass() -> Pipeline:
    """Section 4.4: adds a target of a layer to the image, an instance each."""
    return Pipeline(
        VertexState(blending_vertex, WhichTarget, (VertexBufferLayout(Corner),)),
        FragmentState(blending_fragment, Picture, targets=(ColorTargetState(SUM),)),
        PrimitiveTopology.QUAD_LIST,
        label="blending passes",
    )
