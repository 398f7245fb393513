"""Where light goes that a ball of glass bends, in float64: the paraxial formula, and Snell's law at both surfaces.

Parallel light along +z falls on a ball of radius R about the origin. A ray at height h (distance from the axis) is bent
twice by the same angle and meets the plane at z > R at height

    rho(h) = (h − z sin δ) / cos δ,    δ = 2 (asin(h / R) − asin(h / (n R))),

negative where it has crossed the axis. Near the axis that is h (1 − z / f) with f = n R / (2 (n − 1)), the ball lens's
focal length from its centre. Between ball and focus rho has a largest value: rays pile up there in a ring, the fold of
the caustic. Also the light map in NumPy: photons added up in their texels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]


class Ball(NamedTuple):
    """A ball as the engine has it.

    `entry`, `exit`: radii where light goes in and comes out (a mesh's facets lie a little inside the sphere, with the
    sphere's normals where these are interpolated); `offset`: how far off the surface, along the normal, the engine
    starts a new ray. All in units of length; (R, R, 0) is the ball of the formulas.
    """

    entry: Float64 | float = 1.0
    exit: Float64 | float = 1.0
    offset: float = 0.0
    ior: float = 1.5


def focal_length(index: float, radius: float = 1.0) -> float:
    """Of a ball lens, from its centre, for rays near the axis."""
    return index * radius / (2.0 * (index - 1.0))


def bent_ray(h: Float64, ball: Ball) -> tuple[Float64, Float64]:
    """Angle to the axis and distance from the ball's centre of the ray that comes out; NaN where none goes in."""
    with np.errstate(invalid="ignore"):
        outside = np.arcsin(h / ball.entry)
        inside = np.arcsin(np.sin(outside) / ball.ior)
        chord = (ball.entry - ball.offset) * np.sin(inside)
        before = np.arcsin(chord / ball.exit)
        after = np.arcsin(np.sin(before) * ball.ior)
        return (outside - inside) + (after - before), (ball.exit + ball.offset) * np.sin(after)


def height_on_plane(h: Float64, z: float, ball: Ball = Ball()) -> Float64:  # noqa: B008
    """rho(h) on the plane at z; NaN where the ray never gets there."""
    angle, distance = bent_ray(np.asarray(h, np.float64), ball)
    with np.errstate(invalid="ignore"):
        arrives = np.cos(angle) > 0.0
        return np.where(arrives, (distance - z * np.sin(angle)) / np.cos(np.where(arrives, angle, 0.0)), np.nan)


def ring_radius(z: float, index: float = 1.5, radius: float = 1.0) -> float:
    """The fold of the caustic on the plane at z between ball and focus: the largest rho; 0 from the focus on."""
    if z >= focal_length(index, radius):
        return 0.0
    low, high = 0.0, radius * (1.0 - 1e-12)
    for _ in range(6):  # each round narrows the interval around the largest value a thousandfold
        h = np.linspace(low, high, 4001)
        rho = height_on_plane(h, z, Ball(radius, radius, 0.0, index))
        best = int(np.nanargmax(rho))
        low, high = h[max(best - 2, 0)], h[min(best + 2, len(h) - 1)]
    return float(rho[best])


def irradiance_profile(edges: Float64, z: float, index: float = 1.5, radius: float = 1.0, rays: int = 2**20) -> Float64:
    """Mean irradiance in the rings between `edges` of the plane at z, as a multiple of the light's own.

    A midpoint sum over `rays` heights of equal energy: h² evenly from 0 to R².
    """
    h = radius * np.sqrt((np.arange(rays) + 0.5) / rays)
    rho = np.abs(height_on_plane(h, z, Ball(radius, radius, 0.0, index)))
    counts, _ = np.histogram(rho[np.isfinite(rho)], edges)
    return counts / rays * radius**2 / (edges[1:] ** 2 - edges[:-1] ** 2)


def splat(
    column: NDArray[np.integer], row: NDArray[np.integer], share: NDArray[np.floating], resolution: tuple[int, int]
) -> NDArray[np.floating]:
    """Light map [h, w, k]: the shares [n, k] added up in their texels one after the other, in the dtype of `share`."""
    width, height = resolution
    light = np.zeros((height, width, share.shape[1]), share.dtype)
    np.add.at(light, (row, column), share)
    return light
