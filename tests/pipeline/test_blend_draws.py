"""Blended, masked and 8-bit targets through whole draws.

Plan
- Small random scenes through every case equal the slow pipeline, fragment by fragment in submission order: every plane
  and counter, in the dense loop and in the list loop with its tap, so a tap changes no bit; the tap tells what the
  targets held after each fragment. Stencil, depth and discards are around it, formats differ within a draw.
- Larger scenes: both loops, 1 and 2 threads leave the same bits and counters.
- Order matters: two sprites one over the other in both orders differ, and each order is the equation applied twice.
- Masks leave the components that they leave out as they were (8 bits, float, whole numbers).
- The blend constant is read when the draw runs: nothing is compiled for another one.
- 8-bit targets: clears and writes round as the format does, `bytes` gives the numbers, a texture the values.
- One pipeline drawn into other formats rounds to those; the sample reaches every factor and operation.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.pipeline.color_writes import color_writes
from refsim.pipeline.enums import BlendFactor, BlendOperation, ColorWrite, TextureFormat
from refsim.pipeline.layout import shape_of
from refsim.pipeline.program import program_of
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.state import ColorTargetState
from refsim.pipeline.taps import Taps
from tests.pipeline.blend_scenes import (
    BOTH,
    CASES,
    DENSE,
    OVER,
    TAPPED,
    Case,
    Rule,
    blend_scene,
    restated,
    run,
    target_of,
)
from tests.pipeline.one_blend import written
from tests.pipeline.pipelines import LARGE, SEED
from tests.pipeline.scenes import assert_same, planes

F = np.float32
seeds = st.integers(0, 2**31)


def loops_of(name: str) -> list[dict]:
    """Options of a draw for each loop in which a case is run."""
    return [{"loop": "dense"}] * (name in DENSE) + [{"taps": Taps("fragment")}] * (name in TAPPED)


def assert_restated(name: str, scene) -> Counters:
    """The loops leave what the slow pipeline leaves, with NaN where it has NaN, and the same bits as each other."""
    expected, counts, log = restated(CASES[name], scene)
    drawn = []
    for options in loops_of(name):
        framebuffer, counters = run(CASES[name], scene, **options)
        for plane_name, plane in planes(framebuffer).items():
            np.testing.assert_array_equal(plane, planes(expected)[plane_name], err_msg=f"{plane_name} {options}")
        assert dict(counters) == {name: counts[name] for name in counters}
        assert not set(counts) - set(counters)
        if "taps" in options:
            tap = options["taps"].fragment[0]
            places = list(zip(tap.primitive, tap.y, tap.x, strict=True))
            assert places == [(f.primitive, f.y, f.x) for f in log]
            for target, values in tap.stored.items():
                stored = np.array([part for f in log for part in f.stored[target]], values.dtype)
                np.testing.assert_array_equal(values.ravel(), stored, err_msg=target)
        drawn.append((framebuffer, counters))
    assert_same(drawn[0], drawn[-1])
    return drawn[0][1]


@settings(deadline=None, max_examples=80)
@given(st.sampled_from(sorted(CASES)), seeds)
def test_a_draw_equals_the_slow_pipeline(name, seed):
    assert_restated(name, blend_scene(seed, count=12, width=19, height=13, largest=20.0))


@pytest.mark.parametrize("name", sorted(CASES))
def test_every_case_equals_the_slow_pipeline_where_much_is_drawn_over(name):
    print(f"states drawn with seed {SEED}: {CASES[name].pipe.fragment.targets}")
    scene = blend_scene(5, tame=True, count=60, width=24, height=16, largest=60.0)
    scene.columns["base"][:] = 0.25
    dynamic = scene.dynamic._replace(scissor=None, stencil_reference=254, stencil_read_mask=255, stencil_write_mask=255)
    scene = scene._replace(rule=scene.rule._replace(modulus=LARGE), dynamic=dynamic)
    counters = assert_restated(name, scene)
    assert counters["fragment.written"] > 5 * 24 * 16


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(BOTH), seeds, st.sampled_from([20.0, 70.0]))
def test_loops_and_threads_leave_the_same_bits(name, seed, largest):
    made, scene = CASES[name], blend_scene(seed, count=60, width=150, height=90, largest=largest)
    one = run(made, scene, loop="dense")
    assert_same(one, run(made, scene, loop="dense", threads=2))
    assert_same(one, run(made, scene, taps=Taps("fragment"), threads=2))


def test_the_list_loop_without_a_tap_agrees_too():
    scene = blend_scene(3, count=60, width=150, height=90)
    assert_same(run(CASES["over"], scene, loop="list"), run(CASES["over"], scene, loop="dense"))


def sprites(first, second=(0.25, 0.5, 0.75, 1.0), constant=(0.0, 0.0, 0.0, 0.0)):
    """Sprites over the whole of a target of 8 × 8, one for each row of `first`."""
    n = len(first)
    scene = blend_scene(0, count=3, width=8, height=8)
    columns = {
        "position": np.tile(np.array([0, 0, 0.5, 1], np.float32), (n, 1)), "size": np.full(n, 100, np.float32),
        "base": np.full(n, 0.25, np.float32), "id": np.arange(n, dtype=np.int32),
        "first": np.array(first, np.float32), "second": np.tile(np.array(second, np.float32), (n, 1)),
    }  # fmt: skip
    dynamic = scene.dynamic._replace(scissor=None, blend_constant=constant)
    return scene._replace(columns=columns, rule=scene.rule._replace(modulus=LARGE), dynamic=dynamic)


@pytest.mark.parametrize("options", [{"loop": "dense"}, {"taps": Taps("fragment")}], ids=["dense", "list"])
def test_fragments_are_blended_in_the_order_of_submission(options):
    made = CASES["over"]
    red, green = (1.0, 0.0, 0.0, 0.5), (0.0, 1.0, 0.0, 0.75)
    drawn = []
    for order in ((red, green), (green, red)):
        scene = sprites(order)
        framebuffer, counters = run(made, scene, **options)
        before = target_of(made, scene).color("color")
        value = tuple(before[:, 3, 5])
        for color in order:
            value = written(ColorTargetState(OVER), made.targets["color"], color, None, (0.0,) * 4, value)
        assert tuple(framebuffer.color("color")[:, 3, 5]) == value
        assert counters["blend.fragments"] == counters["fragment.written"] == 2 * 64
        drawn.append(framebuffer.color("color"))
    assert (drawn[0] != drawn[1]).any()


def test_no_component_outside_the_mask_changes():
    made, mask = CASES["latin0"], 10  # other masks are in the sample; each costs a compile
    states = made.pipe.fragment.targets
    scene = sprites([(0.3, 0.6, 0.2, 0.8)] * 2, constant=(0.3, 0.3, 0.3, 0.3))
    before, everything = target_of(made, scene), run(made, scene, taps=Taps("fragment"))[0]
    masked = tuple(state._replace(write_mask=ColorWrite(mask)) for state in states)
    pipe = replace(made.pipe, fragment=replace(made.pipe.fragment, targets=masked))
    framebuffer, counters = run(Case(pipe, made.targets), scene, loop="list")
    assert counters["blend.fragments"] == counters["fragment.written"] == 2 * 64
    for name in made.targets:
        for k, plane in enumerate(framebuffer.color(name)):
            source = everything if mask >> k & 1 else before
            np.testing.assert_array_equal(plane, source.color(name)[k], err_msg=f"{name} {k}")
    assert (everything.floats != before.floats).any(axis=(1, 2)).all()  # or the mask had nothing to keep


def test_masks_decide_whether_a_fragment_counts_as_blended():
    made = CASES["over"]
    formats = tuple(made.targets.values())
    for mask in range(16):
        states = tuple(state._replace(write_mask=ColorWrite(mask)) for state in made.pipe.fragment.targets)
        writes = color_writes(replace(made.pipe.fragment, targets=states), formats)
        assert writes.blends == (mask > 0) and not writes.plain
    plain = color_writes(replace(made.pipe.fragment, targets=()), (TextureFormat.RGBA32FLOAT,) * 4)
    assert plain.plain and not plain.blends


def test_another_blend_constant_compiles_nothing_and_is_seen():
    made = CASES["over"]  # its last target is blended by the constant
    program = program_of(made.pipe, shape_of(Rule(1)), None, False, tuple(made.targets.values()))
    drawn = []
    for constant in ((0.0, 0.25, 0.5, 1.0), (1.0, 1, np.float32(0.25), -2.5)):
        scene = sprites([(0.5, 0.5, 0.5, 0.5)], constant=constant)
        framebuffer, _ = run(made, scene, loop="dense")
        before = tuple(target_of(made, scene).color("light")[:, 2, 6])
        state = made.pipe.fragment.targets[3]
        value = written(state, made.targets["light"], (0.25, 0.5, 0.75, 1.0), None, constant, before)
        assert tuple(framebuffer.color("light")[:, 2, 6]) == value
        drawn.append((program.dense, len(program.dense.signatures), framebuffer.color("light")[0, 0, 0]))
    assert drawn[0][0] is drawn[1][0] and drawn[0][1] == drawn[1][1] and drawn[0][2] != drawn[1][2]


def test_eight_bit_targets_round_clears_and_writes():
    framebuffer = Framebuffer(3, 2, {"color": "rgba8unorm", "other": "rg8unorm", "depth": "r32float"})
    framebuffer.clear_color("color", (0.5, 1 / 255, 2.0, -1.0))
    framebuffer.clear_color("other", float("nan"))
    framebuffer.clear_color("depth", 0.3)
    assert framebuffer.bytes("color")[:, 1, 2].tolist() == [128, 1, 255, 0]
    assert framebuffer.bytes("color").dtype == np.uint8 and framebuffer.bytes("color").shape == (4, 2, 3)
    assert framebuffer.color("color")[:, 0, 0].tolist() == [F(128) / F(255), F(1) / F(255), 1, 0]
    assert not framebuffer.bytes("other").any() and (framebuffer.color("depth") == F(0.3)).all()
    with pytest.raises(InputError, match="'depth' is r32float"):
        framebuffer.bytes("depth")
    with pytest.raises(InputError, match="no target 'colour'"):
        framebuffer.bytes("colour")


def test_every_byte_survives_a_clear():
    framebuffer = Framebuffer(1, 1, {"color": "r8unorm"})
    for k in range(256):
        framebuffer.clear_color("color", k / 255)
        assert framebuffer.bytes("color")[0, 0, 0] == k


def test_a_draw_without_states_rounds_to_the_format():
    made = CASES["over"]
    pipe = replace(made.pipe, fragment=replace(made.pipe.fragment, targets=()))
    values = (0.3, 0.5, -1.0, np.nan)
    scene = sprites([values], second=(0.7, 2.0, 0.1, np.inf))
    framebuffer, counters = run(Case(pipe, {**made.targets, "glow": TextureFormat.RG8UNORM}), scene, loop="list")
    assert framebuffer.bytes("light")[:, 4, 4].tolist() == [178, 255, 26, 255]
    assert framebuffer.bytes("glow")[:, 4, 4].tolist() == [178, 128]
    np.testing.assert_array_equal(framebuffer.color("color")[:, 4, 4], np.array(values, np.float32))
    assert "blend.fragments" not in dict(counters)


def test_a_target_is_read_by_a_later_draw_as_the_values_it_holds():
    framebuffer = Framebuffer(2, 2, {"color": "rgba8unorm"})
    framebuffer.clear_color("color", 0.5)
    assert (framebuffer.texture("color").data == F(128) / F(255)).all()


def test_the_cases_reach_what_they_are_meant_to():
    states = [(state, form) for made in CASES.values()
              for state, form in zip(made.pipe.fragment.targets, made.targets.values(), strict=True)]  # fmt: skip
    parts = [part for state, _ in states if state.blend for part in state.blend]
    assert {part.operation for part in parts} == set(BlendOperation)
    assert {part.src_factor for part in parts} | {part.dst_factor for part in parts} == set(BlendFactor)
    without_second = {factor for factor in BlendFactor if "src1" not in factor}
    for side in ("src_factor", "dst_factor"):
        assert {getattr(part, side) for part in parts} >= without_second
    formats = {form for state, form in states if state.blend}
    assert formats >= {TextureFormat.RGBA8UNORM, TextureFormat.RGBA32FLOAT, TextureFormat.RG8UNORM}
    assert len({int(state.write_mask) for state, _ in states}) > 8
