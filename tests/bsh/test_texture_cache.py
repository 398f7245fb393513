"""The texture cache: replacement, warps that take turns, locality.

Plan
- Random address streams and shapes of cache against an OrderedDict a set; limits: one line, room for all, more ways
  never hit less (inclusion); sets of their own.
- Random searches, orders, machines against plain Python multiprocessors, warps and lanes; several shots a warp.
- What must hold: fetches are the counts of nodes and tests, whatever the machine; misses between the compulsory ones
  and all; a cache that holds everything has only those; two lanes by hand.
- Of a trace: shots are its searches, with shadow rays, heads and cells; locality's rows are what simulate says.
- Refusals.
"""

from __future__ import annotations

from collections import Counter, OrderedDict, deque
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import refsim
from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.locality import list_options, measure, order_of, shots_of
from refsim.papers.sphere_hierarchy.setup import prepare
from refsim.papers.sphere_hierarchy.texture_cache import (
    GT200,
    Cache,
    Machine,
    direct_mapped,
    fully_associative,
    hits_of,
    simulate,
    sweep,
)
from refsim.papers.sphere_hierarchy.visits import Layout, Recorder, Shot
from refsim.papers.sphere_hierarchy.warps import account
from refsim.results import RayKind
from tests.bsh.test_visits import SEEDS, layers_of, shots
from tests.bsh.test_warps import WIDTHS, ordered
from tests.bsh.traced import eye_rays, mixed, traced

STREAMS = st.lists(st.integers(0, 1023), max_size=200)
SHAPES = st.builds(Cache, st.integers(1, 5), st.integers(1, 6), st.sampled_from((16, 32, 48)))


class Plain:
    """A cache as one would write it: a dictionary in order of use for each set."""

    def __init__(self, cache: Cache) -> None:
        self.cache, self.sets = cache, [OrderedDict[int, None]() for _ in range(cache.sets)]
        self.seen: set[int] = set()

    def touch(self, address: int) -> tuple[bool, bool]:
        """Whether it hits, and whether the line was never fetched before."""
        line = address // self.cache.line
        own, new = self.sets[line % self.cache.sets], line not in self.seen
        self.seen.add(line)
        hit = line in own
        own[line] = None
        own.move_to_end(line)
        if len(own) > self.cache.ways:
            own.popitem(last=False)
        return hit, new


@settings(max_examples=200)
@given(STREAMS, SHAPES)
def test_replacement_against_ordered_dictionaries(addresses: list[int], cache: Cache) -> None:
    plain = Plain(cache)
    assert hits_of(addresses, cache).tolist() == [plain.touch(address)[0] for address in addresses]


@settings(max_examples=100)
@given(STREAMS, st.integers(1, 12), st.sampled_from((16, 64)))
def test_limits_and_inclusion(addresses: list[int], ways: int, line: int) -> None:
    numbers = np.array(addresses, np.int64) // line
    smaller, larger = (hits_of(addresses, Cache(1, n, line)) for n in (ways, ways + 1))
    assert not (smaller & ~larger).any()
    assert hits_of(addresses, Cache(1, 1, line))[1:].tolist() == (numbers[1:] == numbers[:-1]).tolist()
    for holds_all in (fully_associative(1024, line), direct_mapped(1024, line)):
        assert holds_all.size == 1024
        assert len(addresses) - hits_of(addresses, holds_all).sum() == len(set(numbers.tolist()))
    # A set sees its own lines alone
    split = hits_of(addresses, Cache(3, ways, line))
    for own in range(3):
        chosen = numbers % 3 == own
        assert np.array_equal(split[chosen], hits_of(np.array(addresses)[chosen], Cache(1, ways, line)))


