"""The paper's example renderer: one point light, Lambert, shadow rays; and what a trace of the method holds.

Plan
- A shadow ray starts epsilon off the hit on the side that was hit and ends at the light; it is sent exactly where the
  surface is diffuse and the light on that side, and is its path's last ray. Recomputed in float64 from the vertices.
- The picture is Lambert's: ambient plus the cosine where nothing hides the light, recomputed from brute force alone.
- Kinds, parents, pixels, counters and their sums; dead rays; the last generation's shadow rays stay unshot.
- Threads and stages change nothing. A scene without a light gets one.
- Boundary table: one ray, no image, one triangle, nothing hit, a light in the surface's plane, a light at the hit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import refsim
from refsim import Rays, Scene
from refsim.results import RayKind, Trace
from refsim.scene import Material, PointLight
from refsim.shading import AMBIENT
from tests.bsh.traced import DIFFUSE, METHOD, bits, eye_rays, mixed, traced, wild_rays

EPS = 2.0**-24


def normals_of(scene: Scene) -> np.ndarray:
    corner = scene.triangles.astype(np.float64)
    n = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def assert_shadow_rays(trace: Trace, least: int) -> None:
    """Every shadow ray of a trace, and every place where there is none."""
    scene, seen = trace.scene, 0
    n, light = normals_of(scene), np.array(scene.lights_or_one[0].position)
    diffuse = scene.optical_indices() < 0
    scale = scene.diagonal + np.abs(scene.triangles).max() + np.abs(light).max()
    for k, g in enumerate(trace.generations):
        hit = (g.hits.triangle >= 0) & (g.kind != RayKind.SHADOW)
        triangle = np.maximum(g.hits.triangle, 0)
        at = np.where(hit, g.hits.t, 0.0)[:, None].astype(np.float64)
        point = g.rays.origin + at * g.rays.direction
        side = -np.sign((n[triangle] * g.rays.direction).sum(axis=1))[:, None]
        start = point + scene.epsilon * side * n[triangle]
        cosine = ((light - start) * n[triangle] * side).sum(axis=1)
        sent = g.next_kind == RayKind.SHADOW
        certain = np.abs(cosine) > 64 * EPS * scale
        due = hit & diffuse[triangle] & (cosine > 0)
        assert (sent == due)[certain].all()
        rays = g.next_rays
        assert (np.abs(rays.origin[sent] - start[sent]) < 64 * EPS * scale).all()
        end = rays.origin[sent] + rays.t_max[sent, None].astype(np.float64) * rays.direction[sent]
        assert (np.abs(end - light) < 64 * EPS * scale).all()
        seen += int(sent.sum())
        if k + 1 < len(trace.generations):
            after = trace.generations[k + 1]
            assert (after.next_rays.t_max[after.kind == RayKind.SHADOW] == 0).all()
    assert seen > least


@pytest.mark.parametrize("facing", ["both", "front"])
def test_shadow_rays(facing: str) -> None:
    assert_shadow_rays(traced(mixed(), eye_rays(), shadows=True, facing=facing), 100)
    scene = mixed("cubes")
    assert_shadow_rays(traced(scene, wild_rays(scene, 500, 2), shadows=True, facing=facing), 30)


def test_the_picture_is_lamberts() -> None:
    """From brute force: what the eye hits, and whether anything lies between that and the light."""
    scene = mixed().with_materials(Material("clay", "diffuse", (0.8, 0.5, 0.3)))
    image = refsim.render(METHOD, scene, 32, 26, fill=0.5, shadows=True, generations=2)
    eye = refsim.trace("brute_force", scene, eye_rays(), generations=1)
    hit = np.flatnonzero(eye.hits.triangle >= 0)
    n, light = normals_of(scene)[eye.hits.triangle[hit]], np.array(scene.lights[0].position)
    rays = eye.generations[0].rays
    point = rays.origin[hit] + eye.hits.t[hit, None].astype(np.float64) * rays.direction[hit]
    side = -np.sign((n * rays.direction[hit]).sum(axis=1))[:, None]
    start = (point + scene.epsilon * side * n).astype(np.float32)
    towards = light - start
    distance = np.linalg.norm(towards, axis=1)
    blocked = refsim.trace("brute_force", scene, Rays(start, towards / distance[:, None], distance), generations=1)
    cosine = np.maximum((n * side * (light - point)).sum(axis=1) / np.linalg.norm(light - point, axis=1), 0.0)
    factor = AMBIENT + np.where(blocked.hits.triangle >= 0, 0.0, scene.lights[0].intensity * cosine)
    expected = factor[:, None] * np.array([0.8, 0.5, 0.3])
    wrong = np.abs(image.rgb.reshape(-1, 3)[hit] - expected).max(axis=1) > 1e-5
    # A shadow's outline may fall on either side of a pixel whose ray was rounded otherwise
    assert wrong.mean() <= 0.005 and (blocked.hits.triangle >= 0).sum() > 10 and (factor > AMBIENT).sum() > 100


def test_counts_kinds_and_parents() -> None:
    trace = traced(mixed(), eye_rays(), shadows=True)
    pixels = np.arange(len(eye_rays()), dtype=np.int32)
    for k, g in enumerate(trace.generations):
        assert (g.pixel == pixels).all() and (g.alive == (g.rays.t_max > 0)).all()
        assert (g.parent == np.where(g.alive & (k > 0), pixels, -1)).all()
        assert (g.per_ray["nodes"][~g.alive] == 0).all() and (g.per_ray["nodes"][g.alive] >= 1).all()
        assert (g.per_ray["triangle_tests"] <= g.per_ray["nodes"]).all()
        nodes, tests = int(g.per_ray["nodes"].sum()), int(g.per_ray["triangle_tests"].sum())
        c = g.counters
        counted = c["traversal.nodes"], c["intersection.triangle_tests"], c["intersection.sphere_tests"]
        assert counted == (nodes, tests, nodes - tests)
        kinds = [c[f"rays.{name}"] for name in ("eye", "shadow", "reflected", "refracted")]
        assert kinds == [int((g.alive & (g.kind == kind)).sum()) for kind in RayKind]
        assert sum(kinds) == int(g.alive.sum())
    for name in ("traversal.nodes", "rays.shadow", "rays.reflected"):
        assert trace.counters[name] == sum(g.counters[name] for g in trace.generations) > 0
    assert trace.per_ray["nodes"].sum() == trace.counters["traversal.nodes"]


def test_threads_change_nothing() -> None:
    for packet in (True, False):
        one, many = (
            traced(mixed(), eye_rays(), shadows=True, packet=packet, threads=threads, heads="regular", screen_cells=4)
            for threads in (1, 5)
        )
        assert bits(one) == bits(many)
        assert all((one.per_ray[name] == many.per_ray[name]).all() for name in one.per_ray)


@pytest.mark.parametrize("stage", ["fragment", "vertex"])
def test_stages_change_nothing_but_their_counters(stage: str) -> None:
    options: dict[str, Any] = {"shadows": True, "heads": "regular", "layers": (60,), "facing": "front"}
    bare = traced(mixed(), eye_rays(), **options)
    drawn = traced(mixed(), eye_rays(), stage=stage, **options)
    assert bits(bare) == bits(drawn)
    assert all((bare.per_ray[name] == drawn.per_ray[name]).all() for name in bare.per_ray)
    assert bare.counters["draw.calls"] == 0 < drawn.counters["draw.calls"]
    invocations = drawn.counters[f"{stage}.invocations"]
    assert invocations >= sum(int(g.alive.sum()) for g in drawn.generations)


def test_a_scene_without_a_light_gets_one() -> None:
    scene = refsim.load_scene("blob_320").with_materials(DIFFUSE).replace(lights=())
    assert not scene.lights
    trace = traced(scene, refsim.camera_rays(scene, 16, 16), shadows=True, generations=2)
    assert_shadow_rays(trace, 20)


ONE = np.array([[[0, 0, 0], [1, 0, 0], [0, 0, -1]]], np.float32)  # faces up
DOWN = Rays([[0.25, 1, -0.25]], [[0, -1, 0]])


@pytest.mark.parametrize(
    ("light", "shadow_rays"),
    [((0.25, 2, -0.25), 1), ((5, 0, 5), 0), ((5, -1, 5), 0), ((0.25, 2.0**-40, -0.25), 0), ((0.25, 0.5, -0.25), 1)],
)
def test_one_triangle_one_ray(light: tuple[float, float, float], shadow_rays: int) -> None:
    scene = Scene(ONE, "one", (DIFFUSE,), lights=(PointLight(light),))
    trace = traced(scene, DOWN, shadows=True)
    assert trace.hits.triangle.tolist() == [0] and trace.hits.t.tolist() == [1.0]
    assert trace.counters["rays.shadow"] == shadow_rays
    assert trace.generations[1].hits.triangle.tolist() == [-1]
    # A node for the triangle alone, and the triangle
    assert trace.generations[0].per_ray["nodes"].tolist() == [2]


def test_the_last_generations_shadow_rays_stay_unshot() -> None:
    trace = traced(mixed(), eye_rays(), shadows=True, generations=1)
    assert trace.counters["rays.shadow"] == 0 and (trace.generations[0].next_kind == RayKind.SHADOW).sum() > 100
    lit, full = (
        refsim.render(METHOD, mixed(), 32, 26, fill=0.5, material="diffuse", shadows=True, generations=count).rgb
        for count in (1, 2)
    )
    assert (lit >= full).all() and (lit > full).any(axis=2).sum() > 5


def test_nothing_hit_and_nothing_alive() -> None:
    scene = mixed()
    away = Rays([[0, 900, 0]] * 3, [[0, 1, 0], [0, 0, 0], [1, 0, 0]], [np.inf, 0, 4])
    trace = traced(scene, away, shadows=True)
    assert (trace.hits.triangle == -1).all() and trace.per_ray["nodes"].tolist() == [1, 0, 1]
