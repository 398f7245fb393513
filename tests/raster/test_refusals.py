"""What triangles refuse, each beside a control that is taken.

Plan
- State: a row a field that means nothing, or nothing together with another; the sentence names the field and nothing
  is made. The control is the same state with the value that is legal.
- A draw: viewports and framebuffers beyond the reach of the sub-pixel grid are refused before anything is drawn, the
  largest that are within it are not.
- A depth-only pipeline draws depth and refuses colour targets.
"""

from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.pipeline.draw import draw
from refsim.pipeline.interpolation import Interpolation
from refsim.pipeline.layout import f32, i32, vec2
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import DynamicState, FrontFace, PrimitiveTopology, Viewport
from tests.raster.drawing import LIST, TARGETS, Corner, with_depth

POINTS = replace(LIST, topology=PrimitiveTopology.POINT_LIST)
NAN = float("nan")


class Smooth(NamedTuple):
    """A number that cannot be interpolated."""

    id: Annotated[i32, Interpolation.LINEAR]


class Inside(NamedTuple):
    """The same within a part that is said to be perspective."""

    part: Annotated[Smooth, Interpolation.PERSPECTIVE]


class Said(NamedTuple):
    """What may be said."""

    where: Annotated[vec2, Interpolation.LINEAR]
    weight: Annotated[f32, Interpolation.PERSPECTIVE]
    id: Annotated[i32, Interpolation.FLAT]


STATES = [
    ("cull_mode", LIST, {"cull_mode": "both"}, {"cull_mode": "back"}, r"cull_mode is 'both'; it must be one of NONE"),
    ("front_face", LIST, {"front_face": 1}, {"front_face": FrontFace.CW}, r"front_face is 1; it must be one of CCW"),
    ("culled points", POINTS, {"cull_mode": "back"}, {"cull_mode": "none"}, "cull_mode is for triangles; point-list"),
    ("biased points", POINTS, {"depth_stencil": with_depth(depth_bias=1)}, {"depth_stencil": with_depth()},
     "depth_bias is for triangles; point-list"),
    ("biased quads", LIST, {"topology": "quad-list", "depth_stencil": with_depth(depth_bias_clamp=0.5)},
     {"depth_stencil": with_depth(depth_bias_clamp=0.5)}, "depth_bias is for triangles; quad-list"),
    ("bias of no number", LIST, {"depth_stencil": with_depth(depth_bias_slope_scale=NAN)},
     {"depth_stencil": with_depth(depth_bias_slope_scale=1.5)}, "must be finite float32s"),
    ("a slope that float32 does not hold", LIST, {"depth_stencil": with_depth(depth_bias_slope_scale=1e39)},
     {"depth_stencil": with_depth(depth_bias_slope_scale=3e38)}, "must be finite float32s"),
    ("clamp without end", LIST, {"depth_stencil": with_depth(depth_bias_clamp=float("inf"))},
     {"depth_stencil": with_depth(depth_bias_clamp=-1.0)}, "must be finite float32s"),
    ("half a step", LIST, {"depth_stencil": with_depth(depth_bias=0.5)}, {"depth_stencil": with_depth(depth_bias=-5)},
     "depth_bias counts steps"),
    ("too many steps", LIST, {"depth_stencil": with_depth(depth_bias=2**31)},
     {"depth_stencil": with_depth(depth_bias=2**31 - 1)}, "depth_bias counts steps"),
    ("smooth integers", LIST, {"vertex": replace(LIST.vertex, varyings=Smooth)},
     {"vertex": replace(LIST.vertex, varyings=Said)}, "varying 'id' of Smooth is linear; integers can only be flat"),
    ("smooth integers within", LIST, {"vertex": replace(LIST.vertex, varyings=Inside)},
     {"topology": "point-list", "vertex": replace(LIST.vertex, varyings=Inside)}, "integers can only be flat"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("base", "illegal", "legal", "sentence"), [row[1:] for row in STATES], ids=[r[0] for r in STATES]
)
def test_state_that_means_nothing_is_named(base, illegal, legal, sentence):
    with pytest.raises(InputError, match=sentence) as refused:
        replace(base, **illegal)
    assert "\n" not in str(refused.value)
    replace(base, **legal)


def corners():
    """One triangle over the upper left half of the clip volume."""
    position = np.array([[-1, -1, 0.5, 1], [-1, 1, 0.5, 1], [1, 1, 0.5, 1]])
    return VertexBuffer.of(
        Corner, position=position, smooth=np.ones(3), straight=np.ones(3), first=np.ones(3), id=[1, 2, 3]
    )


VIEWPORTS = [
    ("left", Viewport(-16385, 0, 16400, 4), Viewport(-16384, 0, 16400, 4)),
    ("above", Viewport(0, -16384.5, 4, 16400), Viewport(0, -16384, 4, 16400)),
    ("right", Viewport(0, 0, 16385, 4), Viewport(0, 0, 16384, 4)),
    ("below", Viewport(0, 1, 4, 16384), Viewport(0, 0, 4, 16384)),
]


@pytest.mark.parametrize(("illegal", "legal"), [row[1:] for row in VIEWPORTS], ids=[row[0] for row in VIEWPORTS])
def test_viewports_beyond_the_grid_are_refused(illegal, legal):
    target, counters = Framebuffer(8, 8, TARGETS), Counters()
    with pytest.raises(InputError, match=r"triangles: Viewport.* leaves ±16384 pixels"):
        draw(LIST, vertices=corners(), framebuffer=target, counters=counters, dynamic=DynamicState(viewport=illegal))
    assert not dict(counters) and (target.invocations == 0).all()
    draw(LIST, vertices=corners(), framebuffer=target, counters=counters, dynamic=DynamicState(viewport=legal))
    assert counters["raster.drawn"] == 1


@pytest.mark.parametrize("size", [(16385, 1), (1, 16385)])
def test_framebuffers_beyond_the_grid_are_refused(size):
    counters = Counters()
    with pytest.raises(InputError, match=rf"a framebuffer of {size[0]} × {size[1]} pixels is too large for triangles"):
        draw(LIST, vertices=corners(), framebuffer=Framebuffer(*size, TARGETS), counters=counters,
             dynamic=DynamicState(viewport=Viewport(0, 0, 1, 1)))  # fmt: skip
    assert not dict(counters)
    largest = Framebuffer(*(min(side, 16384) for side in size), TARGETS)
    draw(LIST, vertices=corners(), framebuffer=largest, counters=counters)
    assert counters["fragment.written"] > 0


def test_without_a_fragment_stage_there_is_depth_and_no_colour():
    depth_only, counters = replace(LIST, fragment=None), Counters()
    target = Framebuffer(8, 8, {})
    draw(depth_only, vertices=corners(), framebuffer=target, counters=counters)
    counters.check()
    written = target.depth == 0.5
    assert written.sum() == counters["fragment.written"] == counters["raster.fragments"] == 28
    with pytest.raises(InputError, match="colour target 'values' is no fragment output; there are none"):
        draw(depth_only, vertices=corners(), framebuffer=Framebuffer(8, 8, TARGETS), counters=counters)
