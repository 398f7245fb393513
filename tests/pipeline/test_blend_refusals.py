"""What blending refuses: one sentence that names the field.

Plan
- State: every row beside a control that differs in that one thing and is accepted when the pipeline is made.
- The blend constant, which is a run-time value: refused by the draw.
- Outputs and colour targets must still agree, a second source being no target.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from refsim.errors import InputError
from refsim.pipeline.enums import BlendFactor, BlendOperation, TextureFormat
from refsim.pipeline.layout import ivec4, vec2, vec3, vec4
from refsim.pipeline.state import BlendComponent, BlendState, ColorTargetState
from tests.pipeline.blend_scenes import CASES, OVER, Case, Dual, blend_scene, run
from tests.pipeline.scenes import planes

O, F = BlendOperation, BlendFactor  # noqa: E741
PIPE = CASES["dual minus"].pipe
NAN, INF = float("nan"), float("inf")


class One(NamedTuple):
    """One target of four components."""

    color: vec4


class Two(NamedTuple):
    """Two targets, and a second source that may be a third."""

    color: vec4
    other: vec4


class Three(NamedTuple):
    """Two targets and a second source."""

    color: vec4
    other: vec4
    src1: vec4


class First(NamedTuple):
    """A second source that does not stand last."""

    src1: vec4
    color: vec4


class Narrow(NamedTuple):
    """A second source unlike the target."""

    color: vec4
    src1: vec3


class Whole(NamedTuple):
    """Whole numbers."""

    color: ivec4


class Pair(NamedTuple):
    """A target without alpha."""

    color: vec2


class PairDual(NamedTuple):
    """A target and a second source without alpha."""

    color: vec2
    src1: vec2


def both(operation=O.ADD, src=F.ONE, dst=F.ONE) -> BlendState:
    """One equation for colour and alpha."""
    return BlendState(*[BlendComponent(operation, src, dst)] * 2)


def state(blend=None, mask=15) -> tuple[ColorTargetState]:
    """The state of a single target."""
    return (ColorTargetState(blend, mask),)


PLAIN = ColorTargetState()
SECOND = state(both(dst=F.SRC1))
ROWS = [
    ("min with a factor", One, state(both(O.MIN, F.SRC)), "color.src_factor must be one with min, not src",
     state(both(O.MIN))),
    ("max with a factor", One, state(both(O.MAX, dst=F.ZERO)), "dst_factor must be one with max, not zero",
     state(both(O.MAX))),
    ("max in alpha alone", One, state(BlendState(alpha=BlendComponent(O.MAX))), "alpha.dst_factor must be one with max",
     state(BlendState(alpha=BlendComponent(O.MAX, F.ONE, F.ONE)))),
    ("a mask of 5 bits", One, state(mask=16), "write_mask is 16; it must be .* 0 to 15", state(mask=15)),
    ("a mask below 0", One, state(mask=-1), "write_mask is -1", state(mask=0)),
    ("a mask with a fraction", One, state(mask=1.0), "write_mask is 1.0", state(mask=1)),
    ("a mask that is a truth", One, state(mask=True), "write_mask is True", state(mask=1)),
    ("two states for one target", One, state() * 2, "targets has 2 states for 1 outputs", state()),
    ("one state for two targets", Two, state(), "targets has 1 states for 2 outputs", state() * 2),
    ("a list of states", One, [PLAIN], "targets must be a tuple, not list", (PLAIN,)),
    ("a blend state for a target state", One, (OVER,), r"targets\[0\] must be a ColorTargetState", state(OVER)),
    ("a component for a blend state", One, state(OVER.color), r"targets\[0\] must be a ColorTargetState", state(OVER)),
    ("a factor for a component", One, state(BlendState(F.ONE)), "blend.color must be a BlendComponent", state(OVER)),
    ("an unknown factor", One, state(both(src="src_alpha")), r"targets\[0\].blend.color.src_factor is 'src_alpha'",
     state(both(src="src-alpha"))),
    ("an unknown operation", One, state(both("plus")), "blend.color.operation is 'plus'; it must be one of ADD",
     state(both("add"))),
    ("whole numbers blended", Whole, state(OVER), "blend must be None: the output 'color' is a whole", state()),
    ("no alpha for a factor", Pair, state(both(src=F.SRC_ALPHA)),
     "color reads the source's alpha, which the output 'color' has not", state(both(src=F.DST_ALPHA))),
    ("no alpha for one minus it", Pair, state(both(dst=F.ONE_MINUS_SRC_ALPHA)), "color reads the source's alpha",
     state(both(dst=F.ONE_MINUS_DST_ALPHA))),
    ("no alpha to saturate", Pair, state(both(src=F.SRC_ALPHA_SATURATED)), "color reads the source's alpha",
     state(BlendState(BlendComponent(), BlendComponent(O.ADD, F.SRC_ALPHA, F.ONE)))),
    ("no alpha in the second source", PairDual, state(both(src=F.SRC1_ALPHA)), "color reads the source's alpha",
     SECOND),
    ("no second source", One, SECOND, "needs a last field 'src1' like 'color'", state(both(dst=F.SRC))),
    ("a second source of another size", Narrow, SECOND, "needs a last field 'src1' like 'color'", None),
    ("a second source that is not last", First, SECOND * 2, "needs a last field 'src1'", state() * 2),
    ("a second source for two targets", Three, (*SECOND, PLAIN), "only a lone target may; there are 2", state() * 3),
    ("a second source in the second target", Three, (PLAIN, *SECOND), r"targets\[1\].*only a lone target",
     state() * 3),
]  # fmt: skip


@pytest.mark.parametrize(
    ("outputs", "states", "sentence", "control"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS]
)
def test_a_state_that_means_nothing_is_refused(outputs, states, sentence, control):
    with pytest.raises(InputError, match=sentence) as refused:
        replace(PIPE, fragment=replace(PIPE.fragment, outputs=outputs, targets=states))
    assert "fragment.targets" in str(refused.value) and "\n" not in str(refused.value)
    if control is not None:
        replace(PIPE, fragment=replace(PIPE.fragment, outputs=outputs, targets=control))


def test_plain_spelling_means_the_same_states():
    spelled = BlendState(*[BlendComponent("add", "src-alpha", "one-minus-src-alpha")] * 2)
    assert spelled == OVER and hash(spelled) == hash(OVER)


@pytest.mark.parametrize(
    "constant",
    [(0, 0, 0), (0, 0, 0, 0, 0), (0, 0, 0, NAN), (INF, 0, 0, 0), (0, 1e39, 0, 0), ("1", 0, 0, 0), (True, 0, 0, 0), 1.0,
     None, [0.0, 0.0, 0.0, 0.0], np.zeros(4)],
)  # fmt: skip
def test_a_blend_constant_is_four_finite_numbers(constant):
    made, scene = CASES["dual minus"], blend_scene(1, count=5)
    with pytest.raises(InputError, match="blend_constant must be four finite numbers, not") as refused:
        run(made, scene._replace(dynamic=scene.dynamic._replace(blend_constant=constant)))
    assert "\n" not in str(refused.value)
    accepted = scene.dynamic._replace(blend_constant=(0, -1.5, np.float32(1), 3e38))
    run(made, scene._replace(dynamic=accepted), loop="list")


@pytest.mark.parametrize(
    ("targets", "fault"),
    [
        ({"color": TextureFormat.RGBA32FLOAT, "src1": TextureFormat.RGBA32FLOAT}, "target 'src1' is no fragment"),
        ({"color": TextureFormat.RGBA32SINT}, "'color' has 4 components of float32, its colour target is rgba32sint"),
        ({"color": TextureFormat.RG8UNORM}, "'color' has 4 components of float32, its colour target is rg8unorm"),
        ({}, "fragment output 'color' has no colour target; the framebuffer has none"),
    ],
)
def test_outputs_without_the_second_source_must_be_the_targets(targets, fault):
    scene = blend_scene(1, count=5)
    with pytest.raises(InputError, match=fault):
        run(Case(PIPE, targets), scene)
    run(CASES["dual minus"], scene, loop="list")


def test_a_field_named_src1_is_a_target_where_no_factor_reads_it():
    # The same outputs: with a factor that reads it `src1` is no target, without one it is
    plain = replace(PIPE, fragment=replace(PIPE.fragment, targets=()))
    scene = blend_scene(1, count=5)
    assert Dual._fields == ("color", "src1")
    with pytest.raises(InputError, match="fragment output 'src1' has no colour target; the framebuffer has color"):
        run(Case(plain, {"color": TextureFormat.RGBA32FLOAT}), scene)
    both_targets = {"color": TextureFormat.RGBA32FLOAT, "src1": TextureFormat.RGBA32FLOAT}
    framebuffer, counters = run(Case(plain, both_targets), scene, loop="list")
    assert "blend.fragments" not in dict(counters) and set(planes(framebuffer)) >= set(both_targets)
