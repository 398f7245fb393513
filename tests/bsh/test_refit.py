"""Lists whose triangles move: the tree stays, the hits are those of lists built anew.

Plan
- Property, over meshes that are hard on a hierarchy, motions (a jitter, a collapse to points and back, turned windings,
  places exchanged, a far corner), lists, orders and culling rules, for all triangles and for a few:
  hits have the bits of a new build; every sphere holds its triangles and their margins and is what the builder's rule
  gives, written out here; the input is not touched; lists that keep the same triangles keep
  order and escape indices; only elements above the moved triangles differ; the ranges, copied over the old bytes, give
  the new ones, for any gap; the bytes pass the reader's checks.
- Vertices: shared ones come apart and keep their numbers, those that meet stay two, no number is ever without a corner.
- A triangle that turns away makes a culled list lay itself out anew, and is then missing from it; one that turns within
  its own partition does not.
- Frames of an animation one after the other, from the last state: errors do not add up.
- A table of what is refused.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from refsim import InputError, camera_rays
from refsim.papers.sphere_hierarchy.byte_layout import from_bytes, to_bytes
from refsim.papers.sphere_hierarchy.byte_ranges import Changes, copied
from refsim.papers.sphere_hierarchy.lists import TraversalLists
from refsim.papers.sphere_hierarchy.partial_update import update_triangles
from refsim.papers.sphere_hierarchy.refit import refit
from refsim.scene import load_scene
from refsim.scene.animation import knight_in_box
from tests.bsh.meshes import Triangles, meshes, rays_at, same_hits
from tests.bsh.moved_lists import PARTITIONS, SQUARE, arrays, hits_of, lists_of


@st.composite
def motions(draw: st.DrawFn, before: Triangles) -> Triangles:
    """The same number of triangles, elsewhere."""
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    kind = draw(st.sampled_from(("jitter", "collapse", "turn", "exchange", "corner", "grow", "stay")))
    some = rng.random(len(before)) < draw(st.sampled_from((0.2, 1.0)))
    size = float(np.ptp(before, axis=(0, 1)).max())
    after = before.copy()
    if kind == "jitter":
        after[some] += (0.1 * size * rng.normal(size=before.shape)).astype(np.float32)[some]
    elif kind == "collapse":
        after[some] = before[some][:, :1]
    elif kind == "turn":
        after[some] = before[some][:, ::-1]
    elif kind == "exchange":
        after[some] = before[some][::-1]
    elif kind == "corner":
        after[some, 2] += np.float32(50 * size)
    elif kind == "grow":
        middle = before.mean(axis=1, keepdims=True)
        after[some] = (middle + (before - middle) * 4)[some]
    return after


def above(lists: TraversalLists, rows: NDArray) -> set[int]:
    """Owners of triangles and their ancestors."""
    found: set[int] = set()
    for row in rows:
        node = int(lists.hierarchy.owner[row])
        while node >= 0:
            found.add(node)
            node = int(lists.hierarchy.parent[node])
    return found


def check_spheres(lists: TraversalLists) -> None:
    """C is the middle of the box, float32; the radius the smallest float32 not below what the rule asks for."""
    h = lists.hierarchy
    below: list[list[int]] = [[] for _ in range(len(h))]
    for row in range(len(h.triangles)):
        for node in above(lists, np.array([row])):
            below[node].append(row)
    for node, rows in enumerate(below):
        corners = h.triangles[rows].astype(np.float64)
        x, y, z, radius = h.spheres[node]
        centre = np.array([x, y, z])
        assert (centre == (0.5 * (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1)))).astype(np.float32)).all()
        off = corners - centre.astype(np.float64)
        square = (off[..., 0] * off[..., 0] + off[..., 1] * off[..., 1]) + off[..., 2] * off[..., 2]
        needed = float(((np.sqrt(square.max(axis=1)) + h.margin[rows]) * (1.0 + 2.0**-48)).max())
        assert np.float64(radius) >= needed
        assert radius == 0 or np.float64(np.nextafter(radius, np.float32(0))) < needed


def check_ranges(old: TraversalLists, new: TraversalLists, changes: Changes, gap: int) -> None:
    """Ascending, apart, within their arrays; copied over the old bytes they give the new ones."""
    groups = (changes.escape, changes.payload, (changes.vertices,), (changes.heads,))
    for group, size in zip(groups, changes.sizes, strict=True):
        ranges = np.concatenate(group)
        ends = ranges.sum(axis=1)
        assert (ranges >= 0).all() and (ends <= size).all() and (ends[:-1] <= ranges[1:, 0]).all()
        for own in group:
            assert (own[:, 1] > 0).all() and (own[1:, 0] - own[:-1].sum(axis=1) > gap).all()
    assert changes.bytes == sum(int(r[:, 1].sum()) for group in groups for r in group)
    assert copied(to_bytes(old), new, changes) == to_bytes(new)


@given(data=st.data(), before=meshes(), partition=st.sampled_from(PARTITIONS), seed=st.integers(0, 999))
@settings(max_examples=120, deadline=None)
def test_hits_are_those_of_a_new_build(
    data: st.DataObject, before: Triangles, partition: tuple[int, str | None], seed: int
) -> None:
    count, culling = partition
    order = data.draw(st.sampled_from(("earliest_first", "latest_last")))
    gap = data.draw(st.sampled_from((0, 16, 100, 10**6)))
    old = lists_of(before, count, order, culling)
    kept = [array.copy() for array in arrays(old)]
    after = data.draw(motions(before))
    moved = np.flatnonzero((after.view(np.int32) != before.view(np.int32)).any(axis=(1, 2)))
    if data.draw(st.booleans()):
        new, changes = refit(old, after, gap)
    else:
        rows = np.random.default_rng(seed).permutation(moved)
        new, changes = update_triangles(old, rows, after[rows], gap)

    for array, copy in zip(arrays(old), kept, strict=True):
        assert array.tobytes() == copy.tobytes()
    assert (new.hierarchy.triangles.view(np.int32) == after.view(np.int32)).all() and changes.triangles == len(moved)
    assert (new.vertices.positions[new.vertices.corners].view(np.int32) == after.view(np.int32)).all()
    check_spheres(new)
    check_ranges(old, new, changes, gap)
    from_bytes(to_bytes(new), order, culling)
    fresh, rays = lists_of(after, count, order, culling), rays_at(after, 48, seed)
    same_hits(hits_of(new, rays), hits_of(fresh, rays))
    assert ((new.triangle_at >= 0) == (fresh.triangle_at >= 0)).all()

    # What stays: other nodes' spheres, and the places in lists that were not laid out anew
    others = np.array([k not in above(old, moved) for k in range(len(old.hierarchy))])
    assert new.hierarchy.spheres[others].tobytes() == old.hierarchy.spheres[others].tobytes()
    assert set(changes.relaid) == set(np.flatnonzero((new.triangle_at >= 0) != (old.triangle_at >= 0)) // len(after))
    for k in set(range(count)) - set(changes.relaid):
        here, there = slice(*old.first[k : k + 2]), slice(*new.first[k : k + 2])
        assert (new.escape[there] == old.escape[here]).all() and (new.node_at[k] == old.node_at[k]).all()
        differs = (new.payload[there] != old.payload[here]).any(axis=1)
        places = {int(new.node_at[k][node]) for node in above(old, moved)}
        renumbered = (new.vertices.corners != old.vertices.corners).any(axis=1)
        places |= set(new.triangle_at[k][renumbered].tolist())
        assert set(np.flatnonzero(differs).tolist()) <= places


def test_vertices_come_apart_and_meet() -> None:
    old = lists_of(SQUARE)
    assert old.vertices.corners.tolist() == [[0, 1, 2], [0, 2, 3]]
    apart, changes = update_triangles(old, [0], SQUARE[:1] + np.float32(0.5))
    # Triangle 1 stays, so it keeps the shared vertices; only triangle 0 had vertex 1
    assert apart.vertices.corners.tolist() == [[4, 1, 5], [0, 2, 3]] and changes.split == 2
    both, changes = refit(old, np.stack([SQUARE[0] + np.float32(0.5), SQUARE[1] - np.float32(0.5)]))
    # None stays, so the first corner keeps them
    assert both.vertices.corners.tolist() == [[0, 1, 2], [4, 5, 3]] and changes.split == 2
    together, changes = refit(apart, SQUARE)
    assert together.vertices.corners.tolist() == [[4, 1, 5], [0, 2, 3]] and changes.split == 0
    assert len(np.unique(together.vertices.positions, axis=0)) == 4
    rigid, changes = refit(old, SQUARE * np.float32(2))
    assert (rigid.vertices.corners == old.vertices.corners).all() and changes.split == 0


@given(seed=st.integers(0, 2**16))
@settings(max_examples=25, deadline=None)
def test_no_vertex_is_without_a_corner(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lists = lists_of(rng.integers(0, 2, (12, 3, 3)).astype(np.float32), 1)
    for _ in range(6):
        rows = rng.choice(12, 4, replace=False)
        lists = update_triangles(lists, rows, rng.integers(0, 2, (4, 3, 3)).astype(np.float32)).lists
        assert (np.unique(lists.vertices.corners) == np.arange(len(lists.vertices.positions))).all()


def test_a_triangle_that_turns_is_culled_elsewhere() -> None:
    flat = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[2, 0, 0], [3, 0, 0], [2, 1, 0]]], np.float32)
    old = lists_of(flat, 6, culling="sextant_safe")
    assert (old.triangle_at[4] < 0).all() and (old.triangle_at[[0, 1, 2, 3, 5]] >= 0).all()
    turned, changes = update_triangles(old, [1], flat[1:, ::-1])
    assert changes.relaid == (4, 5) and (turned.triangle_at[[4, 5]] >= 0).tolist() == [[False, True], [True, False]]
    # List 4 was empty and has root, sphere and triangle now; list 5 lost a sphere and a triangle: two heads move
    assert (np.diff(old.first)[4:].tolist(), np.diff(turned.first)[4:].tolist()) == ([0, 5], [3, 3])
    assert changes.heads.tolist() == [[40, 16]]
    check_ranges(old, turned, changes, 0)
    _, changes = update_triangles(old, [1], flat[1:] + np.float32([[0, 0, 0], [0, 0, 0.1], [0, 0, 0]]))
    assert changes.relaid == () and not any(map(len, changes.escape)) and len(changes.heads) == 0


@pytest.mark.parametrize("culling", [None, "sextant_safe"])
def test_frames_follow_each_other(culling: str | None) -> None:
    lists = lists_of(knight_in_box(0).triangles, 6, culling=culling)
    for frame in (1, 2, 40, 120, 0):
        scene = knight_in_box(frame)
        lists, changes = refit(lists, scene.triangles)
        rays = camera_rays(scene, 24, 24)
        same_hits(hits_of(lists, rays), hits_of(lists_of(scene.triangles, 6, culling=culling), rays))
        assert changes.triangles <= 636  # ten are walls
    assert len(lists.vertices.positions) <= 3 * len(scene)


def test_one_triangle_of_the_knot() -> None:
    """Golden: the path to the root and its bytes, against those of the whole scene."""
    scene = load_scene("torus_knot_1024")
    old = lists_of(scene.triangles)
    new, changes = update_triangles(old, [100], scene.triangles[100:101] * np.float32(1.5))
    path = above(old, np.array([100]))
    elements = sum(int(ranges[:, 1].sum()) for ranges in changes.payload) // 16
    assert changes.split == 3 and elements <= 6 * (len(path) + 1) < 100
    assert changes.bytes == 16 * elements + 3 * 16 < 0.01 * len(to_bytes(old).payload)
    rays = camera_rays(scene, 24, 24)
    same_hits(hits_of(new, rays), hits_of(lists_of(new.hierarchy.triangles), rays))


def test_nothing_moves_nothing_is_copied() -> None:
    old = lists_of(SQUARE)
    for new, changes in (refit(old, SQUARE), update_triangles(old, [], np.empty((0, 3, 3)))):
        assert changes.copies == changes.bytes == changes.nodes == changes.triangles == 0
        assert repr(changes) == "Changes(triangles=0, nodes=0, split=0, relaid=(), bytes=0, copies=0)"
        assert to_bytes(new) == to_bytes(old)


@pytest.mark.parametrize(
    "rows, corners, gap, sentence",
    [
        ([2], SQUARE[:1], 0, "hold 2, and there are 2 triangles"),
        ([-1], SQUARE[:1], 0, "hold -1"),
        ([0, 0], SQUARE, 0, "name one twice"),
        ([0.5], SQUARE[:1], 0, "whole numbers"),
        ([[0]], SQUARE[:1], 0, "one dimension"),
        ([0], SQUARE, 0, r"shape \[2, 3, 3\]"),
        ([0], SQUARE[:1] * np.float32(np.nan), 0, "not finite"),
        ([[0], [0, 1]], SQUARE, 0, "lists of different lengths"),
        ([0], [[1], [2, 3]], 0, "lists of different lengths"),
        ([0], SQUARE[:1], -1, "gap must be"),
        ([0], SQUARE[:1], 1.5, "gap must be"),
    ],
)
def test_what_is_refused(rows: object, corners: object, gap: object, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        update_triangles(lists_of(SQUARE, 1), rows, corners, gap)  # type: ignore[arg-type]


@pytest.mark.parametrize("triangles", [SQUARE[:1], np.concatenate([SQUARE, SQUARE]), SQUARE[0], [[1.0]], [[1], [2, 3]]])
def test_a_refit_of_another_scene_is_refused(triangles: object) -> None:
    with pytest.raises(InputError, match="refit of 2 triangles needs as many"):
        refit(lists_of(SQUARE, 1), triangles)  # type: ignore[arg-type]
