"""Caustics: no photon and no energy is lost, and the light map is that of the NumPy twin.

Plan
- For scenes, lights, receivers and sizes that hypothesis draws: every photon sent has one fate, and the light map holds
  as many as arrived; energy arriving = sent − kept by tinted glass − absorbed − left − unfinished, to rounding in
  float64; the float32 light map is off by no more than its stated bound, and has the bits of the twin, which takes
  brute force's hits and adds up in NumPy.
- Photons of a light carry the light's energy; no ray of a point light misses its cone; every photon on the receiver's
  inner lines arrives.
- Float32 sums of many photons do round (control), within the bound; counts stay exact. One draw of points splats.
- One thread and two: same bits. Refusals.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import refsim
from refsim import Material, PointLight, Scene, load_scene
from refsim.errors import InputError
from refsim.papers.hierarchical_ray_engine.caustics import (
    FATES,
    Caustic,
    ParallelLight,
    Receiver,
    caustic,
    with_receiver,
)
from refsim.papers.hierarchical_ray_engine.photons import Light, photons_of
from refsim.reference import caustics as exact
from refsim.reference.vector import dot
from tests.hre.bits import same_bits

SMOOTH: dict[str, Any] = {"shading": "smooth"}
WHITE, GREEN, MIRROR = Material("white"), Material("green", "glass", (0.5, 0.9, 0.25)), Material("mirror", "mirror")
CLAY = Material("clay", "diffuse")
BODIES = ("sphere_112", "torus_knot_72", "blob_100")
DOWN = ParallelLight((0.0, -1.0, 0.0))


def staged(body: str, material: Material, blocker: tuple[float, float, float]) -> Scene:
    """A body about the origin, a small diffuse one, and two diffuse specks that fix the scene's box, so that the offset
    of new rays does not change when a receiver joins."""
    one, two = load_scene(body), load_scene("sphere_112")
    specks = np.array([[[s, s, s], [s, s, s * 0.999], [s, s * 0.999, s]] for s in (-6.0, 6.0)])
    triangles = [one.triangles, two.triangles * 0.4 + np.array(blocker), specks]
    normals = [one.vertex_normals, two.vertex_normals, np.tile(np.array([0.0, 1.0, 0.0]), (2, 3, 1))]
    ids = np.repeat([0, 1], [len(one), len(two) + 2]).astype(np.int32)
    return Scene(
        np.concatenate(triangles).astype(np.float32), body, (material, CLAY), ids,
        np.concatenate(normals).astype(np.float32),
    )  # fmt: skip


COORDINATE = st.floats(-2.0, 2.0, width=16)
LIGHTS = st.one_of(
    st.builds(
        ParallelLight, st.tuples(COORDINATE, st.just(-1.0), COORDINATE), st.just((1.0, 0.5, 0.0)), st.just(3.0)
    ),
    st.builds(PointLight, st.tuples(COORDINATE, st.just(4.0), COORDINATE), st.just((0.25, 1.0, 1.0)), st.just(20.0)),
)
RECEIVERS = st.builds(
    Receiver,
    st.tuples(st.floats(-3.0, -1.0, width=16), st.floats(-3.0, -0.5, width=16), st.floats(1.0, 3.0, width=16)),
    st.tuples(st.floats(2.0, 5.0, width=16), st.floats(-0.5, 0.5, width=16), st.just(0.0)),
    st.tuples(st.just(0.25), st.just(0.0), st.floats(-5.0, -2.0, width=16)),
)
STAGES = st.builds(
    staged, st.sampled_from(BODIES), st.sampled_from((WHITE, GREEN, MIRROR)), st.tuples(*[COORDINATE] * 3)
)
SIZES = st.tuples(st.integers(1, 24), st.tuples(st.integers(1, 9), st.integers(1, 7)), st.sampled_from((4, 16)))


def twin(scene: Scene, found: Caustic, receiver: Receiver, resolution: tuple[int, int], generations: int) -> Any:
    """Both light maps from brute force's hits, in float32 and in float64: (f32 maps, f64 maps), [direct, caustic]."""
    stage = with_receiver(scene, receiver)
    assert stage.epsilon == scene.epsilon
    traced = refsim.trace("brute_force", stage, found.light.rays, generations=generations, **SMOOTH)
    colors = np.array([material.color for material in stage.materials], np.float32)[stage.material_ids]
    tint = np.ones((len(found.light.rays), 3), np.float32)
    along, up = (axis.astype(np.float32) for axis in receiver.coordinates())
    width, height = resolution
    share = (found.light.energy * (width * height / receiver.area)).astype(np.float32)
    columns = [[np.empty((3, 0), int)], [np.empty((3, 0), int)]]
    for k, generation in enumerate(traced.generations):
        triangle, rays = generation.hits.triangle, generation.rays
        rows = np.flatnonzero(triangle >= len(scene))
        place = (rays.origin[rows] + rays.direction[rows] * generation.hits.t[rows, None]) - np.float32(receiver.corner)
        column = np.clip(np.floor(dot(place, along) * np.float32(width)).astype(int), 0, width - 1)
        row = np.clip(np.floor(dot(place, up) * np.float32(height)).astype(int), 0, height - 1)
        columns[k > 0].append(np.stack([rows, column, row]))
        assert generation.next_rays is not None
        on = generation.next_rays.t_max > 0
        tint[on] = tint[on] * colors[triangle[on]]
    maps = []
    for part in columns:
        photon, column, row = np.concatenate(part, axis=1)
        order = np.argsort(photon)
        photon, column, row = photon[order], column[order], row[order]
        values = share * tint[photon]
        wide = (found.light.energy * (width * height / receiver.area)) * tint[photon].astype(np.float64)
        maps.append([exact.splat(column, row, part, resolution) for part in (values, wide)])
    return maps


