"""A ball's caustic lies where Snell's law puts it.

Plan
- The formulas agree with each other: paraxial, Snell's law, energy.
- Parallel light on a ball of glass: every photon lands where the formula says, to what the mesh's facets allow, which
  falls as 1/triangles with the ball's own normals, and as their root with geometric ones.
- Focal length, ring, and energy within a radius are the formula's too.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from refsim.experiments.hre_caustics import ball_caustic, ball_of, deepest_facet, heights_and_places
from refsim.reference import caustics as exact


def test_formulas_agree() -> None:
    for index, radius in ((1.5, 1.0), (1.33, 2.0), (1.9, 0.5)):
        focus = exact.focal_length(index, radius)
        ball = exact.Ball(radius, radius, 0.0, index)
        for z in (1.1 * radius, focus, 3.0 * focus):
            # Third-order terms are about (h / R)²
            slope = float(exact.height_on_plane(np.array(1e-4 * radius), z, ball)) / (1e-4 * radius)
            assert slope == pytest.approx(1.0 - z / focus, abs=1e-6)
        # Light that falls on the inner part of the ball arrives, all of it
        edges = np.linspace(0.0, 0.5 * radius, 9)
        z = 1.05 * focus
        energy = exact.irradiance_profile(edges, z, index, radius) @ (edges[1:] ** 2 - edges[:-1] ** 2)
        h = radius * np.linspace(0.0, 1.0, 200_001)
        reach = h[np.abs(exact.height_on_plane(h, z, ball)) <= edges[-1]].max()
        assert energy == pytest.approx(reach**2, rel=1e-4)
    assert exact.ring_radius(1.5) == 0.0
    # The fold: at the largest rho two heights meet
    rho = exact.height_on_plane(np.linspace(0.0, 0.9, 100_001), 1.2)
    assert exact.ring_radius(1.2) == pytest.approx(rho.max(), abs=1e-9) and 0.0 < rho.argmax() < 90_000


PLANES = (1.2, 2.0, 3.0)
MESHES = (224, 896, 3584)


@cache
def allowance(mesh: int, plane: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of photons that fall within 0.8 R: height, height on the plane, and how far the mesh lets it be off.

    A facet lies up to s inside the sphere, its interpolated normal is the sphere's: light goes in and out of spheres of
    radius 1 − s to 1. New rays start off the facet along *its* normal, which is tilted against the sphere's by at most
    acos(1 − s): that moves them sideways by offset · sin, and the place by that times the lever of either surface.
    """
    body = ball_of(f"sphere_{mesh}")
    height, place = heights_and_places(ball_caustic(body.name, "smooth", plane, 96))
    inner = height < 0.8
    height, place = height[inner], place[inner]
    s, offset = deepest_facet(body), float(body.epsilon)
    middle = exact.height_on_plane(height, plane, exact.Ball(offset=offset))
    balls = [exact.Ball(1.0 - i * s, 1.0 - o * s, offset) for i in (0, 1) for o in (0, 1)]
    corners = [exact.height_on_plane(height, plane, ball) for ball in balls]
    spread = np.abs(np.array(corners) - middle).max(axis=0)
    angle, _ = exact.bent_ray(height, exact.Ball())
    lever = (plane + 1.0) / np.cos(angle) ** 2 * 1.5 / np.sqrt(1.0 - height**2) + 2.5 / np.cos(angle)
    slip = offset * math.sin(math.acos(1.0 - s))
    return height, place, spread + slip * lever + 1e-5


@pytest.mark.parametrize("plane", PLANES)
def test_photons_land_where_snell_says(plane: float) -> None:
    worst = []
    for mesh in MESHES:
        height, place, allowed = allowance(mesh, plane)
        offset = float(ball_of(f"sphere_{mesh}").epsilon)
        off = np.abs(place - exact.height_on_plane(height, plane, exact.Ball(offset=offset)))
        assert len(height) > 3000 and np.all(off <= allowed), mesh
        worst.append((float(allowed.max()), float(np.sqrt((off**2).mean()))))
    # Four times the triangles, a quarter of the facets' depth
    for (wide, rms), (narrow, next_rms) in pairwise(worst):
        assert narrow < 0.4 * wide and next_rms < 0.45 * rms


