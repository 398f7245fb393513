"""Environments: the light that a ray sees when it leaves the scene, a function of its direction alone.

``lookup`` takes unit directions float32[n, 3] in world space (y up) and gives linear RGB float32[n, 3]. A zero
direction, that of a dead ray, sees black. ``CHECKER`` is the default of methods that are given none.
"""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError
from refsim.scene.material import as_triple

__all__ = ["CHECKER", "SKY", "Checker", "Environment", "Equirectangular", "Sky", "Uniform", "load_environment"]

Float32 = NDArray[np.float32]
Triple = tuple[float, float, float]


class Environment(ABC):
    """Radiance by direction; a subclass gives ``radiance``."""

    def lookup(self, directions: ArrayLike) -> Float32:
        """Linear RGB float32[n, 3] seen in ``directions`` [n, 3], unit, world space; black for a zero direction."""
        direction = np.ascontiguousarray(directions, dtype=np.float32)
        if direction.ndim != 2 or direction.shape[1] != 3:
            raise InputError(f"directions must have shape [n, 3], not {list(direction.shape)}")
        x, y, z = np.ascontiguousarray(direction.T)
        rgb = self.radiance(x, y, z)
        dead = (x == 0.0) & (y == 0.0) & (z == 0.0)
        if dead.any():
            rgb[dead] = 0.0
        return rgb

    @abstractmethod
    def radiance(self, x: Float32, y: Float32, z: Float32) -> Float32:
        """Linear RGB float32[n, 3] for components float32[n] of unit directions, in a fresh array."""


@dataclass(frozen=True)
class Uniform(Environment):
    """The same ``color``, linear RGB, in all directions."""

    color: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "color", as_triple(self.color, "color of the environment"))

    def radiance(self, x: Float32, y: Float32, z: Float32) -> Float32:
        """``color`` in every row."""
        return np.tile(np.array(self.color, np.float32), (len(x), 1))


@dataclass(frozen=True)
class Sky(Environment):
    """A clear sky: ``horizon`` to ``zenith`` with a soft sun, over plain ``ground``.

    sun        towards the sun, any length but zero
    sun_color  added in the sun's middle; its glow falls off with the 256th power of the cosine. Zero: no sun
    """

    horizon: Triple = (0.85, 0.92, 1.0)
    zenith: Triple = (0.16, 0.34, 0.72)
    ground: Triple = (0.32, 0.29, 0.26)
    sun: Triple = (0.5, 0.6, 0.62)
    sun_color: Triple = (2.0, 1.8, 1.4)

    def __post_init__(self) -> None:
        for name in ("horizon", "zenith", "ground", "sun", "sun_color"):
            object.__setattr__(self, name, as_triple(getattr(self, name), f"{name} of the sky"))
        if not any(self.sun):
            raise InputError("sun of the sky must be a direction, not zero")

    def radiance(self, x: Float32, y: Float32, z: Float32) -> Float32:
        """The sky above the horizon; below it the horizon fades into the ground within a few degrees."""
        rise = np.sqrt(np.maximum(y, np.float32(0.0)))
        rgb = _mix(self.horizon, self.zenith, rise)
        below = y < 0.0
        if below.any():
            rgb[below] = _mix(self.horizon, self.ground, np.minimum(y[below] * np.float32(-8.0), np.float32(1.0)))
        if any(self.sun_color):
            rgb += self._sun(x, y, z)[:, None] * np.array(self.sun_color, np.float32)
        return rgb

    def _sun(self, x: Float32, y: Float32, z: Float32) -> Float32:
        length = math.hypot(*self.sun)
        sx, sy, sz = (np.float32(component / length) for component in self.sun)
        glow = np.maximum(x * sx + y * sy + z * sz, np.float32(0.0))
        for _ in range(8):  # the 256th power by squaring
            glow *= glow
        return np.where(y >= 0.0, glow, np.float32(0.0))


