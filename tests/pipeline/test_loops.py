"""The two fragment loops, and both against the pipeline restated fragment by fragment.

Plan
- Dense and list loop leave the same bits in every target, depth, stencil and invocations plane, and the same counters:
  random points (any size, off-screen, NaN) and quads, random scissors, references, masks and stored planes.
- Small scenes, every pipeline of the pool (all early-test policies, discards, written depth, both depth formats), equal
  `slow_pipeline`: planes, counters, and through the tap every fragment's pixel, fate, depth and
  outputs in submission order.
- Specialised draws: every pipeline of the Latin sample, on a target that holds boundary stencil values and depths, with
  every boundary reference and mask in turn.
- A primitive that writes stencil bits that are read, or changes them by failing the depth test, masks the next one over
  the same pixels; one that writes other bits does not.
- Draws of primitives that cover nothing, and of none, change nothing.
- The pool reaches what it is meant to reach: every operation, comparison, policy, format; each way to keep the stencil.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.pipeline.fragment import STENCIL_IN_LOOP, STENCIL_MASK, STENCIL_OFF
from refsim.pipeline.program import fragment_tests
from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.state import DynamicState, EarlyTests
from refsim.pipeline.taps import FragmentTap, Taps
from tests.pipeline.one_fragment import BOUNDARY
from tests.pipeline.pipelines import BOTH, BY_HAND, DENSE, POOL, SEED, TAPPED, Flat, as_quads, ruled_twin
from tests.pipeline.scenes import DEPTHS, Scene, assert_same, full_screen, planes, random_scene, run, target_of
from tests.pipeline.slow_pipeline import slow_draw

FATES = ["", "early stencil", "early depth", "discarded", "stencil", "depth", "written"]
seeds = st.integers(0, 2**31)


@settings(deadline=None, max_examples=150)
@given(st.sampled_from(BOTH), seeds, st.sampled_from([3.0, 20.0, 70.0]), st.booleans())
def test_dense_and_list_loop_agree_bit_for_bit(name, seed, largest, quads):
    pipe = as_quads(POOL[name]) if quads else POOL[name]
    scene = random_scene(seed, count=60, width=70, height=45, largest=largest, quads=quads)
    assert_same(run(pipe, scene, loop="dense"), run(pipe, scene, taps=Taps("fragment")))


@settings(deadline=None, max_examples=30)
@given(seeds)
def test_list_loop_without_tap_agrees_too(seed):
    scene = random_scene(seed, count=60, width=70, height=45)
    assert_same(run(POOL["nearest"], scene, loop="dense"), run(POOL["nearest"], scene, loop="list"))


def loops_of(name: str) -> list[dict]:
    """Options of a draw for each loop in which a pipeline of the pool is run."""
    return [{"loop": "dense"}] * (name in DENSE) + [{"taps": Taps("fragment")}] * (name in TAPPED)


def restated(pipe, scene: Scene) -> tuple[Framebuffer, dict[str, int], list]:
    """What the slow pipeline makes of a scene."""
    framebuffer, columns = target_of(pipe, scene), scene.columns
    rows = zip(columns["position"], columns["size"], columns["base"], columns["color"], columns["id"], strict=True)
    vertices = [(position, size, Flat(base, color, int(number))) for position, size, base, color, number in rows]
    counts, log = slow_draw(pipe, framebuffer, vertices, scene.rules, scene.images, scene.dynamic, ruled_twin)
    return framebuffer, counts, log


def assert_restated(pipe, scene: Scene, **options) -> FragmentTap | None:
    """One draw equals its restatement, fragment for fragment if it is tapped."""
    taps = options.get("taps")
    framebuffer, counters = run(pipe, scene, **options)
    expected, counts, log = restated(pipe, scene)
    for name, plane in planes(framebuffer).items():
        np.testing.assert_array_equal(plane, planes(expected)[name], err_msg=name)
    assert dict(counters) == {name: counts[name] for name in counters}
    assert not set(counts) - set(counters)
    if taps is None:
        return None
    tap = taps.fragment[0]
    places = list(zip(tap.primitive, tap.y, tap.x, strict=True))
    assert places == [(f.primitive, f.y, f.x) for f in log]
    assert [FATES[fate] for fate in tap.fate] == [f.fate for f in log]
    np.testing.assert_array_equal(tap.depth, np.array([f.depth for f in log], np.float32))
    for name, values in tap.outputs.items():
        expected_values = [x for f in log for x in f.outputs[name]]
        np.testing.assert_array_equal(values.ravel(), np.array(expected_values, values.dtype))
    return tap


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(sorted(POOL)), seeds, st.booleans())
def test_a_draw_equals_the_slow_pipeline(name, seed, quads):
    pipe = as_quads(POOL[name]) if quads else POOL[name]
    scene = random_scene(seed, count=12, width=19, height=13, largest=20.0, quads=quads)
    for options in loops_of(name):
        assert_restated(pipe, scene, **options)


def boundary_scene(dynamic: DynamicState, seed: int) -> Scene:
    """Three full-screen sprites over a target whose rows hold every boundary stencil value, columns every depth."""
    rng = np.random.default_rng(seed)
    scene = full_screen(len(DEPTHS), len(BOUNDARY), base=rng.choice(DEPTHS, 3), z=rng.choice([0.25, 0.5, 0.75], 3))
    stencil = np.repeat(np.array(BOUNDARY, np.uint8)[:, None], len(DEPTHS), axis=1)
    return scene._replace(dynamic=dynamic, depth=np.tile(DEPTHS, (len(BOUNDARY), 1)), stencil=stencil)


@pytest.mark.parametrize("name", sorted(set(POOL) - set(BY_HAND)))
def test_specialised_draw_treats_boundary_values_as_restated(name):
    print(f"states drawn with seed {SEED}: {POOL[name].depth_stencil}")
    rng = np.random.default_rng(SEED)
    values = [(r, 255, 255) for r in BOUNDARY] + [(127, m, 255) for m in BOUNDARY] + [(127, 255, m) for m in BOUNDARY]
    for k, (reference, read, write) in enumerate(values + rng.choice(BOUNDARY, (12, 3)).tolist()):
        scene = boundary_scene(DynamicState(None, None, reference, read, write), k)
        for options in loops_of(name):
            assert_restated(POOL[name], scene, **options)


def test_a_depth_failure_that_counts_masks_the_next_primitive():
    # Every sprite is farther than what is stored; reference 0 passes once, then the stencil is 1
    scene = full_screen(base=(0.5, 0.5, 0.5))._replace(depth=np.zeros((12, 16), np.float32))
    framebuffer, counters = run(POOL["counted"], scene, loop="dense")
    assert (framebuffer.stencil == 1).all()
    assert (counters["depth.failed"], counters["stencil.failed"]) == (12 * 16, 2 * 12 * 16)


@pytest.mark.parametrize(("write_mask", "failed"), [(1, 192), (255, 192), (254, 0), (0, 0)])
@pytest.mark.parametrize("options", [{"loop": "dense"}, {"taps": Taps("fragment")}], ids=["dense", "list"])
def test_a_write_masks_the_next_primitive_if_it_reaches_the_bits_that_are_read(options, write_mask, failed):
    scene = full_screen(base=(0.5, 0.25), stencil_read_mask=1, stencil_write_mask=write_mask)
    framebuffer, counters = run(POOL["marked"], scene, **options)
    assert counters["stencil.failed"] == counters["stencil.failed_early"] == failed
    assert (framebuffer.color("id") == (1 if failed else 2)).all()


@pytest.mark.parametrize(("size", "fate"), [(0.0, "empty"), (np.nan, "empty"), (0.25, "empty"), (4.0, "drawn")])
def test_a_draw_that_covers_nothing_changes_nothing(size, fate):
    scene = full_screen(size=size)
    framebuffer, counters = run(POOL["nearest"], scene)
    assert counters[f"raster.{fate}"] == 1
    assert (counters["raster.fragments"] > 0) == framebuffer.invocations.any() == (fate == "drawn")


@pytest.mark.parametrize("drawn", [{"instances": 0}, {"vertex_count": 0}])
def test_a_draw_of_no_primitives_changes_nothing(drawn):
    scene = random_scene(1, count=3)
    framebuffer, counters = run(POOL["nearest"], scene, taps=Taps(), **drawn)
    assert dict(counters) == {name: int(name == "draw.calls") for name in counters}
    for name, plane in planes(framebuffer).items():
        np.testing.assert_array_equal(plane, planes(target_of(POOL["nearest"], scene))[name])


def test_the_pool_reaches_what_it_is_meant_to():
    states = [pipe.depth_stencil for name, pipe in POOL.items() if name not in BY_HAND]
    for part in ("compare", "fail_op", "depth_fail_op", "pass_op"):
        assert sorted(getattr(state.stencil_front, part) for state in states) == list(range(8))
    assert sorted(state.depth_compare for state in states) == list(range(8))
    assert {state.format for state in states} == {0, 1}
    assert {pipe.early_tests for pipe in POOL.values()} == {EarlyTests.IDEAL, EarlyTests.NONE, EarlyTests.FORCED}
    tests = [fragment_tests(pipe.fragment, pipe.depth_stencil, pipe.early_tests) for pipe in POOL.values()]
    assert {test.stencil_mode for test in tests} == {STENCIL_OFF, STENCIL_MASK, STENCIL_IN_LOOP}
    for part in ("tests_first", "probe", "early_stencil", "writes_depth", "discards", "depth_write", "forced"):
        assert {getattr(test, part) for test in tests} == {False, True}, part
