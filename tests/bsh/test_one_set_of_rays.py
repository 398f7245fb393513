"""One set of rays through every paper's method, each in its own form on the pipeline.

Plan
- Camera rays at a knot, and rays at corners and edges, along axes, from triangles, dead and with an end, in the box:
  all methods have the same bits of hits as brute force; triangle tests are counted alike: never fewer
  than the hits, never more than there are triangles where a structure holds each of them once.
- The three forms of the traversal have the same counts and differ in the draws alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import refsim
from refsim import Hits, Rays, Scene, camera_rays, load_scene
from tests.bsh.meshes import rays_at, same_hits

# How each paper shoots the same rays
METHODS: dict[str, dict[str, Any]] = {
    "brute_force": {"generations": 1},
    "ray_engine": {"generations": 1},
    "hierarchical_ray_engine": {"generations": 1},
    "geometry_shader": {"passes": 1, "acceleration": "naive"},
    "fragment_grid": {"passes": 1, "acceleration": "grid"},
    "traversal_list": {"generations": 1},
    "traversal_list, fragment": {"generations": 1, "stage": "fragment"},
    "traversal_list, vertex": {"generations": 1, "stage": "vertex"},
}


def shot_by(name: str, scene: Scene, rays: Rays) -> tuple[Hits, NDArray[np.int32]]:
    """Hits and triangle tests of the eye rays by row, whatever rows the method leaves out or in which order it shoots.

    Dead rays count nothing, though a method that shades every pixel may count them."""
    found = refsim.trace(name.partition(",")[0], scene, rays, **METHODS[name]).generations[0]
    hits, tests, live = Hits.misses(len(rays)), np.zeros(len(rays), np.int32), found.alive
    for column in ("triangle", "t", "u", "v"):
        getattr(hits, column)[found.pixel[live]] = getattr(found.hits, column)[live]
    tests[found.pixel[live]] = found.per_ray["triangle_tests"][live]
    return hits, tests


def everywhere(scene: Scene, count: int, seed: int) -> Rays:
    """Rays at corners and edges, along axes, from triangles, from anywhere; some with an end, one of ten dead."""
    rays = rays_at(scene.triangles, count, seed)
    live = np.arange(count) % 10 != 3
    direction = np.where(live[:, None], rays.direction, np.float32(0))
    return Rays(rays.origin, direction, np.where(live, rays.t_max, np.float32(0)))


@cache
def knot() -> tuple[Scene, Rays]:
    """Most of these rays hit."""
    scene = load_scene("torus_knot_1024")
    return scene, camera_rays(scene, 24, 16, fill=0.6)


CASES: dict[str, Callable[[], tuple[Scene, Rays]]] = {
    "camera": knot,
    "everywhere": lambda: (load_scene("cornell_box"), everywhere(load_scene("cornell_box"), 384, 11)),
}


@pytest.mark.parametrize("case", CASES)
def test_every_paper_hits_the_same_with_the_same_bits(case: str) -> None:
    scene, rays = CASES[case]()
    expected, tests = shot_by("brute_force", scene, rays)
    assert (tests == np.where(rays.alive, len(scene), 0)).all()
    assert expected.hit.sum() > len(rays) // 3
    for name in METHODS:
        hits, tests = shot_by(name, scene, rays)
        same_hits(hits, expected)
        # Counted alike: a hit was tested, and nothing is tested twice where lists have no references
        assert (tests >= expected.hit).all()
        assert (tests <= len(scene)).all() or METHODS[name].get("acceleration") == "grid"


def test_the_forms_of_the_traversal_count_alike() -> None:
    scene, rays = CASES["camera"]()
    forms = [name for name in METHODS if name.startswith("traversal_list")]
    traces = [refsim.trace("traversal_list", scene, rays, **METHODS[name], layers=(300,)) for name in forms]
    assert len(forms) == 3 and traces[0].counters["traversal.nodes"] > len(rays)
    for trace in traces[1:]:
        for name in ("nodes", "triangle_tests"):
            np.testing.assert_array_equal(trace.per_ray[name], traces[0].per_ray[name])
        for name, count in traces[0].counters.items():
            assert trace.counters[name] == count
    assert [trace.counters["draw.calls"] for trace in traces] == [0, 2, 2]
