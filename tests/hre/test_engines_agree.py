"""The Ray Engine, the Hierarchical Ray Engine and brute force give the same bits.

Plan
- In every generation, rays, hits, kinds and exit rays are the same, whatever the submission, the early-test policy
  (but `forced`), the tile size from 1 to 64, the number of threads, and with and without taps: procedural scenes,
  among them one whose triangles all lie on another (equal depths: the triangle listed first wins), and real meshes.
- Incoherent rays, dead rays and rays of bounded length among them, do so too.
- Counts of the same run do not depend on submission, threads or taps.
- Longer tier: all of them with all of them, and larger images.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest

import refsim
from refsim import Scene, camera_rays, load_scene
from refsim.errors import InputError
from refsim.pipeline.taps import Taps
from refsim.results import Trace
from tests.hre.bits import differences
from tests.hre.scenes import PROCEDURAL, REAL, rays_of, scene_of, wild_rays

HRE, RE, BRUTE = "hierarchical_ray_engine", "ray_engine", "brute_force"
TILES = (1, 2, 3, 4, 7, 8, 12, 16, 31, 32, 64)
POLICIES = ("ideal", "mesa", "none")


@cache
def ray_engine(name: str, generations: int = 5) -> Trace:
    """What all others are held against."""
    scene = scene_of(name)
    assert scene is not None
    return refsim.trace(RE, scene, rays_of(name, 60, 45), generations=generations)


def differing(name: str, method: str, **options: Any) -> list[str]:
    """Bits in which a method differs from the Ray Engine."""
    scene = scene_of(name)
    assert scene is not None
    return differences(ray_engine(name), refsim.trace(method, scene, rays_of(name, 60, 45), **options), counters=False)


@pytest.mark.parametrize("name", PROCEDURAL)
@pytest.mark.parametrize("tile_size", TILES)
def test_tile_sizes_and_submissions(name: str, tile_size: int) -> None:
    for submission in ("tile", "primitive"):
        assert differing(name, HRE, tile_size=tile_size, submission=submission) == [], submission


@pytest.mark.parametrize("name", PROCEDURAL)
def test_policies_and_stencil(name: str) -> None:
    assert differing(name, BRUTE) == []
    assert differing(name, RE, stencil=True) == []
    for policy in POLICIES:
        assert differing(name, HRE, early_tests=policy) == [], policy


def test_ties_are_there() -> None:
    """Control: in the doubled scene almost every hit has a rival of exactly equal t, and the earlier one won."""
    first = ray_engine("doubled").hits.triangle
    hit = first[first >= 0]
    assert len(hit) > 500
    once = len(scene_of("doubled").triangles) // 3  # type: ignore[union-attr]
    in_first = (hit < once).mean()
    assert in_first > 0.5 and not ((hit >= once) & (hit < 2 * once)).any()


def test_equal_depths_first_drawn_wins() -> None:
    """Without the first copy, the second gives the very same t: so those were ties."""
    scene = scene_of("doubled")
    assert scene is not None
    once = len(scene) // 3
    rays = rays_of("doubled", 60, 45)
    both = refsim.trace(RE, Scene(scene.triangles[: 2 * once]), rays, generations=1)
    second = refsim.trace(RE, Scene(scene.triangles[once : 2 * once]), rays, generations=1)
    hit = both.hits.triangle >= 0
    assert hit.any()
    assert (both.hits.t[hit] == second.hits.t[hit]).all()
    assert (both.hits.triangle[hit] < once).all()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("tile_size", [3, 16])
def test_threads_and_taps(threads: int, tile_size: int) -> None:
    """Counters too."""
    for name in ("torus_knot_128", "doubled"):
        scene, rays = scene_of(name), rays_of(name, 60, 45)
        assert scene is not None
        plain = refsim.trace(HRE, scene, rays, tile_size=tile_size)
        assert differences(ray_engine(name), plain, counters=False) == []
        for submission, taps in product(("tile", "primitive"), (None, Taps("vertex", "fragment"))):
            how = {"tile_size": tile_size, "submission": submission, "threads": threads, "taps": taps}
            other = refsim.trace(HRE, scene, rays, **how)
            assert differences(plain, other) == [], (submission, taps is not None)
        tapped = refsim.trace(RE, scene, rays, threads=threads, taps=Taps("fragment"))
        assert differences(ray_engine(name), tapped) == []


@pytest.mark.parametrize("seed", range(4))
def test_incoherent_rays(seed: int) -> None:
    for name in PROCEDURAL:
        scene = scene_of(name)
        assert scene is not None
        rays = wild_rays(scene, 33, 21, seed)
        one = refsim.trace(RE, scene, rays)
        assert (one.hits.triangle >= 0).sum() > 20
        fine = {"tile_size": 2, "submission": "primitive"}
        for method, options in ((BRUTE, {}), (HRE, {"tile_size": 4}), (HRE, fine)):
            assert differences(one, refsim.trace(method, scene, rays, **options), counters=False) == [], (name, method)


@pytest.mark.parametrize("name", REAL)
def test_real_meshes(name: str, record_property: Any) -> None:
    """A mesh that is not at hand is refused, and its row says so: nothing stands in for it."""
    scene = scene_of(name)
    record_property(name, "missing" if scene is None else "present")
    if scene is None:
        with pytest.raises(InputError, match=name):
            load_scene(name)
        return
    rays = camera_rays(scene, REAL[name], REAL[name], fill=0.55)
    # On a large mesh brute force stands for the Ray Engine beyond the second generation
    large = len(scene) > 20_000
    generations = 3 if large else 5
    brute = refsim.trace(BRUTE, scene, rays, generations=generations)
    assert (brute.generations[1].hits.triangle >= 0).sum() > 100
    for tile_size, submission in ((16, "tile"), (8, "primitive")):
        other = refsim.trace(HRE, scene, rays, generations=generations, tile_size=tile_size, submission=submission)
        assert differences(brute, other, counters=False) == []
    engine = refsim.trace(RE, scene, rays, generations=generations, stencil=large)
    assert differences(brute, engine, counters=False) == []


@pytest.mark.slow
@pytest.mark.parametrize("facing", ["both", "front"])
@pytest.mark.parametrize("shading", ["geometric", "smooth"])
def test_everything(facing: str, shading: str) -> None:
    for name, depth_format in product(PROCEDURAL, ("depth32float-stencil8", "depth24unorm-stencil8")):
        scene, rays = scene_of(name), rays_of(name, 100, 75)
        assert scene is not None
        shared = {"facing": facing, "shading": shading, "depth_format": depth_format, "generations": 9}
        one = refsim.trace(RE, scene, rays, **shared)
        for policy, stencil in product(POLICIES, (False, True)):
            other = refsim.trace(RE, scene, rays, early_tests=policy, stencil=stencil, **shared)
            assert differences(one, other, counters=False) == []
        for policy, submission, tile_size in product(POLICIES, ("tile", "primitive"), TILES):
            other = refsim.trace(
                HRE, scene, rays, early_tests=policy, submission=submission, tile_size=tile_size, **shared
            )
            assert differences(one, other, counters=False) == [], (name, policy, submission, tile_size)


def test_forced_is_another_picture() -> None:
    """The control of "all policies but forced": with it a written depth is ignored, and most hits are lost."""
    scene, rays = scene_of("torus_knot_128"), rays_of("torus_knot_128", 60, 45)
    assert scene is not None
    forced = refsim.trace(HRE, scene, rays, early_tests="forced")
    hits, all_hits = forced.hits.triangle >= 0, ray_engine("torus_knot_128").hits.triangle >= 0
    assert 0 < hits.sum() < 0.5 * all_hits.sum()
    assert np.all(all_hits[hits])