@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(STAGES, LIGHTS, RECEIVERS, SIZES, st.integers(1, 7))
def test_no_photon_and_no_energy_is_lost(
    scene: Scene, light: Light, receiver: Receiver, size: tuple[int, tuple[int, int], int], generations: int
) -> None:
    across, resolution, tile = size
    found = caustic(
        scene, light, receiver, photons_across=across, resolution=resolution, tile_size=tile, generations=generations,
        **SMOOTH,
    )  # fmt: skip
    photons, energy, rounding = found.account
    assert photons["sent"] == sum(photons[name] for name in FATES) == int((found.light.rays.t_max > 0).sum())
    assert found.photons.sum(axis=(0, 1)).tolist() == [photons["caustic"], photons["direct"]]
    ends = sum(energy[name] for name in FATES) + energy["tinted"]
    # Float64 sums of n terms
    assert np.all(np.abs(ends - energy["sent"]) <= 4.0 * across**2 * 2.0**-53 * energy["sent"])
    texel = receiver.area / (resolution[0] * resolution[1])
    arrived = (found.irradiance.astype(np.float64) + found.direct).sum(axis=(0, 1)) * texel
    lost = energy["tinted"] + energy["absorbed"] + energy["left"] + energy["unfinished"]
    assert np.all(np.abs(arrived - (energy["sent"] - lost)) <= rounding + 1e-14 * energy["sent"])
    for (narrow, wide), own in zip(
        twin(scene, found, receiver, resolution, generations), (found.direct, found.irradiance), strict=True
    ):
        assert same_bits(own, narrow)
        assert np.all(np.abs(own - wide).sum(axis=(0, 1)) * texel <= rounding * (1.0 + 1e-9))


@pytest.mark.parametrize("seed", [None, 0])
def test_photons_carry_the_light(seed: int | None) -> None:
    """Parallel light on a disc: irradiance times area; a point light: W/sr times the solid angle of its cone. The grid
    covers the disc to the cells that its rim cuts."""
    scene = load_scene("sphere_112")
    centre, radius, n = np.array([0.0, 0.5, 0.0]), 1.5, 128
    sun = photons_of(ParallelLight((1.0, -2.0, 0.5), (1.0, 2.0, 0.0), 3.0), scene, (centre, radius), n, seed)
    rim_cells = 8.0 * n / 2
    assert sun.sent * sun.energy == pytest.approx(3.0 * np.array([1, 2, 0]) * math.pi * radius**2, rel=rim_cells / n**2)
    lamp = photons_of(PointLight((3.0, 4.0, 1.0), (0.5, 1.0, 1.0), 2.0), scene, (centre, radius), n, seed)
    distance = math.dist((3.0, 4.0, 1.0), centre)
    cone = 2.0 * math.pi * (1.0 - math.sqrt(1.0 - (radius / distance) ** 2))
    assert lamp.sent * lamp.energy == pytest.approx(2.0 * np.array([0.5, 1, 1]) * cone, rel=rim_cells / n**2)
    axis = (centre - np.array([3.0, 4.0, 1.0])) / distance
    cosine = lamp.rays.direction[lamp.rays.t_max > 0].astype(np.float64) @ axis
    edge = math.sqrt(1.0 - (radius / distance) ** 2)
    # Even by solid angle: as many photons in the inner half of the cone's solid angle as outside it
    assert cosine.min() >= edge - 1e-6
    assert (cosine > 0.5 * (1.0 + edge)).mean() == pytest.approx(0.5, abs=rim_cells / n**2)


