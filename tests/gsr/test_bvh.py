"""The hierarchy that stands in the grid's place: that its nodes are a tree whose boxes hold what is below them.

Plan (its hits are those of the naive search: `test_grid.py`)
- Property: walked without missing any box, escape indices lead through every node once, depth first; the subtrees of a
  node are next to each other and fill it; every triangle that can be hit stands in one leaf, or is loose.
- A node's box holds its children's, and its triangles grown by dilation and slack.
- An escape skips: a ray that misses visits fewer nodes than there are, and no list of a missed box is tested.
- Leaves are small where centres differ; copies without end are halved; golden counts for the knot.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Scene, camera_rays, load_scene
from refsim.papers.geometry_shader_rays.bvh import Hierarchy, bvh
from refsim.papers.geometry_shader_rays.grid_margins import margins
from tests.gsr.grid_cases import INF, KINDS, scene_of, shoot

ESCAPE, START, COUNT = 0, 1, 2


def check(h: Hierarchy, node: int, scene: Scene, growth: np.ndarray) -> tuple[int, list[int]]:
    """The node after this subtree, and its triangles; asserts what must hold in it."""
    escape, start, count = map(int, h.links[node])
    low, high = h.boxes[node, :3].astype(float), h.boxes[node, 3:].astype(float)
    if count:
        members = h.lists[start : start + count].tolist()
        vertices, grown = scene.triangles[members].astype(float), growth[members][:, None, None]
        assert (vertices - grown >= low).all() and (vertices + grown <= high).all()
        assert escape == node + 1
        return escape, members
    following, members = node + 1, []
    for _ in range(2):
        child, own = following, []
        following, own = check(h, child, scene, growth)
        assert (h.boxes[child, :3] >= h.boxes[node, :3]).all() and (h.boxes[child, 3:] <= h.boxes[node, 3:]).all()
        members += own
    assert escape == following
    return following, members


@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(KINDS), exponent=st.integers(-6, 6))
@settings(max_examples=60)
def test_the_nodes_are_a_tree(seed: int, kind: str, exponent: int) -> None:
    scene = scene_of(kind, np.random.default_rng(seed), 10.0**exponent)
    h, bounds = bvh(scene, scene.diagonal).structure, margins(scene, scene.diagonal)
    assert len(h.boxes) == len(h.links) == h.nodes
    end, members = check(h, 0, scene, bounds.dilation + bounds.slack) if h.nodes else (0, [])
    assert end == h.nodes
    assert sorted(members) == np.flatnonzero(bounds.dilation >= 0).tolist()
    assert sorted(members + h.loose.tolist() + np.flatnonzero(scene.degenerate).tolist()) == list(range(len(scene)))


def test_the_knot() -> None:
    scene = load_scene("torus_knot_1024")
    accelerator = bvh(scene)
    h = accelerator.structure
    assert h.links[h.links[:, COUNT] > 0, COUNT].max() <= 8
    rays = camera_rays(scene, 24, 24)
    shot = shoot(accelerator, scene, (rays.origin, rays.direction, rays.t_max))
    visited = shot.cells[shot.rejected == 0]
    assert visited.max() < h.nodes / 4 and shot.tests.mean() < 6


def test_a_missed_box_is_skipped_with_all_below_it() -> None:
    """Two heaps: a ray through one visits the root, the other's top node and its own."""
    rng = np.random.default_rng(4)
    heap = rng.normal(size=(64, 3, 3))
    scene = Scene(np.concatenate([heap, heap + np.array([1000, 0, 0])]).astype(np.float32))
    accelerator = bvh(scene)
    h = accelerator.structure
    left = 1
    right = int(h.links[left, ESCAPE])
    origin, direction = [(float(h.boxes[right, 0] + 4), 0, -100)], [(0, 0, 1)]
    shot = shoot(accelerator, scene, (origin, direction, [INF]))
    assert 2 < shot.cells[0] <= 2 + h.nodes - right
    own = np.arange(right, h.nodes)
    assert shot.tests[0] <= h.links[own, COUNT].sum() == 64


def test_copies_are_halved_and_the_lowest_is_found() -> None:
    triangle = np.array([(0, -1, -1), (0, 2, -1), (0, -1, 2)], np.float32)
    accelerator = bvh(scene := Scene(np.tile(triangle, (3000, 1, 1))))
    h = accelerator.structure
    assert h.links[h.links[:, COUNT] > 0, COUNT].max() <= 8
    shot = shoot(accelerator, scene, ([(5, 0, 0)], [(-1, 0, 0)], [INF]))
    assert (shot.triangle[0], shot.tests[0]) == (0, 3000)
