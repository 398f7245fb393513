"""Early-test policies, fates, and the laws that counters obey.

Plan
- ideal, mesa and none leave the same picture and write the same fragments; without discards each test also fails the
  same ones. Only the number of shader runs differs: ideal ≤ mesa ≤ none.
- forced, row by row beside a control: tests and updates come first, a written depth is ignored, a discard stops colour
  alone.
- Counted from a tap, fates, shader runs, and shader runs of every pixel are what counters and invocations plane say;
  a vertex tap holds every vertex invocation, in order.
- A discarded fragment that would also have failed a test is counted once, by whichever came first.
- Counters refuse undeclared names; a broken law is named.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import LAWS, REGISTRY, ConservationError, Counters
from refsim.pipeline.fragment import DEPTH_FAILED, DISCARDED, EARLY_DEPTH, EARLY_STENCIL, STENCIL_FAILED, WRITTEN
from refsim.pipeline.state import EarlyTests
from refsim.pipeline.taps import Taps
from tests.pipeline.pipelines import LARGE, POOL, TAPPED, Rules
from tests.pipeline.scenes import full_screen, planes, random_scene, run

seeds = st.integers(0, 2**31)


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(["marked", "counted"]), seeds)
def test_policies_give_the_same_picture(name, seed):
    scene = random_scene(seed, count=60, width=70, height=45)
    drawn = {
        policy: run(replace(POOL[name], early_tests=policy), scene, loop="dense")
        for policy in (EarlyTests.IDEAL, EarlyTests.MESA, EarlyTests.NONE)
    }
    pictures = [planes(framebuffer) for framebuffer, _ in drawn.values()]
    counts = [counters for _, counters in drawn.values()]
    for plane in set(pictures[0]) - {"invocations"}:
        for other in pictures[1:]:
            np.testing.assert_array_equal(pictures[0][plane], other[plane], err_msg=plane)
    same = {"raster.fragments", "fragment.written"}
    same |= set() if POOL[name].fragment.discards else {"stencil.failed", "depth.failed"}
    assert all(len({c[counter] for c in counts}) == 1 for counter in same)
    runs = [c["fragment.invocations"] for c in counts]
    assert runs == sorted(runs) and runs[-1] == counts[-1]["raster.fragments"]
    # Mesa tests early as the ideal does, or not at all when the shader discards or writes depth
    shader = POOL[name].fragment
    assert runs[1] == (runs[2] if shader.discards or shader.writes_depth else runs[0])


@settings(deadline=None, max_examples=40)
@given(st.sampled_from(TAPPED), seeds)
def test_a_tap_recounts_everything(name, seed):
    taps = Taps()
    framebuffer, counters = run(POOL[name], random_scene(seed, count=60, width=70, height=45), taps=taps)
    fates = np.bincount(taps.fragment[0].fate, minlength=7)
    assert fates[0] == 0 and fates.sum() == counters["raster.fragments"]
    assert fates[EARLY_STENCIL] == counters["stencil.failed_early"]
    assert fates[EARLY_DEPTH] == counters["depth.failed_early"]
    assert fates[DISCARDED] == counters["fragment.discarded"]
    assert fates[STENCIL_FAILED] + fates[EARLY_STENCIL] == counters["stencil.failed"]
    assert fates[DEPTH_FAILED] + fates[EARLY_DEPTH] == counters["depth.failed"]
    assert fates[WRITTEN] == counters["fragment.written"]
    tap = taps.fragment[0]
    ran = (tap.fate != EARLY_STENCIL) & (tap.fate != EARLY_DEPTH)
    per_pixel = np.zeros_like(framebuffer.invocations)
    np.add.at(per_pixel, (tap.y[ran], tap.x[ran]), 1)
    np.testing.assert_array_equal(per_pixel, framebuffer.invocations)
    assert ran.sum() == counters["fragment.invocations"]


@settings(deadline=None, max_examples=20)
@given(seeds, st.integers(1, 3))
def test_a_vertex_tap_holds_every_invocation(seed, instances):
    scene, taps = random_scene(seed), Taps("vertex")
    _, counters = run(POOL["nearest"], scene, taps=taps, instances=instances)
    tap, columns = taps.vertex[0], scene.columns
    assert len(tap.position) == counters["vertex.invocations"] == instances * len(columns["size"])
    np.testing.assert_array_equal(tap.position, np.tile(columns["position"], (instances, 1)))
    np.testing.assert_array_equal(tap.point_size, np.tile(columns["size"], instances))
    np.testing.assert_array_equal(tap.varyings["color"], np.tile(columns["color"], (instances, 1)))
    number = np.concatenate([columns["id"] + 1000 * k for k in range(instances)])
    np.testing.assert_array_equal(tap.varyings["id"], number)


# A target at depth 1, stencil 0. The primitive lies at 0.25, its shader writes 0.5 and may discard every second pixel.
FORCED = [
    # policy, discards, stored depth, stencil increments, colours written
    ("control: nothing discarded", "marked", LARGE, 0.5, 1.0, 1.0),
    ("control: a discard stops everything", "marked", 2, 0.5, 0.5, 0.5),
    ("forced: written depth is ignored", "marked, forced", LARGE, 0.25, 1.0, 1.0),
    ("forced: a discard stops colour alone", "marked, forced", 2, 0.25, 1.0, 0.5),
]


@pytest.mark.parametrize("loop", ["dense", "list"])
@pytest.mark.parametrize("row", FORCED, ids=[row[0] for row in FORCED])
def test_forced_row(row, loop):
    _, name, modulus, depth, marked, colored = row
    scene = full_screen(base=(0.5,), z=(0.25,))._replace(rules=Rules(modulus, 0.0))
    taps = {"taps": Taps("fragment")} if loop == "list" else {"loop": loop}
    framebuffer, counters = run(POOL[name], scene, **taps)
    changed = framebuffer.depth != 1
    assert set(framebuffer.depth[changed]) == {depth}
    assert changed.mean() == (framebuffer.stencil == 1).mean() == marked
    assert (framebuffer.color("id") == 1).mean() == colored
    assert counters["fragment.discarded"] == (1 - colored) * 192 and counters["fragment.invocations"] == 192


def test_who_comes_first_counts_a_fragment_that_two_would_stop():
    # Stencil 1 everywhere fails the test against 0, and every second fragment is discarded
    scene = full_screen()._replace(rules=Rules(2, 0.0), stencil=np.ones((12, 16), np.uint8))
    _, early = run(POOL["marked"], scene, loop="dense")
    _, late = run(POOL["marked, none"], scene, loop="dense")
    assert (early["stencil.failed"], early["fragment.discarded"], early["fragment.invocations"]) == (192, 0, 0)
    assert (late["stencil.failed"], late["fragment.discarded"], late["fragment.invocations"]) == (96, 96, 192)


def test_counters_refuse_what_is_not_declared():
    counters = Counters()
    with pytest.raises(KeyError, match=r"fragment\.invented"):
        counters.add("fragment.invented", 1)
    with pytest.raises(KeyError, match="invented"):
        counters["invented"]
    assert counters["fragment.written"] == 0 and not len(counters)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: "+".join(law.left + law.right))
def test_a_broken_law_is_named(law):
    counters = Counters()
    counters.merge(dict.fromkeys(REGISTRY, 0))
    counters.check()
    counters.add(law.right[-1], 3)
    with pytest.raises(ConservationError, match=rf"{law.right[-1]} = 3"):
        counters.check()
