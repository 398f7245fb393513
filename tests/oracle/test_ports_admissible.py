"""Plan: no correct float32 implementation is ever accused.
Every port of `ports.py` (Möller–Trumbore, plane, Woop, each in several operation orders, fused or not) on every
adversarial mesh and ray of `cases.py`, at any scale and offset, both facings, gives admissible hits only.
The same with t_max one float32 around the hit, with any-hit semantics, and for real and procedural closed meshes.
A watertight reference (float64, edges decided once) passes as watertight.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.oracle import admissible, bodies_of, judge
from refsim.scene.rays import Hits, Rays
from tests.oracle import cases, ports

PLACES = [(1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e4), (1e3, -1e4), (1e-3, 10.0)]


def placed(mesh: str, seed: int, place: tuple[float, float]) -> np.ndarray:
    tri = cases.MESHES[mesh](np.random.default_rng(seed))
    return (tri * np.float32(place[0]) + np.float32(place[1])).astype(np.float32)


def limited(rays: Rays, tri: np.ndarray, rng: np.random.Generator) -> Rays:
    """Put t_max exactly at a hit, or one float32 beside it."""
    t = ports.trace("plane", tri, rays).t
    step = rng.integers(-1, 2, len(t))
    t = np.where(step > 0, np.nextafter(t, np.float32(np.inf)), np.where(step < 0, np.nextafter(t, np.float32(0)), t))
    return Rays(rays.origin, rays.direction, t.astype(np.float32))


@settings(max_examples=70, deadline=None)
@given(
    mesh=st.sampled_from(sorted(cases.MESHES)),
    kind=st.sampled_from(cases.RAYS),
    place=st.sampled_from(PLACES),
    facing=st.sampled_from(["both", "front"]),
    bounded=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_every_port_is_admissible(mesh, kind, place, facing, bounded, seed):
    rng, tri = np.random.default_rng(seed), placed(mesh, seed, place)
    rays = cases.rays(rng, tri, 32, kind)
    rays = limited(rays, tri, rng) if bounded else rays
    answers = admissible(tri, rays, facing=facing, threads=1)
    for port in ports.PORTS:
        hits = ports.trace(port, tri, rays, facing, seed)
        verdicts = judge(tri, rays, hits, answers=answers)
        assert verdicts.ok, f"{port}: {verdicts.worst()}"
        assert judge(tri, rays, hits, any_hit=True, answers=answers).ok, port


@pytest.mark.parametrize("distance", [1.0, 20.0, 1000.0])
def test_ports_are_admissible_from_near_and_far(distance):
    tri = cases.sphere()
    rays = cases.camera(tri, 48, 48, distance=distance)
    answers = admissible(tri, rays)
    assert (answers.closest >= 0).mean() > 0.4
    for port in ports.PORTS:
        assert judge(tri, rays, ports.trace(port, tri, rays), answers=answers).ok, port


def edge_once(tri: np.ndarray, rays: Rays) -> Hits:
    """A watertight reference: float64 edge functions, which come out exactly opposite for the two sides of an edge."""
    t64, o, d = tri.astype(float), rays.origin.astype(float), rays.direction.astype(float)
    k = np.abs(d).argmax(axis=1)
    kx, ky, r = (k + 1) % 3, (k + 2) % 3, np.arange(len(o))
    p = t64[None] - o[:, None, None]
    along = p[r, :, :, k]
    x = p[r, :, :, kx] - (d[r, kx] / d[r, k])[:, None, None] * along
    y = p[r, :, :, ky] - (d[r, ky] / d[r, k])[:, None, None] * along
    w = np.stack(
        [x[:, :, (i + 2) % 3] * y[:, :, (i + 1) % 3] - y[:, :, (i + 2) % 3] * x[:, :, (i + 1) % 3] for i in range(3)],
        axis=2,
    )
    total = w.sum(axis=2)
    inside = ((w >= 0).all(axis=2) | (w <= 0).all(axis=2)) & (total != 0)
    with np.errstate(all="ignore"):
        w = w / total[:, :, None]
        t = (w * along).sum(axis=2) / d[r, k][:, None]
    depth = np.where(inside & (t > 0), t, np.inf)
    best = depth.argmin(axis=1)
    hit = np.isfinite(depth[r, best])
    values = (np.where(hit, q[r, best], z).astype(np.float32) for q, z in ((t, np.inf), (w[..., 1], 0), (w[..., 2], 0)))
    return Hits(np.where(hit, best, -1).astype(np.int32), *values)


@settings(max_examples=10, deadline=None)
@given(kind=st.sampled_from(["edge", "corner", "inside"]), seed=st.integers(0, 2**32 - 1))
def test_a_watertight_port_is_admissible_as_watertight(kind, seed):
    tri = cases.sphere()
    rays = cases.rays(np.random.default_rng(seed), tri, 64, kind)
    assert judge(tri, rays, edge_once(tri, rays), watertight=True).ok


def test_prepared_triangles_and_scenes_serve_alike():
    tri = cases.sphere()
    rays = cases.camera(tri, 16, 16)

    class Scene:
        triangles = tri

    a, b, c = (admissible(x, rays) for x in (tri, bodies_of(tri), Scene()))
    assert np.array_equal(a.triangles, b.triangles) and np.array_equal(a.t, c.t)
