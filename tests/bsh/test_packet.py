"""Packets change nothing: hits and counts are those of the scalar loop, bit for bit.

Plan
- Hypothesis: random and degenerate meshes × lists × order × facing × any hit, rays that a structure may lose (through
  corners, along axes, from within spheres, with an end): packets ≡ scalar loop.
- Boundary table: 0, 1, 255, 256, 257 and 513 live rays, dead ones among others; heads in mid-list, at the end and
  beyond it; several layers with and without heads; whole lists that are empty; far origins, where κ is large or
  infinite.
- Images: rays of one list and of several, sizes that do not fill tiles; 1, 2 and 3 threads; every slot that stands in
  for an equation of the loop reaches the packets too.
- Golden numbers: counts of one small image, and a real mesh where it is at hand.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import refsim
from refsim import Rays, Scene
from refsim.papers.sphere_hierarchy.errata import Printed, slots_of
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
from refsim.papers.sphere_hierarchy.lists import ORDERS, TraversalLists, build_lists
from refsim.papers.sphere_hierarchy.search import Found, by_list, search, tile_order
from tests.bsh.meshes import meshes, rays_at, same_hits
from tests.bsh.traced import eye_rays, mixed, wild_rays
from tests.scenes_present import real_scene

GOLDEN = (22375, 11254, 118, 90)  # elements, triangle tests; the most of each that a ray has


def lists_of(scene: Scene, lists: int = 6, **options: Any) -> TraversalLists:
    return build_lists(build_hierarchy(scene), lists, **options)


def same(one: Found, other: Found) -> None:
    same_hits(one.hits, other.hits)
    assert one.nodes.dtype == one.triangle_tests.dtype == np.int32
    assert np.array_equal(one.nodes, other.nodes)
    assert np.array_equal(one.triangle_tests, other.triangle_tests)


def both(layers: list[TraversalLists], rays: Rays, **options: Any) -> Found:
    """The packets' answer, after it has been found equal to the scalar loop's."""
    found = search(layers, rays, packet=True, **options)
    same(found, search(layers, rays, packet=False, **options))
    return found


def part(scene: Scene, rows: slice) -> Scene:
    return Scene(scene.triangles[rows], "part")


@settings(max_examples=60)
@given(
    triangles=meshes(),
    seed=st.integers(0, 2**16),
    lists=st.sampled_from((1, 2, 6, 8)),
    order=st.sampled_from(ORDERS),
    facing=st.sampled_from(("both", "front")),
    any_hit=st.booleans(),
)
def test_packets_equal_the_scalar_loop(triangles, seed, lists, order, facing, any_hit) -> None:
    structure = lists_of(Scene(triangles), lists, order=order)
    both([structure], rays_at(triangles, 300, seed), facing=facing, any_hit=any_hit)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**16), any_hit=st.booleans(), cut=st.integers(1, 101), threads=st.integers(1, 3))
def test_heads_and_layers(seed: int, any_hit: bool, cut: int, threads: int) -> None:
    """Heads anywhere from the first element to beyond the last, in none, some or all of the layers."""
    scene = mixed()
    rng = np.random.default_rng(seed)
    layers = [lists_of(part(scene, slice(0, cut)), 6), lists_of(part(scene, slice(cut, None)), 6)]
    rays = wild_rays(scene, 600, seed)
    starts = [
        None if rng.random() < 0.3 else rng.integers(0, len(layer.escape) // 6 + 3, len(rays)).astype(np.int32)
        for layer in layers
    ]
    both(layers, rays, starts=starts, any_hit=any_hit, threads=threads)


@pytest.mark.parametrize("count", [0, 1, 15, 16, 17, 64, 255, 256, 257, 513])
def test_few_rays(count: int) -> None:
    """Live ones, of one list and of several."""
    scene = mixed()
    rays = wild_rays(scene, 700, 5)
    rays = rays[np.flatnonzero(rays.t_max > 0)[:count]]
    for lists in (1, 6):
        found = both([lists_of(scene, lists)], rays)
        assert len(found.nodes) == count and (found.nodes >= 1).all()


@pytest.mark.parametrize("dead", ["all", "first", "last", "every other"])
def test_dead_rays_cost_nothing(dead: str) -> None:
    scene = mixed()
    rays = eye_rays()[:520]
    off = {"all": slice(None), "first": slice(0, 260), "last": slice(260, None), "every other": slice(0, None, 2)}[dead]
    direction, t_max = rays.direction.copy(), rays.t_max.copy()
    direction[off], t_max[off] = 0.0, 0.0
    found = both([lists_of(scene)], Rays(rays.origin, direction, t_max))
    assert not found.nodes[off].any() and not found.triangle_tests[off].any() and not found.hits.hit[off].any()


@pytest.mark.parametrize("distance", [2.0**-20, 1.0, 2.0**20, 2.0**59, 2.0**61, 2.0**100])
def test_origins_near_and_far(distance: float) -> None:
    """From within the spheres to where κ is infinite and no sphere is skipped."""
    scene = mixed()
    rays = wild_rays(scene, 100, 9)
    origin = (scene.center - distance * rays.direction.astype(np.float64)).astype(np.float32)
    found = both([lists_of(scene)], Rays(origin, rays.direction, rays.t_max))
    alive = rays.t_max > 0
    longest = np.diff(lists_of(scene).first).max()
    if distance > 2.0**60:
        assert (found.nodes[alive] == longest).all()
    else:
        assert (found.nodes[alive] <= longest).all()


def test_an_empty_list_and_an_empty_layer_are_passed_over() -> None:
    """Culling leaves the list along the normals empty: its rays visit nothing."""
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    layer = lists_of(Scene(triangle), 6, culling="sextant_safe")
    assert layer.length(4) == 0 and layer.length(5) == 2
    direction = np.tile(np.array([[0, 0, 1], [0, 0, -1]], np.float32), (40, 1))
    origin = np.float32([0.25, 0.25, 0.0]) - direction
    found = both([layer, layer], Rays(origin, direction), facing="front")
    assert found.hits.hit.tolist() == [False, True] * 40
    assert found.nodes.tolist() == [0, 4] * 40 and found.triangle_tests.tolist() == [0, 2] * 40


@pytest.mark.parametrize("size", [(16, 16), (32, 26), (5, 3), (1, 70)])
@pytest.mark.parametrize("lists", [1, 8])
def test_images(size: tuple[int, int], lists: int) -> None:
    """Packets cut by the image's edges and by the lists; the threads change nothing."""
    scene = mixed()
    rays = refsim.camera_rays(scene, *size, fill=0.5)
    structure = lists_of(scene, lists)
    first = both([structure], rays, threads=1)
    for threads in (2, 3):
        same(first, search([structure], rays, threads=threads))
    alone = Rays(rays.origin, rays.direction, rays.t_max)
    same(first, search([structure], alone))


