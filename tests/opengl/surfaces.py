"""Shaders and pipelines that show what a triangle's pixels are given: varyings of every kind and depth.

`exact` restates it in float64 from the clip positions, with a bound for what float32 arithmetic may make of it.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from refsim.jit import func
from refsim.pipeline.enums import CompareFunction, DepthStencilFormat, PrimitiveTopology, TextureFormat
from refsim.pipeline.interpolation import Interpolation
from refsim.pipeline.layout import f32, i32, vec2, vec4
from refsim.pipeline.state import (
    DepthStencilState,
    FragmentState,
    Pipeline,
    VertexBufferLayout,
    VertexState,
)
from tests.opengl.case import Glsl

HALF_UNIT = 2.0**-24
# Slopes: two differences of products over the area, 5 roundings; the value at the screen's corner 4; at the pixel 4
ROUNDINGS = 13
TARGETS = {
    "smooth": TextureFormat.RG32FLOAT,
    "linear": TextureFormat.RG32FLOAT,
    "flat": TextureFormat.R32FLOAT,
    "id": TextureFormat.R32SINT,
}


class Corner(NamedTuple):
    """Clip position and one value of each kind."""

    position: vec4
    smooth: vec2
    linear: vec2
    flat: f32
    id: i32


class Surface(NamedTuple):
    """The varyings."""

    smooth: vec2
    linear: Annotated[vec2, Interpolation.LINEAR]
    flat: Annotated[f32, Interpolation.FLAT]
    id: i32


@func
def vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Corner` on."""
    a = attributes[0]
    return a.position, np.float32(1), Surface(a.smooth, a.linear, a.flat, a.id)


@func
def fragment(u, t, v, inputs, pixel):
    """All varyings to their targets."""
    return True, np.float32(0), v


GLSL = Glsl(
    """
layout(location=0) in vec4 position;
layout(location=1) in vec2 smoothly;
layout(location=2) in vec2 linearly;
layout(location=3) in float flatly;
layout(location=4) in int id;
smooth out vec2 v_smooth; noperspective out vec2 v_linear; flat out float v_flat; flat out int v_id;
void main() { gl_Position = position; v_smooth = smoothly; v_linear = linearly; v_flat = flatly; v_id = id; }
""",
    """
smooth in vec2 v_smooth; noperspective in vec2 v_linear; flat in float v_flat; flat in int v_id;
layout(location=0) out vec2 smoothly; layout(location=1) out vec2 linearly;
layout(location=2) out float flatly; layout(location=3) out int id;
void main() { smoothly = v_smooth; linearly = v_linear; flatly = v_flat; id = v_id; }
""",
)


def pipeline(form: DepthStencilFormat, bias: int = 0, slope: float = 0.0, clamp: float = 0.0) -> Pipeline:
    """Triangles that replace what is there, depth too."""
    state = DepthStencilState(form, True, CompareFunction.ALWAYS, depth_bias=bias, depth_bias_slope_scale=slope,
                              depth_bias_clamp=clamp)  # fmt: skip
    stage = VertexState(vertex, Surface, (VertexBufferLayout(Corner),))
    return Pipeline(stage, FragmentState(fragment, Surface), PrimitiveTopology.TRIANGLE_LIST, state)


class Exact(NamedTuple):
    """Values at every pixel's centre, float64 [h, w], and how far float32 on the sub-pixel grid may be from them."""

    value: np.ndarray
    bound: np.ndarray


class _Plane(NamedTuple):
    """A function that is linear on the screen: values, the sum of its slopes' sizes, the size of what is summed."""

    value: np.ndarray
    slopes: float
    reach: np.ndarray


def exact(
    position: np.ndarray, values: np.ndarray, size: tuple[int, int], *, perspective: bool, on_grid: bool
) -> Exact:
    """A varying with corner values [3] over one triangle of clip positions [3, 4].

    The bound has two parts. A corner may be moved by half a step of the grid, 1/512 pixel in x and y, unless it is
    `on_grid`; the value then is that of a point as near. And OpenGL implementations keep a plane as its value at a
    corner of the screen and two slopes: `ROUNDINGS` roundings of terms as large as slope times distance.
    """
    w = position[:, 3].astype(np.float64)
    values = values.astype(np.float64)
    if not perspective:
        plane = _plane(position, values * w, size)
        return Exact(plane.value, (0 if on_grid else plane.slopes / 512) + ROUNDINGS * HALF_UNIT * plane.reach)
    above, below = _plane(position, values, size), _plane(position, np.ones(3), size)
    value = above.value / below.value
    reach = (above.reach + np.abs(value) * below.reach) / np.abs(below.value)
    slopes = (above.slopes + np.abs(value) * below.slopes) / (np.abs(below.value) - below.slopes / 512)
    return Exact(value, (0 if on_grid else slopes / 512) + ROUNDINGS * HALF_UNIT * reach)


def _plane(position: np.ndarray, values: np.ndarray, size: tuple[int, int]) -> _Plane:
    """Σ q v at every pixel's centre, where q are the homogeneous weights of the corners: Σ q w = 1."""
    width, height = size
    x, y, _, w = position.astype(np.float64).T
    inverse = np.linalg.inv(np.stack([(x + w) * (width / 2), (w - y) * (height / 2), w], axis=-1))
    across, down, constant = inverse @ values
    column, row = np.arange(width) + 0.5, (np.arange(height) + 0.5)[:, None]
    value = across * column + down * row + constant
    return _Plane(value, abs(across) + abs(down), np.abs(value) + abs(across) * width + abs(down) * height)
