"""The enclosing cone holds its rays, and its sphere test rejects nothing that a ray meets.

Plan
- 10,000 different bundles and more come from hypothesis, in arrays of 100; three in five are bounded cones of two live
  rays or more. Single bundles come from it too, for small examples of a failure.
- In float64 the corrected cone, grown by its slack of some 2^-48, holds every ray, to 1e-12 of the distance from the
  apex; single bundles without slack, as far as subtracting far coordinates allows.
- In float32 the corrected cone, its numbers taken as exact, grown by its slack, holds every ray to infinity: at 1e-12
  of the distance, so in practice at 0.
- slack is small: at most 2^-19 of the farthest origin's distance from the apex plus 2^-22 of the apex' largest
  coordinate.
- The same for bundles of 4,096 rays, in any order.
- A sphere that touches a ray of the bundle, at any distance and of any size, is never rejected.
- A triangle that the float32 ray-triangle test accepts, slivers and grazing rays too, is never rejected by its
  enclosing sphere.
- Table: excess by hand, beside the cone, behind its apex and behind the mirrored cone; directions likewise.
- Tables: empty, one ray, dead rays only, parallel, opposite, just under and over the widest half-angle; slack says
  the state.
"""

from collections import Counter
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings

from refsim.geometry.cone import WIDEST_COS
from refsim.geometry.sphere import enclosing_spheres
from refsim.geometry.triangle import pack_triangles
from refsim.reference import cone as reference
from tests.geometry.cone_bundles import (
    KINDS,
    Bundles,
    Recipe,
    bulk,
    bundles,
    farthest,
    prepare,
    recipes,
    unit,
    widest_miss,
)
from tests.geometry.device_loops import build, excesses, hits, meets

ROUNDING = 1e-12        # of the float64 evaluation here
DOUBLE = 2.0**-29       # float64's unit roundoff over float32's


def slack_bound(cones, bundle):
    """The stated margin: 2^-19 max |p - a| + 2^-22 max |a_i|."""
    return 2.0**-19 * farthest(cones, bundle) + 2.0**-22 * np.abs(cones.apex.astype(np.float64)).max(axis=1)


@cache
def put_through():
    """Asserts for each bundle of 125 arrays that it is held in float32 and float64; counts what was drawn."""
    drawn, seen = Counter(), set()

    @settings(max_examples=125, deadline=None, derandomize=True, database=None)
    @given(recipes())
    def held(recipe):
        many = prepare(recipe)
        cones, slack = build(many.p, many.r, many.live)
        miss, bounded = widest_miss(cones, slack, many), cones.state == 1
        worst = int(np.argmax(miss))
        assert miss[worst] <= ROUNDING, describe(many, worst)
        assert np.all(slack[bounded] <= slack_bound(cones, many)[bounded])
        seen.update(p.tobytes() + r.tobytes() for p, r in zip(many.p, many.r, strict=True))
        rays = many.live.sum(axis=1)
        drawn.update({
            "drawn": len(rays), "bounded, 2 rays or more": int((bounded & (rays >= 2)).sum()),
            "one ray": int((rays == 1).sum()), "no ray": int((rays == 0).sum()),
            "unbounded": int((cones.state == 2).sum()), KINDS[many.kind[0]]: len(rays),
        })
        exact = many._replace(p=many.p.astype(np.float64), r=_unit64(many))
        double, slack = reference.build(exact.p, exact.r, exact.live)
        miss = widest_miss(double, slack, exact)
        worst = int(np.argmax(miss))
        assert miss[worst] <= ROUNDING, describe(many, worst)
        bounded = double.state == 1
        assert np.all(slack[bounded] <= DOUBLE * slack_bound(double, exact)[bounded])

    # What Hypothesis draws depends on the modules that are loaded: each kind once in any case
    for seed, kind in enumerate(KINDS):
        held = example(Recipe(kind, 6, -0.5 if kind == "wide" else -2.0, 0.0, seed))(held)
    held()
    return drawn | {"different": len(seen)}


