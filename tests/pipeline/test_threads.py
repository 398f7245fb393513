"""What must not be seen in a result: threads, taps, sizes of slices, bins and batches, a kernel compiled before.

Plan
- 1, 2 and 5 threads leave the same bits and counters, in both loops, points and quads, with instances.
- A tap changes no bit and no counter, whatever loop would run without it.
- Slices of 8 primitives and batches of 64 bin items (bounded memory) leave the same bits, with and without a tap.
- 10 million fragments: 1 and 2 threads, same bits.
- An equal pipeline made anew, other masks, references, scissors, uniforms and threads compile nothing.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.pipeline import draw as draw_module
from refsim.pipeline import fragment_stage as fragment_stage_module
from refsim.pipeline import rounds as rounds_module
from refsim.pipeline.layout import shape_of
from refsim.pipeline.program import program_of
from refsim.pipeline.state import DynamicState, ScissorRect
from refsim.pipeline.taps import Taps
from tests.pipeline.pipelines import LARGE, POOL, TARGETS, Rules, as_quads
from tests.pipeline.scenes import assert_same, random_scene, run

seeds = st.integers(0, 2**31)
names = st.sampled_from(["nearest", "marked", "counted"])


@settings(deadline=None, max_examples=40)
@given(names, seeds, st.sampled_from([2, 5]), st.sampled_from(["dense", "list"]), st.booleans())
def test_any_number_of_threads_gives_the_same_bits(name, seed, threads, loop, quads):
    pipe = as_quads(POOL[name]) if quads else POOL[name]
    taps = {"taps": Taps("fragment")} if loop == "list" else {"loop": "dense"}
    scene = random_scene(seed, count=100, width=150, height=90, quads=quads)
    one = run(pipe, scene, instances=2, threads=1, **taps)
    assert_same(one, run(pipe, scene, instances=2, threads=threads, **taps))


@pytest.mark.parametrize("largest", [3.0, 70.0])
def test_a_tap_changes_nothing(largest):
    scene = random_scene(7, count=200, width=150, height=90, largest=largest)
    assert_same(run(POOL["nearest"], scene), run(POOL["nearest"], scene, taps=Taps()))


@settings(deadline=None, max_examples=25)
@given(names, seeds, st.sampled_from([1, 3]), st.booleans(), st.booleans())
def test_slices_and_batches_do_not_matter(name, seed, threads, tapped, quads):
    pipe = as_quads(POOL[name]) if quads else POOL[name]
    scene = random_scene(seed, count=100, width=150, height=90, quads=quads)
    whole = Taps("fragment") if tapped else None
    parts = Taps("fragment") if tapped else None
    expected = run(pipe, scene, taps=whole, loop="dense")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rounds_module, "SMALLEST_SLICE", 8)
        patch.setattr(rounds_module, "ROUND_PRIMITIVES", 8)
        patch.setattr(fragment_stage_module, "BIN_ITEMS", 64)
        assert_same(expected, run(pipe, scene, taps=parts, loop="dense", threads=threads))
    if tapped:
        for column in ("primitive", "x", "y", "fate", "depth"):
            np.testing.assert_array_equal(getattr(whole.fragment[0], column), getattr(parts.fragment[0], column))


def test_small_slices_are_really_taken(monkeypatch):
    rounds = []
    run_fragments = draw_module.run_fragments
    monkeypatch.setattr(rounds_module, "ROUND_PRIMITIVES", 8)
    monkeypatch.setattr(rounds_module, "SMALLEST_SLICE", 8)
    monkeypatch.setattr(draw_module, "run_fragments", lambda *a, **k: rounds.append(1) or run_fragments(*a, **k))
    scene = random_scene(3, count=100)
    run(POOL["nearest"], scene)
    assert len(rounds) == -(-len(scene.columns["size"]) // 8)


def test_ten_million_fragments_give_the_same_bits_with_two_threads():
    rng = np.random.default_rng(5)
    n, side = 4000, 256
    x, y = rng.integers(0, side - 50, (2, n, 1))
    corners = np.array([[0, 0], [50, 0], [50, 50], [0, 50]])
    pixels = np.stack([x + corners[:, 0], y + corners[:, 1]], axis=-1).reshape(-1, 2)
    z = np.repeat(rng.integers(1, 255, n) / 256, 4)
    scene = random_scene(5, count=1, width=side, height=side)
    columns = {
        "position": np.stack([pixels[:, 0] / 128 - 1, 1 - pixels[:, 1] / 128, z, np.ones(4 * n)], axis=1),
        "size": np.zeros(4 * n),
        "base": z,
        "color": np.repeat(rng.random((n, 2)), 4, axis=0),
        "id": np.repeat(np.arange(n), 4),
    }
    scene = scene._replace(columns=columns, dynamic=DynamicState(), rules=Rules(3, 0.0))
    one = run(as_quads(POOL["nearest"]), scene, threads=1)
    assert one[1]["raster.fragments"] == 10_000_000
    assert_same(one, run(as_quads(POOL["nearest"]), scene, threads=2))


def test_a_pipeline_is_compiled_once():
    scene, pipe = random_scene(1), POOL["marked"]
    run(pipe, scene, loop="dense")
    shapes = shape_of(scene.rules), shape_of(scene.images), False, tuple(TARGETS.values())
    program = program_of(pipe, *shapes)
    kernels = program.front_end, program.dense, program.bin_primitives
    before = [len(kernel.signatures) for kernel in kernels]
    for reference, read, scissor, modulus in ((1, 255, None, 3), (0, 7, ScissorRect(1, 2, 3, 4), LARGE)):
        dynamic = DynamicState(None, scissor, reference, read, 128)
        again = scene._replace(dynamic=dynamic, rules=Rules(modulus, 0.5))
        run(replace(pipe), again, loop="dense", threads=2, instances=2)
    equal = program_of(replace(pipe), *shapes)
    assert (equal.front_end, equal.dense, equal.bin_primitives) == kernels
    assert [len(kernel.signatures) for kernel in kernels] == before
