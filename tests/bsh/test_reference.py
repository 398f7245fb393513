"""The sphere hierarchy's parts in plain NumPy, `refsim.reference`, have the bits of the compiled ones.

Plan
- Property, over the meshes of `tests.bsh.meshes`: the tree built by recursion, the lists by a recursive depth-first
  walk, for every partition, order and culling rule: spheres, parents, owners, escape indices, payloads, places.
- Which list a ray takes, and which triangles a list leaves out, for components −2 to 2 and float32 steps beside them.
- Searches: hits, nodes, triangle tests of every ray, for nearest and any hit, both facings, both loops, two layers,
  any place to begin, and the exit root as printed (BSH-E5).
- Heads by definition (the first primitive that survives with all nodes around it) are those that the compiled walk
  finds, for polygons and screen cells, leaf and climb; and which rays may use them.
- By hand: heads of a row of triangles. No head starts at a primitive that a half-space rejects.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Rays, Scene, camera_rays
from refsim.papers.sphere_hierarchy import directions
from refsim.papers.sphere_hierarchy.cell_heads import cell_heads
from refsim.papers.sphere_hierarchy.culling import RULES, kept_triangles
from refsim.papers.sphere_hierarchy.errata import Printed, slots_of
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy, hierarchy_of
from refsim.papers.sphere_hierarchy.lists import ORDERS, TraversalLists, build_lists
from refsim.papers.sphere_hierarchy.polygon_heads import polygon_heads, polygon_starts
from refsim.papers.sphere_hierarchy.search import search
from refsim.reference import traversal_lists as reference
from refsim.reference.list_heads import PolygonHeads, are_out, cell_starts, first_leaf
from refsim.reference.list_search import Walked, walk
from refsim.reference.sphere_tree import sphere_tree
from refsim.reference.triangle import pack
from tests.bsh.meshes import Triangles, meshes, rays_at, same_hits, scenes

PARTITIONS = [(1, None), (2, None), (6, None), (8, None), (6, "sextant_safe"), (6, "sextant_same")]
PARTITIONS += [(6, "sextant_opposite"), (8, "octant")]
THRESHOLDS = (0.5, 1.0, 0.2)


def both_lists(
    triangles: Triangles, partition: tuple[int, str | None], order: str = "earliest_first", threshold: float = 0.5
) -> tuple[TraversalLists, reference.Lists]:
    """The same lists, compiled and plain."""
    compiled = build_lists(hierarchy_of(triangles, threshold), partition[0], order, partition[1])
    return compiled, reference.traversal_lists(sphere_tree(triangles, threshold), partition[0], order, partition[1])


def assert_same(a: np.ndarray, b: np.ndarray, what: str) -> None:
    assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes(), what


@given(scene=scenes(), threshold=st.sampled_from(THRESHOLDS))
@settings(max_examples=80)
def test_trees(scene: Scene, threshold: float) -> None:
    compiled, plain = build_hierarchy(scene, threshold), sphere_tree(scene.triangles, threshold)
    for name in ("spheres", "parent", "owner", "margin"):
        assert_same(getattr(compiled, name), getattr(plain, name), name)


@given(
    triangles=meshes(), partition=st.sampled_from(PARTITIONS), order=st.sampled_from(ORDERS),
    threshold=st.sampled_from(THRESHOLDS),
)  # fmt: skip
@settings(max_examples=80)
def test_lists(triangles: Triangles, partition: tuple[int, str | None], order: str, threshold: float) -> None:
    compiled, plain = both_lists(triangles, partition, order, threshold)
    for name in ("escape", "payload", "first", "node_at", "triangle_at"):
        assert_same(getattr(compiled, name), getattr(plain, name), name)


@pytest.mark.parametrize("lists", [1, 2, 6, 8])
def test_partitions_and_the_lists_of_rays(lists: int) -> None:
    assert directions.list_directions(lists).tolist() == [list(along) for along in reference.directions(lists)]
    d = np.array(list(itertools.product((-2, -1, -0.0, 0, 1, 2), repeat=3)), np.float32)
    d = np.concatenate([d, np.nextafter(d, np.float32(9)), np.nextafter(d, np.float32(-9))])
    assert_same(directions.list_of_rays(d, lists), reference.list_of_rays(d, lists), "lists")


@pytest.mark.parametrize("rule", RULES)
def test_rules(rule: str) -> None:
    n = np.array([v for v in itertools.product(range(-2, 3), repeat=3) if any(v)], np.float64)
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    n = np.concatenate([n, n + np.float32(2.0**-22), n - np.float32(2.0**-24)])
    degenerate = np.arange(len(n)) % 7 == 0
    for along in reference.directions(8 if rule == "octant" else 6):
        kept = kept_triangles(n, ~degenerate, np.array(along), rule)
        assert_same(kept, ~reference.culled(n, degenerate, along, rule), str(along))
        assert 0 < (~kept).sum() < len(n)


@given(
    triangles=meshes(), seed=st.integers(0, 2**16), partition=st.sampled_from(PARTITIONS), any_hit=st.booleans(),
    front=st.booleans(), packet=st.booleans(), exit_root=st.booleans(), begins=st.booleans(), layers=st.booleans(),
)  # fmt: skip
@settings(max_examples=80)
def test_searches(
    triangles: Triangles, seed: int, partition: tuple[int, str | None], any_hit: bool, front: bool, packet: bool,
    exit_root: bool, begins: bool, layers: bool,
) -> None:  # fmt: skip
    rays, front = rays_at(triangles, 70, seed), front or partition[1] is not None
    cut = len(triangles) // 2 if layers and len(triangles) > 1 else 0
    parts = [triangles[:cut], triangles[cut:]] if cut else [triangles]
    pairs = [both_lists(np.ascontiguousarray(part), partition) for part in parts]
    rng, starts, offset, found = np.random.default_rng(seed), [], 0, Walked.nothing(len(rays))
    for compiled, plain in pairs:
        lengths = np.diff(compiled.first)[reference.list_of_rays(rays.direction, compiled.count)]
        starts.append((rng.random(len(rays)) * (lengths + 1)).astype(np.int32) if begins else None)
        walk(
            plain, rays.origin, rays.direction, rays.t_max, found, starts=starts[-1], offset=offset, any_hit=any_hit,
            front_only=front, exit_root=exit_root,
        )  # fmt: skip
        offset += len(compiled.hierarchy.triangles)
    result = search(
        [compiled for compiled, _ in pairs], rays, starts=starts, any_hit=any_hit, facing="front" if front else "both",
        packet=packet, threads=1, slots=slots_of(Printed(E5=exit_root)),
    )  # fmt: skip
    same_hits(result.hits, found)
    assert_same(result.nodes, found.nodes, "nodes")
    assert_same(result.triangle_tests, found.tests, "triangle tests")


def leaving(triangles: Triangles, count: int, seed: int, epsilon: np.float32) -> tuple[Rays, np.ndarray]:
    """Rays that leave triangles, on the normal's side or not, and the triangles; −1 for some."""
    rng = np.random.default_rng(seed)
    left = rng.integers(-1, len(triangles), count).astype(np.int32)
    weights = rng.dirichlet((1, 1, 1), count)[:, :, None]
    side = rng.choice((1.0, 1.0, 1.0, -1.0), count)[:, None]
    origin = (triangles[left] * weights).sum(axis=1) + side * epsilon * pack(triangles)[1][left]
    direction = rays_at(triangles, count, seed).direction
    return Rays.unchecked(origin.astype(np.float32), direction, np.full(count, np.inf, np.float32)), left