@dataclass(frozen=True)
class Checker(Environment):
    """A checkered floor under a sky, the floor at infinity: it looks the same from everywhere.

    tile        edge of a square, in units of the eye's height over the floor, above 0
    light, dark linear RGB of the squares; towards the horizon they fade into its colour, so that no moire is left
    """

    tile: float = 0.75
    light: Triple = (0.78, 0.74, 0.66)
    dark: Triple = (0.12, 0.10, 0.11)
    sky: Sky = field(default_factory=Sky)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tile) and self.tile > 0.0):
            raise InputError(f"tile of the checker must be a finite number above 0, not {self.tile!r}")
        for name in ("light", "dark"):
            object.__setattr__(self, name, as_triple(getattr(self, name), f"{name} of the checker"))

    def radiance(self, x: Float32, y: Float32, z: Float32) -> Float32:
        """The sky's radiance above the horizon, that of the floor below."""
        rgb = self.sky.radiance(x, y, z)
        below = np.flatnonzero(y < 0.0)
        if len(below) == 0:
            return rgb
        down = -y[below]
        # Where the direction meets a floor one unit below the eye. Near the horizon that is far away, and the square
        # does not matter: it has faded. The clip keeps it within what int32 holds.
        steps = np.float32(1.0 / self.tile) / np.maximum(down, np.float32(1e-6))
        odd = (np.floor(x[below] * steps).astype(np.int32) + np.floor(z[below] * steps).astype(np.int32)) & 1
        floor = np.array([self.light, self.dark], np.float32)[odd]
        distinct = np.clip((down - np.float32(0.02)) * np.float32(5.0), np.float32(0.0), np.float32(1.0))
        horizon = np.array(self.sky.horizon, np.float32)
        rgb[below] = horizon + (floor - horizon) * distinct[:, None]
        return rgb


@dataclass(frozen=True, eq=False)
class Equirectangular(Environment):
    """A picture of all directions, ``image`` float32[h, w, 3], linear RGB.

    Columns are longitude: the middle of the picture is -z, a quarter further right +x, both edges +z. Rows are
    latitude: the top edge is +y. Bilinear between pixel centres; wraps around in longitude, stops at the first and
    last row.
    """

    image: Float32
    name: str = "image"

    def __post_init__(self) -> None:
        try:
            image = np.ascontiguousarray(self.image, dtype=np.float32)
        except (TypeError, ValueError):
            image = np.zeros(0, np.float32)
        if image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
            raise InputError(f"environment {self.name!r} must have shape [h, w, 3], not {list(np.shape(self.image))}")
        if not np.isfinite(image).all() or float(image.min()) < 0.0:
            raise InputError(f"environment {self.name!r} has a pixel that is negative or not finite")
        object.__setattr__(self, "image", image)

    def radiance(self, x: Float32, y: Float32, z: Float32) -> Float32:
        """The four nearest pixels, weighted."""
        height, width = self.image.shape[:2]
        # Arc tangents in float64, rounded once: those of float32 have other bits on other processors
        around = np.arctan2(x, -z, dtype=np.float64).astype(np.float32)
        column = (around * np.float32(0.5 / math.pi) + np.float32(0.5)) * np.float32(width) - np.float32(0.5)
        # arctan2 keeps its accuracy at the poles, where an arc cosine of y would not.
        polar = np.arctan2(np.sqrt(x * x + z * z), y, dtype=np.float64).astype(np.float32)
        row = polar * np.float32(height / math.pi) - np.float32(0.5)
        row = np.clip(row, np.float32(0.0), np.float32(height - 1))
        left, top = np.floor(column), np.floor(row)
        across, down = (column - left)[:, None], (row - top)[:, None]
        i0 = top.astype(np.intp)
        i1 = np.minimum(i0 + 1, height - 1)
        j0 = left.astype(np.intp) % width
        j1 = (j0 + 1) % width
        pixels = self.image.reshape(-1, 3)
        upper = _lerp(pixels[i0 * width + j0], pixels[i0 * width + j1], across)
        lower = _lerp(pixels[i1 * width + j0], pixels[i1 * width + j1], across)
        return _lerp(upper, lower, down)


SKY = Sky()
CHECKER = Checker()
NAMED: dict[str, Environment] = {
    "checker": CHECKER,
    "sky": SKY,
    "black": Uniform(),
    "white": Uniform((1.0, 1.0, 1.0)),
}


def load_environment(source: str | os.PathLike[str]) -> Environment:
    """The environment "checker", "sky", "black" or "white", or the equirectangular picture in a file.

    .npy (float [h, w, 3]) and .hdr (Radiance) are taken as linear; what Pillow reads (PNG, JPEG, TIFF, …) as sRGB.
    ``InputError`` names a file that is missing or no such picture.
    """
    if isinstance(source, str) and source in NAMED:
        return NAMED[source]
    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"an environment is a name or a path, not a {type(source).__name__}")
    if isinstance(source, str) and not any(mark in source for mark in (os.sep, "/", ".")):
        raise InputError(f"unknown environment {source!r}: it is {', '.join(NAMED)}, or the path of a picture")
    from refsim.scene.environment_file import read_environment_image

    path = Path(os.fspath(source))
    return Equirectangular(read_environment_image(path), str(path))


def _mix(start: Triple, end: Triple, weight: Float32) -> Float32:
    first = np.array(start, np.float32)
    return first + (np.array(end, np.float32) - first) * weight[:, None]


def _lerp(start: Float32, end: Float32, weight: Float32) -> Float32:
    return start + (end - start) * weight
