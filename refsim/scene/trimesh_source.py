"""Meshes that come through trimesh: PLY, OBJ, STL and GLB files, and objects that a script already holds.

trimesh is imported here, inside the functions, and only when something of its is at hand. Its exceptions become
``InputError``, its log stays silent. What it would read wrongly without a word is caught in ``sound_bytes.py`` before
it reads a file, and here after it has.
"""

from __future__ import annotations

import io
import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from refsim.errors import InputError
from refsim.scene.polygons import RawMesh, fan
from refsim.scene.sound_bytes import ply_face_count, sound_obj, sound_ply, sound_stl

__all__ = ["TRIMESH_LABEL", "is_trimesh", "read_glb", "read_obj", "read_ply", "read_stl", "read_trimesh"]

TRIMESH_LABEL = "the trimesh object"
PLY_TEXCOORDS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
# Sentences of trimesh and NumPy that say too little.
CLEARER = {
    "PLY is unexpected length!": "its length is not what its header and first rows ask for; "
    "it is truncated, or its polygons differ in size, which is read from ASCII PLY only",
}


def is_trimesh(source: object) -> bool:
    """``source`` is a trimesh.Trimesh, Scene or other geometry; nobody can hold one unless trimesh is imported."""
    module = sys.modules.get("trimesh")
    if module is None:
        return False
    return isinstance(source, (module.Trimesh, module.Scene, module.PointCloud, module.path.path.Path))


def read_trimesh(source: Any) -> RawMesh:
    """The triangles of a Trimesh, or of all meshes of a trimesh Scene with their transforms applied, in its order."""
    with _quiet(f"{TRIMESH_LABEL} cannot be read"):
        return _joined(TRIMESH_LABEL, source)


def read_ply(label: str, data: bytes) -> RawMesh:
    """The mesh in the bytes of a PLY file, ASCII or binary of either byte order; strips and colours are left out."""
    sound = sound_ply(label, data)
    with _quiet(f"{label} cannot be read as PLY"):
        # The tables, because trimesh orders triangles made of polygons by the size of the polygon.
        tables = _loaded("ply", sound).metadata["_ply_raw"]
        _check_ply_lists(label, tables)
        vertex, face = tables.get("vertex"), tables.get("all.face")
        # Where a binary file ends before the first list of an element, trimesh drops the element.
        if vertex is None or (not face and ply_face_count(data)):
            raise InputError(f"{label} is truncated: it ends before its {'faces' if vertex else 'vertices'}")
        texcoords = [_columns(vertex, *names) for names in PLY_TEXCOORDS if set(names) <= vertex["properties"].keys()]
        normals = {"nx", "ny", "nz"} <= vertex["properties"].keys()
        return RawMesh(
            _columns(vertex, "x", "y", "z"),
            _ply_faces(label, face, "tristrips" in tables),
            _columns(vertex, "nx", "ny", "nz") if normals else None,
            texcoords[0] if texcoords else None,
        )


def read_obj(label: str, data: bytes) -> RawMesh:
    """The mesh in the bytes of an OBJ file; normals and texture coordinates where every face has them."""
    sound = sound_obj(label, data)
    with _quiet(f"{label} cannot be read as OBJ"):
        # Where corners have normals or texture coordinates, an order maintained would give all corners of a vertex the
        # median of their indices; otherwise it keeps the vertices that no face uses.
        return _joined(label, _loaded("obj", sound, group_material=False, maintain_order=b"/" not in sound))


def read_stl(label: str, data: bytes) -> RawMesh:
    """The mesh in the bytes of an STL file, binary or ASCII; the facet normals of the file are left out."""
    sound = sound_stl(label, data)
    with _quiet(f"{label} cannot be read as STL"):
        return _joined(label, _loaded("stl", sound))


def read_glb(label: str, data: bytes) -> RawMesh:
    """The triangles in the bytes of a GLB (binary glTF 2.0) file: meshes in the file's order, transforms applied."""
    with _quiet(f"{label} cannot be read as GLB"):
        scene = _loaded("glb", data, maintain_order=True)
        return _joined(label, scene, _file_order(scene))


def _loaded(kind: str, data: bytes, **options: bool) -> Any:
    import trimesh

    # process would merge vertices and drop those that are not finite.
    return trimesh.load(io.BytesIO(data), file_type=kind, process=False, skip_materials=True, **options)


def _check_ply_lists(label: str, tables: dict[str, dict[str, Any]]) -> None:
    # trimesh gives all lists of a binary table the length of the first; others may by chance fill the same bytes.
    for element, table in tables.items():
        for name in getattr(getattr(table.get("data"), "dtype", None), "names", None) or ():
            column = table["data"][name]
            if column.dtype.names and (column["f0"] != column["f1"].shape[1]).any():
                name = element.removeprefix("all.")
                raise InputError(f"{label} has lists of several lengths in its element {name}, read from ASCII only")


def _columns(table: dict[str, Any], *names: str) -> np.ndarray:
    rows = table["length"]
    if rows == 0:
        return np.zeros((0, len(names)))
    return np.stack([table["data"][name].reshape(rows) for name in names], axis=1)


