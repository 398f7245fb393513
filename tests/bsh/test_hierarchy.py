"""The sphere hierarchy of section 2.2: what its nodes hold, where triangles stay, that the recursion ends.

Plan
- Property, over the meshes of `tests.bsh.meshes` and thresholds, in exact arithmetic on the float32 values: a sphere
  holds every triangle below it with that triangle's acceptance margin, and is not larger than that needs; its centre
  is the middle of the box.
- A tree: parents come before children, nodes are numbered depth first, every triangle has one owner; a node owns a
  triangle or has two children, so there are fewer nodes than twice the triangles.
- A triangle is a child of the first node against which it is big enough; the others part by octants.
- The recursion ends: for 2,000 triangles in one place, whatever their sizes, and for nested ones.
- Boundary tables: thresholds that are refused and those that are not; slivers with an infinite margin; one triangle.
- Golden: nodes of three scenes at three thresholds.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Scene, load_scene
from refsim.errors import InputError
from refsim.geometry.sphere import acceptance_margin
from refsim.papers.sphere_hierarchy.hierarchy import Hierarchy, build_hierarchy
from tests.bsh import meshes
from tests.bsh.meshes import scenes

THRESHOLDS = st.sampled_from((0.5, 1.0, 0.25, 0.05))
# Decisions by float64 sums and roots: what a different order of operations may change
CLOSE = 1e-12


def exactly(row: np.ndarray) -> list[Fraction]:
    """Floating-point numbers as what they are."""
    return [Fraction(float(x)) for x in row]


def below(h: Hierarchy) -> list[list[int]]:
    """The triangles in each node's subtree."""
    members: list[list[int]] = [[] for _ in range(len(h))]
    for row, node in enumerate(h.owner.tolist()):
        while node >= 0:
            members[node].append(row)
            node = int(h.parent[node])
    return members


@given(scene=scenes(), threshold=THRESHOLDS)
@settings(max_examples=60)
def test_a_sphere_holds_all_below_it_and_no_more_than_that(scene: Scene, threshold: float) -> None:
    h = build_hierarchy(scene, threshold)
    margins = acceptance_margin(scene.triangles)
    for node, rows in enumerate(below(h)):
        radius = float(h.spheres[node, 3])
        if not np.isfinite(margins[rows]).all():
            assert radius == np.inf
            continue
        centre = exactly(h.spheres[node, :3])
        smaller = Fraction(float(np.nextafter(h.spheres[node, 3], np.float32(-1)))) / (1 + Fraction(1, 2**47))
        needed = False
        for row in rows:
            margin = Fraction(margins[row])
            farthest = max(
                sum((a - c) ** 2 for a, c in zip(exactly(vertex), centre, strict=True)) for vertex in h.triangles[row]
            )
            assert Fraction(radius) >= margin and farthest <= (Fraction(radius) - margin) ** 2
            needed = needed or smaller < margin or farthest > (smaller - margin) ** 2
        assert needed, "the next smaller float32 would do"


@given(scene=scenes(), threshold=THRESHOLDS)
@settings(max_examples=40)
def test_centres_are_the_middles_of_boxes(scene: Scene, threshold: float) -> None:
    h = build_hierarchy(scene, threshold)
    for node, rows in enumerate(below(h)):
        points = h.triangles[rows].reshape(-1, 3)
        for a in range(3):
            middle = (Fraction(float(points[:, a].min())) + Fraction(float(points[:, a].max()))) / 2
            centre = h.spheres[node, a]
            # Rounded to float64 first: at most a little more than half of a float32 step
            assert abs(Fraction(float(centre)) - middle) <= Fraction(float(np.spacing(abs(centre)))) * Fraction(51, 100)


@given(scene=scenes(), threshold=THRESHOLDS)
@settings(max_examples=60)
def test_nodes_are_a_tree_numbered_depth_first(scene: Scene, threshold: float) -> None:
    h = build_hierarchy(scene, threshold)
    assert h.owner.shape == (len(scene),) and h.owner.min() >= 0 and h.owner.max() < len(h)
    assert h.parent[0] == -1 and (h.parent[1:] >= 0).all() and (h.parent[1:] < np.arange(1, len(h))).all()
    path: list[int] = []
    for node, parent in enumerate(h.parent.tolist()):
        while path and path[-1] != parent:
            path.pop()
        assert path or node == 0, "the parent is not above the node before"
        path.append(node)
    owned, children = np.bincount(h.owner, minlength=len(h)), np.bincount(h.parent[1:], minlength=len(h))
    assert ((owned > 0) | (children > 1)).all()
    assert len(h) < 2 * len(scene)


@given(scene=scenes(), threshold=THRESHOLDS)
@settings(max_examples=60)
def test_a_triangle_stays_where_it_is_first_big_enough(scene: Scene, threshold: float) -> None:
    h = build_hierarchy(scene, threshold)
    margin = acceptance_margin(scene.triangles)
    exact = scene.triangles.astype(np.float64)
    middle = (0.5 * (exact.min(axis=1) + exact.max(axis=1))).astype(np.float32).astype(np.float64)
    size = np.linalg.norm(exact - middle[:, None], axis=2).max(axis=1) + margin
    barycentre = exact.sum(axis=1) / 3.0
    members = below(h)
    for row, owner in enumerate(h.owner.tolist()):
        # Radii rounded up to float32 may make a triangle look smaller than it was against the radius before
        rounding = CLOSE + 2.0**-23
        others = [k for k in members[owner] if h.owner[k] == owner and not size[k] >= threshold * h.spheres[owner, 3]]
        big = size[row] >= threshold * h.spheres[owner, 3] * (1.0 - rounding) or size[row] == np.inf
        assert big or np.ptp(barycentre[others], axis=0).max() == 0.0
        node = int(h.parent[owner])
        while node >= 0:
            assert size[row] < threshold * h.spheres[node, 3] * (1.0 + CLOSE)
            node = int(h.parent[node])


