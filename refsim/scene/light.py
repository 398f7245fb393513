"""Point lights: a position in world space and an RGB intensity."""

from __future__ import annotations

import math
from dataclasses import dataclass

from refsim.errors import InputError
from refsim.scene.material import as_triple

__all__ = ["PointLight"]


@dataclass(frozen=True)
class PointLight:
    """A light without extent.

    position   world space, finite
    color      linear RGB, 0 or more
    intensity  factor on ``color``, 0 or more; light does not fall off with distance

    Raises ``InputError`` for any other value.
    """

    position: tuple[float, float, float]
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", as_triple(self.position, "position of a point light"))
        color = as_triple(self.color, "color of a point light")
        object.__setattr__(self, "color", color)
        if min(color) < 0.0:
            raise InputError(f"color of a point light must not be negative, and is {color}")
        if not (math.isfinite(self.intensity) and self.intensity >= 0.0):
            raise InputError(f"intensity of a point light must be a finite number from 0, not {self.intensity!r}")

    @property
    def radiance(self) -> tuple[float, float, float]:
        """``color`` times ``intensity``, linear RGB."""
        red, green, blue = self.color
        return red * self.intensity, green * self.intensity, blue * self.intensity
