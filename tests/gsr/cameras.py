"""Pinholes: rays made from a camera's matrix, and pictures seen through the library's camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from refsim.scene import Rays, Scene, camera_rays
from refsim.scene.camera import camera_frame

# A corner moves by half a step of the sub-pixel grid along each axis.
HALF_STEP = 1 / 512
# float32 rounds directions, positions and the products of either test, 16 times at most one upon the other.
ROUNDINGS = 16 * 2.0**-24


def rays_of(eye, matrix: np.ndarray, width: int, height: int, dead: np.ndarray | None = None) -> Rays:
    """Rays through pixel centres along matrix @ (x, y, 1), made in float64."""
    x = (2 * np.arange(width) + 1) / width - 1
    y = 1 - (2 * np.arange(height) + 1) / height
    ndc = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1).reshape(-1, 3)
    direction = ndc @ matrix.T
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    if dead is not None:
        direction[dead] = 0.0
    return Rays(np.tile(np.float32(eye), (width * height, 1)), direction, np.inf, width, height)


class View(NamedTuple):
    """Scene, picture size, camera arguments; mirrored: columns run from right to left."""

    scene: Scene
    size: tuple[int, int]
    camera: tuple = ((0.3, 0.25, 1.0), 40.0, 0.55)
    mirrored: bool = False

    def rays(self) -> Rays:
        rays = camera_rays(self.scene, *self.size, *self.camera)
        if not self.mirrored:
            return rays
        order = np.arange(len(rays)).reshape(self.size[::-1])[:, ::-1].ravel()
        return Rays(rays.origin, rays.direction[order], rays.t_max, *self.size)

    def matrix(self) -> tuple[np.ndarray, np.ndarray]:
        """Eye, and the matrix whose columns are what one pixel to the right, one down, and pixel (0, 0)'s corner add
        up to a direction."""
        eye, right, up, forward = camera_frame(self.scene, *self.camera)
        half = math.tan(math.radians(self.camera[1]) / 2)
        step = 2 * half / self.size[1]
        right = -right if self.mirrored else right
        corner = forward - right * step * self.size[0] / 2 + up * half
        return eye, np.stack([right * step, -up * step, corner], axis=1)

    def slack(self) -> float:
        """Pixels by which a border may be off: the grid's half step, and roundings over the angle of a pixel."""
        # A pixel's least angle is that in a corner of the picture.
        half = math.tan(math.radians(self.camera[1]) / 2)
        corner = 1 + half * half * (1 + (self.size[0] / self.size[1]) ** 2)
        return HALF_STEP + ROUNDINGS * corner / (2 * half / self.size[1])
