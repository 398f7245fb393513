"""Plan: the camera is recovered from its rays.

- Any pinhole's rays (turned, sheared, off centre, mirrored, partly dead, of narrow and wide angle) give back a camera
  whose directions are theirs; a ray bent by less than the bound passes, by more is refused by number.
- Rays that are no pinhole's are refused, each with its reason.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays.primary import MOST_RESIDUAL, first_triangles, pinhole
from refsim.scene import Rays, camera_rays, load_scene
from refsim.scene.camera import camera_frame
from tests.gsr.cameras import rays_of


def turned(seed: int) -> np.ndarray:
    """A random rotation, or a mirrored one."""
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]


def angles(camera, rays: Rays) -> np.ndarray:
    """Radians between the camera's and the given directions, of live rays."""
    fitted = rays_of(camera.eye, np.stack(camera[1:], axis=1), rays.width, rays.height)
    a, b = fitted.direction[rays.alive].astype(np.float64), rays.direction[rays.alive].astype(np.float64)
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32),
    st.integers(2, 48),
    st.integers(2, 48),
    st.floats(-5.0, 3.0),
    st.floats(0.3, 3.0),
    st.floats(-0.5, 0.5),
    st.floats(-1.0, 1.0),
    st.floats(0.0, 0.6),
)
def test_any_pinhole_is_recovered(seed, width, height, logarithm, aspect, shear, shift, share) -> None:
    opening = 10.0**logarithm  # the tangent of half the angle: from a thousandth of a degree to nearly 180 of them
    local = np.array([[1.0, shear, shift], [0.0, aspect, -shift], [0.0, 0.0, 1.0 / opening]])
    rng = np.random.default_rng(seed)
    dead = rng.random(width * height) < share
    dead[rng.permutation(width * height)[:4]] = False
    dead[[0, width - 1, -width, -1]] = False  # four corners are enough for any camera
    rays = rays_of(rng.normal(size=3), turned(seed) @ local, width, height, dead)
    camera = pinhole(rays)
    np.testing.assert_array_equal(camera.eye, rays.origin[0].astype(np.float64))
    assert abs(np.linalg.norm(camera.forward) - 1) < 1e-12
    assert angles(camera, rays).max() < 2.0**-21


@pytest.mark.parametrize("size", [(2, 2), (7, 5), (48, 36), (256, 256)])
def test_the_library_camera_is_recovered(size) -> None:
    scene = load_scene("torus_knot_128")
    camera = pinhole(camera_rays(scene, *size, (-0.5, 0.4, 0.7), 50.0, 0.8))
    eye, right, up, forward = camera_frame(scene, (-0.5, 0.4, 0.7), 50.0, 0.8)
    half = math.tan(math.radians(25.0))
    wanted = (eye, right * half * size[0] / size[1], up * half, forward)
    for found, vector in zip(camera, wanted, strict=True):
        np.testing.assert_allclose(found, vector, atol=4e-7)


def bent(rays: Rays, pixel: int, angle: float) -> Rays:
    """One ray turned by an angle."""
    direction = rays.direction.astype(np.float64)
    across = np.cross(direction[pixel], (0.6, -0.64, 0.48))
    direction[pixel] += math.tan(angle) * across / np.linalg.norm(across)
    direction[pixel] /= np.linalg.norm(direction[pixel])
    return Rays(rays.origin, direction, rays.t_max, rays.width, rays.height)


@given(st.integers(0, 40 * 30 - 1))
@settings(max_examples=15, deadline=None)
def test_a_bent_ray_is_named(pixel: int) -> None:
    rays = camera_rays(load_scene("room"), 40, 30)
    pinhole(bent(rays, pixel, 0.5 * MOST_RESIDUAL))
    # Far from the others it draws the fit after it, but not by half.
    with pytest.raises(InputError, match=f"ray {pixel} is .* radians off the camera that fits best"):
        pinhole(bent(rays, pixel, 2.5 * MOST_RESIDUAL))


def fish_eye() -> Rays:
    x, y = np.meshgrid(np.linspace(-1, 1, 8), np.linspace(1, -1, 8))
    direction = np.stack([np.sin(x) * np.cos(y), np.sin(y), -np.cos(x) * np.cos(y)], axis=-1).reshape(-1, 3)
    return Rays(np.zeros((64, 3)), direction, np.inf, 8, 8)


def parallel() -> Rays:
    return Rays(np.zeros((64, 3)), np.tile([0.0, 0.0, -1.0], (64, 1)), np.inf, 8, 8)


def shifted() -> Rays:
    rays = camera_rays(load_scene("room"), 8, 8)
    origin = rays.origin.copy()
    origin[37, 1] = np.nextafter(origin[37, 1], np.float32(9))
    return Rays(origin, rays.direction, rays.t_max, 8, 8)


def only_alive(pixels) -> Rays:
    dead = np.ones(64, bool)
    dead[pixels] = False
    return rays_of((0, 0, 0), np.diag([1.0, 1.0, -1.0]), 8, 8, dead)


def turned_round() -> Rays:
    rays = camera_rays(load_scene("room"), 8, 8)
    direction = rays.direction.copy()
    direction[20] = -direction[20]
    return Rays(rays.origin, direction, rays.t_max, 8, 8)


REFUSED = {
    "control": (lambda: only_alive([0, 7, 56, 63]), None),
    "control, opposite corner of a small picture": (lambda: rays_of((1, 2, 3), -np.eye(3), 2, 2), None),
    "no size": (lambda: camera_rays(load_scene("room"), 8, 8)[:], "these have no width and height"),
    "a row": (lambda: camera_rays(load_scene("room"), 8, 1), "8 × 1 pixels do not tell its axes"),
    "a column": (lambda: camera_rays(load_scene("room"), 1, 8), "1 × 8 pixels do not tell its axes"),
    "dead": (lambda: only_alive([]), "all of these are dead"),
    "in a line": (lambda: only_alive(np.arange(0, 64, 9)), "too few, or in a line"),
    "three": (lambda: only_alive([0, 7, 56]), "too few, or in a line"),
    "parallel": (parallel, "all but parallel"),
    "fish eye": (fish_eye, "radians off the camera that fits best, and 9.5e-07 is allowed"),
    "another origin": (shifted, "ray 37 does not start where ray 0 does"),
    "a ray that looks back": (turned_round, "ray 20 is 3.1 radians off"),
}


@pytest.mark.parametrize("row", REFUSED)
def test_other_rays_are_refused(row: str) -> None:
    make, message = REFUSED[row]
    if message is None:
        pinhole(make())
        return
    with pytest.raises(InputError, match=message):
        first_triangles(load_scene("room"), make(), Counters())