def test_slots_reach_the_packets() -> None:
    """The exit root as printed, BSH-E5: other counts than the corrected loop's, the same in both forms."""
    scene, rays = mixed(), eye_rays()
    slots = slots_of(Printed(E5=True))
    printed = both([lists_of(scene)], rays, slots=slots)
    assert not np.array_equal(printed.nodes, both([lists_of(scene)], rays).nodes)


def test_counts_of_an_image() -> None:
    """Golden: sums over the image, and the largest counts of a ray."""
    found = both([lists_of(mixed())], eye_rays())
    got = (found.nodes.sum(), found.triangle_tests.sum(), found.nodes.max(), found.triangle_tests.max())
    assert tuple(map(int, got)) == GOLDEN


@pytest.mark.parametrize("name", ["suzanne", "bunny"])
def test_real_meshes(name: str) -> None:
    scene = real_scene(name)
    if scene is None:
        print(f"{name}: the mesh is missing")
        return
    structure = lists_of(scene)
    found = both([structure], refsim.camera_rays(scene, 48, 48))
    assert found.hits.hit.any() and not found.hits.hit.all()
    both([structure], wild_rays(scene, 500, 3), any_hit=True)


def test_order_of_rays() -> None:
    """Every row once; tiles stay together down to a group's 4 × 4; rays of one list stand together."""
    rows = tile_order(20, 17, 340, (16, 8, 4))
    assert sorted(rows.tolist()) == list(range(340))
    y, x = np.divmod(rows[:256], 20)
    for side in (16, 8, 4):
        tiles = np.stack([y // side, x // side], axis=1).reshape(-1, side * side, 2)
        assert (tiles == tiles[:, :1]).all()
    picked = np.random.default_rng(1).integers(0, 6, 340).astype(np.int32)
    sorted_rows = by_list(rows, picked)
    assert (np.diff(picked[sorted_rows]) >= 0).all() and sorted(sorted_rows.tolist()) == list(range(340))
    place = np.argsort(rows)
    for number in range(6):
        assert (np.diff(place[sorted_rows[picked[sorted_rows] == number]]) > 0).all()
