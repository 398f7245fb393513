"""refsim's state values said to OpenGL: `apply(gl, pipeline, dynamic, width, height)` sets all that a draw depends on.

refsim's conventions are those of OpenGL with the clip origin in the upper left, depth from 0 to 1 and the first vertex
provoking; memory row 0 is then refsim's row 0.
"""

from __future__ import annotations

from refsim.pipeline.state import (
    BlendFactor,
    BlendOperation,
    ColorTargetState,
    ColorWrite,
    CompareFunction,
    CullMode,
    DepthStencilState,
    DynamicState,
    FrontFace,
    Pipeline,
    PrimitiveTopology,
    ScissorRect,
    StencilOperation,
    Viewport,
)
from tests.opengl import gl as c
from tests.opengl.gl import GL

COMPARE = {function: 0x0200 + int(function) for function in CompareFunction}  # GL_NEVER … GL_ALWAYS, in the same order
STENCIL = {
    StencilOperation.KEEP: 0x1E00,
    StencilOperation.ZERO: 0,
    StencilOperation.REPLACE: 0x1E01,
    StencilOperation.INVERT: 0x150A,
    StencilOperation.INCREMENT_CLAMP: 0x1E02,
    StencilOperation.DECREMENT_CLAMP: 0x1E03,
    StencilOperation.INCREMENT_WRAP: 0x8507,
    StencilOperation.DECREMENT_WRAP: 0x8508,
}
# Factor for colour, factor for alpha: OpenGL has a name for each
FACTOR = {
    BlendFactor.ZERO: (0, 0),
    BlendFactor.ONE: (1, 1),
    BlendFactor.SRC: (0x0300, 0x0300),
    BlendFactor.ONE_MINUS_SRC: (0x0301, 0x0301),
    BlendFactor.SRC_ALPHA: (0x0302, 0x0302),
    BlendFactor.ONE_MINUS_SRC_ALPHA: (0x0303, 0x0303),
    BlendFactor.DST: (0x0306, 0x0306),
    BlendFactor.ONE_MINUS_DST: (0x0307, 0x0307),
    BlendFactor.DST_ALPHA: (0x0304, 0x0304),
    BlendFactor.ONE_MINUS_DST_ALPHA: (0x0305, 0x0305),
    BlendFactor.SRC_ALPHA_SATURATED: (0x0308, 0x0308),
    BlendFactor.CONSTANT: (0x8001, 0x8003),
    BlendFactor.ONE_MINUS_CONSTANT: (0x8002, 0x8004),
    BlendFactor.SRC1: (0x88F9, 0x8589),
    BlendFactor.ONE_MINUS_SRC1: (0x88FA, 0x88FB),
    BlendFactor.SRC1_ALPHA: (0x8589, 0x8589),
    BlendFactor.ONE_MINUS_SRC1_ALPHA: (0x88FB, 0x88FB),
}
OPERATION = {
    BlendOperation.ADD: 0x8006,
    BlendOperation.SUBTRACT: 0x800A,
    BlendOperation.REVERSE_SUBTRACT: 0x800B,
    BlendOperation.MIN: 0x8007,
    BlendOperation.MAX: 0x8008,
}
TOPOLOGY = {
    PrimitiveTopology.POINT_LIST: c.POINTS,
    PrimitiveTopology.TRIANGLE_LIST: c.TRIANGLES,
    PrimitiveTopology.TRIANGLE_STRIP: c.TRIANGLE_STRIP,
}


def apply(gl: GL, pipeline: Pipeline, dynamic: DynamicState, width: int, height: int) -> None:
    """All state of a draw into a framebuffer of `width` × `height`. Vertices and programs are not state."""
    gl.glClipControl(c.UPPER_LEFT, c.ZERO_TO_ONE)
    gl.glProvokingVertex(c.FIRST_VERTEX_CONVENTION)
    gl.glEnable(c.PROGRAM_POINT_SIZE)
    gl.glDisable(c.DITHER)
    _switch(gl, c.RASTERIZER_DISCARD, pipeline.rasterizer_discard)
    _apply_rectangles(gl, dynamic, width, height)
    _apply_facing(gl, pipeline)
    _apply_depth_stencil(gl, pipeline.depth_stencil, dynamic)
    gl.glBlendColor(*dynamic.blend_constant)
    for k, target in enumerate(pipeline.fragment.targets if pipeline.fragment else ()):
        _apply_target(gl, k, target)
    gl.check("state")


def reset(gl: GL) -> None:
    """Blending off and every component written, for all targets: what a draw without targets' states expects."""
    for k in range(8):
        _apply_target(gl, k, ColorTargetState())


def _switch(gl: GL, what: int, on: bool) -> None:
    (gl.glEnable if on else gl.glDisable)(what)


def _apply_rectangles(gl: GL, dynamic: DynamicState, width: int, height: int) -> None:
    view = dynamic.viewport or Viewport(0, 0, width, height)
    gl.glViewportIndexedf(0, view.x, view.y, view.width, view.height)
    gl.glDepthRange(view.min_depth, view.max_depth)
    gl.glEnable(c.SCISSOR_TEST)
    gl.glScissor(*(dynamic.scissor or ScissorRect(0, 0, width, height)))


def _apply_facing(gl: GL, pipeline: Pipeline) -> None:
    gl.glFrontFace(c.CCW if pipeline.front_face == FrontFace.CCW else c.CW)
    _switch(gl, c.CULL_FACE, pipeline.cull_mode != CullMode.NONE)
    gl.glCullFace(c.FRONT if pipeline.cull_mode == CullMode.FRONT else c.BACK)


def _apply_depth_stencil(gl: GL, state: DepthStencilState, dynamic: DynamicState) -> None:
    gl.glEnable(c.DEPTH_TEST)
    gl.glDepthFunc(COMPARE[state.depth_compare])
    gl.glDepthMask(state.depth_write_enabled)
    bias = (state.depth_bias_slope_scale, float(state.depth_bias), state.depth_bias_clamp)
    _switch(gl, c.POLYGON_OFFSET_FILL, any(bias))
    gl.glPolygonOffsetClamp(*bias)
    gl.glEnable(c.STENCIL_TEST)
    for side, face in ((c.FRONT, state.stencil_front), (c.BACK, state.stencil_back)):
        gl.glStencilFuncSeparate(side, COMPARE[face.compare], dynamic.stencil_reference, dynamic.stencil_read_mask)
        gl.glStencilOpSeparate(side, STENCIL[face.fail_op], STENCIL[face.depth_fail_op], STENCIL[face.pass_op])
        gl.glStencilMaskSeparate(side, dynamic.stencil_write_mask)


def _apply_target(gl: GL, k: int, target: ColorTargetState) -> None:
    gl.glColorMaski(k, *(bool(target.write_mask & bit) for bit in list(ColorWrite)[:4]))
    (gl.glEnablei if target.blend else gl.glDisablei)(c.BLEND, k)
    if target.blend:
        color, alpha = target.blend
        gl.glBlendEquationSeparatei(k, OPERATION[color.operation], OPERATION[alpha.operation])
        sources = (FACTOR[color.src_factor][0], FACTOR[color.dst_factor][0])
        gl.glBlendFuncSeparatei(k, *sources, FACTOR[alpha.src_factor][1], FACTOR[alpha.dst_factor][1])
