"""The account of warps: lock-step, the branch, shared fetches, packets, and what counters would report.

Plan
- Random meshes and searches, widths, mappings, lines: the account of plain Python warps that go round together, and
  packets that walk as `packet.walk_packets` describes.
- What must hold of any account: sums are the search's counts, utilisations at most 1, iterations the longest lane,
  distinct elements between iterations and nodes, packets between the longest lane and the distinct elements.
- Width 1 is the scalar loop; order within a warp changes nothing; twice the width issues no less.
- Mappings: each pixel once, tiles are tiles, Morton's curve, lists apart, a seed is a picture; refusals.
- Dead lanes stay, or are left out; accounts of shots add up.
- Readings: each by its words; of a width of 1 the plain ones are equal.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import camera_rays, load_scene
from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.search import search
from refsim.papers.sphere_hierarchy.visits import Layout, Recorder, Shot
from refsim.papers.sphere_hierarchy.warps import READINGS, Account, account, map_rays, readings, warp_table, without
from tests.bsh.test_visits import SEEDS, layers_of, shots

WIDTHS = st.sampled_from((1, 2, 3, 8, 32))
MAPPINGS = ("rows", "4x2", "2x4", "square", "morton", "tiles", "lists", "random")


def ordered(rng: np.random.Generator, rays: int, width: int) -> np.ndarray:
    """Some of the rays in any order, and some lanes without."""
    rows = np.full((-(-rays // width) + 1, width), -1, np.int32)
    kept = rng.permutation(rays)[: int(rng.integers(1, rays + 1))]
    rows.ravel()[np.sort(rng.permutation(rows.size)[: len(kept)])] = kept
    return rows


def simulated(shot: Shot, order: np.ndarray, line: int) -> list[list[int]]:
    """A row a warp: its lanes go round together, each a list of elements, one iteration after the other."""
    visits, layout, width = Recorder(shot, 1).visits(order), Layout.of(shot.layers), order.shape[1]
    found = []
    for warp in range(len(order)):
        spans = [visits.offsets[warp * width + j : warp * width + j + 2] for j in range(width)]
        left = [visits.elements[a:b].tolist() for a, b in spans]
        tests = iterations = distinct = spheres = triangles = packet = 0
        lines, nodes, remaining = [0, 0, 0], sum(map(len, left)), [list(lane) for lane in left]
        while any(remaining):
            at = [lane.pop(0) for lane in remaining if lane]
            testing = [element for element in at if layout.escape[element] in (0, 1)]
            tests, iterations, distinct = tests + len(testing), iterations + 1, distinct + len(set(at))
            spheres, triangles = spheres + (len(testing) < len(at)), triangles + bool(testing)
            lines[0] += len({(4 * element) // line for element in at})
            lines[1] += len({(int(layout.bases[1]) + 16 * element) // line for element in at})
            for k in range(3):
                corners = [int(layout.payload[element, k]) for element in testing]
                lines[2] += len({(int(layout.bases[2]) + 16 * corner) // line for corner in corners})
        following = [lane[0] if lane else None for lane in left]
        while any(element is not None for element in following):
            packet += 1
            low = min(element for element in following if element is not None)
            for j, lane in enumerate(left):
                if following[j] == low:
                    later = [element for element in lane if element > low]
                    following[j] = later[0] if later else None
        found.append([nodes, tests, iterations, distinct, spheres, triangles, packet, *lines])
    return found


@settings(max_examples=50)
@given(shots(), SEEDS, WIDTHS, st.sampled_from((4, 16, 64, 128)))
def test_against_warps_in_plain_python(shot: Shot, seed: int, width: int, line: int) -> None:
    order = ordered(np.random.default_rng(seed), len(shot.rays), width)
    assert warp_table(shot, order, line=line, threads=1).tolist() == simulated(shot, order, line)


@settings(max_examples=40)
@given(shots(), SEEDS, WIDTHS)
def test_what_holds_of_any_account(shot: Shot, seed: int, width: int) -> None:
    rng = np.random.default_rng(seed)
    order = ordered(rng, len(shot.rays), width)
    rows = order[order >= 0]
    counted = search(shot.layers, shot.rays, starts=shot.starts, any_hit=shot.any_hit, facing=shot.facing, threads=1)
    one = account([shot], order, threads=1)
    nodes = np.where(order < 0, 0, counted.nodes[order])
    assert one.nodes == counted.nodes[rows].sum() and one.triangle_tests == counted.triangle_tests[rows].sum()
    assert one.iterations == nodes.max(axis=1).sum() and one.warps == int(nodes.any(axis=1).sum())
    assert one.rays == int((shot.rays.t_max[rows] > 0).sum())
    assert one.iterations <= one.packet <= one.distinct <= one.nodes
    assert max(one.sphere_issues, one.triangle_issues) <= one.iterations <= one.sphere_issues + one.triangle_issues
    assert one.escape_lines <= one.distinct and one.payload_lines <= one.distinct
    assert 3 * one.triangle_issues <= one.vertex_lines <= 3 * one.triangle_tests
    shares = (one.utilisation, one.sphere_utilisation, one.triangle_utilisation, one.packet_utilisation)
    assert all(0.0 <= share <= 1.0 for share in shares) and one.packet_utilisation <= one.utilisation

    # Order within a warp changes nothing
    turned = np.take_along_axis(order, rng.permuted(np.tile(np.arange(width), (len(order), 1)), axis=1), axis=1)
    assert account([shot], turned, threads=1) == one
    # Two warps as one issue no less: they wait for the longer
    doubled = np.concatenate([order, np.full((len(order) % 2, width), -1, np.int32)]).reshape(-1, 2 * width)
    wide = account([shot], doubled, threads=1)
    assert wide.iterations * wide.width >= one.iterations * one.width and wide.packet <= one.packet
    # Both shots together
    both = account([shot, shot], order, threads=1)
    assert both == one.plus(one) and both.utilisation == one.utilisation


@settings(max_examples=20)
@given(shots(), SEEDS)
def test_a_warp_of_one_lane_is_the_scalar_loop(shot: Shot, seed: int) -> None:
    order = ordered(np.random.default_rng(seed), len(shot.rays), 1)
    one = account([shot], order, threads=1)
    assert one.utilisation == one.sphere_utilisation == one.triangle_utilisation == one.packet_utilisation == 1.0
    assert one.iterations == one.distinct == one.packet == one.escape_lines == one.payload_lines == one.nodes
    assert (one.sphere_issues, one.triangle_issues) == (one.nodes - one.triangle_tests, one.triangle_tests)
    assert one.vertex_lines == 3 * one.triangle_tests
    if one.warps:
        read = readings(one)
        same = ("nodes", "iterations", "distinct", "packet", "issues", "nodes × width", "iterations × width²")
        assert len({read[name] for name in same}) == 1


@given(st.integers(1, 21), st.integers(1, 21), st.sampled_from(MAPPINGS), SEEDS)
def test_each_pixel_has_one_lane(width: int, height: int, mapping: str, seed: int) -> None:
    lists = np.random.default_rng(seed).integers(0, 6, width * height).astype(np.int32)
    order = map_rays(mapping, width, height, 8, lists=lists, seed=seed)
    assert order.shape[1] == 8 and order.dtype == np.int32
    assert np.array_equal(np.sort(order[order >= 0]), np.arange(width * height))
    tile = {"rows": (8, 1), "4x2": (4, 2), "2x4": (2, 4), "square": (4, 2)}.get(mapping)
    for warp in order:
        y, x = np.divmod(warp[warp >= 0], width)
        if tile is not None:
            assert len(set(x // tile[0])) == 1 and len(set(y // tile[1])) == 1
            assert warp[warp >= 0].tolist() == sorted(warp[warp >= 0])
    if mapping == "lists":
        assert (np.diff(lists[order[order >= 0]]) >= 0).all()
    if mapping == "random":
        assert np.array_equal(order, map_rays("random", width, height, 8, seed=seed))
    if tile is None:
        assert len(order) == -(-width * height // 8)


def test_morton_order_and_tiles_by_hand() -> None:
    assert map_rays("morton", 4, 4, 4).tolist() == [[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 12, 13], [10, 11, 14, 15]]
    assert map_rays("2x2", 3, 3, 4).tolist() == [[0, 1, 3, 4], [2, -1, 5, -1], [6, 7, -1, -1], [8, -1, -1, -1]]
    assert map_rays("rows", 3, 2, 2).tolist() == [[0, 1], [2, -1], [3, 4], [5, -1]]
    assert [part.tolist() for part in map_rays("tiles", 16, 16, 64)][1][:9] == [*range(8, 16), 24]
    dead = np.array([False, True, True, False, False, False])
    assert without(map_rays("rows", 3, 2, 2), dead).tolist() == [[0, 3], [4, 5]]
    assert len(without(map_rays("rows", 3, 2, 2), np.ones(6, np.bool_))) == 0
    assert not np.array_equal(map_rays("random", 8, 8, 4, seed=1), map_rays("random", 8, 8, 4, seed=2))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("spiral", 4, 4, 4), "must be a tile"),
        (("8x4", 4, 4, 16), "does not fill"),
        (("square", 4, 4, 24), "no square tile"),
        (("rows", 4, 4, 0), "cannot hold rays"),
        (("lists", 4, 4, 4), "needs the list"),
    ],
)
def test_mappings_that_are_refused(arguments: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        map_rays(*arguments)


def test_what_cannot_be_accounted_is_refused() -> None:
    scene = load_scene("cubes")
    shot = Shot(layers_of(scene.triangles, 1), camera_rays(scene, 4, 4))
    order = map_rays("rows", 4, 4, 4)
    with pytest.raises(InputError, match="holds nothing"):
        account([shot], order, line=0)
    with pytest.raises(InputError, match="needs a shot"):
        account([], order)
    with pytest.raises(InputError, match="cannot be added"):
        account([shot], order).plus(account([shot], map_rays("rows", 4, 4, 2)))
    with pytest.raises(InputError, match="no counts a ray"):
        readings(account([shot], np.full((2, 4), -1, np.int32)))


def test_readings_say_what_their_names_say() -> None:
    numbers = Account(
        width=4, line=64, rays=10, warps=5, nodes=200, triangle_tests=30, iterations=70, distinct=150, sphere_issues=60,
        triangle_issues=20, packet=110, escape_lines=80, payload_lines=90, vertex_lines=40,
    )  # fmt: skip
    assert readings(numbers) == {
        "nodes": 20.0, "iterations": 7.0, "distinct": 15.0, "packet": 11.0, "issues": 8.0, "lines": 21.0,
        "texels": 49.0, "bytes": 20 * 20 + 48 * 3.0, "line bytes": 21 * 64.0, "nodes × width": 80.0,
        "iterations × width": 28.0, "iterations × width²": 112.0, "distinct × width": 60.0, "packet × width": 44.0,
        "packet × width²": 176.0, "issues × width": 32.0, "lines × width": 84.0, "nodes of a warp": 40.0,
        "iterations of a warp": 14.0, "packet of a warp": 22.0,
    }  # fmt: skip
    assert set(readings(numbers)) == set(READINGS)
    shares = (numbers.utilisation, numbers.sphere_utilisation, numbers.triangle_utilisation)
    assert shares == (200 / 280, 170 / 240, 30 / 80) and numbers.packet_utilisation == 200 / 440


def test_tiles_keep_warps_together_and_chance_does_not() -> None:
    """The cubes: the same rays and counts, another grouping."""
    scene = load_scene("cubes")
    rays = camera_rays(scene, 32, 32)
    shot = Shot(layers_of(scene.triangles, 6), rays)
    picked = list_of_rays(rays.direction, 6)
    orders = {name: map_rays(name, 32, 32, lists=picked) for name in ("8x4", "lists", "random")}
    found = {name: account([shot], order, threads=1) for name, order in orders.items()}
    assert len({one.nodes for one in found.values()}) == 1
    assert found["8x4"].utilisation > found["random"].utilisation
    assert found["8x4"].packet < found["random"].packet and found["8x4"].lines < found["random"].lines
    # Lanes of one list share more of it, though the tiles at a border between two lists are not whole any more
    assert found["lists"].distinct < found["random"].distinct