@given(scene=scenes(), threshold=THRESHOLDS)
@settings(max_examples=60)
def test_the_others_part_by_octants(scene: Scene, threshold: float) -> None:
    h = build_hierarchy(scene, threshold)
    exact, members = scene.triangles.astype(np.float64), below(h)
    barycentre = ((exact[:, 0] + exact[:, 1]) + exact[:, 2]) / 3.0
    for node in range(len(h)):
        groups = [members[k] for k in np.flatnonzero(h.parent == node)]
        rows = [row for group in groups for row in group]
        if not rows:
            continue
        about = h.spheres[node, :3].astype(np.float64)
        if len({tuple(p) for p in (barycentre[rows] > about).tolist()}) == 1 and not (h.owner == node).any():
            about = 0.5 * (barycentre[rows].min(axis=0) + barycentre[rows].max(axis=0))
        octants = [{int(k) for k in (barycentre[group] > about) @ (1, 2, 4)} for group in groups]
        assert all(len(octant) == 1 for octant in octants)
        numbers = [octant.pop() for octant in octants]
        assert numbers == sorted(set(numbers)), "children come in the order of octants, one each"


@pytest.mark.parametrize(("kind", "nodes"), [("coincident", (1, 4, 1)), ("identical", (1, 1, 1))])
def test_the_recursion_ends_for_2000_triangles_in_one_place(kind: str, nodes: tuple[int, ...]) -> None:
    """Nothing parts them but their sizes: while some are big the rest go on, and when none is they are all children."""
    scene = Scene(meshes.KINDS[kind](np.random.default_rng(3), 2000))
    hierarchies = [build_hierarchy(scene, threshold) for threshold in (1.0, 0.5, 1e-3)]
    assert tuple(map(len, hierarchies)) == nodes
    assert all((h.owner >= 0).all() for h in hierarchies)


@pytest.mark.parametrize(("threshold", "nodes"), [(1.0, 60), (0.5, 30), (0.25, 20)])
def test_nested_triangles_need_a_node_for_each_halving(threshold: float, nodes: int) -> None:
    """About the origin, each half the size of the one before: a node takes those big against it, the rest go on."""
    triangle = np.array([[[-1, -1, 0], [1, -1, 0], [0, 2, 0]]], np.float32)
    h = build_hierarchy(Scene(triangle * np.float32(0.5) ** np.arange(60, dtype=np.float32)[:, None, None]), threshold)
    assert len(h) == nodes


@pytest.mark.parametrize("threshold", [0, 0.0, -0.5, 1.0001, 2, np.nan, np.inf, True, None, "0.5"])
def test_thresholds_that_are_refused(threshold: object) -> None:
    with pytest.raises(InputError, match=r"threshold must be a number above 0 and at most 1"):
        build_hierarchy(Scene(meshes.soup(np.random.default_rng(1), 3)), threshold)  # type: ignore[arg-type]


@pytest.mark.parametrize("threshold", [1, 1.0, 0.5, np.float32(0.25), 1e-300])
def test_thresholds_that_are_not(threshold: float) -> None:
    assert len(build_hierarchy(Scene(meshes.soup(np.random.default_rng(1), 3)), threshold)) >= 1


def test_the_smallest_threshold_keeps_all_at_the_root() -> None:
    h = build_hierarchy(Scene(meshes.soup(np.random.default_rng(1), 50)), 1e-300)
    assert len(h) == 1 and not h.owner.any()


def test_a_sliver_without_margin_is_a_child_of_a_root_without_bounds() -> None:
    triangles = meshes.soup(np.random.default_rng(2), 12)
    triangles[5] = [[-1, 0, 0], [1, 1e-9, 0], [0, 2e-9, 0]]
    assert acceptance_margin(triangles)[5] == np.inf
    h = build_hierarchy(Scene(triangles))
    assert h.owner[5] == 0 and h.spheres[0, 3] == np.inf
    assert (np.flatnonzero(h.owner == 0) == 5).all() and np.isfinite(h.spheres[1:]).all()


def test_one_triangle_is_one_node() -> None:
    h = build_hierarchy(Scene(meshes.single(np.random.default_rng(1), 1)))
    assert len(h) == 1 and h.parent.tolist() == [-1] and h.owner.tolist() == [0]


@pytest.mark.parametrize(
    ("name", "nodes"),
    [("cornell_box", (4, 7, 52)), ("cubes", (15, 70, 341)), ("torus_knot_1024", (85, 509, 1294))],
)
def test_golden_nodes(name: str, nodes: tuple[int, ...]) -> None:
    scene = load_scene(name)
    assert tuple(len(build_hierarchy(scene, threshold)) for threshold in (0.25, 0.5, 1.0)) == nodes
