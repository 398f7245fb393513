"""Section 5: paths that have ended are left out by stencil, for eight generations; nothing of an older path comes back.

Plan
- `ideal`: pass k < 8 runs the shader only where pass k − 1 hit something; from pass 8 on everywhere that is drawn.
  In the Ray Engine that is every triangle or none, in the hierarchical engine what the tile's other pixels get.
- `none` and `mesa`: the stencil saves no shading at all, but the pictures are those of `ideal`.
- A pixel that a pass skips or misses holds a dead ray afterwards, in every generation, also ten passes on; no ray is
  shot twice.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import refsim
from refsim.results import Trace
from tests.hre.bits import differences
from tests.hre.scenes import rays_of, scene_of

HRE, RE, BRUTE = "hierarchical_ray_engine", "ray_engine", "brute_force"
WIDTH, HEIGHT, TILE = 40, 30, 8
SCENES = ("mirror_room", "torus_knot_128", "cornell_box")


def traced(method: str, name: str, **options: Any) -> Trace:
    scene = scene_of(name)
    assert scene is not None
    own = {"tile_size": TILE} if method == HRE else {"stencil": True}
    return refsim.trace(method, scene, rays_of(name, WIDTH, HEIGHT), **{"generations": 11, **own, **options})


def runs_of(trace: Trace) -> np.ndarray:
    """Shader runs, int[generations, pixels]."""
    return np.stack([generation.per_ray["triangle_tests"] for generation in trace.generations])


def went_on(trace: Trace) -> np.ndarray:
    """bool[generations, pixels]: the stencil lets the pixel pass: hit in the pass before, or no bit is left to test."""
    hit = np.stack([generation.hits.triangle >= 0 for generation in trace.generations])
    allowed = np.ones_like(hit)
    allowed[1:8] = hit[:7]
    return allowed


@pytest.mark.parametrize("name", SCENES)
def test_ray_engine_shades_all_or_nothing(name: str) -> None:
    trace = traced(RE, name)
    allowed = went_on(trace)
    expected = np.where(allowed, len(trace.scene), 0)
    assert (runs_of(trace) == expected).all()
    # Both kinds of pixel are there, before and after the last bit
    assert (~allowed[7]).any() and allowed[8:].all() and (~trace.generations[8].alive).any()
    if name == "mirror_room":
        assert all(generation.alive.any() for generation in trace.generations)
    rejected = [generation.counters["stencil.failed_early"] for generation in trace.generations]
    assert rejected == [int((~row).sum()) * len(trace.scene) for row in allowed]


@pytest.mark.parametrize("name", SCENES)
def test_hierarchical_shades_what_is_left_of_a_tile(name: str) -> None:
    trace = traced(HRE, name)
    allowed = went_on(trace)
    tile = np.arange(HEIGHT)[:, None] // TILE * 10 + np.arange(WIDTH) // TILE
    for k, tests in enumerate(runs_of(trace)):
        assert (tests[~allowed[k]] == 0).all(), f"pass {k} shades ended paths"
        for number in np.unique(tile):
            inside = (tile.ravel() == number) & allowed[k]
            assert len(np.unique(tests[inside])) <= 1, f"pass {k}, tile {number}"
        alive = trace.generations[k].alive
        assert (tests[alive] > 0).all() or name != "mirror_room"
    ended_in_live_tile = (runs_of(trace)[8:] > 0) & ~np.stack([g.alive for g in trace.generations[8:]])
    assert ended_in_live_tile.any() or name != "mirror_room", "from pass 8 on nothing is left out"


@pytest.mark.parametrize("policy", ["mesa", "none"])
def test_late_stencil_saves_no_shading(policy: str) -> None:
    ideal, late = traced(HRE, "torus_knot_128"), traced(HRE, "torus_knot_128", early_tests=policy)
    assert differences(ideal, late, counters=False) == []
    for a, b in zip(ideal.generations, late.generations, strict=True):
        assert b.counters["fragment.invocations"] == b.counters["raster.fragments"] == a.counters["raster.fragments"]
        assert b.counters["stencil.failed_early"] == 0
    saved = [generation.counters["stencil.failed_early"] for generation in ideal.generations]
    assert saved[0] == 0 and sum(saved[1:8]) > 0 and sum(saved[8:]) == 0


@pytest.mark.parametrize(("method", "policy"), [(RE, "ideal"), (HRE, "ideal"), (HRE, "none"), (HRE, "forced")])
@pytest.mark.parametrize("name", SCENES)
def test_no_ray_comes_back(method: str, policy: str, name: str) -> None:
    trace = traced(method, name, early_tests=policy)
    seen: list[set[bytes]] = [set() for _ in range(WIDTH * HEIGHT)]
    for generation in trace.generations:
        hit = generation.hits.triangle >= 0
        assert not (hit & ~generation.alive).any()
        following = generation.next_rays
        assert following is not None
        ends = ~hit | (trace.scene.optical_indices()[generation.hits.triangle] < 0)
        assert ((following.t_max > 0) == ~ends).all()
        assert (following.direction[ends] == 0).all()
        rows = np.concatenate([generation.rays.origin, generation.rays.direction], axis=1)
        for pixel in np.flatnonzero(generation.alive):
            ray = rows[pixel].tobytes()
            assert ray not in seen[pixel], f"pixel {pixel} shoots a ray again"
            seen[pixel].add(ray)
