"""Every hit of every generation is one that a right float32 answer may be, and every new ray follows from its hit.

Plan
- The judge, which shares no code with the engine, finds every hit of every generation admissible on that generation's
  own rays: procedural scenes, both facings, smooth shading, incoherent rays, real meshes. Its sentence is the message.
- The judge sees the fault when one hit of a trace is moved (control).
- New rays agree with Snell's law and the law of reflection, recomputed in float64 from the triangle's vertices, within
  a stated bound; origins lie on the ray, offset to the side of the new direction; kinds fit.
- The exit ray of a pixel is the last ray of its path, found again one pixel at a time; parents and pixels fit.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import refsim
from refsim import Hits, Rays, Scene, camera_rays, load_scene
from refsim.errors import InputError
from refsim.oracle import judge
from refsim.results import Generation, RayKind, Trace
from tests.hre.scenes import PROCEDURAL, REAL, rays_of, scene_of, wild_rays

HRE, RE, BRUTE = "hierarchical_ray_engine", "ray_engine", "brute_force"
EPS = 2.0**-24
SMOOTH_FRONT: dict[str, Any] = {
    "submission": "primitive",
    "early_tests": "none",
    "facing": "front",
    "shading": "smooth",
}


def assert_admissible(trace: Trace, facing: str = "both") -> None:
    for k, generation in enumerate(trace.generations):
        verdicts = judge(trace.scene, generation.rays, generation.hits, facing=facing)  # type: ignore[arg-type]
        assert verdicts.ok, f"generation {k}: {verdicts.worst()}"


@pytest.mark.parametrize("name", [*PROCEDURAL, "slivers"])
def test_procedural_scenes(name: str) -> None:
    scene = scene_of(name)
    assert scene is not None
    trace = refsim.trace(HRE, scene, rays_of(name, 64, 48), tile_size=8)
    assert sum(int((g.hits.triangle >= 0).sum()) for g in trace.generations[1:]) > 100 or name == "cornell_box"
    assert_admissible(trace)


def test_incoherent_rays() -> None:
    for name in PROCEDURAL:
        scene = scene_of(name)
        assert scene is not None
        assert_admissible(refsim.trace(HRE, scene, wild_rays(scene, 40, 30, 11), tile_size=8))


def test_front_and_smooth() -> None:
    for name in ("torus_knot_128", "blob_100"):
        scene = scene_of(name)
        assert scene is not None
        trace = refsim.trace(HRE, scene, rays_of(name, 64, 48), **SMOOTH_FRONT)
        assert_admissible(trace, "front")


@pytest.mark.parametrize("name", REAL)
def test_real_meshes(name: str, record_property: Any) -> None:
    scene = scene_of(name)
    record_property(name, "missing" if scene is None else "present")
    if scene is None:
        with pytest.raises(InputError, match=name):
            load_scene(name)
        return
    trace = refsim.trace(HRE, scene, camera_rays(scene, REAL[name], REAL[name], fill=0.55), generations=4)
    assert (trace.generations[1].hits.triangle >= 0).sum() > 100
    assert_admissible(trace)


def test_the_judge_sees_a_wrong_hit() -> None:
    scene = scene_of("torus_knot_128")
    assert scene is not None
    generation = refsim.trace(HRE, scene, rays_of("torus_knot_128")).generations[1]
    rows = np.flatnonzero(generation.hits.triangle >= 0)[[3, 40, 90]]
    triangle, t = generation.hits.triangle.copy(), generation.hits.t.copy()
    triangle[rows[0]], t[rows[0]] = -1, np.inf
    t[rows[1]] *= np.float32(1.001)
    triangle[rows[2]] = (triangle[rows[2]] + 40) % len(scene)
    verdicts = judge(scene, generation.rays, Hits(triangle, t, generation.hits.u, generation.hits.v))
    assert (np.flatnonzero(~verdicts.admissible) == np.sort(rows)).all()


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def normals64(scene: Scene, hits: Hits, rows: np.ndarray, smooth: bool) -> tuple[np.ndarray, np.ndarray]:
    """Geometric and shading normal of the hits, float64."""
    corner = scene.triangles[hits.triangle[rows]].astype(np.float64)
    flat = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    if not smooth:
        return flat, flat
    n = scene.vertex_normals[hits.triangle[rows]].astype(np.float64)
    u, v = hits.u[rows, None].astype(np.float64), hits.v[rows, None].astype(np.float64)
    return flat, unit(n[:, 0] * (1 - u - v) + n[:, 1] * u + n[:, 2] * v)


def assert_new_rays(generation: Generation, scene: Scene, ior: float, smooth: bool) -> dict[str, int]:
    """New rays within a bound; returns how many there are of each kind.

    Directions: the cosine of incidence c carries some 8 eps (16 with an interpolated normal of length down to 1/2), so
    k = 1 − eta² (1 − c²) carries δ = 64 eps max(1, eta²) and its root δ / (2 √k), or √δ where k is smaller than δ.
    Rays that graze (|d · n| ≤ 32 eps) or stand at the critical angle (|k| ≤ δ) may go either way; few do."""
    following = generation.next_rays
    assert following is not None and generation.next_kind is not None
    rows = np.flatnonzero(generation.hits.triangle >= 0)
    index = scene.optical_indices(ior)[generation.hits.triangle[rows]].astype(np.float64)
    flat, n = normals64(scene, generation.hits, rows, smooth)
    d = generation.rays.direction[rows].astype(np.float64)
    new, kind = following.direction[rows].astype(np.float64), generation.next_kind[rows]
    ends = index < 0
    assert (following.t_max[rows[ends]] == 0).all() and (new[ends] == 0).all() and (kind[ends] == 0).all()
    misses = generation.hits.triangle < 0
    assert (following.t_max[misses] == 0).all() and (following.direction[misses] == 0).all()

    dn = (d * n).sum(axis=1)
    m, c = np.where(dn[:, None] < 0, n, -n), np.abs(dn)
    safe_index = np.where(index > 0, index, 1.0)
    eta = np.where(dn < 0, 1 / safe_index, safe_index)
    k = 1 - eta**2 * (1 - c**2)
    delta = 64 * EPS * np.maximum(1, eta**2)
    clear = ~ends & (c > 32 * EPS) & ((index == 0) | (np.abs(k) > delta))
    assert (~clear & ~ends).sum() <= 0.002 * len(rows)
    reflects = (index == 0) | (k < 0)
    assert (kind[clear] == np.where(reflects[clear], RayKind.REFLECTED, RayKind.REFRACTED)).all()
    root = np.sqrt(np.maximum(k, 0))
    mirrored, bent = d + 2 * c[:, None] * m, eta[:, None] * d + (eta * c - root)[:, None] * m
    expected = unit(np.where(reflects[:, None], mirrored, bent))
    bound = 64 * EPS + np.where(reflects, 0, np.minimum(delta / (2 * np.maximum(root, 1e-30)), np.sqrt(delta)))
    off = np.linalg.norm(new - expected, axis=1)
    wrong = np.flatnonzero(clear & ~(off <= bound))
    assert not len(wrong), f"ray {rows[wrong[0]]}: {new[wrong[0]]} is {off[wrong[0]]:.3g} off {expected[wrong[0]]}"

    # Origins: the hit point, and epsilon along the geometric normal to the side of the new direction
    o, t = generation.rays.origin[rows].astype(np.float64), generation.hits.t[rows].astype(np.float64)
    side = (new * flat).sum(axis=1)
    goes_on = ~ends & (np.abs(side) > 32 * EPS)
    place = o + t[:, None] * d + np.sign(side)[:, None] * float(scene.epsilon) * flat
    reach = 4 * EPS * (np.abs(o).max(axis=1) + t)
    assert (np.abs(following.origin[rows] - place).max(axis=1)[goes_on] <= reach[goes_on]).all()
    assert np.isinf(following.t_max[rows[~ends]]).all()
    return {"refracted": int((kind == 3).sum()), "reflected": int((kind == 2).sum()), "ended": int(ends.sum())}


@pytest.mark.parametrize(
    ("name", "options", "least"),
    [
        ("torus_knot_128", {}, {"refracted": 3000, "reflected": 1000}),
        ("torus_knot_128", SMOOTH_FRONT, {"refracted": 1000}),
        ("blob_100", {"ior": 2.4}, {"refracted": 3000, "reflected": 500}),
        ("blob_100", {"ior": 0.7}, {"refracted": 1000, "reflected": 100}),
        ("torus_knot_128", {"material": "mirror"}, {"reflected": 2000}),
        ("cornell_box", {}, {"refracted": 100, "reflected": 100, "ended": 1000}),
        ("mirror_room", {}, {"reflected": 5000}),
    ],
)
def test_new_rays_follow_from_hits(name: str, options: dict[str, Any], least: dict[str, int]) -> None:
    scene, seen = scene_of(name), dict.fromkeys(("refracted", "reflected", "ended"), 0)
    assert scene is not None
    trace = refsim.trace(HRE, scene, rays_of(name, 64, 48), **options)
    for generation in trace.generations:
        new = assert_new_rays(generation, trace.scene, options.get("ior", 1.5), options.get("shading") == "smooth")
        seen = {key: seen[key] + new[key] for key in seen}
    assert all(seen[key] >= least.get(key, 0) for key in seen), seen


def test_a_wrong_new_ray_is_seen() -> None:
    """Control: the offset to the other side, and a refracted ray bent with the wrong index."""
    scene = scene_of("blob_100")
    assert scene is not None
    generation = refsim.trace(HRE, scene, rays_of("blob_100"), generations=1).generations[0]
    rays = generation.next_rays
    assert rays is not None
    with pytest.raises(AssertionError):
        assert_new_rays(generation, scene, 1.51, False)
    other = rays.origin - 2 * scene.epsilon * rays.direction
    wrong = replace(generation, next_rays=Rays.unchecked(other, rays.direction, rays.t_max))
    with pytest.raises(AssertionError):
        assert_new_rays(wrong, scene, 1.5, False)


@pytest.mark.parametrize("method", [BRUTE, RE, HRE])
@pytest.mark.parametrize("name", ["torus_knot_128", "cornell_box", "mirror_room"])
def test_exit_rays_are_the_last_rays(method: str, name: str) -> None:
    scene = scene_of(name)
    assert scene is not None
    trace = refsim.trace(method, scene, rays_of(name), generations=3)
    beyond = trace.generations[-1].next_rays
    assert beyond is not None
    lengths = set()
    for pixel in range(len(trace.exit_rays)):
        path = [g.rays for g in trace.generations if g.alive[pixel]] + [beyond] * bool(beyond.t_max[pixel] > 0)
        lengths.add(len(path))
        for column in ("origin", "direction", "t_max"):
            assert (getattr(trace.exit_rays, column)[pixel] == getattr(path[-1], column)[pixel]).all()
    assert len(lengths) > 1 and max(lengths) == 4


@pytest.mark.parametrize("method", [BRUTE, RE, HRE])
def test_a_path_goes_on_from_its_own_pixel(method: str) -> None:
    scene = scene_of("cornell_box")
    assert scene is not None
    trace = refsim.trace(method, scene, rays_of("cornell_box"))
    for k, generation in enumerate(trace.generations):
        assert (generation.pixel == np.arange(len(generation.pixel))).all()
        assert (generation.alive == (generation.rays.t_max > 0)).all()
        assert (generation.rays.direction[~generation.alive] == 0).all()
        assert (generation.hits.triangle[~generation.alive] == -1).all()
        assert (generation.parent[~generation.alive] == -1).all()
        if k == 0:
            assert (generation.parent == -1).all() and (generation.kind == RayKind.EYE).all()
            continue
        before = trace.generations[k - 1]
        parent = generation.parent[generation.alive]
        assert (parent == np.flatnonzero(generation.alive)).all()
        assert (before.hits.triangle[parent] >= 0).all()
        assert generation.rays is before.next_rays and generation.kind is before.next_kind