def plain_counts(passes: list[Shot], order: np.ndarray, machine: Machine) -> tuple[list[int], list[int], list[int]]:
    """Multiprocessors, warps and lanes in plain Python."""
    layout, width = Layout.of(passes[0].layers), order.shape[1]
    parts = [Recorder(shot, 1).visits(order) for shot in passes]
    queues: list[deque[list[list[list[int]]]]] = [deque() for _ in range(machine.multiprocessors)]
    for warp in range(len(order)):
        work = []
        for part in parts:
            ends = part.offsets[warp * width : (warp + 1) * width + 1].tolist()
            lanes = [part.elements[a:b].tolist() for a, b in pairwise(ends)]
            # In lock-step: what the active lanes fetch, iteration after iteration
            work += [[lane[k] for lane in lanes if k < len(lane)] for k in range(max(map(len, lanes)))]
        queues[warp // machine.block % machine.multiprocessors].append(work)
    fetches, misses, new = Counter[int](), Counter[int](), Counter[int]()
    for queue in queues:
        cache = Plain(machine.cache)

        def fetch(kind: int, address: int, cache: Plain = cache) -> None:
            hit, never = cache.touch(int(layout.bases[kind]) + address)
            fetches[kind] += 1
            misses[kind] += not hit
            new[kind] += never

        places: list[Any] = [[] for _ in range(machine.resident)]
        while queue or any(places):
            for k in range(machine.resident):
                while queue and not places[k]:
                    places[k] = queue.popleft()
                if not places[k]:
                    continue
                active = places[k].pop(0)
                for element in active:
                    fetch(0, 4 * element)
                for element in active:
                    fetch(1, 16 * element)
                for corner in range(3):
                    for element in active:
                        if layout.escape[element] in (0, 1):
                            fetch(2, 16 * int(layout.payload[element, corner]))
    return tuple([count[kind] for kind in range(3)] for count in (fetches, misses, new))  # type: ignore[return-value]


MACHINES = st.builds(
    Machine,
    st.builds(Cache, st.integers(1, 4), st.integers(1, 4), st.sampled_from((16, 64))),
    st.integers(1, 3),
    st.integers(1, 4),
    st.integers(1, 2),
)


@settings(max_examples=60)
@given(shots(), st.booleans(), SEEDS, WIDTHS, MACHINES)
def test_against_plain_multiprocessors(shot: Shot, twice: bool, seed: int, width: int, machine: Machine) -> None:
    order = ordered(np.random.default_rng(seed), len(shot.rays), width)
    passes = [shot, shot._replace(any_hit=not shot.any_hit)] if twice else [shot]
    counts = simulate(passes, order, machine, threads=1)
    expected = plain_counts(passes, order, machine)
    assert (counts.fetches.tolist(), counts.misses.tolist(), counts.compulsory.tolist()) == expected

    own = account(passes, order, threads=1)
    assert counts.rays == own.rays and counts.fetches.tolist() == [own.nodes, own.nodes, 3 * own.triangle_tests]
    assert (counts.compulsory <= counts.misses).all() and (counts.misses <= counts.fetches).all()
    assert counts.bytes_from_memory == counts.misses.sum() * machine.cache.line
    total = int(counts.fetches.sum())
    assert counts.hit_rates["all"] == (1.0 - int(counts.misses.sum()) / total if total else 1.0)
    assert all(0.0 <= rate <= 1.0 for rate in counts.hit_rates.values())
    # The same on three threads, and where everything fits only what must be fetched is
    large = machine._replace(cache=fully_associative(1 << 16, machine.cache.line))
    again, all_held = sweep(passes, order, [machine, large], threads=3)
    assert all(np.array_equal(a, b) for a, b in zip(again, counts, strict=True))
    assert np.array_equal(all_held.misses, counts.compulsory) and np.array_equal(all_held.compulsory, counts.compulsory)
    if machine.multiprocessors == 1:
        assert all_held.misses.sum() * machine.cache.line <= counts.footprint + 3 * machine.cache.line


def test_two_lanes_by_hand() -> None:
    """A root and two triangles: two lanes, three iterations. Lines of 16 bytes: payloads and vertices are a line each.

    Escapes of the three elements lie in one line; a lane that follows another always hits what that one fetched.
    """
    square = np.array([[0, -1, -1], [0, 1, -1], [0, 0, 1]], np.float32)
    layers = layers_of(np.stack([square, square + np.float32([4, 0, 0])]), 1)
    origin, direction = np.array([[-1, 0, 0], [-1, 0.1, 0]]), np.array([[1, 0, 0], [1, 0, 0]])
    shot, pair = Shot(layers, refsim.Rays(origin, direction)), np.array([[0, 1]], np.int32)
    counts = simulate([shot], pair, Machine(fully_associative(1024, 16), 1, 1))
    assert (counts.fetches.tolist(), counts.misses.tolist()) == ([6, 6, 12], [1, 3, 6])
    # One line in all: of the two lanes of each fetch the second hits, and nothing survives until the next
    one = simulate([shot], pair, Machine(fully_associative(16, 16), 1, 1))
    assert one.misses.tolist() == [3, 3, 6] and one.compulsory.tolist() == [1, 3, 6]
    # Two warps of a lane on two multiprocessors fetch everything twice; on one, resident together, they share
    apart = simulate([shot], pair.T.copy(), Machine(fully_associative(1024, 16), 2, 1))
    assert apart.misses.tolist() == [2, 6, 12]
    assert simulate([shot], pair.T.copy(), Machine(fully_associative(1024, 16), 1, 2)).misses.tolist() == [1, 3, 6]


@pytest.mark.parametrize(
    "options",
    [
        {"shadows": True, "generations": 2},
        {"shadows": True, "heads": "regular", "screen_cells": 4, "generations": 3},
        {"lists": 1, "layers": (50,), "generations": 3, "errata": "BSH-E5"},
        {"culling": "sextant_safe", "facing": "front", "generations": 1},
    ],
)
def test_shots_are_the_searches_of_a_trace(options: dict[str, Any]) -> None:
    trace = traced(mixed(), eye_rays(), **options)
    prepared = prepare(trace.scene, list_options(trace))
    made = shots_of(prepared, trace)
    order = order_of(eye_rays(), "8x4", trace.options["lists"])
    one = account(made, order)
    assert one.nodes == trace.counters["traversal.nodes"]
    assert one.triangle_tests == trace.counters["intersection.triangle_tests"]
    assert one.rays == sum(int(generation.alive.sum()) for generation in trace.generations)
    shadows = [bool((generation.kind == RayKind.SHADOW).any()) for generation in trace.generations]
    assert [shot.any_hit for shot in made].count(True) == sum(shadows)


def test_locality_says_what_the_parts_say() -> None:
    trace = traced(mixed(), eye_rays(), shadows=True, generations=2)
    small = Machine(Cache(4, 2, 64), 4, 8)
    rows = measure(trace, (1, 6), ("8x4", "random"), (Machine(), small), seed=3)
    assert [(row.lists, row.mapping, row.machine) for row in rows] == [
        (lists, mapping, machine) for lists in (1, 6) for mapping in ("8x4", "random") for machine in (Machine(), small)
    ]
    for row in rows:
        assert row.account.line == GT200.line and row.cache.cache == row.machine.cache
        assert row.bytes_per_node * row.account.nodes == pytest.approx(row.cache.bytes_from_memory, rel=1e-12)
    of = {(row.lists, row.mapping, row.machine): row for row in rows}
    for lists in (1, 6):
        tiles, chance = of[lists, "8x4", small], of[lists, "random", small]
        assert tiles.account.nodes == chance.account.nodes and tiles.cache.footprint == chance.cache.footprint
        assert tiles.cache.misses.sum() < chance.cache.misses.sum()
        assert of[lists, "8x4", Machine()].cache.misses.sum() < tiles.cache.misses.sum()
    assert of[6, "8x4", small].cache.footprint > of[1, "8x4", small].cache.footprint
    # A hundred triangles: one list is held far better, so the paper's claim does not hold of small scenes
    assert of[6, "8x4", small].cache.misses.sum() > of[1, "8x4", small].cache.misses.sum()


def test_what_is_refused() -> None:
    layers = layers_of(np.eye(3, dtype=np.float32)[None], 1)
    shot, order = Shot(layers, refsim.Rays(np.zeros((1, 3)), np.eye(3)[:1])), np.zeros((1, 1), np.int32)
    for machine, words in (
        (Machine(Cache(0, 1, 16)), "at least one set"),
        (Machine(Cache(1, 1, 24)), "would split a fetch"),
        (Machine(resident=0), "at least one multiprocessor"),
    ):
        with pytest.raises(InputError, match=words):
            simulate([shot], order, machine)
    for made in ([], [shot, shot._replace(layers=list(layers))]):
        with pytest.raises(InputError, match="all of the same layers"):
            simulate(made, order)
    with pytest.raises(InputError, match="0 or more"):
        hits_of([-1], GT200)
    other = refsim.trace("brute_force", mixed(), eye_rays(), generations=1)
    with pytest.raises(InputError, match="visits no traversal lists"):
        measure(other)
    with pytest.raises(InputError, match="picture's width and height"):
        order_of(shot.rays, "rows", 1)
