"""A pinhole camera that frames a scene: one ray through each pixel centre.

The camera looks at the centre of the bounding box from the direction ``view``; up is +y; pixel row 0 is the top.
Arithmetic is float64 and rounded to float32 at the end.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError
from refsim.scene.material import as_triple
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

__all__ = ["camera_frame", "camera_rays"]

MOST_RAYS = 2**28
# Below this sine of the angle between view and the y axis the horizon is undefined, and +x serves as right.
PARALLEL = 1e-6


def camera_rays(
    scene: Scene,
    width: int,
    height: int,
    view: ArrayLike = (0.3, 0.25, 1.0),
    fov: float = 40.0,
    fill: float = 1.0,
) -> Rays:
    """Rays of a width x height image of ``scene``: row-major, row 0 at the top, t_max inf, pixel centres at .5.

    view  from the centre of the bounding box towards the eye, any length but zero, world space
    fov   vertical angle of view, degrees, between 0 and 180
    fill  the eye stands at half-diagonal / sin(fov / 2) * fill from the centre: 1 shows the whole bounding sphere
          of the box, smaller values come closer

    Looking straight down or up, where +y gives no up, right is +x: the top of the picture is -z, or +z.
    ``InputError`` names the argument that is wrong.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene must be a refsim.Scene (refsim.load_scene makes one), not {type(scene).__name__}")
    pixels = _check_size(width, height)
    eye, right, up, forward = camera_frame(scene, view, fov, fill)
    half = math.tan(math.radians(fov) * 0.5)
    # Both axes share the pixel size of the vertical one; y falls with the row.
    x = ((np.arange(width) + 0.5) * 2.0 - width) / height * half
    y = (height - (np.arange(height) + 0.5) * 2.0) / height * half
    direction = forward + x[None, :, None] * right + y[:, None, None] * up
    direction /= np.sqrt((direction * direction).sum(axis=2, keepdims=True))
    return Rays.unchecked(
        np.tile(eye.astype(np.float32), (pixels, 1)),
        np.ascontiguousarray(direction.reshape(pixels, 3), dtype=np.float32),
        np.full(pixels, np.inf, np.float32),
        int(width),
        int(height),
    )


def camera_frame(
    scene: Scene, view: ArrayLike = (0.3, 0.25, 1.0), fov: float = 40.0, fill: float = 1.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Eye, right, up and forward, each float64[3], of the camera that ``camera_rays`` uses; arguments as there."""
    if not (_is_number(fov) and 0.0 < fov < 180.0):
        raise InputError(f"fov must be an angle in degrees between 0 and 180, not {fov!r}")
    if not (_is_number(fill) and math.isfinite(fill) and fill > 0.0):
        raise InputError(f"fill must be a finite number above 0, not {fill!r}")
    backward = np.array(as_triple(view, "view"))
    largest = np.abs(backward).max()
    if largest == 0.0:
        raise InputError("view must be a direction, not zero")
    backward /= largest  # no overflow or underflow in the length
    backward /= math.sqrt(float(backward @ backward))
    distance = 0.5 * scene.diagonal / math.sin(math.radians(fov) * 0.5) * fill
    eye = scene.center + distance * backward
    if not (np.abs(eye) <= np.finfo(np.float32).max).all():
        raise InputError(f"the camera of scene {scene.name!r} would stand outside the range of float32")
    forward = -backward
    across = math.hypot(backward[0], backward[2])
    right = np.array([backward[2], 0.0, -backward[0]]) / across if across > PARALLEL else np.array([1.0, 0.0, 0.0])
    up = np.cross(right, forward)
    return eye, right, up / math.sqrt(float(up @ up)), forward


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def _check_size(width: int, height: int) -> int:
    for name, value in (("width", width), ("height", height)):
        if not isinstance(value, (int, np.integer)) or isinstance(value, bool) or value < 1:
            raise InputError(f"{name} must be a whole number of pixels from 1, not {value!r}")
    pixels = int(width) * int(height)
    if pixels > MOST_RAYS:
        raise InputError(f"an image of {width} x {height} pixels is more than {MOST_RAYS} rays")
    return pixels
