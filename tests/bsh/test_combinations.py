"""Every combination of options finds the same hits, and they are right.

Plan
- On a procedural scene with glass, mirrors, diffuse surfaces, a ground and shadow rays, all 864 combinations of lists ×
  order × safe culling × heads × head rule × cells × packet × layers give the same bits in every generation as the
  single list without any of it: ties go to the lower triangle number, so nothing is exempt. No ray visits more elements
  than its lists have.
- That single list: all generations equal brute force bit for bit (specular paths); every hit of every kind is
  admissible to the judge, which shares no code with it, shadow rays included.
- The same on other scenes (a box, a blob, soups, incoherent and dead rays) for combinations drawn with a seed, and on
  real meshes; a mesh that is absent is named.
- Embree's hits on the same rays are admissible too, and of the same triangles wherever the judge sees no tie.
- Control: a head one element too far, a culled visible triangle, an escape index too large and the exit root each
  change hits. A wrong sort key changes counts alone (`test_lists`).
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import refsim
from refsim import Hits, Rays, Scene
from refsim.oracle import judge
from refsim.papers.sphere_hierarchy.directions import list_of_rays
from refsim.papers.sphere_hierarchy.errata import misses_by_exit_root
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
from refsim.papers.sphere_hierarchy.lists import build_lists
from refsim.papers.sphere_hierarchy.search import Found, search
from refsim.results import RayKind, Trace
from tests.bsh.embree import embree_hits
from tests.bsh.traced import COLUMNS, bits, eye_rays, mixed, traced, wild_rays
from tests.scenes_present import absent, real_scene

PARTITIONS = ((1, None), (2, None), (6, None), (6, "sextant_safe"), (8, None), (8, "octant"))
AXES: dict[str, tuple[Any, ...]] = {
    "order": ("earliest_first", "latest_last"),
    "heads": (None, "simple", "regular"),
    "head_rule": ("leaf", "climb"),
    "screen_cells": (None, 3),
    "packet": (True, False),
    "layers": ((), (50,), (30, 100)),
}
BODY = "torus_knot_100"


def combinations(partition: tuple[int, str | None]) -> list[dict[str, Any]]:
    lists, culling = partition
    return [
        {"lists": lists, "culling": culling, **dict(zip(AXES, values, strict=True))}
        for values in itertools.product(*AXES.values())
    ]


def plain(scene: Scene, rays: Rays, facing: str, **options: Any) -> Trace:
    return traced(scene, rays, lists=1, packet=False, facing=facing, **options)


def longest(scene: Scene) -> int:
    """More than this no list can have: a node for every triangle and every branching above."""
    return 3 * len(scene)


@pytest.mark.parametrize("partition", PARTITIONS, ids=str)
def test_all_combinations_agree(partition: tuple[int, str | None]) -> None:
    scene, rays = mixed(), eye_rays()
    expected = bits(plain(scene, rays, "front", shadows=True))
    every = combinations(partition)
    assert len(every) == 144
    for options in every:
        trace = traced(scene, rays, facing="front", shadows=True, **options)
        assert bits(trace) == expected, options
        assert max(int(g.per_ray["nodes"].max()) for g in trace.generations) <= longest(scene), options


def assert_admissible(trace: Trace, facing: Any) -> None:
    for k, generation in enumerate(trace.generations):
        shadow = (generation.kind == RayKind.SHADOW) & generation.alive
        for rows, any_hit in ((shadow, True), (generation.alive & ~shadow, False)):
            hits = Hits(*(getattr(generation.hits, name)[rows] for name in COLUMNS))
            verdicts = judge(trace.scene, generation.rays[rows], hits, any_hit=any_hit, facing=facing)
            assert verdicts.ok, f"generation {k}: {verdicts.worst()}"


@pytest.mark.parametrize("facing", ["front", "both"])
def test_what_they_agree_on_is_right(facing: str) -> None:
    scene, rays = mixed(), eye_rays()
    trace = plain(scene, rays, facing, shadows=True)
    assert_admissible(trace, facing)
    shadows = [g.hits.triangle[(g.kind == RayKind.SHADOW) & g.alive] >= 0 for g in trace.generations]
    assert sum(int(s.sum()) for s in shadows) > 5 and sum(int((~s).sum()) for s in shadows) > 50
    specular, brute = plain(scene, rays, facing), refsim.trace("brute_force", scene, rays, generations=4, facing=facing)
    assert bits(specular) == bits(brute)
    assert sum(int((g.hits.triangle >= 0).sum()) for g in brute.generations[1:]) > (60 if facing == "both" else 20)


def drawn(count: int, seed: int, facing: str) -> list[dict[str, Any]]:
    """Combinations drawn at random, of all partitions that fit the facing."""
    rng = np.random.default_rng(seed)
    partitions = [p for p in PARTITIONS if p[1] is None or facing == "front"]
    picked = []
    for _ in range(count):
        every = combinations(partitions[rng.integers(len(partitions))])
        picked.append(every[rng.integers(len(every))])
    return picked


@pytest.mark.parametrize("name", ["cornell_box", "blob_320", "sphere_192", "cubes", "torus_knot_1024"])
def test_other_scenes(name: str) -> None:
    scene = refsim.load_scene(name)
    rays = refsim.camera_rays(scene, 20, 16, fill=0.6)
    for facing in ("both", "front"):
        brute = refsim.trace("brute_force", scene, rays, generations=4, facing=facing)
        for options in drawn(5, len(scene), facing):
            options["layers"] = tuple(row * len(scene) // 102 for row in options["layers"])
            trace = traced(scene, rays, facing=facing, **options)
            assert bits(trace) == bits(brute), (facing, options)
            assert_admissible(trace, facing)


def test_incoherent_rays_with_ends() -> None:
    for name in (BODY, "cubes"):
        scene = mixed(name)
        rays = wild_rays(scene, 700, 3)
        for facing in ("both", "front"):
            brute = refsim.trace("brute_force", scene, rays, generations=3, facing=facing)
            for options in drawn(5, 7, facing):
                trace = traced(scene, rays, facing=facing, generations=3, **{**options, "screen_cells": None})
                assert bits(trace) == bits(brute), (name, facing, options)


@pytest.mark.parametrize("name", ["suzanne", "teapot", "dragon_res4", "bunny"])
def test_real_meshes(name: str) -> None:
    scene = real_scene(name)
    if scene is None:
        assert name in absent()
        print(f"{name}: missing")
        return
    rays = refsim.camera_rays(scene, 48, 40, fill=0.6)
    expected = plain(scene, rays, "front", material="glass", generations=3)
    assert_admissible(expected, "front")
    for options in drawn(3, len(scene), "front"):
        trace = traced(scene, rays, facing="front", generations=3, **{**options, "heads": "regular"})
        assert bits(trace) == bits(expected), options


@pytest.mark.parametrize("name", ["cornell_box", "torus_knot_1024", "suzanne", "bunny"])
def test_embree(name: str) -> None:
    scene = real_scene(name) if name in ("suzanne", "bunny") else refsim.load_scene(name)
    if scene is None:
        assert name in absent()
        return
    for rays in (refsim.camera_rays(scene, 64, 48, fill=0.6), endless(wild_rays(scene, 2000, 5))):
        theirs = embree_hits(scene, rays)
        ours = traced(scene, rays, generations=1).hits
        for hits in (theirs, ours):
            verdicts = judge(scene, rays, hits)
            assert verdicts.ok, verdicts.worst()
        differ = theirs.triangle != ours.triangle
        assert differ.mean() < 0.005 and int(theirs.hit.sum()) > 100


def test_what_is_broken_is_seen() -> None:
    """A head one element too far, an escape index too large, a visible triangle left out, the wrong root."""
    scene = refsim.load_scene("sphere_192")
    rays = refsim.camera_rays(scene, 24, 24, fill=0.5)
    lists = build_lists(build_hierarchy(scene), 6)
    right = search([lists], rays)
    assert int(right.hits.hit.sum()) > 200

    def differ(found: Found) -> int:
        return int((found.hits.triangle != right.hits.triangle).sum())

    # The head of each ray: the very element that it hits. It still finds it; from the next one on it does not
    picked = list_of_rays(rays.direction, 6)
    at = np.where(right.hits.hit, lists.triangle_at[picked, np.maximum(right.hits.triangle, 0)], 0).astype(np.int32)
    assert differ(search([lists], rays, starts=[at])) == 0
    assert differ(search([lists], rays, starts=[at + right.hits.hit.astype(np.int32)])) == int(right.hits.hit.sum())
    # Escape indices of inner nodes that skip a sibling's sphere and what comes first in it
    escape = np.where(lists.escape > 1, lists.escape + 2, lists.escape).astype(np.int32)
    assert differ(search([replace(lists, escape=escape)], rays)) > 0
    # Front faces culled in the place of back faces
    front, literal = (
        search([build_lists(build_hierarchy(scene), 6, culling=rule)], rays, facing="front")
        for rule in ("sextant_safe", "sextant_opposite")
    )
    assert differ(front) == 0 < differ(literal)
    # The exit root of spheres in the entry root's place, in lists whose order does not hide it
    one = build_lists(build_hierarchy(scene), 1)
    assert differ(search([one], rays)) == 0 < differ(search([one], rays, slots={"misses_sphere": misses_by_exit_root}))


def endless(rays: Rays) -> Rays:
    return Rays(rays.origin, rays.direction)
