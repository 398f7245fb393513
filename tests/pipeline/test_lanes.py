"""Plan: whatever lanes the dense loop shades beside those that are drawn, the pixel that a shader sees is one of the
framebuffer's: a shader that notes every pixel it is asked for, on targets whose sides are no multiples of a bin.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from refsim.counters import Counters
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import f32, vec2
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import (
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)

ONE = np.float32(1)


class Corner(NamedTuple):
    """A corner of the screen."""

    position: vec2


class Nothing(NamedTuple):
    """No varyings."""


class Shade(NamedTuple):
    """One channel."""

    value: f32


class Seen(NamedTuple):
    """i32[h + 64, w + 64]: pixels that the shader was asked for, the framebuffer's first."""

    pixels: np.ndarray


@func
def corner_vertex(u, t, attributes, vertex_index, instance_index):
    """A corner of a full-screen quad."""
    corner = attributes[0].position
    return (corner[0], corner[1], np.float32(0), ONE), ONE, Nothing()


@func
def noting_fragment(u, t, varyings, inputs, pixel):
    """Notes the pixel."""
    t.pixels[np.uintp(pixel[1]), np.uintp(pixel[0])] = np.int32(1)
    return True, np.float32(0), Shade(ONE)


NOTING = Pipeline(
    VertexState(corner_vertex, Nothing, (VertexBufferLayout(Corner),)),
    FragmentState(noting_fragment, Shade),
    PrimitiveTopology.QUAD_LIST,
)
CORNERS = VertexBuffer.of(Corner, position=np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]], np.float32))


@pytest.mark.parametrize("size", [(200, 75), (33, 47), (1, 300), (129, 1)])
def test_a_shader_is_asked_for_pixels_of_the_framebuffer_alone(size):
    width, height = size
    seen = Seen(np.zeros((height + 64, width + 64), np.int32))
    target = Framebuffer(width, height, {"value": TextureFormat.R32FLOAT})
    draw(NOTING, vertices=CORNERS, textures=seen, framebuffer=target, counters=Counters(), threads=1, loop="dense")
    assert (target.color("value") == 1).all()
    assert seen.pixels[:height, :width].all()
    seen.pixels[:height, :width] = 0
    assert not seen.pixels.any()
