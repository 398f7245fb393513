"""The plain NumPy methods are the pipeline's twins, bits and counters.

Plan
- For option combinations that hypothesis draws (image and tile sizes, generations, scenes, coherent and wild rays,
  surfaces, index, over a few compiled pipelines): backend="numpy" gives the hits, rays, kinds, cones, exit rays and
  all counters, in every generation, that backend="numba" gives.
- The same on a fixed table: every early-test policy, both depth formats, both submissions, facing, shading, stencil,
  errata as printed, tile sizes from 1 to 64, ten generations.
- The reference's enclosing spheres have the bits of the vertex buffer's.
- Taps are refused in one sentence, and so are no rays.
- Longer tier: the full cross product of what a pipeline is compiled from, and every erratum alone.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import refsim
from refsim.errors import InputError
from refsim.geometry.sphere import enclosing_spheres
from refsim.pipeline.taps import Taps
from refsim.reference import sphere as reference_sphere
from tests.hre.bits import differences, same_bits
from tests.hre.scenes import PROCEDURAL, rays_of, scene_of, wild_rays

HRE, RE, BRUTE = "hierarchical_ray_engine", "ray_engine", "brute_force"
D24 = "depth24unorm-stencil8"
SMOOTH_FRONT: dict[str, Any] = {"shading": "smooth", "facing": "front"}
POLICIES = ("ideal", "mesa", "none", "forced")
ERRATA = [f"HRE-E{k}" for k in range(1, 8)]

# What is compiled: the tests draw their pipelines from here, so that few compile
PIPELINES: list[tuple[str, dict[str, Any]]] = [
    (BRUTE, {}),
    (BRUTE, SMOOTH_FRONT),
    (RE, {}),
    (RE, {"stencil": True}),
    (RE, {"stencil": True, "early_tests": "none", "depth_format": D24, **SMOOTH_FRONT}),
    (HRE, {}),
    (HRE, {"submission": "primitive"}),
    (HRE, {"early_tests": "mesa"}),
    (HRE, {"early_tests": "forced"}),
    (HRE, {"depth_format": D24}),
    (HRE, {"early_tests": "none", "submission": "primitive", **SMOOTH_FRONT}),
]


def both(method: str, scene: refsim.Scene, rays: refsim.Rays, **options: Any) -> list[str]:
    """Where the two backends differ."""
    return differences(
        refsim.trace(method, scene, rays, **options), refsim.trace(method, scene, rays, backend="numpy", **options)
    )


def named(part: str | dict[str, Any]) -> str:
    """How a row of the table is called."""
    return part if isinstance(part, str) else "-".join(map(str, part.values())) or "default"


@st.composite
def runs(draw: st.DrawFn) -> tuple[str, refsim.Scene, refsim.Rays, dict[str, Any]]:
    """A method, a scene, rays, options."""
    method, state = draw(st.sampled_from(PIPELINES))
    name = draw(st.sampled_from((*PROCEDURAL, "slivers")))
    scene = scene_of(name)
    assert scene is not None
    width, height = draw(st.integers(8, 40)), draw(st.integers(8, 30))
    if draw(st.booleans()):
        rays = rays_of(name, width, height)
    else:
        rays = wild_rays(scene, width, height, draw(st.integers(0, 9)))
    if draw(st.booleans()):
        rays = rays[:]  # no image size: the rows fill the squarest image
    options = dict(
        state,
        generations=draw(st.integers(1, 10)),
        ior=draw(st.sampled_from((1.5, 1.0, 0.7, 2.4))),
        material=draw(st.sampled_from((None, "glass", "mirror", "diffuse"))),
        threads=draw(st.sampled_from((1, 2))),
    )
    if method == HRE:
        # Tiles of a few pixels run in another loop of the pipeline, which compiles too
        small = (1, 2, 3) if state.keys() <= {"submission"} else ()
        options["tile_size"] = draw(st.sampled_from((*small, 5, 8, 16, 31, 64)))
    return method, scene, rays, options


@given(runs())
@settings(max_examples=50, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
def test_any_options(run: tuple[str, refsim.Scene, refsim.Rays, dict[str, Any]]) -> None:
    method, scene, rays, options = run
    assert both(method, scene, rays, **options) == []


@pytest.mark.parametrize("name", [*PROCEDURAL, "slivers"])
@pytest.mark.parametrize(("method", "state"), PIPELINES, ids=named)
def test_scenes_and_pipelines(method: str, state: dict[str, Any], name: str) -> None:
    scene = scene_of(name)
    assert scene is not None
    assert both(method, scene, rays_of(name, 37, 23), generations=4, **state) == []


@pytest.mark.parametrize("tile_size", [1, 2, 3, 5, 8, 16, 64])
def test_tile_sizes(tile_size: int) -> None:
    scene = scene_of("torus_knot_128")
    assert scene is not None
    assert both(HRE, scene, rays_of("torus_knot_128", 24, 18), tile_size=tile_size) == []


def differing_with(errata: str) -> list[str]:
    """Incoherent rays too, so that every formula is reached."""
    found = []
    for name in ("torus_knot_128", "blob_100"):
        scene = scene_of(name)
        assert scene is not None
        for rays in (rays_of(name, 24, 18), wild_rays(scene, 24, 18, 3)):
            found += both(HRE, scene, rays, errata=errata, tile_size=6)
    return found


@pytest.mark.parametrize("errata", ["as_printed", "HRE-E1"])
def test_errata(errata: str) -> None:
    assert differing_with(errata) == []


@pytest.mark.slow
@pytest.mark.parametrize("errata", [*ERRATA[1:], "HRE-E2,e6"])
def test_errata_alone(errata: str) -> None:
    assert differing_with(errata) == []


@pytest.mark.parametrize(("method", "policy"), [*((HRE, policy) for policy in POLICIES), (RE, "ideal"), (RE, "forced")])
def test_ten_generations(method: str, policy: str) -> None:
    """Past the eight bits of the stencil: between mirrors paths live on."""
    scene = scene_of("mirror_room")
    assert scene is not None
    options = {"generations": 10, "early_tests": policy, **({"stencil": True} if method == RE else {})}
    a = refsim.trace(method, scene, rays_of("mirror_room"), **options)
    b = refsim.trace(method, scene, rays_of("mirror_room"), backend="numpy", **options)
    assert differences(a, b) == []
    if policy != "forced":
        assert a.generations[9].alive.any(), "no path is that long, so the case shows nothing"


@pytest.mark.slow
@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("depth_format", ["depth32float-stencil8", D24])
@pytest.mark.parametrize("facing", ["both", "front"])
@pytest.mark.parametrize("shading", ["geometric", "smooth"])
def test_every_pipeline(policy: str, depth_format: str, facing: str, shading: str) -> None:
    state = {"early_tests": policy, "depth_format": depth_format, "facing": facing, "shading": shading}
    cases: list[tuple[str, dict[str, Any]]] = [(RE, {"stencil": stencil}) for stencil in (False, True)]
    cases += [
        (HRE, {"submission": submission, "tile_size": tile_size})
        for submission, tile_size in product(("tile", "primitive"), (2, 8))
    ]
    for (method, own), name in product(cases, PROCEDURAL):
        scene = scene_of(name)
        assert scene is not None
        assert both(method, scene, rays_of(name, 26, 19), **state, **own) == [], (method, own, name)


def test_enclosing_spheres() -> None:
    """Triangles of all shapes and sizes, flat, thin and shrunk ones too."""
    random = np.random.default_rng(5)
    free = random.normal(size=(4000, 3, 3)) * 10.0 ** random.uniform(-6, 6, (4000, 1, 1))
    thin = free[:1000].copy()
    thin[:, 2] = thin[:, 0] + random.random((1000, 1)) * (thin[:, 1] - thin[:, 0])
    thin[:500] += random.normal(size=(500, 3, 3)) * 1e-5
    shifted = free[:1000] + random.normal(size=(1000, 1, 3)) * 1e3
    shrunk = np.repeat(free[:50, :1], 3, axis=1)
    right = np.array([[[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 0, 0], [1, 0, 0], [0.5, 0.8660254, 0]]])
    real = np.concatenate([scene_of(name).triangles for name in PROCEDURAL])  # type: ignore[union-attr]
    triangles = np.concatenate([free, thin, shifted, shrunk, right, real]).astype(np.float32)
    for ours, theirs in zip(reference_sphere.enclosing_spheres(triangles), enclosing_spheres(triangles), strict=True):
        assert same_bits(ours, theirs)


@pytest.mark.parametrize("method", [RE, HRE])
def test_taps_are_refused(method: str) -> None:
    with pytest.raises(InputError, match=r"numpy.*no stages to tap.*numba"):
        refsim.trace(method, "cornell_box", rays_of("cornell_box", 2, 2), backend="numpy", taps=Taps("vertex"))


@pytest.mark.parametrize("method", [BRUTE, RE, HRE])
def test_no_rays_are_refused(method: str) -> None:
    none = np.zeros((0, 3), np.float32)
    for backend in ("numpy", "numba"):
        with pytest.raises(InputError, match="no rays"):
            refsim.trace(method, "cornell_box", refsim.Rays(none, none), backend=backend)
