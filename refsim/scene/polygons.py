"""What a mesh file holds, before it is a scene: indexed polygons, split into triangles and checked.

Readers of file formats hand over a ``RawMesh``; ``triangle_soup`` turns it into corner arrays in file order and refuses
vertices that are not finite and indices that point nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError

__all__ = ["RawMesh", "TriangleSoup", "fan", "triangle_soup"]

Float = NDArray[np.floating]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Indexed triangles as a file gives them, nothing checked.

    vertices   float[v, 3]; faces int64[n, 3], rows of ``vertices``
    normals    float[v, 3] or None; texcoords float[v, 2] or None
    """

    vertices: Float
    faces: Index
    normals: Float | None = None
    texcoords: Float | None = None


@dataclass(frozen=True, eq=False)
class TriangleSoup:
    """Corner arrays float32: triangles [n, 3, 3], normals [n, 3, 3] or None, texcoords [n, 3, 2] or None."""

    triangles: NDArray[np.float32]
    normals: NDArray[np.float32] | None
    texcoords: NDArray[np.float32] | None


def fan(counts: Index, corners: Index) -> Index:
    """Triangles int64[n, 3] of polygons: (0, 1, 2), (0, 2, 3) … of each, polygons in order.

    counts   int64[polygons], corners of each polygon, 3 or more
    corners  int64[sum of counts], all polygons' corners, one after the other
    """
    if len(counts) and (counts == 3).all():
        return corners.reshape(-1, 3)
    start = np.cumsum(counts) - counts
    triangles = counts - 2
    polygon = np.repeat(np.arange(len(counts)), triangles)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    first = start[polygon]
    return np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)


def triangle_soup(label: str, mesh: RawMesh) -> TriangleSoup:
    """Corner arrays of ``mesh`` in its order; ``InputError`` opens with ``label`` and names the vertex or triangle."""
    if len(mesh.faces) == 0:
        raise InputError(f"{label} holds no triangles")
    # A cast may overflow, or meet a signalling NaN: both are named below.
    with np.errstate(over="ignore", invalid="ignore"):
        vertices = mesh.vertices.astype(np.float32)
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        with np.errstate(invalid="ignore"):
            position = mesh.vertices[row].astype(np.float64).tolist()
        raise InputError(f"{label} has a vertex that is not finite in float32: vertex {row} is {position}")
    wrong = (mesh.faces < 0) | (mesh.faces >= len(vertices))
    if wrong.any():
        row = int(np.argmax(wrong.any(axis=1)))
        raise InputError(
            f"{label} has an index out of range: triangle {row} refers to vertex "
            f"{int(mesh.faces[row][wrong[row]][0])}, but only 0 to {len(vertices) - 1} exist"
        )
    return TriangleSoup(vertices[mesh.faces], _corners(mesh.normals, mesh.faces), _corners(mesh.texcoords, mesh.faces))


def _corners(values: Float | None, faces: Index) -> NDArray[np.float32] | None:
    if values is None:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        return values.astype(np.float32)[faces]
