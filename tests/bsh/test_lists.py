"""Traversal lists (section 2.1): depth-first, with escape indices on super-siblings, as the paper lays them out.

Plan
- Property, over meshes, numbers of lists, orders and culling rules: every list is a depth-first walk of the tree; each
  kept triangle stands in it once, a culled one nowhere, a node exactly where something below it is kept.
- Each escape index leads to the super-sibling, found from the tree's parents and the elements' places alone; 0 stands
  at the last primitive and nowhere else, −1 at the internal nodes without super-sibling and nowhere else, 1 at all
  other primitives and nowhere else but where a super-sibling is next.
- Siblings come in ascending order of where their projections begin, or end.
- Payloads: spheres to the bit, vertex indices into an array of distinct vertices that give back the triangle's bits.
- Lists' lengths; the first list is the same whether it is one of 1, 2 or 6; a list where all is culled is empty.
- Which list a ray takes: a table of borders, and that directions lie in the part of space they are given.
- Refused: other numbers of lists, orders and rules. Golden: a hand-made list of Figure 1's kind, element by element.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Scene, load_scene
from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.culling import kept_triangles
from refsim.papers.sphere_hierarchy.directions import list_directions, list_of_rays
from refsim.papers.sphere_hierarchy.hierarchy import Hierarchy, build_hierarchy
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.reference.triangle import pack
from tests.bsh import meshes
from tests.bsh.meshes import scenes

ORDERS = ("earliest_first", "latest_last")
KINDS = [(1, None), (2, None), (6, None), (8, None), (6, "sextant_safe"), (6, "sextant_same"), (8, "octant")]
KINDS += [(6, "sextant_opposite")]
Made = tuple[Hierarchy, TraversalLists]


@st.composite
def made(draw: st.DrawFn) -> Made:
    """A hierarchy and its lists."""
    h = build_hierarchy(draw(scenes()), draw(st.sampled_from((0.5, 1.0, 0.1))))
    lists, culling = draw(st.sampled_from(KINDS))
    return h, build_lists(h, lists, draw(st.sampled_from(ORDERS)), culling)


def items_of(h: Hierarchy, lists: TraversalLists, number: int) -> list[int]:
    """What stands at each element of a list: nodes as their number, triangles as len(h) + row. Checks that the places
    that `node_at` and `triangle_at` give fill the list, each once."""
    places = np.concatenate([lists.node_at[number], lists.triangle_at[number]])
    present = np.flatnonzero(places >= 0)
    assert sorted(places[present].tolist()) == list(range(lists.length(number)))
    return present[np.argsort(places[present])].tolist()


def parent_of(h: Hierarchy, item: int) -> int:
    """The node that an item is a child of, −1 for the root."""
    return int(h.parent[item] if item < len(h) else h.owner[item - len(h)])


@given(case=made())
@settings(max_examples=80)
def test_every_list_is_a_depth_first_walk(case: Made) -> None:
    h, lists = case
    for number in range(lists.count):
        path: list[int] = []
        for item in items_of(h, lists, number):
            while path and path[-1] != parent_of(h, item):
                path.pop()
            assert path or item == 0, "the parent is not among the elements that this one may follow"
            path.append(item)


@given(case=made())
@settings(max_examples=80)
def test_each_kept_triangle_stands_once_and_nothing_that_holds_none(case: Made) -> None:
    h, lists = case
    _, normals, _, _, _, degenerate = pack(h.triangles)
    for number, direction in enumerate(list_directions(lists.count)):
        kept = kept_triangles(normals, ~degenerate, direction, lists.culling)
        part = slice(lists.first[number], lists.first[number + 1])
        escape, payload = lists.escape[part], lists.payload[part]
        leaf = np.array([item >= len(h) for item in items_of(h, lists, number)], np.bool_)
        assert sorted(payload[leaf, 3].tolist()) == np.flatnonzero(kept).tolist()
        holds = {-1}
        for node in h.owner[kept].tolist():
            while node not in holds:
                holds.add(node)
                node = int(h.parent[node])
        assert set(np.flatnonzero(lists.node_at[number] >= 0).tolist()) == holds - {-1}
        assert len(escape) == int(kept.sum()) + len(holds) - 1


@given(case=made())
@settings(max_examples=80)
def test_escape_indices_lead_to_super_siblings(case: Made) -> None:
    h, lists = case
    for number in range(lists.count):
        items = items_of(h, lists, number)
        place = {item: at for at, item in enumerate(items)}
        siblings: dict[int, list[int]] = {}
        for at, item in enumerate(items):
            siblings.setdefault(parent_of(h, item), []).append(at)
        escape = lists.escape[lists.first[number] : lists.first[number + 1]].tolist()
        for at, item in enumerate(items):
            # "its immediate sibling in the tree, or, if it has none, the one of its first ancestor having one"
            above, target = item, None
            while target is None and above != 0:
                later = [k for k in siblings[parent_of(h, above)] if k > place[above]]
                target = later[0] if later else None
                above = parent_of(h, above)
            if item >= len(h):
                assert escape[at] == (0 if at + 1 == len(items) else 1)
                assert target == (None if at + 1 == len(items) else at + 1)
            else:
                assert escape[at] == (-1 if target is None else target - at)
                assert escape[at] == -1 or escape[at] > 1, "an internal node has a child before its super-sibling"


@given(case=made())
@settings(max_examples=80)
def test_siblings_ascend_along_the_list(case: Made) -> None:
    h, lists = case
    exact, spheres = h.triangles.astype(np.float64), h.spheres.astype(np.float64)
    for number, direction in enumerate(list_directions(lists.count)):
        corners = exact @ direction
        middle, reach = spheres[:, :3] @ direction, np.linalg.norm(direction) * spheres[:, 3]
        begins = np.concatenate([middle - reach, corners.min(axis=1)])
        ends = np.concatenate([middle + reach, corners.max(axis=1)])
        keys = begins if lists.order == "earliest_first" else ends
        # The sums of products may be taken in another order here: 2⁻⁵⁰ of the numbers they are made of
        finite = spheres[np.isfinite(spheres).all(axis=1)]
        rounding = 2.0**-50 * max(np.abs(exact).max(), np.abs(finite).max(initial=0.0)) * 3.0
        last: dict[int, float] = {}
        for item in items_of(h, lists, number):
            before = last.get(parent_of(h, item), -np.inf)
            assert before <= keys[item] + rounding
            last[parent_of(h, item)] = keys[item]


@given(case=made())
@settings(max_examples=60)
def test_payloads_are_spheres_and_vertex_indices(case: Made) -> None:
    h, lists = case
    positions = lists.vertices.positions.view(np.int32)
    assert len({tuple(p) for p in positions.tolist()}) == len(positions)
    assert lists.escape.dtype == np.int32 and lists.payload.dtype == np.int32
    assert lists.payload.shape == (len(lists.escape), 4) and lists.first[-1] == len(lists.escape)
    for number in range(lists.count):
        part = slice(lists.first[number], lists.first[number + 1])
        for item, bits in zip(items_of(h, lists, number), lists.payload[part], strict=True):
            if item < len(h):
                assert bits.tolist() == h.spheres[item].view(np.int32).tolist()
            else:
                assert bits[3] == item - len(h)
                assert positions[bits[:3]].tolist() == h.triangles[bits[3]].view(np.int32).tolist()


@given(scene=scenes(), order=st.sampled_from(ORDERS))
@settings(max_examples=30)
def test_fewer_lists_are_the_first_of_more(scene: Scene, order: str) -> None:
    h = build_hierarchy(scene)
    one, two, six = (build_lists(h, lists, order) for lists in (1, 2, 6))
    length = len(h) + len(scene)
    assert [len(lists.escape) for lists in (one, two, six)] == [length, 2 * length, 6 * length]
    for fewer in (one, two):
        assert np.array_equal(fewer.escape, six.escape[: len(fewer.escape)])
        assert np.array_equal(fewer.payload, six.payload[: len(fewer.payload)])


def test_a_list_of_which_all_is_culled_is_empty() -> None:
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)  # normal +z
    lists = build_lists(build_hierarchy(Scene(triangle)), 6, culling="sextant_safe")
    assert [lists.length(k) for k in range(6)] == [2, 2, 2, 2, 0, 2]


def test_a_small_list_by_hand() -> None:
    """Two pairs of small triangles left and right, and a big one that spans them."""
    small = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    big = np.array([[-12, 0, 0], [13, 0, 0], [0, 1, 0]], np.float32)
    rows = [small + np.float32([10, 0, 0]), small - np.float32([10, 0, 0]), big, small + np.float32([9, 0, 0])]
    rows.append(small - np.float32([9, 0, 0]))
    h = build_hierarchy(Scene(np.array(rows)))
    assert h.parent.tolist() == [-1, 0, 0] and h.owner.tolist() == [2, 1, 0, 2, 1]
    lists = build_lists(h, 2)
    # Root, the big one (which begins at −12), left node with 1 and 4, right node with 3 and 0
    assert lists.escape[:8].tolist() == [-1, 1, 3, 1, 1, -1, 1, 0]
    assert lists.payload[[1, 3, 4, 6, 7], 3].tolist() == [2, 1, 4, 3, 0]
    # Along −x: the big one's right end comes first, then right to left
    assert lists.escape[8:].tolist() == [-1, 1, 3, 1, 1, -1, 1, 0]
    assert lists.payload[[9, 11, 12, 14, 15], 3].tolist() == [2, 0, 3, 4, 1]


@pytest.mark.parametrize(
    ("direction", "two", "six", "eight"),
    [
        ((1, 0, 0), 0, 0, 0),
        ((-1, 0, 0), 1, 1, 1),
        ((0, -1, 0), 0, 3, 2),
        ((0, 0, -1), 0, 5, 4),
        ((-0.0, 0, 1), 0, 4, 0),  # −0 is not below 0
        ((0, 0, 0), 0, 0, 0),
        ((1, 1, 1), 0, 0, 0),
        ((-1, 1, 1), 1, 1, 1),
        ((-1, -1, -1), 1, 1, 7),
        ((0, 1, 1), 0, 2, 0),
        ((0, -1, 1), 0, 3, 2),
        ((0.5, 1, -1), 0, 2, 4),
        ((1, np.nextafter(np.float32(1), np.float32(2)), 0), 0, 2, 0),
        ((-1e-45, 0, 1), 1, 4, 1),  # the smallest number below 0
        ((np.nextafter(np.float32(1), np.float32(0)), 1, 1), 0, 2, 0),
    ],
)
def test_the_list_of_a_ray_on_a_border(direction: tuple[float, ...], two: int, six: int, eight: int) -> None:
    d = np.array([direction], np.float32)
    assert [list_of_rays(d, k).tolist() for k in (1, 2, 6, 8)] == [[0], [two], [six], [eight]]


@given(seed=st.integers(0, 2**32 - 1), coarse=st.booleans())
@settings(max_examples=50)
def test_directions_lie_where_their_list_says(seed: int, coarse: bool) -> None:
    rng = np.random.default_rng(seed)
    d = (rng.integers(-2, 3, (64, 3)) if coarse else rng.normal(size=(64, 3))).astype(np.float32)
    for lists in (1, 2, 6, 8):
        along = list_directions(lists)[list_of_rays(d, lists)].astype(np.float32)
        if lists == 2:
            assert (d[:, 0] * along[:, 0] >= 0).all()
        elif lists == 6:
            assert ((d * along).sum(axis=1) == np.abs(d).max(axis=1)).all()
        elif lists == 8:
            assert (d * along >= 0).all()


@pytest.mark.parametrize("lists", [0, 3, 4, 5, 7, 9, -1, "6", None])
def test_other_numbers_of_lists_are_refused(lists: object) -> None:
    h = build_hierarchy(Scene(meshes.soup(np.random.default_rng(1), 3)))
    with pytest.raises(InputError, match="must be one of 1, 2, 6, 8"):
        build_lists(h, lists)  # type: ignore[arg-type]


@pytest.mark.parametrize("order", ["", "Earliest_First", "latest_first", None, 1])
def test_other_orders_are_refused(order: object) -> None:
    h = build_hierarchy(Scene(meshes.soup(np.random.default_rng(1), 3)))
    with pytest.raises(InputError, match="must be one of 'earliest_first', 'latest_last'"):
        build_lists(h, 6, order)  # type: ignore[arg-type]


@pytest.mark.parametrize(("lists", "rule"), [(1, "sextant_safe"), (8, "sextant_safe"), (6, "octant"), (6, "sextant")])
def test_rules_of_other_lists_are_refused(lists: int, rule: str) -> None:
    """Built all the same, they would lose hits without a word: every ray takes the single list, whatever it culls."""
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    with pytest.raises(InputError, match="culling"):
        build_lists(build_hierarchy(Scene(triangle)), lists, culling=rule)


def test_golden_lengths() -> None:
    """The knot: 1,024 triangles in 509 nodes. The paper's 16.67 % would leave 853 of the triangles in each list."""
    h = build_hierarchy(load_scene("torus_knot_1024"))
    plain, safe = build_lists(h), build_lists(h, 6, culling="sextant_safe")
    octant = build_lists(h, 8, culling="octant")
    assert [plain.length(k) for k in range(6)] == [1533] * 6
    assert [safe.length(k) for k in range(6)] == [1410, 1417, 1416, 1418, 1362, 1366]
    assert [octant.length(k) for k in range(8)] == [1365, 1362, 1367, 1372, 1368, 1373, 1371, 1366]