def _ply_faces(label: str, face: dict[str, Any] | None, strips: bool) -> np.ndarray:
    names = [name for name in ("vertex_indices", "vertex_index") if face and name in face["properties"]]
    if not face or not face["length"] or not names:
        raise InputError(f"{label} holds no triangles{' (its triangle strips are not read)' if strips else ''}")
    polygons = face["data"][names[0]]
    if polygons.dtype.names:
        polygons = polygons["f1"]
    # Lists of one length are rows; others an array of arrays.
    rows = polygons if polygons.dtype == object else polygons.reshape(face["length"], -1)
    counts = np.array([len(row) for row in rows]) if rows.ndim == 1 else np.full(len(rows), rows.shape[1])
    if (counts < 3).any():
        row = int(np.argmax(counts < 3))
        raise InputError(f"{label} has a face that is no polygon: face {row} has {counts[row]} vertices")
    corners = np.concatenate(rows) if rows.ndim == 1 else rows.reshape(-1)
    # An ASCII file may hold any number here, NaN and 1e300 too.
    whole = corners.astype(np.int64)
    if (whole != corners).any():
        raise InputError(f"{label} has a vertex index that is no whole number in its element face")
    return fan(counts, whole)


@contextmanager
def _quiet(failure: str) -> Iterator[None]:
    log = logging.getLogger("trimesh")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # Older NumPy stops at the first word that is no number and only warns.
            warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
            yield
    except InputError:
        raise
    except Exception as error:  # whatever a damaged mesh provokes
        raise InputError(f"{failure}: {_first_line(error)}") from None
    finally:
        log.setLevel(level)


def _joined(label: str, source: Any, nodes: list[str] | None = None) -> RawMesh:
    parts = [_part(label, mesh, matrix) for mesh, matrix in _meshes(source, nodes)]
    parts = [part for part in parts if len(part.faces)]
    if not parts:
        raise InputError(f"{label} holds no triangles")
    if len(parts) == 1:
        return parts[0]
    shifts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    return RawMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + shift for part, shift in zip(parts, shifts, strict=True)]),
        _all_or_none([part.normals for part in parts]),
        texcoords=_all_or_none([part.texcoords for part in parts]),
    )


def _file_order(scene: Any) -> list[str]:
    # trimesh walks the nodes of a file from the last to the first, but keeps its meshes in order.
    rank = {name: number for number, name in enumerate(scene.geometry)}
    return sorted(reversed(scene.graph.nodes_geometry), key=lambda node: rank[scene.graph[node][1]])


def _meshes(source: Any, nodes: list[str] | None) -> list[tuple[Any, np.ndarray | None]]:
    if hasattr(source, "faces"):
        return [(source, None)]
    if not hasattr(source, "graph"):  # a point cloud or a path
        return []
    placed = []
    for node in source.graph.nodes_geometry if nodes is None else nodes:
        matrix, name = source.graph[node]
        placed.append((source.geometry[name], np.asarray(matrix, np.float64)))
    return [(mesh, matrix) for mesh, matrix in placed if hasattr(mesh, "faces")]


def _part(label: str, mesh: Any, matrix: np.ndarray | None) -> RawMesh:
    vertices = np.asarray(mesh.vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    # Checked here, because joining parts would turn a wrong index into another part's vertex.
    if len(faces) and (int(faces.min()) < 0 or int(faces.max()) >= len(vertices)):
        row = int(np.argmax(((faces < 0) | (faces >= len(vertices))).any(axis=1)))
        raise InputError(
            f"{label} has an index out of range: triangle {row} refers to vertices {faces[row].tolist()}, "
            f"but only 0 to {len(vertices) - 1} exist"
        )
    normals = _stored_normals(mesh, len(vertices))
    if matrix is not None and not np.array_equal(matrix, np.eye(4)):
        vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        normals = None if normals is None else normals @ np.linalg.pinv(matrix[:3, :3])
        # A mirroring transform turns the winding round (glTF 2.0, section 3.7.4), so that the front stays the front.
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            faces = faces[:, [0, 2, 1]]
    return RawMesh(vertices, faces, normals, texcoords=_texcoords(mesh, len(vertices)))


def _stored_normals(mesh: Any, count: int) -> np.ndarray | None:
    # Asking the mesh itself would make trimesh compute normals of its own kind; only those given with the mesh count.
    cache = getattr(getattr(mesh, "_cache", None), "cache", {})
    normals = cache.get("vertex_normals")
    return None if normals is None or np.shape(normals) != (count, 3) else np.asarray(normals, np.float64)


def _texcoords(mesh: Any, count: int) -> np.ndarray | None:
    uv = getattr(getattr(mesh, "visual", None), "uv", None)
    return None if uv is None or np.shape(uv) != (count, 2) else np.asarray(uv, np.float64)


def _all_or_none(values: list[np.ndarray | None]) -> np.ndarray | None:
    present = [value for value in values if value is not None]
    return np.concatenate(present) if len(present) == len(values) else None


def _first_line(error: Exception) -> str:
    text = str(error).strip().splitlines()
    return CLEARER.get(text[0], text[0][:120]) if text else type(error).__name__
