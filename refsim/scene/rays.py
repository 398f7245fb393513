"""Rays and hits: plain float32 and int32 columns that travel between a scene, a method and the judge.

Rows of an image are row-major, row 0 at the top. A dead ray keeps its row: zero direction and ``t_max`` 0.
A hit at parameter t needs 0 < t < t_max.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refsim.errors import InputError

__all__ = ["Hits", "Rays"]

Float32 = NDArray[np.float32]

# A float32 unit vector is off by about 1e-7; anything beyond this was never normalised.
UNIT_TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class Rays:
    """n rays; ``p(t) = origin + t * direction`` in world space.

    origin     float32[n, 3], finite
    direction  float32[n, 3], unit length within 1e-4, or zero for a dead ray
    t_max      float32[n], a hit needs t < t_max; inf for no limit, 0 for a dead ray; a scalar serves every live ray
    width, height  of the image whose pixels the rows are (both or none), width * height == n

    Anything that NumPy turns into such arrays is accepted and copied to contiguous float32 where it is not.
    ``InputError`` names the first ray that is wrong.
    """

    origin: Float32
    direction: Float32
    t_max: Float32 = np.inf  # type: ignore[assignment]
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        origin = _columns(self.origin, "origin")
        direction = _columns(self.direction, "direction")
        if len(origin) != len(direction):
            raise InputError(f"rays need one direction an origin, and have {len(direction)} for {len(origin)}")
        alive = np.any(direction != 0.0, axis=1)
        t_max = _limits(self.t_max, alive)
        _check_values(origin, direction, t_max, alive)
        _check_size(self.width, self.height, len(origin))
        self._set(origin, direction, t_max, self.width, self.height)

    @classmethod
    def unchecked(
        cls, origin: Float32, direction: Float32, t_max: Float32, width: int | None = None, height: int | None = None
    ) -> Rays:
        """Rays from columns known to be right: contiguous float32, unit or dead. Nothing is checked or copied."""
        rays = object.__new__(cls)
        rays._set(origin, direction, t_max, width, height)
        return rays

    def _set(self, origin: Float32, direction: Float32, t_max: Float32, width: int | None, height: int | None) -> None:
        # The one place that writes the fields of the frozen class.
        for name, value in zip(self.__dataclass_fields__, (origin, direction, t_max, width, height), strict=True):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.origin)

    @property
    def alive(self) -> NDArray[np.bool_]:
        """bool[n]: the ray has a direction."""
        return np.any(self.direction != 0.0, axis=1)

    def __getitem__(self, rows: slice | ArrayLike) -> Rays:
        """The rays of ``rows`` (a slice, indices or a mask), without an image size."""
        index = rows if isinstance(rows, slice) else np.atleast_1d(np.asarray(rows))
        origin, direction, t_max = (column[index] for column in (self.origin, self.direction, self.t_max))
        return Rays.unchecked(
            np.ascontiguousarray(origin), np.ascontiguousarray(direction), np.ascontiguousarray(t_max)
        )


@dataclass(frozen=True, eq=False)
class Hits:
    """What n rays hit.

    triangle  int32[n], row of the scene's triangles, -1 for a miss
    t         float32[n], ray parameter, inf for a miss
    u, v      float32[n], weights of vertex 1 and vertex 2 (vertex 0 has 1 - u - v), 0 for a miss
    """

    triangle: NDArray[np.int32]
    t: Float32
    u: Float32
    v: Float32

    def __len__(self) -> int:
        return len(self.triangle)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """bool[n]: the ray hit something."""
        return self.triangle >= 0

    @classmethod
    def misses(cls, count: int) -> Hits:
        """``count`` rows that all missed."""
        return cls(
            np.full(count, -1, np.int32),
            np.full(count, np.inf, np.float32),
            np.zeros(count, np.float32),
            np.zeros(count, np.float32),
        )


def _columns(value: ArrayLike, name: str) -> Float32:
    try:
        # A number beyond float32 becomes inf here and is named by the check that follows.
        with np.errstate(over="ignore", invalid="ignore"):
            array = np.ascontiguousarray(value, dtype=np.float32)
    except (TypeError, ValueError):
        raise InputError(f"{name} of rays must be numbers of shape [n, 3]") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} of rays must have shape [n, 3], not {list(array.shape)}")
    return array


def _limits(value: ArrayLike, alive: NDArray[np.bool_]) -> Float32:
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            t_max = np.asarray(value, dtype=np.float32)
    except (TypeError, ValueError):
        raise InputError("t_max of rays must be numbers of shape [n]") from None
    if t_max.ndim == 0:
        return np.where(alive, t_max, np.float32(0.0)).astype(np.float32)
    if t_max.shape != alive.shape:
        raise InputError(f"t_max of rays must have shape [{len(alive)}], not {list(t_max.shape)}")
    return np.ascontiguousarray(t_max)


def _check_values(origin: Float32, direction: Float32, t_max: Float32, alive: NDArray[np.bool_]) -> None:
    _refuse(~np.isfinite(origin).all(axis=1), "has an origin that is not finite", origin)
    _refuse(~np.isfinite(direction).all(axis=1), "has a direction that is not finite", direction)
    length = np.sqrt(np.square(direction, dtype=np.float64).sum(axis=1))
    _refuse(alive & (np.abs(length - 1.0) > UNIT_TOLERANCE), "has a direction that is not of unit length", direction)
    # `not >=` also catches NaN.
    _refuse(~(t_max >= 0.0), "has a t_max that is negative or not a number", t_max)
    _refuse(~alive & (t_max != 0.0), "has a zero direction, so it is dead and its t_max must be 0", t_max)


def _refuse(wrong: NDArray[np.bool_] | np.bool_, sentence: str, values: Float32) -> None:
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(f"ray {row} {sentence}: {np.asarray(values[row]).tolist()}")


def _check_size(width: int | None, height: int | None, count: int) -> None:
    if width is None and height is None:
        return
    if width is None or height is None:
        raise InputError("rays of an image need both width and height, or neither")
    if width < 1 or height < 1 or width * height != count:
        raise InputError(f"an image of {width} x {height} pixels cannot have {count} rays")
