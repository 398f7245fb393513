"""The traversal as a fragment shader and as a vertex shader: the bits and counts of the bare loop.

Plan
- Property: any mesh that is hard on a hierarchy, its lists of any number, order and safe culling, one layer or two,
  rays with dead ones among them, heads anywhere in the lists, any hit or the nearest, both facings: hits and counts of
  both forms have the bits of the scalar loop. Controls: the comparison sees one bit; ties take the lower number; with
  the printed sphere test (BSH-E5) all forms miss the same.
- Table of sizes: 0, 1 and 300 rays without an image, 1 × 1, 17 × 13, and 80 × 60, which takes the dense fragment loop;
  with 1 and 2 threads; counters as reckoned by hand, and the conservation laws.
- Taps change nothing and hold what was found. A draw that does nothing finds nothing. Lists are bound, not copied: an
  update is seen. A second search compiles nothing.
- Stages and slots that do not exist are refused, and lists and rays that are too many for a texture.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from refsim import Rays, camera_rays, load_scene
from refsim.counters import Counters
from refsim.errors import InputError
from refsim.papers.sphere_hierarchy import list_textures
from refsim.papers.sphere_hierarchy import shader_search as module
from refsim.papers.sphere_hierarchy.errata import misses_by_exit_root
from refsim.papers.sphere_hierarchy.hierarchy import hierarchy_of
from refsim.papers.sphere_hierarchy.lists import TraversalLists, build_lists
from refsim.papers.sphere_hierarchy.search import Found, search
from refsim.papers.sphere_hierarchy.shader_search import STAGES, shader_search
from refsim.pipeline.program import program_of
from refsim.pipeline.taps import Taps
from tests.bsh.meshes import Triangles, meshes, rays_at, same_hits

# Lists, order, culling, facing
CULLED = ((6, "sextant_safe"), (8, "octant"))
FORMS = [
    *((lists, order, None, "both") for lists in (1, 2, 6, 8) for order in ("earliest_first", "latest_last")),
    *((lists, order, rule, "front") for lists, rule in CULLED for order in ("earliest_first", "latest_last")),
]
PRINTED = {"misses_sphere": misses_by_exit_root}


def lists_of(triangles: Triangles, lists: int = 6, order: str = "earliest_first", rule: Any = None) -> TraversalLists:
    """The lists of a mesh with the default threshold."""
    return build_lists(hierarchy_of(np.ascontiguousarray(triangles), 0.5), lists, order, rule)


def with_dead(rays: Rays, share: float, seed: int, width: int | None = None, height: int | None = None) -> Rays:
    """The same rays, a share of them dead."""
    live = np.random.default_rng(seed).random(len(rays)) >= share
    direction = np.where(live[:, None], rays.direction, np.float32(0))
    return Rays(rays.origin, direction, np.where(live, rays.t_max, np.float32(0)), width, height)


def heads_anywhere(layers: list[TraversalLists], count: int, seed: int) -> list[NDArray[np.int32] | None]:
    """Elements of the lists at which rays begin, some beyond their end; for an odd seed the first layer has none."""
    rng = np.random.default_rng(seed)
    longest = [max(lists.length(k) for k in range(lists.count)) for lists in layers]
    starts: list[Any] = [rng.integers(0, most + 2, count).astype(np.int32) for most in longest]
    return [None if seed % 2 else starts[0], *starts[1:]]


def same_found(one: Found, other: Found) -> None:
    """Asserts equal bits of hits and equal counts."""
    same_hits(one.hits, other.hits)
    for name in ("nodes", "triangle_tests"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype == np.int32 and a.flags.c_contiguous
        np.testing.assert_array_equal(a, b, name)


@settings(max_examples=40)
@given(
    meshes(most=20),
    st.sampled_from(FORMS),
    st.integers(1, 80),
    st.integers(0, 2**16),
    st.booleans(),
    st.booleans(),
    st.floats(0.0, 1.0),
)
def test_bits_and_counts_are_those_of_the_bare_loop(
    triangles: Triangles, form: Any, count: int, seed: int, any_hit: bool, heads: bool, cut: float
) -> None:
    lists, order, rule, facing = form
    row = round(cut * len(triangles))
    parts = [part for part in (triangles[:row], triangles[row:]) if len(part)]
    layers = [lists_of(part, lists, order, rule) for part in parts]
    rays = with_dead(rays_at(triangles, count, seed), 0.1, seed)
    options: dict[str, Any] = {"any_hit": any_hit, "facing": facing, "threads": 1 + seed % 2}
    options["starts"] = heads_anywhere(layers, count, seed) if heads else None
    bare = search(layers, rays, packet=False, **options)
    for stage in STAGES:
        same_found(shader_search(layers, rays, stage=stage, **options), bare)


def test_the_comparison_sees_one_bit() -> None:
    layers, rays = knot()
    bare, found = search(layers, rays), shader_search(layers, rays)
    found.hits.t.view(np.int32)[found.hits.hit.argmax()] ^= 1
    with pytest.raises(AssertionError, match="t of ray"):
        same_found(found, bare)
    found = shader_search(layers, rays)
    found.nodes[7] += 1
    with pytest.raises(AssertionError, match="nodes"):
        same_found(found, bare)


def test_ties_take_the_lower_number() -> None:
    # Four times the same triangle, two in each layer: whatever the order of the lists, the first of all is hit
    one = np.array([[[-1, -1, 0], [2, -1, 0], [-1, 2, 0]]], np.float32)
    rays = Rays([(0.0, 0.0, 3.0), (5.0, 5.0, 3.0)], [(0.0, 0.0, -1.0)] * 2)
    for order in ("earliest_first", "latest_last"):
        layers = [lists_of(np.repeat(one, 2, axis=0), 6, order)] * 2
        for stage in STAGES:
            found = shader_search(layers, rays, stage=stage)
            assert found.hits.triangle.tolist() == [0, -1] and found.hits.t.tolist() == [3.0, np.inf]
            assert found.triangle_tests[0] == 4
            assert shader_search(layers, rays, stage=stage, any_hit=True).triangle_tests[0] == 1


@cache
def knot(width: int = 24, height: int = 16) -> tuple[list[TraversalLists], Rays]:
    """A knot in two layers, camera rays at it."""
    scene = load_scene("torus_knot_1024")
    layers = [lists_of(scene.triangles[:300]), lists_of(scene.triangles[300:])]
    return layers, camera_rays(scene, width, height, fill=0.6)


def test_the_printed_sphere_test_misses_the_same() -> None:
    layers, rays = knot()
    bare, printed = search(layers, rays, packet=False), search(layers, rays, packet=False, slots=PRINTED)
    assert bare.hits.hit.any() and not bare.hits.hit.all()
    assert (printed.hits.t > bare.hits.t).any(), "the nearest hit lies in a sphere that reaches beyond a farther one"
    for stage in STAGES:
        same_found(shader_search(layers, rays, stage=stage, slots=PRINTED), printed)


# Rays (None: as many without an image), and pixels of the targets that hold them
SIZES = {
    "none": ((0, None), 1),
    "one": ((1, None), 1),
    "three": ((3, None), 4),
    "300": ((300, None), 18 * 17),
    "1 × 1": ((1, 1), 1),
    "17 × 13": ((17, 13), 221),
    "80 × 60": ((80, 60), 4800),
}


def sized(size: tuple[int, int | None]) -> Rays:
    """So many rays of a picture, some dead: an image, or rows without one."""
    width, height = size
    rays = knot(width, height)[1] if height is not None else knot()[1][:width]
    return with_dead(rays, 0.15, 5, *((width, height) if height is not None else ()))


@pytest.mark.parametrize("name", SIZES)
def test_sizes_and_counters(name: str) -> None:
    size, pixels = SIZES[name]
    layers, rays = knot()[0], sized(size)
    bare = search(layers, rays, packet=False)
    for threads in (1, 2):
        counters = {stage: Counters() for stage in STAGES}
        for stage in STAGES:
            found = shader_search(layers, rays, stage=stage, threads=threads, counters=counters[stage])
            same_found(found, bare)
            counters[stage].check()
        drawn, captured = counters["fragment"], counters["vertex"]
        # Two layers: a quad of four corners each, or a point a ray each
        assert drawn["draw.calls"] == captured["draw.calls"] == 2
        assert drawn["vertex.invocations"] == 2 * 4 and drawn["raster.drawn"] == 2
        assert drawn["fragment.invocations"] == drawn["fragment.written"] == 2 * pixels
        assert captured["vertex.invocations"] == captured["stream_output.primitives"] == 2 * len(rays)
        assert captured["fragment.invocations"] == captured["raster.primitives"] == 0


def test_counters_are_added_to_what_they_held() -> None:
    layers, rays = knot()
    counters = Counters()
    for stage in STAGES:
        shader_search(layers, rays, stage=stage, counters=counters)
        shader_search(layers[:1], rays, stage=stage, counters=counters)
    assert counters["draw.calls"] == 6
    assert shader_search([], rays).nodes.sum() == 0 and not shader_search([], rays, stage="vertex").hits.hit.any()


@pytest.mark.parametrize("stage", STAGES)
def test_taps_change_nothing(stage: str) -> None:
    layers, rays = knot()
    plain, tapped, taps = Counters(), Counters(), Taps("vertex", "stream_output", "fragment")
    found = shader_search(layers, rays, stage=stage, counters=plain)
    same_found(shader_search(layers, rays, stage=stage, counters=tapped, taps=taps), found)
    assert dict(plain) == dict(tapped)
    assert len(taps.vertex) == 2
    if stage == "fragment":
        tap, held = taps.fragment[1], taps.fragment[1].outputs
        row = tap.y * 24 + tap.x
    else:
        tap, held = taps.stream_output[1], taps.stream_output[1].records
        row = tap.primitives
    hits = found.hits
    expected = {"found": (hits.triangle, found.nodes, found.triangle_tests), "hit": (hits.t, hits.u, hits.v)}
    for name, columns in expected.items():
        np.testing.assert_array_equal(held[name][np.argsort(row)], np.column_stack(columns))


@pytest.mark.parametrize("stage", STAGES)
def test_without_the_draw_nothing_is_found(stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    layers, rays = knot()
    assert shader_search(layers[:1], rays, stage=stage).hits.hit.any()
    monkeypatch.setattr(module, "draw", lambda *arguments, **options: None)
    counters = Counters()
    found = shader_search(layers[:1], rays, stage=stage, counters=counters)
    assert not found.hits.hit.any() and np.isinf(found.hits.t).all() and not counters
    assert not found.nodes.any() and not found.triangle_tests.any()


@pytest.mark.parametrize("stage", STAGES)
def test_lists_are_bound_where_they_lie(stage: str) -> None:
    scene = load_scene("torus_knot_1024")
    lists, rays = lists_of(scene.triangles), knot()[1]
    assert shader_search([lists], rays, stage=stage).hits.hit.any()
    # No sphere is large enough any more: κ, a few millionths of the scene, is all that is left of the root
    lists.spheres[lists.escape != 1, 3] = 0
    found = shader_search([lists], rays, stage=stage)
    same_found(found, search([lists], rays, packet=False))
    assert not found.hits.hit.any() and (found.nodes == 1).all()


def test_a_second_search_compiles_nothing() -> None:
    layers, rays = knot()
    for stage in STAGES:
        shader_search(layers, rays, stage=stage)
        before = program_of.cache_info().misses
        shader_search([lists_of(load_scene("torus_knot_1024").triangles[:40], 2)], rays, stage=stage, any_hit=True)
        assert program_of.cache_info().misses == before


def test_what_does_not_exist_or_fit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    layers, rays = knot()
    with pytest.raises(InputError, match="stage is 'geometry'; it must be one of 'fragment', 'vertex'"):
        shader_search(layers, rays, stage="geometry")
    with pytest.raises(InputError, match="slot 'misses_spheres' is none of the traversal's: misses_sphere"):
        shader_search(layers, rays, slots={"misses_spheres": misses_by_exit_root})
    monkeypatch.setattr(list_textures, "MOST_TEXELS", 2000)
    with pytest.raises(InputError, match="texels of a list are more than the 2000 of a one-dimensional texture"):
        shader_search(layers, rays)
    monkeypatch.setattr(list_textures, "MAX_TARGET_PIXELS", 383)
    with pytest.raises(InputError, match="24 × 16 rays are more than a target of 383 pixels holds"):
        shader_search([], rays)
    assert not shader_search([], rays, stage="vertex").hits.hit.any()
