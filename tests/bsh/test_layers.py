"""Layers: the same hits however a scene is split, and a dynamic layer that changes alone.

Plan
- Property: over hard meshes and any rows at which layers begin, for 1, 2, 6 and 8 lists, hits have the bits of one.
- Frames of an animation, the walls a static layer: refitted and rebuilt, hits are those of a new list of the frame; the
  static layer is the very same object, only the dynamic one is copied, a refit copies less than a rebuild.
- A layer may be rebuilt with other numbers of triangles, and keeps its options; earlier layers are not touched.
- A table of what is refused.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim import Hits, InputError, Rays, Scene, camera_rays
from refsim.papers.sphere_hierarchy.byte_layout import bytes_of, to_bytes
from refsim.papers.sphere_hierarchy.layers import Layers, split_layers
from refsim.papers.sphere_hierarchy.search import search
from refsim.scene.animation import knight_in_box
from tests.bsh.meshes import Triangles, meshes, rays_at, same_hits
from tests.bsh.moved_lists import PARTITIONS, SQUARE, hits_of, lists_of

WALLS = 10


def hits_in(layers: Layers, rays: Rays, facing: str = "both") -> Hits:
    return search(layers.lists, rays, facing=facing, threads=1).hits


@given(triangles=meshes(), partition=st.sampled_from(PARTITIONS[:5]), data=st.data(), seed=st.integers(0, 999))
@settings(max_examples=60, deadline=None)
def test_any_split_finds_the_same(
    triangles: Triangles, partition: tuple[int, str | None], data: st.DataObject, seed: int
) -> None:
    count, culling = partition
    inner = st.integers(1, max(1, len(triangles) - 1))
    rows = sorted(data.draw(st.sets(inner, max_size=3))) if len(triangles) > 1 else []
    layers = Layers.of(Scene(triangles), rows, lists=count, culling=culling)
    assert len(layers.lists) == len(rows) + 1
    joined = np.concatenate([lists.hierarchy.triangles for lists in layers.lists])
    assert joined.tobytes() == triangles.tobytes()
    rays = rays_at(triangles, 48, seed)
    expected = hits_of(lists_of(triangles, count, culling=culling), rays)
    same_hits(hits_in(layers, rays, "front" if culling else "both"), expected)
    assert layers.bytes == sum(bytes_of(lists).total for lists in layers.lists)


@pytest.mark.parametrize("count", [1, 2, 6, 8])
def test_a_walk_in_a_box(count: int) -> None:
    scene = knight_in_box(0)
    refitted = rebuilt = Layers.of(scene, (WALLS,), lists=count)
    static = refitted.lists[0]
    for frame in (1, 30, 100):
        scene = knight_in_box(frame)
        refitted, few = refitted.refit(1, scene.triangles[WALLS:])
        rebuilt, all_of_it = rebuilt.rebuild(1, scene.triangles[WALLS:])
        rays = camera_rays(scene, 24, 24)
        expected = hits_of(lists_of(scene.triangles, count), rays)
        same_hits(hits_in(refitted, rays), expected)
        same_hits(hits_in(rebuilt, rays), expected)
        assert refitted.lists[0] is static and rebuilt.lists[0] is static
        assert few.bytes < all_of_it.bytes == bytes_of(rebuilt.lists[1]).total and all_of_it.copies == 4
    fresh = lists_of(scene.triangles[WALLS:], count)
    assert to_bytes(rebuilt.lists[1]) == to_bytes(fresh)


def test_a_layer_of_another_length() -> None:
    scene = knight_in_box(0)
    layers = Layers.of(scene, (WALLS, 300), threshold=0.25, lists=6, order="latest_last", culling="sextant_safe")
    own = scene.triangles[WALLS:200].copy()
    after, changes = layers.rebuild(1, own)
    assert changes.triangles == 190 and changes.bytes == bytes_of(after.lists[1]).total
    assert (after.lists[1].order, after.lists[1].culling, after.threshold) == ("latest_last", "sextant_safe", 0.25)
    assert after.lists[0] is layers.lists[0] and after.lists[2] is layers.lists[2]
    together = np.concatenate([scene.triangles[:200], scene.triangles[300:]])
    rays = camera_rays(scene, 16, 16)
    same_hits(hits_in(after, rays, "front"), hits_of(lists_of(together, 6, "latest_last", "sextant_safe"), rays))
    # The caller's triangles may change afterwards
    own[:] = 0
    assert (after.lists[1].hierarchy.triangles == scene.triangles[WALLS:200]).all()


@pytest.mark.parametrize(
    "rows, sentence",
    [
        ((0,), "row 0: rows must ascend from 1 to 3"),
        ((4,), "row 4"),
        ((-1,), "row -1"),
        ((2, 2), "row 2: .* no layer is empty"),
        ((3, 1), "row 1"),
        ((1.5,), "whole numbers"),
        ((True,), "whole numbers"),
        ("12", "whole numbers"),
        (2, "must be rows"),
        (None, "must be rows"),
    ],
)
def test_splits_that_are_refused(rows: object, sentence: str) -> None:
    scene = Scene(np.concatenate([SQUARE, SQUARE]))
    with pytest.raises(InputError, match=sentence):
        split_layers(scene, rows)  # type: ignore[arg-type]


@pytest.mark.parametrize("number", [-1, 2, 0.0, True])
def test_layers_that_are_not_there(number: object) -> None:
    layers = Layers.of(Scene(np.concatenate([SQUARE, SQUARE])), (2,))
    for change in (layers.refit, layers.rebuild):
        with pytest.raises(InputError, match=r"no layer .* there are 2"):
            change(number, SQUARE)  # type: ignore[arg-type]


def test_triangles_that_a_layer_cannot_have() -> None:
    layers = Layers.of(Scene(np.concatenate([SQUARE, SQUARE])), (2,))
    with pytest.raises(InputError, match="refit of 2 triangles"):
        layers.refit(1, SQUARE[:1])
    with pytest.raises(InputError, match="no triangles"):
        layers.rebuild(1, SQUARE[:0])
    with pytest.raises(InputError, match="not finite"):
        layers.rebuild(1, SQUARE + np.float32(np.inf))
