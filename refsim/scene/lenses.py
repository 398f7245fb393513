"""Cameras that are no pinhole, one ray a pixel: a thin lens with depth of field, and a fisheye.

"Casting primary rays can be a good way to produce depth of field and fish eye effects" (Toczek, Houzet, Mancini 2010,
section 3.2). Both stand and look as `camera_rays` does; arithmetic is float64 and rounded to float32 at the end.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError
from refsim.scene.camera import camera_frame, camera_rays
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

__all__ = ["fisheye_rays", "thin_lens_rays"]


def thin_lens_rays(
    scene: Scene,
    width: int,
    height: int,
    view: ArrayLike = (0.3, 0.25, 1.0),
    fov: float = 40.0,
    fill: float = 1.0,
    *,
    aperture: float = 0.05,
    focus: float | None = None,
    seed: int = 0,
) -> Rays:
    """Rays from points of a lens through the points where the pinhole's rays meet the plane of focus.

    aperture  radius of the lens in diagonals of the scene's box; 0 is the pinhole
    focus     distance of the plane of focus from the lens, scene units; None: the centre of the box is sharp
    seed      of the points on the lens, evenly spread over its disc, one a ray: average pictures of several seeds

    The other arguments are those of ``camera_rays``; ``InputError`` names the one that is wrong.
    """
    pinhole = camera_rays(scene, width, height, view, fov, fill)
    eye, right, up, forward = camera_frame(scene, view, fov, fill)
    _check_number(aperture, "aperture", 0.0, "a radius in diagonals, zero or more")
    distance = float((scene.center - eye) @ forward) if focus is None else focus
    _check_number(distance, "focus", math.ulp(0.0), "a distance above 0")
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"seed must be a whole number from 0, not {seed!r}")
    generator = np.random.default_rng(int(seed))
    radius = float(aperture) * scene.diagonal * np.sqrt(generator.random(len(pinhole)))
    angle = 2.0 * math.pi * generator.random(len(pinhole))
    lens = (radius * np.cos(angle))[:, None] * right + (radius * np.sin(angle))[:, None] * up
    direction = pinhole.direction.astype(np.float64)
    sharp = direction * (distance / (direction @ forward))[:, None]
    return _image(eye + lens, sharp - lens, width, height, scene)


def fisheye_rays(
    scene: Scene,
    width: int,
    height: int,
    view: ArrayLike = (0.3, 0.25, 1.0),
    fov: float = 180.0,
    distance: float = 0.75,
) -> Rays:
    """Rays whose angle to the axis grows with the distance from the middle of the picture.

    fov       angle of view across the circle that the shorter side holds, degrees, above 0 and at most 360; the rays of
              pixels outside the circle are dead
    distance  of the eye from the centre of the scene's box, in diagonals; 0 stands in the middle

    The other arguments are those of ``camera_rays``; ``InputError`` names the one that is wrong.
    """
    camera_rays(scene, width, height, view)  # the checks
    _, right, up, forward = camera_frame(scene, view)
    if isinstance(fov, bool) or not isinstance(fov, int | float | np.integer | np.floating) or not 0.0 < fov <= 360.0:
        raise InputError(f"fov must be an angle in degrees above 0 and at most 360, not {fov!r}")
    _check_number(distance, "distance", 0.0, "a number of diagonals, zero or more")
    x = (np.arange(width) + 0.5) * 2.0 - width
    y = height - (np.arange(height) + 0.5) * 2.0
    x, y = (part.ravel() / min(width, height) for part in np.broadcast_arrays(x[None, :], y[:, None]))
    radius = np.hypot(x, y)
    theta = radius * math.radians(float(fov)) / 2.0
    across = np.where(radius > 0.0, np.sin(theta) / np.where(radius > 0.0, radius, 1.0), 0.0)
    direction = np.cos(theta)[:, None] * forward + (across * x)[:, None] * right + (across * y)[:, None] * up
    direction[radius > 1.0] = 0.0
    eye = scene.center - float(distance) * scene.diagonal * forward
    return _image(np.broadcast_to(eye, direction.shape), direction, width, height, scene)


def _image(
    origin: NDArray[np.float64], direction: NDArray[np.float64], width: int, height: int, scene: Scene
) -> Rays:
    """Rays of an image, directions normalised, those without one dead."""
    if not (np.abs(origin) <= np.finfo(np.float32).max).all():
        raise InputError(f"the camera of scene {scene.name!r} would stand outside the range of float32")
    length = np.sqrt((direction * direction).sum(axis=1, keepdims=True))
    unit = direction / np.where(length > 0.0, length, 1.0)
    return Rays(origin.astype(np.float32), unit.astype(np.float32), width=int(width), height=int(height))


def _check_number(value: object, name: str, least: float, meaning: str) -> None:
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if not (number and math.isfinite(float(value)) and float(value) >= least):  # type: ignore[arg-type]
        raise InputError(f"{name} must be {meaning}, not {value!r}")
