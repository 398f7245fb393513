"""The next ray: reflection, refraction, total internal reflection, the end of a path, and the offset.

Plan
- Device and NumPy give the same bits in every case, shading normals apart from geometric ones included.
- Reflection: the angle out is the angle in, in one plane with the normal. Refraction: Snell's law holds to float32;
  direction in the plane.
- Total internal reflection exactly where Snell's law has no solution.
- Directions are unit; the origin is the hit point moved by epsilon along the geometric normal, to the side that the
  ray travels to.
- In and out through a parallel plate leaves the direction as it was.
- Tables: normal incidence, grazing, diffuse, index 1, and the directions by hand.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.reference import optics as reference
from tests.geometry.cone_bundles import unit
from tests.geometry.device_loops import next_rays

UP = np.array([[0.0, 0.0, 1.0]], np.float32)
EPSILON = np.float32(2.0**-10)


def one(d, ior, n=UP, shading=None):
    """A ray that hits the origin of coordinates from 1 away along d: (origin, direction, kind, alive)."""
    d = unit(np.array([d])).astype(np.float32)
    shading = n if shading is None else shading
    out = next_rays(-d, d, np.ones(1, np.float32), n, shading, np.array([ior], np.float32), EPSILON)
    return tuple(x[0] for x in out)


@pytest.mark.parametrize("smooth", [False, True])
def test_device_and_numpy_agree_bit_for_bit(smooth):
    rng = np.random.default_rng(2)
    n = 50000
    o, d, normal = (rng.normal(size=(n, 3)) for _ in range(3))
    d, normal = unit(d).astype(np.float32), unit(normal).astype(np.float32)
    shading = unit(normal + 0.2 * rng.normal(size=(n, 3))).astype(np.float32) if smooth else normal
    ior = rng.choice([0.0, -1.0, 1.0, 1.5, 2.4, 0.7], n).astype(np.float32)
    arguments = o.astype(np.float32), d, rng.uniform(0, 9, n).astype(np.float32), normal, shading, ior, EPSILON
    two = reference.next_ray(*arguments)
    for a, b in zip(next_rays(*arguments), two, strict=True):
        assert np.array_equal(a, b) and a.dtype == b.dtype
    assert {int(k) for k in two[2]} == {0, 2, 3}


angle = st.floats(0.0, np.pi / 2 - 1e-3)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(angle, st.floats(0, 2 * np.pi), st.sampled_from([1.0, -1.0]), st.floats(0.3, 3.0))
def test_the_laws(incidence, azimuth, side, ior):
    d = np.array([np.sin(incidence) * np.cos(azimuth), np.sin(incidence) * np.sin(azimuth), -side * np.cos(incidence)])
    ior = float(np.float32(ior))
    sine_out = np.sin(incidence) * (1 / ior if side > 0 else ior)           # Snell's law
    origin, r, kind, alive = one(d, ior)
    assert alive and abs(np.linalg.norm(r.astype(np.float64)) - 1) < 2.0**-22
    if abs(sine_out - 1) > 1e-5:
        assert kind == (2 if sine_out > 1 else 3)
    sine = np.hypot(r[0], r[1])
    if kind == 3:
        assert abs(sine - sine_out) < 1e-6 and r[2] * d[2] > -1e-6
    else:
        assert abs(sine - np.sin(incidence)) < 1e-6 and abs(r[2] + d[2]) < 1e-6
    if np.sin(incidence) > 1e-3:                                            # in the plane of incidence, going on
        assert abs(r[0] * np.sin(azimuth) - r[1] * np.cos(azimuth)) < 1e-6
        assert r[0] * np.cos(azimuth) + r[1] * np.sin(azimuth) > -1e-6
    if abs(r[2]) > 1e-6:
        assert np.sign(origin[2]) == np.sign(r[2])
    assert abs(abs(origin[2]) - EPSILON) < 1e-6


@settings(max_examples=50, deadline=None, derandomize=True, database=None)
@given(angle, st.floats(1.1, 2.5))
def test_a_plate_leaves_the_direction(incidence, ior):
    d = np.array([np.sin(incidence), 0.0, -np.cos(incidence)])
    _, inside, kind_in, _ = one(d, ior)
    _, out, kind_out, _ = one(inside, ior, n=-UP)                       # the far side's normal points out of the plate
    assert kind_in == kind_out == 3
    assert np.abs(out - d).max() < 2e-6 / max(np.cos(incidence), 1e-3)      # near grazing the cosine amplifies


def test_shading_normal_turns_the_ray_and_geometric_normal_moves_it():
    shading = unit(np.array([[1.0, 0.0, 1.0]])).astype(np.float32)
    origin, r, kind, _ = one((0, 0, -1), 0.0, shading=shading)
    assert kind == 2 and np.allclose(r, (1, 0, 0), atol=1e-6)
    assert origin[0] == 0 and origin[1] == 0 and abs(origin[2]) == EPSILON
    # A mirror direction below the surface is offset to below it.
    shading = unit(np.array([[-0.3, 0.0, -1.0]])).astype(np.float32)
    origin, r, _, _ = one((1, 0, -0.2), 0.0, shading=shading)
    assert np.sign(origin[2]) == np.sign(r[2])


@pytest.mark.parametrize(
    ("name", "d", "ior", "kind", "direction"),
    [
        ("control: straight into glass", (0, 0, -1), 1.5, 3, (0, 0, -1)),
        ("straight out of glass", (0, 0, 1), 1.5, 3, (0, 0, 1)),
        ("index 1 does nothing", (0.6, 0, -0.8), 1.0, 3, (0.6, 0, -0.8)),
        ("mirror", (0.6, 0, -0.8), 0.0, 2, (0.6, 0, 0.8)),
        ("mirror from behind", (0.6, 0, 0.8), 0.0, 2, (0.6, 0, -0.8)),
        ("total internal reflection", (0.8, 0, 0.6), 1.5, 2, (0.8, 0, -0.6)),
        ("into glass, sine 0.6 to 0.4", (0.6, 0, -0.8), 1.5, 3, (0.4, 0, -(0.84**0.5))),
        ("out of glass, sine 0.4 to 0.6", (0.4, 0, 0.84**0.5), 1.5, 3, (0.6, 0, 0.8)),
        ("diffuse ends", (0.6, 0, -0.8), -1.0, 0, (0, 0, 0)),
    ],
)
def test_by_hand(name, d, ior, kind, direction):
    _, r, got, alive = one(d, ior)
    assert got == kind and alive == (kind != 0), name
    assert np.allclose(r, direction, atol=3e-7), name
