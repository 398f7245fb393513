"""Surface materials: perfect glass, perfect mirror, diffuse (where a path ends), each with a Phong colour.

A material is a value. The number that the ray kernels read is ``Material.optical_index``: above 0 the refractive
index of glass, 0 a mirror, below 0 a diffuse surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from refsim.errors import InputError

__all__ = ["DIFFUSE", "GLASS", "MIRROR", "Kind", "Material", "as_triple"]

Kind = Literal["glass", "mirror", "diffuse"]
KINDS: tuple[Kind, ...] = ("glass", "mirror", "diffuse")
KIND_REFLECTIVITY: dict[Kind, float] = {"glass": 0.1, "mirror": 1.0, "diffuse": 0.0}


def as_triple(value: object, name: str) -> tuple[float, float, float]:
    """Three finite floats from any sequence of three numbers; ``InputError`` names ``name`` otherwise."""
    try:
        triple = tuple(float(component) for component in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        triple = ()
    if len(triple) != 3 or not all(math.isfinite(component) for component in triple):
        raise InputError(f"{name} must be three finite numbers, not {value!r}")
    return triple[0], triple[1], triple[2]


@dataclass(frozen=True)
class Material:
    """One surface material.

    kind       "glass" refracts, "mirror" reflects, "diffuse" ends the path
    color      linear RGB, 0 or more: Phong diffuse colour; tint of a mirror or of glass
    ior        refractive index of glass relative to its surroundings, above 0; None takes the method's ``ior`` option
    specular   strength of the Phong highlight, 0 or more
    shininess  Phong exponent, 0 or more
    reflectivity  share ρ of the mirrored light in Whitted's model, 0 to 1; None is 0 where diffuse, 1 for a mirror,
               0.1 for glass. Methods that follow one ray a path (`hierarchical_ray_engine`) do not read it

    Raises ``InputError`` for any other value.
    """

    name: str = "glass"
    kind: Kind = "glass"
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ior: float | None = None
    specular: float = 0.0
    shininess: float = 32.0
    reflectivity: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"material kind must be one of {', '.join(KINDS)}, not {self.kind!r}")
        color = as_triple(self.color, f"color of material {self.name!r}")
        if min(color) < 0.0:
            raise InputError(f"color of material {self.name!r} must not be negative, and is {color}")
        object.__setattr__(self, "color", color)
        if self.ior is not None and not (math.isfinite(self.ior) and self.ior > 0.0):
            raise InputError(f"ior of material {self.name!r} must be a finite number above 0, not {self.ior!r}")
        for field in ("specular", "shininess"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"{field} of material {self.name!r} must be a finite number from 0, not {value!r}")

        rho = self.reflectivity
        if rho is not None and not 0.0 <= rho <= 1.0:
            raise InputError(f"reflectivity of material {self.name!r} must be a number from 0 to 1, not {rho!r}")

    @property
    def rho(self) -> float:
        """Reflectivity: the one given, or the kind's."""
        return KIND_REFLECTIVITY[self.kind] if self.reflectivity is None else float(self.reflectivity)

    @property
    def tau(self) -> float:
        """Share of the light that glass lets through: what it does not reflect."""
        return 1.0 - self.rho if self.kind == "glass" else 0.0

    def optical_index(self, default_ior: float = 1.5) -> float:
        """The number that kernels read: refractive index for glass (above 0), 0 for a mirror, -1 for diffuse."""
        if self.kind == "glass":
            return default_ior if self.ior is None else self.ior
        return 0.0 if self.kind == "mirror" else -1.0


GLASS = Material("glass", "glass")
MIRROR = Material("mirror", "mirror", specular=0.5)
DIFFUSE = Material("diffuse", "diffuse", (0.8, 0.8, 0.8))
