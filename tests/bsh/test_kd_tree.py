"""The kd-tree and its three traversals (their hits are those of brute force: `test_compared.py`).

Plan
- Property, over the meshes of `tests.bsh.meshes`: the tree is the plain twin's, node by node; a cell is its parent's,
  cut by the plane; every triangle that can be hit stands in each leaf that its grown box overlaps, and in no other.
- All three traversals have the twin's hits and counts of everything, and pass the same leaves; the stack looks at each
  node once at most; a restart begins at the root each time; a climb ends below as many nodes as it went up.
- Progress: rays in planes, along axes, from planes, with 0 and −0, never pass a leaf twice, on meshes of whole numbers
  whose planes coincide with vertices, far from the origin, where few float32 numbers lie between the planes.
- Margins: rays from beyond reach meet all triangles and still are right; slivers are loose; growth by the formula.
- Boundary tables: reach and traversal that are refused; copies of one triangle are given up; no usable triangle.
- A division pays: fewer tests than a leaf of all; equal halves are cut between. Golden: knot's tree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Rays, Scene, load_scene
from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin
from refsim.papers.sphere_hierarchy.kd_search import TRAVERSALS, KdCounts, kd_search
from refsim.papers.sphere_hierarchy.kd_tree import EMPTY, REACH, TEST, KdTree, build_kd_tree
from refsim.papers.sphere_hierarchy.search import Found
from refsim.reference import kd_tree as plain
from refsim.reference.kd_tree_search import search_kd
from tests.bsh import meshes
from tests.bsh.meshes import rays_at, same_hits, scenes
from tests.bsh.test_compared import boundary_rays, brute, some_dead, two_squares

SEEDS = st.integers(0, 2**32 - 1)
LEAF = 3


def walk(tree: KdTree, node: int = 0) -> Iterator[int]:
    """All nodes below one, depth first, below the plane before above it."""
    yield node
    if tree.links[node, 0] != LEAF:
        yield from walk(tree, node + 1)
        yield from walk(tree, int(tree.links[node, 1]))


def leaf_rows(tree: KdTree, node: int) -> list[int]:
    first, count = tree.links[node, 1:3].tolist()
    return tree.lists[first : first + count].tolist()


def grown(scene: Scene, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """The triangles' boxes, grown as the module says, before rounding."""
    extent = scene.upper.astype(float) - scene.lower.astype(float)
    half, middle = 0.5 * math.sqrt((extent**2).sum()), 0.5 * np.abs(scene.upper.astype(float) + scene.lower).max()
    far = reach * half + 2.0**-24 * middle
    margin = acceptance_margin(scene.triangles) + 25 * 2.0**-24 * (math.sqrt(3.0) * far + half)
    exact = scene.triangles.astype(float)
    return exact.min(axis=1) - margin[:, None], exact.max(axis=1) + margin[:, None]


@given(scene=scenes(most=60))
@settings(max_examples=40)
def test_the_tree_is_the_twins(scene: Scene) -> None:
    tree, twin = build_kd_tree(scene), plain.kd_tree(scene.triangles, REACH, TEST, EMPTY)
    assert tree.loose.tolist() == list(twin.loose) and tree.far == twin.far
    np.testing.assert_array_equal(tree.centre, twin.centre)
    pending, deepest = [(twin.root, -1, 0)], 0
    for node in range(len(tree)):
        expected, parent, depth = pending.pop()
        deepest = max(deepest, depth)
        np.testing.assert_array_equal(tree.boxes[node], expected.cell)
        assert tree.links[node, [0, 3]].tolist() == [expected.axis, parent]
        if expected.axis == LEAF:
            assert leaf_rows(tree, node) == list(expected.triangles)
        else:
            assert tree.split[node] == expected.plane
            pending += [(child, node, depth + 1) for child in expected.children[::-1]]
    assert not pending and tree.depth == deepest and list(walk(tree)) == list(range(len(tree)))


