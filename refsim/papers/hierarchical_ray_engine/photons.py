"""Light rays for the engine: photons from a light, spread evenly over the disc around what the light is aimed at.

"We start off with a texture of eye and light rays" (The Hierarchical Ray Engine, section 5). A photon is a ray that
carries energy (W); all photons of a light carry the same. They lie on a square grid whose neighbours are neighbours in
space, so that a tile's cone stays narrow; pixels outside the disc are dead. With a seed each photon lies anywhere in
its cell of the grid instead of in the middle, so that the grid does not show as a pattern on the receiver.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene.light import PointLight
from refsim.scene.material import as_triple
from refsim.scene.mesh import Scene
from refsim.scene.rays import Rays

Float64 = NDArray[np.float64]

# A texel counts its photons in float32, which is exact up to 2^24: as many as the largest grid has
LARGEST_GRID = 4096
# The disc is a little larger than what it is drawn around
MARGIN = 1.0 + 2.0**-10


@dataclass(frozen=True)
class ParallelLight:
    """The sun: rays of one direction.

    direction   in which the light travels, any length but zero
    color       linear RGB, 0 or more
    irradiance  factor on `color`: W/m² on a surface across the light

    `InputError` for any other value.
    """

    direction: tuple[float, float, float]
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    irradiance: float = 1.0

    def __post_init__(self) -> None:
        for name in ("direction", "color"):
            object.__setattr__(self, name, as_triple(getattr(self, name), f"{name} of a parallel light"))
        if not any(self.direction):
            raise InputError("direction of a parallel light must not be zero.")
        if min(self.color) < 0.0 or not (math.isfinite(self.irradiance) and self.irradiance >= 0.0):
            raise InputError("color and irradiance of a parallel light must be finite numbers from 0.")


Light = ParallelLight | PointLight


@dataclass(frozen=True, eq=False)
class Photons:
    """Light rays of a square grid, row-major; `energy` f64[3]: W a photon, RGB; `sent`: live ones."""

    rays: Rays
    energy: Float64
    sent: int


def around_ideal(scene: Scene) -> tuple[Float64, float]:
    """Centre and radius of the sphere around the scene's glass and mirrors; `InputError` where it has none."""
    ideal = scene.triangles[scene.optical_indices() >= 0].reshape(-1, 3).astype(np.float64)
    if not len(ideal):
        raise InputError(f"scene {scene.name!r} has no glass and no mirror to aim a light at.")
    centre = 0.5 * (ideal.min(axis=0) + ideal.max(axis=0))
    return centre, float(np.linalg.norm(ideal - centre, axis=1).max()) * MARGIN


def photons_of(
    light: Light, scene: Scene, aim: tuple[Float64, float], across: int, seed: int | None = 0
) -> Photons:
    """`across`² cells around the sphere `aim` (centre, radius), seen from the light; dead where outside its outline.

    Light is emitted over the square's disc: a `PointLight` sends `radiance` W/sr (its intensity times its colour) into
    the cone that touches the sphere, evenly by solid angle (Lambert's azimuthal equal-area map of the disc). Parallel
    light starts before everything in the scene.
    """
    if isinstance(across, bool) or not isinstance(across, int) or not 1 <= across <= LARGEST_GRID:
        raise InputError(f"photons_across is {across!r}; it must be a whole number from 1 to {LARGEST_GRID}.")
    x, y = _grid(across, seed)
    inside = x * x + y * y <= 1.0
    make = _parallel if isinstance(light, ParallelLight) else _from_point
    origin, direction, energy = make(light, scene, *aim, x, y)  # type: ignore[arg-type]
    direction[~inside] = 0.0
    rays = Rays(origin.astype(np.float32), direction.astype(np.float32), width=across, height=across)
    return Photons(rays, energy, int(inside.sum()))


def _grid(across: int, seed: int | None) -> tuple[Float64, Float64]:
    """Places in the square [−1, 1]², row by row."""
    within = np.full((2, across, across), 0.5)
    if seed is not None:
        within = np.random.default_rng(seed).random((2, across, across))
    cell = np.arange(across)
    x = (cell[None, :] + within[0]) / across * 2.0 - 1.0
    y = (cell[:, None] + within[1]) / across * 2.0 - 1.0
    return x.ravel(), y.ravel()


def _across(axis: Float64) -> tuple[Float64, Float64]:
    """Two unit vectors at right angles to a unit vector and to each other."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(other, axis)
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)


def _parallel(
    light: ParallelLight, scene: Scene, centre: Float64, radius: float, x: Float64, y: Float64
) -> tuple[Float64, Float64, Float64]:
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    u, v = _across(axis)
    behind = float(((scene.triangles.reshape(-1, 3) - centre) @ axis).min())
    start = min(behind, -radius) - 2.0**-6 * radius
    origin = centre + start * axis + radius * (x[:, None] * u + y[:, None] * v)
    cell = (2.0 * radius) ** 2 / len(x)
    return origin, np.tile(axis, (len(x), 1)), light.irradiance * cell * np.array(light.color)


def _from_point(
    light: PointLight, scene: Scene, centre: Float64, radius: float, x: Float64, y: Float64
) -> tuple[Float64, Float64, Float64]:
    place = np.array(light.position)
    distance = float(np.linalg.norm(centre - place))
    if distance <= radius:
        raise InputError("the light stands inside the sphere that it is aimed at; move it out, or aim at less.")
    axis = (centre - place) / distance
    u, v = _across(axis)
    rim = 2.0 * math.sin(0.5 * math.asin(radius / distance))
    reach = np.minimum(rim * np.hypot(x, y), 2.0)
    # Chord `reach` of the unit sphere belongs to the angle 2 asin(reach / 2)
    cosine = 1.0 - 0.5 * reach * reach
    lateral = rim * np.sqrt(1.0 - 0.25 * reach * reach)
    direction = cosine[:, None] * axis + lateral[:, None] * (x[:, None] * u + y[:, None] * v)
    cell = (2.0 * rim) ** 2 / len(x)
    return np.tile(place, (len(x), 1)), direction, cell * np.array(light.radiance)