@given(
    scene=scenes(most=14), seed=st.integers(0, 2**16), partition=st.sampled_from(PARTITIONS),
    kind=st.sampled_from(("simple", "regular")), rule=st.sampled_from(("leaf", "climb")), any_side=st.booleans(),
)  # fmt: skip
@settings(max_examples=25)
def test_heads_of_polygons(
    scene: Scene, seed: int, partition: tuple[int, str | None], kind: str, rule: str, any_side: bool
) -> None:
    if not scene.epsilon > 0:  # all in one point: rays have nowhere to start
        return
    triangles = scene.triangles
    compiled, plain = both_lists(triangles, partition)
    heads = polygon_heads(compiled, triangles, kind, rule, threads=1, epsilon=scene.epsilon)
    own = PolygonHeads(plain, triangles, pack(triangles)[1], float(scene.epsilon), kind == "regular", rule == "climb")
    elements = [[own.head(number, row) for row in range(len(triangles))] for number in range(plain.count)]
    assert_same(heads.elements, np.array(elements, np.int32), "heads")
    rays, left = leaving(triangles, 60, seed, scene.epsilon)
    starts = polygon_starts(heads, compiled, rays, left, any_side=any_side)
    assert_same(starts, own.starts(rays.origin, rays.direction, left, any_side), "starts")