@given(scene=scenes(most=60))
@settings(max_examples=40)
def test_a_triangle_stands_in_every_leaf_that_its_grown_box_overlaps(scene: Scene) -> None:
    tree = build_kd_tree(scene)
    low, high = grown(scene, REACH)
    listed = np.setdiff1d(np.flatnonzero(~scene.degenerate), tree.loose)
    for node in walk(tree):
        lower, upper = tree.boxes[node, :3].astype(float), tree.boxes[node, 3:].astype(float)
        if node == 0:
            assert (low[listed] >= lower).all() and (high[listed] <= upper).all()
        axis, second, _, _ = tree.links[node].tolist()
        if axis == LEAF:
            within = (low[listed] < upper).all(axis=1) & (high[listed] > lower).all(axis=1)
            # Rounded outwards by less than one unit in the last place: such a box may overlap one cell more
            near = (np.nextafter(low[listed].astype(np.float32), np.float32(-np.inf)) < upper).all(axis=1)
            near &= (np.nextafter(high[listed].astype(np.float32), np.float32(np.inf)) > lower).all(axis=1)
            assert set(listed[within]) <= set(leaf_rows(tree, node)) <= set(listed[near])
        else:
            assert lower[axis] < tree.split[node] < upper[axis]
            for child, side in ((node + 1, axis + 3), (second, axis)):
                cut = tree.boxes[node].copy()
                cut[side] = tree.split[node]
                np.testing.assert_array_equal(tree.boxes[child], cut)


def all_three(tree: KdTree, rays: Rays, **options: object) -> dict[str, tuple[Found, KdCounts]]:
    return {way: kd_search(tree, way).search_counted(rays, **options) for way in TRAVERSALS}  # type: ignore[arg-type]


def check_counts(tree: KdTree, three: dict[str, tuple[Found, KdCounts]]) -> None:
    """What must hold between the traversals, and of each."""
    stack, counts = three["stack"]
    assert (stack.nodes - stack.triangle_tests).max(initial=0) <= len(tree)
    assert counts.deepest.max(initial=0) <= tree.depth and not counts.climbed.any()
    for way, (found, own) in three.items():
        same_hits(found.hits, stack.hits)
        np.testing.assert_array_equal(found.triangle_tests, stack.triangle_tests)
        np.testing.assert_array_equal(own.leaves, counts.leaves)
        np.testing.assert_array_equal(own.resumed, np.maximum(own.leaves - 1, 0))
        assert (own.leaves <= tree.leaves).all() and (found.nodes >= stack.nodes).all()
        assert way == "stack" or not own.deepest.any()
        inner = found.nodes - found.triangle_tests - own.leaves - own.climbed
        assert (inner >= 0).all() and (inner <= tree.depth * own.leaves).all()
        assert (own.climbed <= tree.depth * own.resumed).all()


@given(scene=scenes(most=40), seed=SEEDS, any_hit=st.booleans(), front=st.booleans())
@settings(max_examples=30)
def test_all_three_count_as_the_twin(scene: Scene, seed: int, any_hit: bool, front: bool) -> None:
    rays = some_dead(rays_at(scene.triangles, 18, seed))
    tree, twin = build_kd_tree(scene), plain.kd_tree(scene.triangles, REACH, TEST, EMPTY)
    three = all_three(tree, rays, any_hit=any_hit, facing="front" if front else "both")
    check_counts(tree, three)
    for way, (found, counts) in three.items():
        walked, expected = search_kd(twin, way, rays.origin, rays.direction, rays.t_max, any_hit, front)
        same_hits(found.hits, walked)
        np.testing.assert_array_equal(found.nodes, walked.nodes)
        np.testing.assert_array_equal(found.triangle_tests, walked.tests)
        np.testing.assert_array_equal(np.column_stack(counts), expected)


def rays_along_planes(tree: KdTree) -> Rays:
    """From places on planes of the tree, and on the faces of its cells, along axes, diagonals, with 0 and −0."""
    cells = tree.boxes[tree.links[:, 0] == LEAF][:12]
    middle = 0.5 * (cells[:, :3] + cells[:, 3:])
    origins = np.concatenate([cells[:, :3], cells[:, 3:], np.where([True, False, False], cells[:, :3], middle), middle])
    axes = np.eye(3, dtype=np.float32)
    zeros = np.where(axes == 0, np.float32(-0.0), axes)
    slanted = np.array([(1, 1, 0), (1, 0, -1), (-1, 1, 1), (1, 1, 1e-7), (1e-30, -1, 0)], np.float64)
    slanted /= np.linalg.norm(slanted, axis=1, keepdims=True)
    directions = np.concatenate([axes, -axes, zeros, slanted.astype(np.float32)])
    return Rays(np.repeat(origins, len(directions), axis=0), np.tile(directions, (len(origins), 1)))


@given(kind=st.sampled_from(("grid", "flat", "soup", "nested")), seed=SEEDS, away=st.sampled_from((0, 1000, 2**18)))
@settings(max_examples=20)
def test_no_leaf_is_passed_twice(kind: str, seed: int, away: int) -> None:
    rng = np.random.default_rng(seed)
    scene = Scene((meshes.KINDS[kind](rng, 30) + away * np.array([1, -1, 0])).astype(np.float32))
    tree = build_kd_tree(scene)
    rays = rays_along_planes(tree)
    three = all_three(tree, rays)
    check_counts(tree, three)
    same_hits(three["restart"][0].hits, brute(scene, rays))