def describe(many, row):
    """The live rays of one bundle of many, for people."""
    rays = [f"from {p.tolist()} along {r.tolist()}" for p, r in zip(many.p[row], many.r[row], strict=True) if r.any()]
    return f"{KINDS[many.kind[row]]}: " + "; ".join(rays)


def test_ten_thousand_bundles_from_hypothesis():
    assert put_through()["different"] >= 10_000


def test_what_hypothesis_draws():
    drawn = put_through()
    print(dict(drawn))
    assert drawn["bounded, 2 rays or more"] >= 0.6 * drawn["drawn"]
    assert all(drawn[name] >= 100 for name in (*KINDS, "one ray", "no ray", "unbounded"))


@settings(max_examples=300, deadline=None, derandomize=True, database=None)
@given(bundles())
def test_any_bundle_is_held_in_float32(bundle):
    cones, slack = build(bundle.p, bundle.r, bundle.live)
    assert widest_miss(cones, slack, bundle).max() <= ROUNDING
    assert cones.state[0] != 1 or slack[0] <= slack_bound(cones, bundle)[0]


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(bundles())
def test_any_bundle_is_held_in_float64(bundle):
    exact = bundle._replace(p=bundle.p.astype(np.float64), r=_unit64(bundle))
    cones, slack = reference.build(exact.p, exact.r, exact.live)
    assert widest_miss(cones, np.zeros_like(slack), exact).max() <= ROUNDING * _condition(cones, exact)[0]


def _unit64(bundle):
    """Directions made unit in float64; dead rays stay zero."""
    r = bundle.r.astype(np.float64)
    return np.where(bundle.live[..., None], r / np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-30), 0.0)


def _condition(cones, bundle):
    """Coordinates over the bundle's own size: what float64 loses by subtracting."""
    coordinate = np.abs(cones.apex).max(axis=1)
    return 1.0 + coordinate / np.maximum(farthest(cones, bundle), 1e-300) * 1e-3


@pytest.fixture(scope="module")
def many():
    return bulk(seed=20060130, per_kind=1500, n=10)


def test_fifteen_thousand_bundles_in_float32(many):
    cones, slack = build(many.p, many.r, many.live)
    miss = widest_miss(cones, slack, many)
    for k, kind in enumerate(KINDS):
        assert miss[many.kind == k].max() <= ROUNDING, kind
    bounded = cones.state == 1
    assert np.all(slack[bounded] <= slack_bound(cones, many)[bounded])
    assert np.all(slack[bounded] >= 0) and bounded.sum() > 8000


def test_fifteen_thousand_bundles_in_float64(many):
    exact = many._replace(p=many.p.astype(np.float64), r=_unit64(many))
    cones, slack = reference.build(exact.p, exact.r, exact.live)
    miss = widest_miss(cones, slack, exact)
    for k, kind in enumerate(KINDS):
        assert miss[many.kind == k].max() <= ROUNDING, kind
    bounded = cones.state == 1
    assert np.all(slack[bounded] <= DOUBLE * slack_bound(cones, exact)[bounded])


@pytest.mark.parametrize("order", ["as drawn", "reversed", "shuffled"])
def test_4096_rays_in_any_order(order):
    rng = np.random.default_rng(64)
    b, n = 24, 4096
    spread = 10.0 ** rng.uniform(-5, -0.3, (b, 1, 1))
    r = unit(rng.normal(size=(b, 1, 3)) + spread * rng.uniform(-1, 1, (b, n, 3)))
    p = rng.uniform(-1, 1, (b, n, 3)) * 10.0 ** rng.uniform(-5, 0, (b, 1, 1)) + rng.normal(size=(b, 1, 3)) * 10.0
    turn = {"as drawn": np.arange(n), "reversed": np.arange(n)[::-1], "shuffled": rng.permutation(n)}[order]
    p, r = p[:, turn].astype(np.float32), r[:, turn].astype(np.float32)
    bundle = Bundles(p, r, np.ones((b, n), bool), np.zeros(b, int))
    cones, slack = build(bundle.p, bundle.r, bundle.live)
    assert widest_miss(cones, slack, bundle).max() <= ROUNDING
    assert np.all((slack <= slack_bound(cones, bundle)) | (cones.state == 2))
    assert (cones.state == 1).sum() >= 12