@given(
    scene=scenes(), seed=st.integers(0, 2**16), partition=st.sampled_from(PARTITIONS),
    rule=st.sampled_from(("leaf", "climb")), cells=st.integers(1, 4), camera=st.booleans(),
)  # fmt: skip
@settings(max_examples=25)
def test_heads_of_screen_cells(
    scene: Scene, seed: int, partition: tuple[int, str | None], rule: str, cells: int, camera: bool
) -> None:
    compiled, plain = both_lists(scene.triangles, partition)
    if camera and scene.diagonal > 0:
        rays = camera_rays(scene, 8, 6, fov=10.0 + seed % 120)
    else:
        wild = rays_at(scene.triangles, 48, seed)
        rays = Rays.unchecked(wild.origin, wild.direction, wild.t_max, 8, 6)
    starts = cell_heads(compiled, rays, cells, rule).starts
    assert_same(starts, cell_starts(plain, rays, cells, rule == "climb"), "starts")


def test_heads_of_a_row_by_hand() -> None:
    """Five triangles in a row along x, all facing +x: what leaves the third begins at the fourth."""
    one = np.array([[0, -1, -1], [0, 1, -1], [0, 0, 1]], np.float32)
    triangles = np.array([one + np.float32([4 * k, 0, 0]) for k in range(5)])
    plain = reference.traversal_lists(sphere_tree(triangles, 0.9), 6, "earliest_first", None)
    own = PolygonHeads(plain, triangles, pack(triangles)[1], 0.01, False, False)
    order = [int(plain.payload[at, 3]) for at in range(plain.first[1]) if plain.is_triangle()[at]]
    assert order == [0, 1, 2, 3, 4]
    for polygon in range(4):
        assert plain.payload[own.head(0, polygon), 3] == polygon + 1
    assert own.head(0, 4) == plain.first[1], "behind the last there is nothing"
    # Along −x the same primitives come the other way round: the last is the first that survives
    for polygon in range(4):
        assert plain.payload[plain.first[1] + own.head(1, polygon), 3] == 4


@given(triangles=meshes(most=12), partition=st.sampled_from(PARTITIONS))
@settings(max_examples=20)
def test_no_head_is_out(triangles: Triangles, partition: tuple[int, str | None]) -> None:
    """Nor is any primitive before it in, but below a node that is out."""
    plain = both_lists(triangles, partition)[1]
    own = PolygonHeads(plain, triangles, pack(triangles)[1], 1e-3, True, False)
    for number, row in itertools.product(range(plain.count), range(len(triangles))):
        planes = own.planes(number, row)
        leaf, out = first_leaf(plain, number, planes), are_out(plain, number, planes)
        first, above = plain.first[number], plain.above

        def survives(at: int, out: np.ndarray = out, first: int = first, above: np.ndarray = above) -> bool:
            return at < 0 or (not out[at] and survives(int(above[first + at])))

        leaves = np.flatnonzero(plain.is_triangle()[first : plain.first[number + 1]])
        assert [at for at in leaves if survives(int(at))][:1] == ([leaf] if leaf < len(out) else [])