def missed_on_inner_lines(triangles: slice) -> int:
    """Rays straight down at the diagonals of turned receivers that hit none of these of its triangles."""
    missed = 0
    for turn in np.linspace(0.1, 1.4, 8):
        a = 3.0 * np.array([math.cos(turn), 0.0, math.sin(turn)])
        b = 3.0 * np.array([-math.sin(turn), 0.0, math.cos(turn)])
        corner = np.array([0.1, -3.0, 0.2]) - 0.5 * (a + b)
        receiver = Receiver(tuple(corner), tuple(a), tuple(b))  # type: ignore[arg-type]
        part = np.linspace(0.001, 0.999, 4001)[:, None]
        target = np.concatenate([corner + part * (a + b), corner + b + part * (a - b)]).astype(np.float32)
        rays = refsim.Rays(target + np.float32([0, 1, 0]), np.tile(np.float32([0, -1, 0]), (len(target), 1)))
        scene = Scene(receiver.triangles[triangles], "receiver", CLAY)
        missed += int((refsim.trace("brute_force", scene, rays, generations=1, **SMOOTH).hits.triangle < 0).sum())
    return missed


def test_every_photon_on_the_inner_lines_arrives() -> None:
    """Its two halves alone (control) lose rays on the line between them."""
    assert missed_on_inner_lines(slice(None)) == 0 < missed_on_inner_lines(slice(2))


def test_many_photons_in_a_texel_round_within_the_bound() -> None:
    scene = load_scene("sphere_112")
    receiver = Receiver((-3.0, -1.5, 3.0), (6.0, 0.0, 0.0), (0.0, 0.0, -6.0))
    light = ParallelLight((0.0, -1.0, 0.0), irradiance=math.pi)
    found = caustic(scene, light, receiver, photons_across=400, resolution=(1, 1), tile_size=16, **SMOOTH)
    photons, energy, rounding = found.account
    off = np.abs(found.irradiance.astype(np.float64).sum(axis=(0, 1)) * receiver.area - energy["caustic"])
    assert found.photons.sum() > 100_000 and found.photons[0, 0, 0] == photons["caustic"]
    assert np.all((2.0**-24 * energy["caustic"] < off) & (off <= rounding))


def test_one_draw_of_points_splats_them() -> None:
    scene = load_scene("sphere_112")
    receiver = Receiver((-2.0, -1.5, 2.0), (4.0, 0.0, 0.0), (0.0, 0.0, -4.0))
    found = caustic(scene, DOWN, receiver, photons_across=32, resolution=(8, 8), generations=3, **SMOOTH)
    arrived = found.account.photons["caustic"] + found.account.photons["direct"]
    assert found.counters["blend.fragments"] == arrived > 200
    # A generation draws cones, ideal triangles, the receiver, path ends; then the splat
    assert found.counters["draw.calls"] == 3 * 4 + 1
    green = scene.with_materials(GREEN)
    tinted = caustic(green, DOWN, receiver, photons_across=32, resolution=(8, 8), generations=3, **SMOOTH)
    assert tinted.counters["draw.calls"] == 3 * 5 + 1
    assert np.array_equal(tinted.photons, found.photons) and (tinted.irradiance < found.irradiance).any()


def test_threads_change_nothing() -> None:
    receiver = Receiver((-2.0, -1.5, 2.0), (4.0, 0.0, 0.0), (0.0, 0.0, -4.0))
    options = {"photons_across": 64, "resolution": (16, 16), **SMOOTH}
    one, two = (caustic(load_scene("sphere_112"), DOWN, receiver, threads=n, **options) for n in (1, 2))
    assert same_bits(one.irradiance, two.irradiance) and same_bits(one.direct, two.direct)
    assert dict(one.counters) == dict(two.counters)


FLOOR = Receiver((-2.0, -2.0, 2.0), (4.0, 0.0, 0.0), (0.0, 0.0, -4.0))
WRONG: dict[str, tuple[Any, str]] = {
    "no direction": (lambda: ParallelLight((0.0, 0.0, 0.0)), "direction"),
    "negative light": (lambda: ParallelLight((0.0, 1.0, 0.0), irradiance=-1.0), "irradiance"),
    "flat receiver": (lambda: Receiver((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)), "parallel"),
    "nothing ideal": (lambda: caustic(load_scene("sphere_112").with_materials(CLAY), DOWN, FLOOR), "no glass"),
    "light inside": (lambda: caustic(load_scene("sphere_112"), PointLight((0.0, 0.5, 0.0)), FLOOR), "inside"),
    "too many": (lambda: caustic(load_scene("sphere_112"), DOWN, FLOOR, photons_across=5000), "photons_across"),
    "tile": (lambda: caustic(load_scene("sphere_112"), DOWN, FLOOR, tile_size=0), "tile_size"),
    "resolution": (lambda: caustic(load_scene("sphere_112"), DOWN, FLOOR, resolution=(0, 4)), "resolution"),
    "aim": (lambda: caustic(load_scene("sphere_112"), DOWN, FLOOR, aim=((0.0, 0.0, 0.0), -1.0)), "aim"),
    "seed": (lambda: caustic(load_scene("sphere_112"), DOWN, FLOOR, seed=-1), "seed"),
}


@pytest.mark.parametrize("name", WRONG)
def test_refusals(name: str) -> None:
    make, word = WRONG[name]
    with pytest.raises(InputError, match=word):
        make()
