"""A scene: triangles in file order, with materials, lights and an environment.

Nothing is merged, reordered or repaired. Triangles of zero area are kept (row numbers stay the file's), never hit,
and marked in ``Scene.degenerate``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene.light import PointLight
from refsim.scene.material import GLASS, Material

if TYPE_CHECKING:
    from refsim.scene.environment import Environment

__all__ = ["Scene", "area_weighted_normals", "degenerate_triangles"]

Float32 = NDArray[np.float32]

# A new ray starts this fraction of the box diagonal off the surface: a power of two, so it scales with the scene.
EPSILON = 2.0**-12


@dataclass(frozen=True, eq=False)
class Scene:
    """Triangles and what is needed to shade them.

    triangles     float32[n, 3, 3], vertices of each triangle, world space, finite, n >= 1; front = counter-clockwise
    name          for reports
    materials     one or more; ``material_ids`` int32[n] chooses, zeros when not given
    normals       float32[n, 3, 3] unit vertex normals of the source, or None; read ``vertex_normals``
    texcoords     float32[n, 3, 2], zeros when not given
    lights        point lights
    environment   what a ray sees that leaves the scene; None means the method's default

    ``InputError`` for wrong shapes, non-finite vertices and material ids out of range.
    """

    triangles: Float32
    name: str = "scene"
    materials: tuple[Material, ...] = (GLASS,)
    material_ids: NDArray[np.int32] = None  # type: ignore[assignment]
    normals: Float32 | None = None
    texcoords: Float32 = None  # type: ignore[assignment]
    lights: tuple[PointLight, ...] = ()
    environment: Environment | None = None

    def __post_init__(self) -> None:
        triangles = _array(self.triangles, "triangles", (3, 3))
        count = len(triangles)
        if count == 0:
            raise InputError(f"scene {self.name!r} holds no triangles")
        bad = ~np.isfinite(triangles).all(axis=(1, 2))
        if bad.any():
            raise InputError(f"triangle {int(np.argmax(bad))} of scene {self.name!r} has a vertex that is not finite")
        normals = None if self.normals is None else _array(self.normals, "normals", (3, 3), count)
        texcoords = np.zeros((count, 3, 2), np.float32)
        if self.texcoords is not None:
            texcoords = _array(self.texcoords, "texcoords", (3, 2), count)
        materials = (self.materials,) if isinstance(self.materials, Material) else tuple(self.materials)
        values = {
            "triangles": triangles,
            "normals": normals,
            "texcoords": texcoords,
            "materials": materials,
            "material_ids": _material_ids(self.material_ids, count, len(materials)),
            "lights": tuple(self.lights),
        }
        for field, value in values.items():
            object.__setattr__(self, field, value)

    def __len__(self) -> int:
        return len(self.triangles)

    @cached_property
    def lower(self) -> Float32:
        """float32[3]: smallest corner of the bounding box."""
        return self.triangles.min(axis=(0, 1))

    @cached_property
    def upper(self) -> Float32:
        """float32[3]: largest corner of the bounding box."""
        return self.triangles.max(axis=(0, 1))

    @property
    def center(self) -> NDArray[np.float64]:
        """float64[3]: centre of the bounding box."""
        return (self.lower.astype(np.float64) + self.upper) * 0.5

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal."""
        x, y, z = (self.upper.astype(np.float64) - self.lower).tolist()
        return float(np.sqrt(x * x + y * y + z * z))

    @property
    def epsilon(self) -> np.float32:
        """Distance along the geometric normal at which a new ray starts: 2**-12 of the box diagonal."""
        return np.float32(EPSILON * self.diagonal)

    @cached_property
    def degenerate(self) -> NDArray[np.bool_]:
        """bool[n]: the triangle has no plane in float32 and is never hit."""
        return degenerate_triangles(self.triangles)

    @cached_property
    def vertex_normals(self) -> Float32:
        """float32[n, 3, 3]: unit vertex normals, the source's where it has them, else area-weighted ones."""
        smooth = area_weighted_normals(self.triangles) if self.normals is None else None
        if smooth is not None:
            return smooth
        given = np.asarray(self.normals, np.float64)
        length = np.sqrt((given * given).sum(axis=2, keepdims=True))
        usable = np.isfinite(length) & (length > 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            unit = (given / length).astype(np.float32)
        return unit if usable.all() else np.where(usable, unit, area_weighted_normals(self.triangles))

    @property
    def lights_or_one(self) -> tuple[PointLight, ...]:
        """The lights; where the scene has none, a white one to the right of the default view, above and in front: 0.5,
        0.8, 0.7 of the box diagonal along x, y, z from the centre."""
        x, y, z = (self.center + self.diagonal * np.array([0.5, 0.8, 0.7])).tolist()
        return self.lights or (PointLight((x, y, z)),)

    def optical_indices(self, default_ior: float = 1.5) -> Float32:
        """float32[n]: per triangle, refractive index of glass (above 0), 0 mirror, -1 diffuse."""
        table = np.array([material.optical_index(default_ior) for material in self.materials], np.float32)
        return table[self.material_ids]

    def with_materials(self, material: Material | Sequence[Material]) -> Scene:
        """The same scene made of one material throughout; a sequence replaces the table and keeps the ids."""
        if isinstance(material, Material):
            return replace(self, materials=(material,), material_ids=np.zeros(len(self), np.int32))
        return replace(self, materials=tuple(material))

    def replace(self, **fields: object) -> Scene:
        """The same scene with some fields changed."""
        unknown = sorted(set(fields) - set(self.__dataclass_fields__))
        if unknown:
            raise InputError(f"a scene has no field {unknown[0]!r}, only {', '.join(self.__dataclass_fields__)}")
        return replace(self, **fields)  # type: ignore[arg-type]


def _array(value: object, name: str, tail: tuple[int, ...], count: int | None = None) -> Float32:
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            array = np.ascontiguousarray(value, dtype=np.float32)
    except (TypeError, ValueError):
        raise InputError(f"{name} of a scene must be numbers of shape {['n', *tail]}") from None
    if array.ndim != 3 or array.shape[1:] != tail or (count is not None and len(array) != count):
        wanted = ", ".join(map(str, ("n" if count is None else count, *tail)))
        raise InputError(f"{name} of a scene must have shape [{wanted}], not {list(array.shape)}")
    return array


def _material_ids(value: object, count: int, materials: int) -> NDArray[np.int32]:
    if materials == 0:
        raise InputError("a scene needs at least one material")
    if value is None:
        return np.zeros(count, np.int32)
    ids = np.asarray(value)
    if ids.shape != (count,) or ids.dtype.kind not in "iu":
        raise InputError(f"material_ids of a scene must be {count} integers")
    wrong = (ids < 0) | (ids >= materials)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(f"triangle {row} has material {int(ids[row])}, but the scene has {materials} materials")
    return np.ascontiguousarray(ids, dtype=np.int32)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-1)