def test_geometric_normals_err_by_the_facets_tilt() -> None:
    errors = []
    for mesh in MESHES:
        height, place = heights_and_places(ball_caustic(f"sphere_{mesh}", "geometric", 2.0, 96))
        inner = height < 0.8
        off = place[inner] - exact.height_on_plane(height[inner], 2.0)
        errors.append(float(np.sqrt((off**2).mean())))
    ratios = [a / b for a, b in pairwise(errors)]
    # Tilt halves with four times the triangles; facets of a globe are not all alike
    assert all(1.5 < ratio < 3.0 for ratio in ratios)
    _, place, allowed = allowance(MESHES[-1], 2.0)
    assert errors[-1] > 2.0 * float(np.sqrt((allowed**2).mean()))


def test_focal_length_and_ring() -> None:
    """Near the axis photons cross at n R / (2 (n − 1)), and before that pile up in a ring, both to what the facets
    allow."""
    for plane in PLANES:
        height, place, allowed = allowance(MESHES[-1], plane)
        near = height < 0.15
        h, weight = height[near], (height[near] ** 2).sum()
        slope, may_be_off = (place[near] @ h) / weight, (allowed[near] @ h) / weight
        # Spherical aberration of the heights used, from the formula
        aberration = abs((exact.height_on_plane(h, plane) @ h) / weight - (1.0 - plane / 1.5))
        offset = float(ball_of("sphere_3584").epsilon)
        started = exact.height_on_plane(h, plane, exact.Ball(offset=offset)) - exact.height_on_plane(h, plane)
        off = abs(slope - (1.0 - plane / exact.focal_length(1.5)))
        assert off <= may_be_off + aberration + abs(started @ h) / weight
        assert aberration < 0.02 and may_be_off < 0.05
    height, place, allowed = allowance(MESHES[-1], 1.2)
    ring, largest = exact.ring_radius(1.2), int(place.argmax())
    # Photons 1/48 R apart: the fold is flat, so that the nearest is within 2 · spacing² of it
    assert abs(place[largest] - ring) <= allowed[largest] + 2.0 / 48.0**2 + 2.0 * float(ball_of("sphere_3584").epsilon)


@pytest.mark.parametrize(("plane", "radius"), [(1.5, 0.15), (2.0, 0.3), (2.0, 0.6), (3.0, 0.3), (3.0, 0.6)])
def test_energy_within_a_radius(plane: float, radius: float) -> None:
    """Photons within a radius of the receiver carry the light of the heights that the formula sends there."""
    found = ball_caustic("sphere_3584", "smooth", plane, 96)
    place = found.point[(found.generation == 2) & (found.triangle >= 0)].astype(np.float64)
    inside = int((np.hypot(place[:, 0], place[:, 2]) < radius).sum())
    h = np.linspace(0.0, 0.8, 80_001)
    rho = exact.height_on_plane(h, plane)
    edge = float(h[np.abs(rho) < radius].max())
    steep = abs(float(np.interp(edge, h, np.gradient(rho, h))))
    assert edge < 0.79
    height, _, allowed = allowance(3584, plane)
    near = float(np.interp(edge, np.sort(height), allowed[np.argsort(height)]))
    cell = float(found.light.energy[0])
    # The circle cuts cells, and facets and offset move the photons near it
    cut = 8.0 * edge / math.sqrt(cell) * cell
    moved = 2.0 * math.pi * edge * (near + 3.0 * float(ball_of("sphere_3584").epsilon)) / steep
    assert abs(inside * cell - math.pi * edge**2) <= cut + moved
    assert cut + moved < 0.35 * math.pi * edge**2
