"""Meshes that come through trimesh: GLB files and objects that a script already holds.

trimesh is imported here, inside the functions, and only when something of its is at hand. Its exceptions become
``InputError``, its log stays silent.
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
from refsim.scene.polygons import RawMesh

__all__ = ["TRIMESH_LABEL", "is_trimesh", "read_glb", "read_trimesh"]

TRIMESH_LABEL = "the trimesh object"


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


def read_glb(label: str, data: bytes) -> RawMesh:
    """The triangles in the bytes of a GLB (binary glTF 2.0) file: meshes in the file's order, transforms applied."""
    import trimesh

    with _quiet(f"{label} cannot be read as GLB"):
        scene = trimesh.load(io.BytesIO(data), file_type="glb", process=False, maintain_order=True, skip_materials=True)
        return _joined(label, scene, _file_order(scene))


@contextmanager
def _quiet(failure: str) -> Iterator[None]:
    log = logging.getLogger("trimesh")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
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
    return text[0][:120] if text else type(error).__name__
