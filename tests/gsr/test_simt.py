"""The account of divergence: warps, lanes, branches, loops.

Plan
- Random blocks, lanes and widths against a warp simulated lane by lane in plain Python, with both ideas of where lanes
  come together; what must hold of any account (bounds, one lane, lanes alike, order within a warp, wider warps).
- One shader after another issues what both issue as one if branches end where they end; never less if they do not.
- Pixels in quads and tiles: each once, four to a quad, a tile to a warp.
- Of traced pictures: active lane-steps are the run's arithmetic and fetches, shader by shader, in all configurations;
  lanes are invocations; finished rays keep their places in the buffer; a row of pixels by hand.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import refsim
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays.simt import WIDTHS, Account, Block, account, pixel_order
from refsim.papers.geometry_shader_rays.simt_lanes import accounts
from refsim.results import Trace
from tests.gsr.scenes import cornell, cornell_rays, cornell_trace, court, court_rays, traced

# Name, steps, whether it is a branch; trips follow
SHAPES = st.lists(st.tuples(st.integers(0, 9), st.booleans()), min_size=1, max_size=5)
SEEDS = st.integers(0, 2**32 - 1)


def made(shapes: list[tuple[int, bool]], lanes: int, seed: int) -> list[Block]:
    random = np.random.default_rng(seed)
    return [
        Block(str(k), steps, random.integers(0, 4, lanes) * random.integers(0, 2, lanes), branch)
        for k, (steps, branch) in enumerate(shapes)
    ]


def simulated(blocks: list[Block], width: int, reconverge: bool) -> tuple[int, int, int, int]:
    """Active and issued lane-steps, paths, divergent warps: one warp after the other, one block after the other."""
    lanes, active, issued, paths, divergent = len(blocks[0].trips), 0, 0, 0, 0
    for start in range(0, lanes, width):
        warp = list(range(start, min(start + width, lanes)))
        came: dict[int, tuple[bool, ...]] = dict.fromkeys(warp, ())
        for block in blocks:
            if block.branch:
                came = {lane: (*way, bool(block.trips[lane])) for lane, way in came.items()}
            groups = [warp] if reconverge else [[x for x in warp if came[x] == way] for way in set(came.values())]
            for group in groups:
                issued += width * block.steps * max(int(block.trips[lane]) for lane in group)
            active += block.steps * sum(int(block.trips[lane]) for lane in warp)
        paths += len(set(came.values()))
        divergent += len(set(came.values())) > 1
    return active, issued, paths, divergent


@given(SHAPES, st.integers(1, 70), SEEDS, st.sampled_from((1, 3, *WIDTHS)), st.booleans())
def test_against_warps_lane_by_lane(shapes: Any, lanes: int, seed: int, width: int, reconverge: bool) -> None:
    blocks = made(shapes, lanes, seed)
    found = account(blocks, width, reconverge)
    assert (found.active, found.issued, found.paths, found.divergent) == simulated(blocks, width, reconverge)
    assert (found.lanes, found.warps) == (lanes, -(-lanes // width))
    assert 0.0 <= found.utilisation <= 1.0 and found.active <= found.issued


@given(SHAPES, st.integers(1, 70), SEEDS, st.sampled_from(WIDTHS))
def test_what_holds_of_any_account(shapes: Any, lanes: int, seed: int, width: int) -> None:
    blocks = made(shapes, lanes, seed)
    found = account(blocks, width)
    alone = account(blocks, 1)
    assert alone.issued == alone.active == found.active and alone.divergent == 0 and alone.paths == lanes
    # A machine that waits less issues less; a warp of twice the width no less
    assert found.issued <= account(blocks, width, reconverge=False).issued
    assert found.issued <= account(blocks, 2 * width).issued
    order = np.random.default_rng(seed).permutation(np.arange(min(width, lanes)))
    order = np.concatenate([order, np.arange(len(order), lanes)])
    turned = [block._replace(trips=block.trips[order]) for block in blocks]
    assert account(turned, width) == found
    alike = [block._replace(trips=np.full(2 * width, block.trips[0])) for block in blocks]
    assert account(alike, width).utilisation == 1.0 and account(alike, width).divergent == 0


@given(SHAPES, SHAPES, st.integers(1, 70), SEEDS, st.sampled_from(WIDTHS))
def test_two_shaders_and_both_as_one(first: Any, second: Any, lanes: int, seed: int, width: int) -> None:
    one, other = made(first, lanes, seed), made(second, lanes, seed // 2 + 1)
    apart = account(one, width).plus(account(other, width))
    together = account(one + other, width)
    assert (together.issued, together.active) == (apart.issued, apart.active)
    waiting = [account(blocks, width, reconverge=False).issued for blocks in (one + other, one, other)]
    assert waiting[0] >= waiting[1] + waiting[2]


def test_separate_shaders_do_help_where_lanes_wait_for_the_end() -> None:
    """Two branches that have nothing to do with each other: four paths in one shader, two in each of two."""
    trips = [np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])]
    one, other = ([Block("side", 5, t), Block("after", 7, np.ones(4, np.int64), False)] for t in trips)
    assert account(one, 4, False).plus(account(other, 4, False)).issued == 2 * 4 * (5 + 2 * 7)
    assert account(one + other, 4, False).issued == 4 * (5 + 2 * 7) + 4 * (2 * 5 + 4 * 7)
    assert account(one + other, 4).issued == 2 * 4 * (5 + 7) and account(one + other, 4).paths == 4


def test_fragments_of_points_leave_three_lanes_of_a_quad_idle() -> None:
    blocks = [Block("start", 3, np.ones(16, np.int64), False)]
    assert account(blocks, 8).utilisation == 1.0 and account(blocks, 8, quads=True).utilisation == 0.25
    assert account(blocks, 8, quads=True).warps == 8


@given(st.integers(1, 21), st.integers(1, 21), st.sampled_from((4, *WIDTHS)))
def test_pixels_lie_in_quads_and_tiles(width: int, height: int, lanes: int) -> None:
    order = pixel_order(width, height, lanes)
    assert sorted(order[order >= 0]) == list(range(width * height)) and len(order) % lanes == 0
    for group, (wide, high) in ((4, (2, 2)), (lanes, {8: (4, 2), 32: (8, 4)}.get(lanes, (lanes**0.5, lanes**0.5)))):
        for part in order.reshape(-1, group):
            y, x = np.divmod(part[part >= 0], width)
            assert not len(x) or (np.ptp(x) < wide and np.ptp(y) < high)
            assert len(set(x // wide)) <= 1 and len(set(y // high)) <= 1
    if width % 8 == height % 8 == 0:
        assert (order >= 0).all()


CONFIGURATIONS: dict[str, dict[str, Any]] = {
    "three shaders": {},
    "first two as one": {"stages": "geometry", "passes": 2, "lights": 1},
    "no geometry shader": {"stages": "vertex_only", "passes": 1, "lights": 1},
    "rasterised": {"primary": "raster", "passes": 2},
    "as printed": {"errata": "as_printed", "passes": 3},
    "never shaded": {"errata": "GSR-E3", "passes": 2},
    "reversed": {"emission_order": "reversed", "passes": 2, "background": (0.0, 0.0, 0.0), "lights": 1},
    "smooth": {"shading": "smooth", "passes": 2},
    "fewer lights": {"lights": 2, "shadows": False, "passes": 3},
}


@cache
def configured(name: str) -> Trace:
    options = CONFIGURATIONS[name]
    return traced(cornell(), cornell_rays(), **{"passes": 4, "lights": 2, **options})


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_active_lane_steps_are_what_was_counted(name: str) -> None:
    trace = configured(name)
    counted = {shader: trace.counters[f"{shader}.arithmetic"] + trace.counters[f"{shader}.fetches"]
               for shader in ("vertex", "geometry", "fragment")}  # fmt: skip
    for width in (8, 64):
        found = accounts(trace, width)
        assert all(each.width == width and each.active <= each.issued for each in found.values())
        assert found["fragment"].active == counted["fragment"]
        assert found["fragment"].lanes == sum(g.counters["fragment.invocations"] for g in trace.generations)
        stages = trace.options["stages"]
        assert set(found) == {"fragment", *{"vertex": ("vertex", "geometry", "together"), "geometry": ("together",),
                                            "vertex_only": ("vertex",)}[stages]}  # fmt: skip
        if stages == "geometry":
            assert found["together"].active == counted["geometry"] and counted["vertex"] == 0
            continue
        assert found["vertex"].active == counted["vertex"]
        assert found["vertex"].lanes == sum(g.counters["vertex.invocations"] for g in trace.generations)
        if stages == "vertex":
            assert found["geometry"].active == counted["geometry"]
            assert found["together"].active == counted["vertex"] + counted["geometry"]


def test_the_separation_into_two_shaders_changes_no_issued_step() -> None:
    """Section 4.1's reason: it holds only of a machine whose lanes wait for the shader's end, and by a hundredth."""
    for width in WIDTHS:
        found, waiting = (accounts(cornell_trace(), width, reconverge) for reconverge in (True, False))
        assert found["together"].issued == found["vertex"].issued + found["geometry"].issued
        apart = waiting["vertex"].issued + waiting["geometry"].issued
        assert 1.0 < waiting["together"].issued / apart < 1.03
        assert found["together"].paths_per_warp > max(found[s].paths_per_warp for s in ("vertex", "geometry"))


def test_places_in_the_buffer() -> None:
    for name in ("three shaders", "reversed", "never shaded"):
        trace = configured(name)
        for before, g in zip((None, *trace.generations), trace.generations, strict=False):
            drawn = g.counters["vertex.invocations"]
            assert (np.diff(g.slot) > 0).all() and len(g.slot) == len(g.rays)
            assert drawn - g.alive.sum() == g.counters["geometry.in_finished"]
            assert before is None or before.occupancy.vertices == drawn
    # The floor at pixel 0 sends a shadow ray, the wall at pixel 2 one and a reflected ray, pixel 6 nothing
    trace = traced(court(), court_rays(), passes=2, background=(0.0, 0.0, 0.0))
    first, second = trace.generations
    assert first.slot.tolist() == list(range(8))
    groups = np.cumsum([0] + [2 if pixel in (0, 1) else 3 for pixel in (0, 1, 2, 3, 4, 5, 7)])[:-1]
    places = [start + step for start, pixel in zip(groups, (0, 1, 2, 3, 4, 5, 7), strict=True)
              for step in ((1,) if pixel in (0, 1) else (1, 2))]  # fmt: skip
    assert second.slot.tolist() == places


def test_fragments_of_a_viewport() -> None:
    trace = refsim.trace("fragment_grid", cornell(), cornell_rays(), acceleration="naive", passes=2, lights=2)
    lanes = len(cornell_rays()) and sum(len(pixel_order(14, 11, 8)) for _ in trace.generations)
    found = accounts(trace, 8)["fragment"]
    assert found.lanes == lanes and 0.0 < found.utilisation < 1.0
    tests = int(sum(g.per_ray["triangle_tests"].sum() for g in trace.generations))
    assert found.active > 60 * tests
    points = accounts(traced(cornell(), cornell_rays(), passes=2, lights=2), 8, quads=True)["fragment"]
    assert points.utilisation <= 0.25


def test_refusals() -> None:
    block = Block("start", 1, np.ones(4, np.int64))
    with pytest.raises(InputError, match="0 lanes"):
        account([block], 0)
    with pytest.raises(InputError, match="6 lanes"):
        account([block], 6, quads=True)
    with pytest.raises(InputError, match="the same lanes"):
        account([block, Block("other", 1, np.ones(5, np.int64))], 8)
    with pytest.raises(InputError, match="cannot be added"):
        account([block], 8).plus(account([block], 16))
    with pytest.raises(InputError, match="power of two"):
        pixel_order(4, 4, 12)
    with pytest.raises(InputError, match="brute_force"):
        accounts(refsim.trace("brute_force", court(), court_rays(), generations=1), 8)
    assert account([], 8) == Account(8, 0, 0, 0, 0, 0, 0) and account([], 8).utilisation == 1.0
