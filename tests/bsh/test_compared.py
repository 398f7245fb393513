"""What the traversal lists are compared with, on one interface: boxes, an ordered stack, three walks of a kd-tree.

Plan
- Property, over the meshes and rays of `tests.bsh.meshes`, dead rays, ends and both facings: every structure finds the
  bits of brute force, so of equal hits the first triangle, too; searches for any hit find one where there is one.
- The same counts as the plain twins in `refsim.reference`, which walk by recursion and make the boxes their own way.
- No ray looks at more elements than there are; triangle tests are part of them; stacks stay within their capacity.
- A box is the smallest float32 one around the triangles of its element, with their margins, in exact arithmetic.
- Margins: the same hits from 10,000 half-diagonals away, where the arithmetic of a ray is off by a visible distance.
- Boundary table: rays in faces of boxes, along axes with 0 and −0, from corners, from afar; what is refused.
- A stack that visits the nearer of two spheres first; what waits behind a hit is dropped, and not looked at again.
- Threads and the order of rays change nothing. Golden: counts of the knot, all structures on one set of rays.
- Real meshes: the same hits for all; a mesh that is absent is named.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import refsim
from refsim import Hits, Rays, Scene, camera_rays, load_scene
from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin
from refsim.papers.sphere_hierarchy.boxes import BoxList, build_boxes
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
from refsim.papers.sphere_hierarchy.kd_search import TRAVERSALS, kd_search
from refsim.papers.sphere_hierarchy.kd_tree import REACH, build_kd_tree
from refsim.papers.sphere_hierarchy.lists import build_lists
from refsim.papers.sphere_hierarchy.ordered_stack import OrderedStack, build_stack
from refsim.papers.sphere_hierarchy.search import Found, search
from refsim.reference.box_search import boxes_of, search_boxes
from refsim.reference.list_search import Walked
from refsim.reference.sphere_tree import sphere_tree
from refsim.reference.stack_search import search_ordered
from refsim.reference.traversal_lists import traversal_lists
from tests.bsh.meshes import KINDS, rays_at, same_hits, scenes
from tests.scenes_present import absent, real_scene

Search = Callable[..., Found]
STRUCTURES = ("boxes", "stack", *(f"kd-{traversal}" for traversal in TRAVERSALS))
SEEDS = st.integers(0, 2**32 - 1)


def boxes(scene: Scene, order: str = "earliest_first") -> BoxList:
    return build_boxes(build_lists(build_hierarchy(scene), 1, order))


def stack(scene: Scene) -> OrderedStack:
    return build_stack(build_hierarchy(scene))


def searches(scene: Scene, reach: float = REACH) -> dict[str, Search]:
    """Every structure of the scene."""
    found: dict[str, Search] = {"boxes": boxes(scene).search, "stack": stack(scene).search}
    tree = build_kd_tree(scene, reach)
    return found | {f"kd-{traversal}": kd_search(tree, traversal).search for traversal in TRAVERSALS}


def brute(scene: Scene, rays: Rays, facing: str = "both") -> Hits:
    return refsim.trace("brute_force", scene, rays, generations=1, facing=facing).generations[0].hits


def some_dead(rays: Rays) -> Rays:
    """The same rays, every ninth dead."""
    dead = np.arange(len(rays)) % 9 == 8
    direction = np.where(dead[:, None], np.float32(0), rays.direction)
    return Rays(rays.origin, direction, np.where(dead, np.float32(0), rays.t_max))


@given(scene=scenes(most=40), seed=SEEDS, facing=st.sampled_from(("both", "front")))
@settings(max_examples=70)
def test_every_structure_finds_what_brute_force_finds(scene: Scene, seed: int, facing: str) -> None:
    rays = some_dead(rays_at(scene.triangles, 90, seed))
    expected = brute(scene, rays, facing)
    dead = rays.t_max == 0
    for name, find in searches(scene).items():
        nearest, some = find(rays, facing=facing), find(rays, any_hit=True, facing=facing)
        same_hits(nearest.hits, expected)
        np.testing.assert_array_equal(some.hits.hit, expected.hit, err_msg=name)
        for found in (nearest, some):
            assert (found.triangle_tests <= found.nodes).all() and not found.nodes[dead].any(), name


@given(kind=st.sampled_from(("grid", "flat", "soup")), seed=SEEDS)
@settings(max_examples=25)
def test_rays_from_afar(kind: str, seed: int) -> None:
    """From 10,000 half-diagonals float32 places a hit by some 10⁻³ of them: what margins are for."""
    rng = np.random.default_rng(seed)
    scene = Scene(KINDS[kind](rng, 30))
    near = rays_at(scene.triangles, 120, seed)
    rays = Rays(near.origin - np.float32(1e4 * 0.5 * scene.diagonal) * near.direction, near.direction)
    expected = brute(scene, rays)
    for find in searches(scene, 3e4).values():
        same_hits(find(rays).hits, expected)


def same_walk(found: Found, twin: Walked) -> None:
    """Asserts equal hits and counts."""
    same_hits(found.hits, twin)
    np.testing.assert_array_equal(found.nodes, twin.nodes)
    np.testing.assert_array_equal(found.triangle_tests, twin.tests)


@given(scene=scenes(most=16), seed=SEEDS, any_hit=st.booleans(), front=st.booleans())
@settings(max_examples=30)
def test_boxes_and_stack_count_as_their_twins(scene: Scene, seed: int, any_hit: bool, front: bool) -> None:
    rays, tree = some_dead(rays_at(scene.triangles, 18, seed)), sphere_tree(scene.triangles, 0.5)
    given_rays, options = (rays.origin, rays.direction, rays.t_max), {"any_hit": any_hit, "front_only": front}
    facing = "front" if front else "both"

    list_of_boxes, lists = boxes(scene), traversal_lists(tree, 1, "earliest_first", None)
    inner = ~lists.is_triangle()
    np.testing.assert_array_equal(list_of_boxes.boxes[inner], boxes_of(lists)[inner])
    found = list_of_boxes.search(rays, any_hit=any_hit, facing=facing)
    same_walk(found, search_boxes(lists, *given_rays, **options))
    assert found.nodes.max(initial=0) <= len(list_of_boxes)

    ordered = stack(scene)
    found, use = ordered.search_counted(rays, any_hit=any_hit, facing=facing)
    twin, depths = search_ordered(tree, *given_rays, **options)
    same_walk(found, twin)
    np.testing.assert_array_equal(np.column_stack(use), depths)
    assert found.nodes.max(initial=0) <= len(list_of_boxes) and use.largest < ordered.capacity
    assert use.mean == use.deepest.mean()


@given(scene=scenes(most=24))
@settings(max_examples=30)
def test_a_box_holds_all_below_it_and_no_more(scene: Scene) -> None:
    held = boxes(scene)
    lists, margins = held.lists, acceptance_margin(scene.triangles)
    is_triangle = (lists.escape == 1) | (lists.escape == 0)
    for at, step in enumerate(lists.escape.tolist()):
        rows = np.arange(at, at + step if step > 0 else len(held))
        rows = lists.payload[rows[is_triangle[rows]], 3]
        if not np.isfinite(margins[rows]).all():
            assert (held.boxes[at, :3] == -np.inf).all() and (held.boxes[at, 3:] == np.inf).all()
            continue
        for axis in range(3):
            for corner, outwards in ((axis, -1), (axis + 3, 1)):
                # Float64 sums of a coordinate and a margin: 2⁻⁵² of the larger is what they may be off
                extremes = [
                    outwards * Fraction(float(x)) + Fraction(float(margins[row]))
                    for row in rows.tolist() for x in scene.triangles[row, :, axis]
                ]  # fmt: skip
                bound, off = max(extremes), max(abs(x) for x in extremes) / 2**51
                box = held.boxes[at, corner]
                inwards = np.nextafter(box, np.float32(-outwards * np.inf))
                assert outwards * Fraction(float(box)) >= bound - off, "it does not hold a triangle"
                assert outwards * Fraction(float(inwards)) < bound + off, "the next smaller float32 would do"


def boundary_rays() -> Rays:
    """At two unit squares in z = 0 and z = 1, x and y from 0 to 1: in faces, edges and corners, in and out."""
    one, zero = np.float32(1), np.float32(-0.0)
    slanted = np.float32(np.sqrt(0.5))
    cases = [
        ((0.5, 0.25, -1.0), (0.0, 0.0, 1.0)), ((0.5, 0.25, -1.0), (zero, zero, one)),
        ((0.0, 0.0, -1.0), (0.0, 0.0, 1.0)), ((1.0, 1.0, 2.0), (zero, zero, -one)),
        ((-1.0, 0.5, 0.0), (1.0, 0.0, 0.0)), ((-1.0, 0.5, 1.0), (1.0, zero, zero)),
        ((0.5, 0.25, 0.0), (0.0, 0.0, 1.0)), ((0.5, 0.25, 1.0), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, 0.0), (slanted, slanted, 0.0)), ((0.0, 0.0, 0.5), (slanted, 0.0, slanted)),
        ((0.25, 0.125, 4096.0), (0.0, 0.0, -1.0)), ((0.25, 0.125, -1e6), (0.0, zero, 1.0)),
        ((-1e6, 0.5, 0.0), (1.0, 0.0, 0.0)), ((1e15, 0.5, 0.5), (-1.0, 0.0, 0.0)),
        ((1e30, 0.5, 0.5), (-1.0, 0.0, 0.0)), ((0.5, 0.5, 0.5), (1.0, 0.0, 0.0)),
    ]  # fmt: skip
    origin, direction = (np.array([case[k] for case in cases], np.float32) for k in range(2))
    return Rays(origin, direction)


@cache
def two_squares() -> Scene:
    """Squares in z = 0 and z = 1, of two triangles each; all four stand there twice, so equal hits abound."""
    corners = [np.array([(0, 0, z), (1, 0, z), (1, 1, z), (0, 1, z)], np.float32) for z in (0, 1)]
    halves = [half for square in corners for half in (square[[0, 1, 2]], square[[0, 2, 3]])]
    return Scene(np.array(halves + halves[::-1], np.float32))


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("facing", ("both", "front"))
def test_rays_in_faces_edges_and_corners(name: str, facing: str) -> None:
    rays = boundary_rays()
    expected = brute(two_squares(), rays, facing)
    assert 1 < expected.hit.sum() < len(rays)
    same_hits(searches(two_squares())[name](rays, facing=facing).hits, expected)


@pytest.mark.parametrize("name", STRUCTURES)
def test_what_is_refused_and_what_is_empty(name: str) -> None:
    find, none = searches(two_squares())[name], np.empty((0, 3), np.float32)
    with pytest.raises(InputError, match=r"'back'.*'both', 'front'"):
        find(boundary_rays(), facing="back")
    with pytest.raises(InputError, match="threads must be"):
        find(boundary_rays(), threads=0)
    found = find(Rays(none, none))
    assert len(found.hits) == len(found.nodes) == len(found.triangle_tests) == 0


def test_boxes_are_for_a_single_list() -> None:
    with pytest.raises(InputError, match="lists=1"):
        build_boxes(build_lists(build_hierarchy(two_squares()), 6))


def test_the_nearer_sphere_comes_first_whatever_the_direction() -> None:
    """Two heaps on the x axis: from either side, the ray leaves the second alone. A fixed list cannot."""
    heap = 0.01 * np.random.default_rng(3).normal(size=(12, 3, 3))
    heap[0] = [(0, -1, -1), (0, 2, -1), (0, -1, 2)]
    scene = Scene(np.concatenate([heap, heap + np.array([100, 0, 0])]).astype(np.float32))
    rays = Rays([(-50, 0.3, 0.3), (150, 0.3, 0.3)], [(1, 0, 0), (-1, 0, 0)])
    found, use = stack(scene).search_counted(rays)
    assert found.hits.hit.all() and found.nodes[0] == found.nodes[1]
    assert use.deepest.max() >= 1 and found.triangle_tests.max() < 12
    of_list = search([build_lists(build_hierarchy(scene), 1)], rays)
    assert of_list.nodes[1] > of_list.nodes[0] >= found.nodes[0]


@cache
def knot() -> tuple[Scene, Rays]:
    scene = load_scene("torus_knot_1024")
    return scene, camera_rays(scene, 32, 24)


def test_threads_and_the_order_of_rays_change_nothing() -> None:
    scene, rays = knot()
    backwards = rays[::-1]
    for find in searches(scene).values():
        alone, shared, turned = find(rays, threads=1), find(rays, threads=3), find(backwards)
        same_hits(alone.hits, shared.hits)
        for other in (shared.nodes, turned.nodes[::-1]):
            np.testing.assert_array_equal(alone.nodes, other)
        np.testing.assert_array_equal(alone.triangle_tests, turned.triangle_tests[::-1])
        np.testing.assert_array_equal(alone.hits.t, turned.hits.t[::-1])


# Nodes and triangle tests of all rays
GOLDEN = {
    "boxes": (16665, 3002),
    "stack": (15594, 2493),
    "kd-stack": (8655, 2626),
    "kd-restart": (17151, 2626),
    "kd-backtrack": (12286, 2626),
    "lists=1": (20149, 4413),
    "lists=6": (16283, 2743),
}


def test_counts_on_one_set_of_rays() -> None:
    scene, rays = knot()
    found = searches(scene)
    hierarchy = build_hierarchy(scene)
    for lists in (1, 6):
        found[f"lists={lists}"] = lambda rays, lists=lists: search([build_lists(hierarchy, lists)], rays)
    counts = {}
    for name, find in found.items():
        shot = find(rays)
        counts[name] = int(shot.nodes.sum()), int(shot.triangle_tests.sum())
    assert counts == GOLDEN


@pytest.mark.parametrize("name", ("suzanne", "bunny"))
def test_real_meshes(name: str) -> None:
    scene = real_scene(name)
    if scene is None:
        assert name in absent()
        return
    rays = camera_rays(scene, 32, 32)
    expected = search([build_lists(build_hierarchy(scene), 6)], rays)
    assert 0.1 < expected.hits.hit.mean() < 0.9
    for find in searches(scene).values():
        same_hits(find(rays).hits, expected.hits)
