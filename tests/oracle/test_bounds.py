"""Plan: the bound holds and is not fat.
Float64 decisions agree with rational arithmetic; every port's error, measured against rationals, is below the bound
and reaches a tenth of it; well-conditioned camera rays have one answer in 99.9 % and a median t bound below 64 ulps;
margin > 1 is the same as one answer; grazing rays admit both hit and miss.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.oracle import admissible
from refsim.scene.rays import Rays
from tests.oracle import cases, ports


def rational(tri, o, d):
    """t, u, v of the crossing in fractions, written down independently (Cramer); None in the plane."""
    a, b, c, o, d = ([Fraction(float(x)) for x in row] for row in (*tri, o, d))
    s, e1, e2 = ([x - y for x, y in zip(p, a, strict=True)] for p in (o, b, c))

    def det(x, y, z):
        return (
            x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0]) + x[2] * (y[0] * z[1] - y[1] * z[0])
        )

    back = [-x for x in d]
    m = det(back, e1, e2)
    return None if m == 0 else (det(s, e1, e2) / m, det(back, s, e2) / m, det(back, e1, s) / m)


def closest_by_fractions(tri, rays, i):
    best = None
    for k in range(len(tri)):
        x = rational(tri[k], rays.origin[i], rays.direction[i])
        if x is None or min(x) < 0 or x[1] + x[2] > 1 or x[0] == 0 or x[0] >= float(rays.t_max[i]):
            continue
        best = min(best, (x[0], k)) if best else (x[0], k)
    return best


@settings(max_examples=24, deadline=None)
@given(
    mesh=st.sampled_from(["grid", "plate", "soup", "degenerate"]),
    kind=st.sampled_from(cases.RAYS),
    seed=st.integers(0, 2**32 - 1),
)
def test_closest_is_that_of_rational_arithmetic(mesh, kind, seed):
    rng = np.random.default_rng(seed)
    tri = cases.MESHES[mesh](rng)[:40]
    rays = cases.rays(rng, tri, 4, kind)
    answers = admissible(tri, rays, threads=1)
    for i in range(len(rays)):
        best = closest_by_fractions(tri, rays, i)
        assert answers.closest[i] == (best[1] if best else -1)
        if best:
            # Float64 errs where float32 errs, 2⁻²⁶ as much: a t near 0 has few correct digits in either.
            row = answers.rows(answers.closest)[i]
            slack = min(1e-6 * answers.t_bound[row], 1e-3 * answers.t[i])
            assert answers.t[i] == pytest.approx(float(best[0]), rel=1e-12, abs=slack)


@pytest.mark.parametrize("distance", [2.0, 20.0])
def test_port_errors_fill_the_bound_but_never_pass_it(distance):
    tri = cases.sphere()
    rays = cases.camera(tri, 48, 48, distance=distance)
    answers = admissible(tri, rays)
    worst_t, worst_u = 0.0, 0.0
    for port in ports.PORTS:
        hits = ports.trace(port, tri, rays)
        row = answers.rows(hits.triangle)
        at = np.flatnonzero(row >= 0)
        row = row[at]
        for i, k in zip(at[::40], row[::40], strict=True):
            exact = rational(tri[hits.triangle[i]], rays.origin[i], rays.direction[i])
            assert float(abs(Fraction(float(hits.t[i])) - exact[0])) <= answers.t_bound[k]
            assert float(abs(Fraction(float(hits.u[i])) - exact[1])) <= answers.u_bound[k]
            assert float(abs(Fraction(float(hits.v[i])) - exact[2])) <= answers.v_bound[k]
        worst_t = max(worst_t, float((np.abs(hits.t[at] - answers.t_float64[row]) / answers.t_bound[row]).max()))
        worst_u = max(worst_u, float((np.abs(hits.u[at] - answers.u[row]) / answers.u_bound[row]).max()))
    # A bound five times larger would fail here, one five times smaller too.
    assert 0.1 < worst_t < 0.5
    assert 0.1 < worst_u < 0.5


def test_well_conditioned_rays_have_one_answer():
    tri = cases.sphere(24, 40)
    rays = cases.camera(tri, 160, 160)
    answers = admissible(tri, rays)
    inner = (answers.closest >= 0) & (answers.conditioning < 10)
    assert inner.sum() > 10_000
    assert (answers.answers[inner] == 1).mean() >= 0.999
    row = answers.rows(answers.closest)[inner]
    ulps = answers.t_bound[row] / np.spacing(answers.t[inner].astype(np.float32))
    assert np.median(ulps) < 64
    assert np.median(answers.u_bound[row]) < 5e-4


@settings(max_examples=20, deadline=None)
@given(mesh=st.sampled_from(sorted(cases.MESHES)), kind=st.sampled_from(cases.RAYS), seed=st.integers(0, 2**32 - 1))
def test_margin_above_one_means_one_answer(mesh, kind, seed):
    rng = np.random.default_rng(seed)
    tri = cases.MESHES[mesh](rng)
    answers = admissible(tri, cases.rays(rng, tri, 64, kind), threads=1)
    assert np.array_equal(answers.margin > 1.0, answers.answers == 1)
    assert (answers.answers >= 1).all()


def test_bounds_grow_as_one_over_cosine_until_both_hit_and_miss_are_right():
    # Tilted: in a plane across an axis the componentwise bounds are small relative to n·d itself, and do not grow.
    tri = np.array([[[1, 0.1, 0.3], [0.2, 1, -0.1], [-0.3, 0.2, 1]]], np.float32)
    e1, e2 = tri[0, 1].astype(float) - tri[0, 0], tri[0, 2].astype(float) - tri[0, 0]
    n = np.cross(e1, e2) / np.linalg.norm(np.cross(e1, e2))
    along = (e1 + e2) / np.linalg.norm(e1 + e2)
    slope = 10.0 ** -np.arange(0.0, 9.0)
    d = cases.unit(along - slope[:, None] * n)
    target = tri[0, 0] + 0.3 * e1 + 0.3 * e2
    rays = Rays((target - 0.9 * d.astype(float)).astype(np.float32), d)
    answers = admissible(tri, rays)
    assert (np.diff(answers.offsets) == 1).all()
    growth = answers.t_bound[2:4] * slope[2:4]
    assert growth[1] == pytest.approx(growth[0], rel=0.2)
    assert not answers.miss[:4].any() and answers.miss[-2:].all()
    assert np.isinf(answers.t_bound[-1])
    assert answers.conditioning[0] == pytest.approx(np.sqrt(2), rel=1e-6)
