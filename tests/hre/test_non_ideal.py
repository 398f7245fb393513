"""Non-ideal triangles among glass: the rule "nearest" has the hits of brute force, "final_rays" those of its letter.

Plan
- For scenes that hypothesis puts together (bodies of glass, mirror and diffuse, one in another too), cameras and wild
  rays, tile sizes and generations: "nearest" has the rays, hits and kinds of brute force, bit for bit, and "final_rays"
  the final rays and hits of the plain NumPy twin.
- What the letter gets wrong: an object behind glass is right on every path; before, between and inside glass it is
  wrong exactly where a path of "nearest" ends although the ideal triangles alone would have carried it on.
- The stencil is taken back: no pixel is shaded whose path has ended (while there are bits), as it is where both kinds
  share a draw.
- Boundaries: ideal triangles alone, none, one generation, ten; one thread and two; a picture; refusals.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import refsim
from refsim import Material, Rays, Scene, camera_rays, load_scene
from refsim.errors import InputError
from refsim.experiments.hre_behind_glass import wrong_ends
from refsim.papers.hierarchical_ray_engine.non_ideal import ending_triangles, trace_non_ideal
from refsim.reference.non_ideal import final_rays
from refsim.shading import environment_of, shade
from tests.hre.bits import differences, same_bits
from tests.hre.scenes import wild_rays

GLASS, MIRROR, CLAY = Material("glass"), Material("mirror", "mirror"), Material("clay", "diffuse", (0.8, 0.3, 0.1))
BODIES = ("sphere_112", "torus_knot_72", "blob_100", "cubes")
# One compiled pipeline for all tests
SMOOTH: dict[str, Any] = {"shading": "smooth"}

Part = tuple[str, float, tuple[float, float, float], Material]


def staged(parts: list[Part]) -> Scene:
    """Library bodies scaled to about the size given, in their places."""
    triangles, normals, ids = [], [], []
    materials = (GLASS, MIRROR, CLAY)
    for name, size, place, material in parts:
        body = load_scene(name)
        scale = 2.0 * size / body.diagonal
        triangles.append(((body.triangles - body.center) * scale + np.array(place)).astype(np.float32))
        normals.append(body.vertex_normals)
        ids.append(np.full(len(body), materials.index(material), np.int32))
    return Scene(
        np.concatenate(triangles), "staged", materials, np.concatenate(ids), normals=np.concatenate(normals)
    )


@st.composite
def stages(draw: Any) -> Scene:
    place = st.tuples(*[st.floats(-1.0, 1.0, width=32)] * 3)
    part = st.tuples(
        st.sampled_from(BODIES), st.floats(0.25, 1.25, width=32), place, st.sampled_from((GLASS, MIRROR, CLAY))
    )
    return staged(draw(st.lists(part, min_size=1, max_size=4)))


def eye(scene: Scene, size: int = 32) -> Rays:
    return camera_rays(scene, size, size, view=(0.0, 0.1, 1.0), fill=0.6)


@settings(max_examples=12, suppress_health_check=list(HealthCheck))
@given(stages(), st.integers(0, 3), st.sampled_from((3, 8, 16)), st.integers(1, 10))
def test_both_rules_have_the_hits_of_brute_force(scene: Scene, seed: int, tile: int, generations: int) -> None:
    rays = eye(scene, 21) if seed == 0 else wild_rays(scene, 19, 14, seed)
    options = {**SMOOTH, "generations": generations}
    nearest = trace_non_ideal(scene, rays, tile_size=tile, **options)
    assert differences(nearest, refsim.trace("brute_force", scene, rays, **options), counters=False) == []
    letter = trace_non_ideal(scene, rays, rule="final_rays", tile_size=tile, **options)
    last, hits = final_rays(scene, rays, {"ior": 1.5, "facing": "both", **options})
    final = letter.generations[-1]
    for name in ("origin", "direction", "t_max"):
        assert same_bits(getattr(final.rays, name), getattr(last, name)), name
    for name in ("triangle", "t", "u", "v"):
        assert same_bits(getattr(final.hits, name), getattr(hits, name)), name


KNOT: Part = ("torus_knot_512", 0.5, (0.0, 0.0, 0.0), CLAY)
PLACES: dict[str, list[Part]] = {
    "behind": [("sphere_224", 1.6, (0.0, 0.0, 2.5), GLASS), KNOT],
    "before": [("sphere_224", 1.6, (0.0, 0.0, -2.5), GLASS), KNOT],
    "between": [("sphere_224", 1.2, (0.0, 0.0, 2.0), GLASS), KNOT, ("sphere_224", 1.2, (0.0, 0.0, -2.0), GLASS)],
    "inside": [("sphere_224", 1.6, (0.0, 0.0, 0.0), GLASS), KNOT],
}


@pytest.mark.parametrize("place", PLACES)
def test_what_the_letter_gets_wrong(place: str) -> None:
    scene = staged(PLACES[place])
    rays = eye(scene, 48)
    right = trace_non_ideal(scene, rays, tile_size=8, generations=6, **SMOOTH)
    letter = trace_non_ideal(scene, rays, rule="final_rays", tile_size=8, generations=6, **SMOOTH)
    wrong = wrong_ends(letter, right)
    # A path is cut short where it ends on clay and the ideal triangles alone send it on
    cut = np.zeros(len(rays), np.bool_)
    clay = ending_triangles(right) >= 0
    for own, ideal in zip(right.generations, letter.generations, strict=False):
        cut |= own.alive & (own.hits.triangle >= 0) & clay & (ideal.hits.triangle >= 0) & (
            scene.optical_indices()[own.hits.triangle] < 0
        )
    assert np.array_equal(wrong, cut)
    assert clay.sum() > 100
    assert (wrong.sum() == 0) == (place == "behind")
    assert place == "behind" or wrong.sum() > 40


def test_ended_paths_are_not_shaded() -> None:
    scene = staged(PLACES["inside"])
    rays = eye(scene, 48)
    own = trace_non_ideal(scene, rays, tile_size=8, generations=8, **SMOOTH)
    together = refsim.trace("hierarchical_ray_engine", scene, rays, tile_size=8, generations=8, **SMOOTH)

    def by_ended(trace: refsim.Trace) -> int:
        return sum(int(g.per_ray["triangle_tests"][~g.alive].sum()) for g in trace.generations)

    assert by_ended(own) == 0 < by_ended(together)
    tests = "intersection.triangle_tests"
    assert own.counters[tests] == together.counters[tests] - by_ended(together)
    for name in ("cone.sphere_tests", "cone.pairs_kept"):
        assert own.counters[name] == together.counters[name]


@pytest.mark.parametrize("material", [GLASS, MIRROR, CLAY])
def test_one_kind_alone(material: Material) -> None:
    """All ideal: neither rule draws anything else. None ideal: the eye rays are the final rays."""
    scene = staged([("blob_100", 1.0, (0.0, 0.0, 0.0), material)])
    rays = eye(scene)
    for generations in (1, 10):
        own = trace_non_ideal(scene, rays, generations=generations, **SMOOTH)
        brute = refsim.trace("brute_force", scene, rays, generations=generations, **SMOOTH)
        assert differences(own, brute, counters=False) == []
        letter = trace_non_ideal(scene, rays, rule="final_rays", generations=generations, **SMOOTH)
        assert np.array_equal(ending_triangles(letter), ending_triangles(own))
        assert same_bits(letter.exit_rays.direction, own.exit_rays.direction)
        assert (letter.generations[-1].hits.triangle >= 0).any() == (material is CLAY)


def test_threads_change_nothing_and_pictures_are_of_the_ends() -> None:
    scene = staged(PLACES["between"])
    rays = eye(scene)
    for rule in ("nearest", "final_rays"):
        one, two = (trace_non_ideal(scene, rays, rule=rule, threads=n, **SMOOTH) for n in (1, 2))  # type: ignore[arg-type]
        assert differences(one, two) == []
        light = shade(one, environment_of(scene, "black"))
        ends = ending_triangles(one) >= 0
        assert ends.any() and np.array_equal((light > 0).any(axis=1), ends)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "rule": ({"rule": "last"}, "rule"),
    "no generation": ({"generations": 0}, "generations"),
    "true is no number": ({"generations": True}, "generations"),
    "tile": ({"tile_size": 65}, "tile_size"),
    "facing": ({"facing": "back"}, "facing"),
    "ior": ({"ior": 0.0}, "ior"),
    "errata": ({"errata": "HRE-E9"}, "HRE-E9"),
}


@pytest.mark.parametrize("name", WRONG)
def test_refusals(name: str) -> None:
    options, word = WRONG[name]
    scene = staged([KNOT])
    with pytest.raises(InputError, match=word):
        trace_non_ideal(scene, eye(scene, 4), **options)