def _touching_spheres(rng, bundle, rows):
    """A float32 sphere for each row that, in float64, a live ray of the row meets, mostly just so; and which rows
    have one."""
    ray = np.argmax(bundle.live * rng.random(bundle.live.shape), axis=1)
    p, r = (x[rows, ray].astype(np.float64) for x in (bundle.p, bundle.r))
    size = np.maximum(np.abs(bundle.p - p[:, None]).max(axis=(1, 2)), 1e-6)
    t = size * 10.0 ** rng.uniform(-3, 5, len(rows))
    radius = (np.maximum(t, size) * 10.0 ** rng.uniform(-5, 1, len(rows))).astype(np.float32)
    side = rng.normal(size=p.shape)
    across = unit(side - np.sum(side * r, axis=1, keepdims=True) * r)
    # Mostly tangent, else anywhere around the point.
    side = np.where(rng.random((len(rows), 1)) < 0.7, across, unit(side))
    centre = (p + t[:, None] * r + side * radius[:, None]).astype(np.float32)
    toward = centre.astype(np.float64) - p
    nearest = np.maximum(np.sum(toward * r, axis=1) / np.maximum(np.sum(r * r, axis=1), 0.5), 0.0)
    met = np.linalg.norm(toward - nearest[:, None] * r, axis=1) <= radius
    return centre, radius, met & bundle.live.any(axis=1)


@pytest.mark.parametrize("seed", range(8))
def test_no_sphere_that_a_ray_meets_is_rejected(many, seed):
    cones, slack = build(many.p, many.r, many.live)
    rows = np.arange(len(many.p))
    centre, radius, met = _touching_spheres(np.random.default_rng(seed), many, rows)
    assert met.sum() > 4000
    kept = meets(cones, slack, centre, radius)
    assert kept[met].all(), [KINDS[k] for k in set(many.kind[met & ~kept])]


def _triangles_at(rng, x, r, reach):
    """Triangles with a corner, an edge or the inside at the points x, in every shape down to slivers and every tilt
    to grazing."""
    b = len(x)
    grazing = 10.0 ** rng.uniform(-6, 0, (b, 1))
    first = unit(r + grazing * rng.normal(size=x.shape))
    second = unit(rng.normal(size=x.shape) * 10.0 ** rng.uniform(-4, 0, (b, 1)) + first * rng.choice([-1, 1], (b, 1)))
    size = (reach * 10.0 ** rng.uniform(-3, 1, b))[:, None]
    e1, e2 = first * size, second * size * rng.uniform(0.1, 1.0, (b, 1))
    weight = rng.dirichlet([0.3, 0.3, 0.3], b) * (rng.random((b, 3)) < 0.7)
    weight[weight.sum(axis=1) == 0] = [1.0, 0.0, 0.0]
    weight /= weight.sum(axis=1, keepdims=True)
    v0 = x - weight[:, 1:2] * e1 - weight[:, 2:] * e2
    turn = rng.integers(0, 3, b)
    vertices = np.stack([v0, v0 + e1, v0 + e2], axis=1)
    return vertices[np.arange(b)[:, None], (np.arange(3) + turn[:, None]) % 3].astype(np.float32)


@pytest.mark.parametrize("seed", range(8))
def test_no_triangle_that_float32_hits_is_rejected(many, seed):
    rng = np.random.default_rng(1000 + seed)
    cones, slack = build(many.p, many.r, many.live)
    rows = np.arange(len(many.p))
    ray = np.argmax(many.live * rng.random(many.live.shape), axis=1)
    o, d = many.p[rows, ray], many.r[rows, ray]
    size = np.maximum(np.abs(many.p - o[:, None]).max(axis=(1, 2)), 1e-6)
    t = size * 10.0 ** rng.uniform(-2, 4, len(rows))
    triangles = _triangles_at(rng, o + d.astype(np.float64) * t[:, None], d, t)
    records = pack_triangles(triangles)
    hit = hits(o, d, np.full(len(rows), np.inf, np.float32), records)[0] & many.live.any(axis=1)
    assert hit.sum() > 2000
    kept = meets(cones, slack, *enclosing_spheres(triangles))
    assert kept[hit].all()