@pytest.mark.parametrize("reach", (0.0, 1.5, 1e6))
def test_rays_from_beyond_reach_meet_all_triangles(reach: float) -> None:
    scene, rays = two_squares(), boundary_rays()
    tree = build_kd_tree(scene, reach)
    beyond = (np.abs(rays.origin - tree.centre) > tree.far).any(axis=1)
    assert beyond.any() and (reach == 0.0 or not beyond.all())
    for found, counts in all_three(tree, rays).values():
        same_hits(found.hits, brute(scene, rays))
        assert (found.triangle_tests[beyond] == len(scene)).all() and not counts.leaves[beyond].any()
        assert (found.nodes[beyond] == len(scene)).all() and (reach == 0.0 or counts.leaves[~beyond].any())


def test_slivers_are_loose_and_tested_by_every_ray() -> None:
    rng = np.random.default_rng(8)
    triangles = rng.uniform(-1, 1, (12, 3, 3))
    triangles[3, 2] = 0.5 * (triangles[3, 0] + triangles[3, 1]) + 1e-8
    triangles[5, 2] = triangles[5, 0]
    scene = Scene(triangles.astype(np.float32))
    tree = build_kd_tree(scene)
    assert tree.loose.tolist() == [3] and 5 not in tree.lists and set(tree.lists.tolist()) == {*range(12)} - {3, 5}
    away = Rays([(5, 5, 5)], [(0, 0, 1)])
    for found, counts in all_three(tree, away).values():
        assert (found.nodes[0], found.triangle_tests[0], counts.leaves[0]) == (1, 1, 0)


def test_without_a_usable_triangle() -> None:
    """Three segments: nothing can be hit, one empty leaf is all there is."""
    tree = build_kd_tree(Scene(np.repeat(np.array([[(0, 0, 0), (1, 1, 1), (2, 2, 2)]], np.float32), 3, axis=0)))
    rays = Rays([(-1, 1, 1), (0, 0, 0)], [(1, 0, 0), (0, 1, 0)])
    assert (len(tree), len(tree.lists), len(tree.loose), tree.depth) == (1, 0, 0, 0)
    for found, _ in all_three(tree, rays).values():
        assert not found.hits.hit.any() and not found.triangle_tests.any() and (found.nodes <= 1).all()


def test_copies_of_one_triangle_are_soon_given_up() -> None:
    """No plane parts them, so every division is a bad one: a third on the way down is not made."""
    tree = build_kd_tree(Scene(np.repeat(np.eye(3, dtype=np.float32)[None], 50, axis=0)))
    assert (len(tree), tree.leaves, tree.depth) == (7, 4, 2)
    assert tree.lists.reshape(4, 50).tolist() == [list(range(50))] * 4


@pytest.mark.parametrize("reach", (-1.0, math.inf, math.nan, True, None, "far"))
def test_a_reach_that_is_refused(reach: object) -> None:
    with pytest.raises(InputError, match="reach must be"):
        build_kd_tree(two_squares(), reach)  # type: ignore[arg-type]


def test_a_traversal_that_is_refused() -> None:
    with pytest.raises(InputError, match=r"'short_stack'.*'stack', 'restart', 'backtrack'"):
        kd_search(build_kd_tree(two_squares()), "short_stack")


def test_two_heaps_are_cut_between() -> None:
    """The space between two heaps is empty: the first planes cut it off, so a ray there tests nothing."""
    heap = np.random.default_rng(3).uniform(0, 1, (10, 3, 3))
    scene = Scene(np.concatenate([heap, heap + np.array([50, 0, 0])]).astype(np.float32))
    tree = build_kd_tree(scene)
    assert tree.links[0, 0] == 0
    for found, counts in all_three(tree, Rays([(25, 0.5, -3)], [(0, 0, 1)])).values():
        assert found.triangle_tests[0] == 0 and counts.leaves[0] == 1 and found.nodes[0] <= 3


@cache
def knot_tree() -> KdTree:
    return build_kd_tree(load_scene("torus_knot_1024"))


def test_the_knots_tree() -> None:
    tree = knot_tree()
    assert (len(tree), tree.leaves, len(tree.lists), len(tree.loose), tree.depth) == (4877, 2439, 8160, 0, 20)
    assert len(tree) == 2 * tree.leaves - 1