def _edges(triangles: Float32) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    vertices = triangles.astype(np.float64)
    return vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0]


def degenerate_triangles(triangles: Float32) -> NDArray[np.bool_]:
    """bool[n]: triangles that can never be hit.

    True where the float64 cross product N of the edges e1 = v1 - v0 and e2 = v2 - v0 is exactly zero, or where
    the plane data m1 = (e2 x N)/|N|^2 and m2 = (N x e1)/|N|^2 are not finite in float32.
    """
    e1, e2 = _edges(triangles)
    normal = _cross(e1, e2)
    square = (normal * normal).sum(axis=1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        m1 = (_cross(e2, normal) / square).astype(np.float32)
        m2 = (_cross(normal, e1) / square).astype(np.float32)
    return (normal == 0.0).all(axis=1) | ~(np.isfinite(m1) & np.isfinite(m2)).all(axis=1)


def area_weighted_normals(triangles: Float32) -> Float32:
    """Smooth unit normals float32[n, 3, 3]: sum of the area vectors of all triangles with a vertex at that position.

    Where the sum is zero (two sides of a sheet, say) the triangle's own normal stands in; zero for a triangle
    of zero area.
    """
    e1, e2 = _edges(triangles)
    area = _cross(e1, e2)
    index, count = _equal_positions(triangles.reshape(-1, 3))
    sums = np.stack([np.bincount(index, np.repeat(area[:, axis], 3), count) for axis in range(3)], axis=1)
    corner = sums[index].reshape(-1, 3, 3)
    own = np.broadcast_to(area[:, None, :], corner.shape)
    length = np.sqrt((corner * corner).sum(axis=2, keepdims=True))
    corner = np.where(length > 0.0, corner, own)
    length = np.sqrt((corner * corner).sum(axis=2, keepdims=True))
    return (corner / np.where(length > 0.0, length, 1.0)).astype(np.float32)


def _equal_positions(points: Float32) -> tuple[NDArray[np.intp], int]:
    # Adding 0.0 turns -0.0 into 0.0, after which equal positions have equal bits.
    bits = (points + np.float32(0.0)).view(np.uint32)
    xy = (bits[:, 0].astype(np.uint64) << np.uint64(32)) | bits[:, 1]
    order = np.lexsort((bits[:, 2], xy))
    first = np.empty(len(points), bool)
    first[:1] = True
    first[1:] = (xy[order][1:] != xy[order][:-1]) | (bits[order, 2][1:] != bits[order, 2][:-1])
    index = np.empty(len(points), np.intp)
    index[order] = np.cumsum(first) - 1
    return index, int(first.sum())