def test_states_and_what_slack_says():
    up, down = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
    edge = float(np.arccos(float(WIDEST_COS)))
    table = {                       # name: origins, directions, live, state
        "no ray": ([], [], 0),
        "one ray": ([(1, 2, 3)], [up], 1),
        "parallel": ([(0, 0, 0), (1, 0, 0)], [up, up], 1),
        "opposite": ([(0, 0, 0), (0, 0, 1)], [up, down], 2),
        "just bounded": ([(0, 0, 0)] * 2, [up, (np.sin(2 * edge - 1e-3), 0, np.cos(2 * edge - 1e-3))], 1),
        "just unbounded": ([(0, 0, 0)] * 2, [up, (np.sin(2 * edge + 1e-3), 0, np.cos(2 * edge + 1e-3))], 2),
    }
    for name, (p, r, state) in table.items():
        n = max(len(p), 1)
        p32, r32 = np.zeros((1, n, 3), np.float32), np.zeros((1, n, 3), np.float32)
        live = np.full((1, n), bool(p))
        if p:
            p32[0], r32[0] = p, r
        cones, slack = build(p32, r32, live)
        assert cones.state[0] == state, name
        assert {0: slack[0] == -np.inf, 1: 0 <= slack[0] < 1e-3, 2: slack[0] == np.inf}[state], name
        # A huge sphere, and a small one far behind: an empty cone meets neither, an unbounded one both.
        for centre, radius, control in (((0, 0, 0), 1e6, True), ((0, 0, -1e6), 1.0, False)):
            met = meets(cones, slack, np.array([centre], np.float32), np.array([radius], np.float32))[0]
            assert met == {0: False, 1: control, 2: True}[state], name


HALF = 0.5 * np.sqrt(3.0)       # cosine of 30 degrees


@pytest.mark.parametrize(
    ("name", "p", "r", "distance", "sine"),
    [
        ("control: on the axis", (0, 0, 1), (0, 0, 1), 0.0, 0.0),
        ("inside", (0.5, 0, 1), (0.4, 0, HALF), 0.0, 0.0),
        ("beside", (1, 0, 0), (1, 0, 0), HALF, HALF),
        ("in the mirrored cone", (0, 0, -2), (0, 0, -1), 2.0, 1.0),
        ("nearest to the apex", (0.6, 0, -0.8), (0.6, 0, -0.8), 1.0, 1.0),
        ("just nearer to the side", (HALF, 0, -0.49), (HALF, 0, -0.49), 0.995, 0.995),
        ("on the apex", (0, 0, 0), (0, 0, 1), 0.0, 0.0),
        ("not a number", (0, 0, np.nan), (0, 0, np.nan), np.inf, 1.0),
    ],
)
def test_excess_by_hand(name, p, r, distance, sine):
    rows = [np.array([x], np.float32) for x in ((0, 0, 0), (0, 0, 1), HALF, 0.5, p, r)]
    got = excesses(reference.Cones(*rows[:4], np.ones(1, np.int32)), *rows[4:])[:, 0]
    assert np.allclose(got, (distance, sine), rtol=6e-4, atol=3e-6), name
    assert got[0] >= np.float32(distance) and got[1] >= np.float32(sine) * np.float32(1 - 1e-6), name


def test_one_ray_keeps_its_own_apex_and_axis_exactly():
    p, r = np.array([[[3.0, -1.0, 2.0]]], np.float32), np.array([[[0.0, 1.0, 0.0]]], np.float32)
    cones, slack = build(p, r, np.ones((1, 1), bool))
    assert cones.apex[0].tolist() == [3, -1, 2] and cones.axis[0].tolist() == [0, 1, 0] and slack[0] == 0
    assert cones.sin[0] == np.float32(2.0**-20)
