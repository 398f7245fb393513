"""Plan: state that means nothing is refused where it is made, and a shader that does not compile is named.

- Each enumerated field with a wrong value: one sentence with the field, the value and what it may be; the control row,
  the same pipeline spelled with plain strings and numbers, is accepted and equals the original.
- A shader without @func, one that reads a varying that is not there, one that returns too little: one sentence.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.enums import LEFT_OUT
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.state import DepthStencilState, StencilFaceState, TextureFormat
from tests.pipeline.pipelines import POOL
from tests.pipeline.scenes import random_scene
from tests.pipeline.scenes import run as draw_scene

PIPE = POOL["nearest"]


def test_the_control_is_accepted_in_plain_spelling():
    spelled = replace(PIPE, early_tests=str(PIPE.early_tests.value), topology=str(PIPE.topology.value))
    assert spelled == PIPE and spelled.early_tests is PIPE.early_tests


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("early_tests", "idael"),
        ("topology", "triangle-fan"),
        ("front_face", "left"),
        ("cull_mode", 3),
        ("depth_stencil", DepthStencilState(depth_compare="less")),
        ("depth_stencil", DepthStencilState(format=7)),
        ("depth_stencil", DepthStencilState(stencil_front=StencilFaceState(compare=8))),
        ("depth_stencil", DepthStencilState(stencil_front=StencilFaceState(pass_op="keep"))),
    ],
)
def test_a_value_that_means_nothing_is_named(field, value):
    with pytest.raises(InputError, match=r"must be one of .*\(") as refused:
        replace(PIPE, **{field: value})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("topology", [value for value in LEFT_OUT])
def test_what_is_left_out_says_so(topology):
    reason = "lines are left out" if "adjacency" not in topology else "adjacency is left out"
    with pytest.raises(InputError, match=f"topology is '{topology}'; {reason}"):
        replace(PIPE, topology=topology)


def test_formats_and_sizes_of_a_framebuffer():
    assert Framebuffer(1, 1, {"c": "r32float"}).targets == {"c": TextureFormat.R32FLOAT}
    with pytest.raises(InputError, match="c is 'rgb8'; it must be one of"):
        Framebuffer(1, 1, {"c": "rgb8"})
    with pytest.raises(InputError, match="a × 1 pixels"):
        Framebuffer("a", 1, {})


def test_a_plain_function_is_no_shader():
    with pytest.raises(InputError, match=r"fragment shader .* is not marked with @refsim.func"):
        replace(PIPE, fragment=replace(PIPE.fragment, shader=lambda *a: None))


@pytest.mark.parametrize("fault", ["attribute", "length"])
def test_a_shader_that_does_not_compile_is_named(fault):
    @func
    def unknown_varying(u, t, v, inputs, pixel):
        return True, v.no_such_varying, v

    @func
    def too_little(u, t, v, inputs, pixel):
        return True, v

    shader = {"attribute": unknown_varying, "length": too_little}[fault]
    pipe = replace(PIPE, fragment=replace(PIPE.fragment, shader=shader), label="broken")
    with pytest.raises(InputError, match="broken: a shader does not compile: ") as refused:
        draw_scene(pipe, random_scene(1, count=60, width=40, height=30))
    assert "\n" not in str(refused.value)
    assert {"attribute": "no_such_varying", "length": "tuple"}[fault] in str(refused.value)


@pytest.mark.parametrize("name", ["pipeline", "framebuffer", "counters", "taps", "dynamic"])
def test_wrong_kinds_of_arguments(name):
    arguments = {"pipeline": PIPE, "framebuffer": Framebuffer(1, 1, {}), "counters": Counters(), name: "odd"}
    with pytest.raises(InputError, match=name):
        draw(arguments.pop("pipeline"), **arguments)
