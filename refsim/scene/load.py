"""``load_scene``: from a library name, a mesh file, a real mesh's bare name or a trimesh object to a Scene.

Triangles keep the order of their source and nothing is merged. Files are read by trimesh, which is imported only then.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from refsim.errors import InputError
from refsim.scene.archives import ORIGINALS
from refsim.scene.known import FOLDER_VARIABLE, FORMATS, KNOWN_MESHES, find_mesh, meshes_folder, scenes_folder
from refsim.scene.library import LIBRARY, library_scene
from refsim.scene.material import Material
from refsim.scene.mesh import Scene, degenerate_triangles
from refsim.scene.polygons import RawMesh, TriangleSoup, triangle_soup
from refsim.scene.sound_bytes import ply_face_count
from refsim.scene.stages import SILK, on_ground
from refsim.scene.trimesh_source import (
    TRIMESH_LABEL,
    is_trimesh,
    read_glb,
    read_obj,
    read_ply,
    read_stl,
    read_trimesh,
)

if TYPE_CHECKING:
    import trimesh

__all__ = ["load_scene", "missing_meshes", "scene_names"]

GROUND = "_on_ground"
READERS: dict[str, Callable[[str, bytes], RawMesh]] = {
    ".ply": read_ply,
    ".obj": read_obj,
    ".stl": read_stl,
    ".glb": read_glb,
}


def load_scene(
    source: str | os.PathLike[str] | trimesh.Trimesh | trimesh.Scene, *, material: Material | None = None
) -> Scene:
    """A scene from ``source``, its triangles float32[n, 3, 3] in the order of the source.

    source    a library name ("torus_knot_1024", "cornell_box", …); a path to a .ply, .obj, .stl or .glb file; the bare
              name of a file in the folder that REFSIM_SCENES names ("bunny"); either name with "_on_ground" behind it
              ("bunny_on_ground": silk above a ground, and one light); a trimesh.Trimesh or trimesh.Scene
    material  of all triangles; None keeps a library scene's own and makes everything else of glass

    A string is a path when it holds a separator or a dot, and a name otherwise; the library goes before the folder.
    Polygons are split into fans. Vertex normals and texture coordinates are kept where the source has them; its
    materials are not. Triangles of zero area are kept. ``InputError`` names what is missing, unreadable or not a
    triangle mesh.
    """
    if is_trimesh(source):
        scene = _scene("trimesh", triangle_soup(TRIMESH_LABEL, read_trimesh(source)), TRIMESH_LABEL)
    elif isinstance(source, str) and not _is_path(source):
        scene = library_scene(source) or _on_ground(source) or _from_file(_named_mesh(source), source)
    elif isinstance(source, (str, os.PathLike)):
        path = Path(os.fspath(source))
        scene = _from_file(path, path.stem)
    else:
        raise InputError(f"a scene is a name, a path or a trimesh object, not a {type(source).__name__}")
    return scene if material is None else scene.with_materials(material)


def scene_names() -> dict[str, int | None]:
    """Names that ``load_scene`` takes, and their numbers of triangles: the library, then the meshes in REFSIM_SCENES.

    A number is the one of the file's header, None where it could only be had by reading the whole file.
    """
    names: dict[str, int | None] = {name: entry.triangles for name, entry in LIBRARY.items()}
    folder = meshes_folder()
    if folder is not None and folder.is_dir():
        for path in sorted(folder.iterdir()):
            if path.suffix.lower() in FORMATS and library_or_none(path.stem) is None:
                names.setdefault(path.stem, _declared_triangles(path))
    return names


def missing_meshes() -> list[str]:
    """Names of the real meshes that refsim knows and does not find in the folder that REFSIM_SCENES names."""
    return [name for name in KNOWN_MESHES if find_mesh(name) is None]


def library_or_none(name: str) -> str | None:
    """``name`` if the library makes a scene of that name, else None."""
    try:
        return name if library_scene(name) is not None else None
    except InputError:
        return None


def _declared_triangles(path: Path) -> int | None:
    if path.suffix.lower() != ".ply":
        return None
    try:
        with path.open("rb") as file:
            return ply_face_count(file.read(65_536))
    except OSError:
        return None


def _on_ground(name: str) -> Scene | None:
    """The scene of a name that ends in "_on_ground", put there by `stages.on_ground`; None for another name."""
    base = name.removesuffix(GROUND)
    if base in ("", name) or find_mesh(name) is not None:
        return None
    return on_ground(load_scene(base), material=SILK).replace(name=name)


def _is_path(source: str) -> bool:
    return any(mark in source for mark in (os.sep, "/", "."))


def _named_mesh(name: str) -> Path:
    path = find_mesh(name)
    if path is not None:
        return path
    folder = scenes_folder()
    known = KNOWN_MESHES.get(name)
    if known is not None:
        where = f"the folder that the environment variable {FOLDER_VARIABLE} names"
        where += " (it is not set)" if folder is None else f" ({folder})"
        raise InputError(
            f"scene {name!r} is missing: put {name}.ply into {where}; "
            f"it is the {known.source}, {known.triangles} triangles"
            + (f"; `refsim scenes fetch {name}` gets it" if name in ORIGINALS else "")
        )
    names = dict.fromkeys([*scene_names(), *KNOWN_MESHES])
    close = difflib.get_close_matches(name, names, n=3)
    hint = f"did you mean {' or '.join(close)}? " if close else ""
    raise InputError(
        f"unknown scene {name!r}; {hint}the library has {', '.join(LIBRARY)}, "
        f"and a file needs its ending ({', '.join(FORMATS)})"
    )


def _from_file(path: Path, name: str) -> Scene:
    label = f"file {str(path)!r}"
    reader = READERS.get(path.suffix.lower())
    if path.is_dir():
        raise InputError(f"{label} is a folder, not a mesh")
    if reader is None:
        raise InputError(f"{label} is of no format that can be read: a mesh ends in {', '.join(FORMATS)}")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{label} does not exist") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{label} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not data:
        raise InputError(f"{label} is empty")
    return _scene(name, triangle_soup(label, reader(label, data)), label)


def _scene(name: str, soup: TriangleSoup, label: str) -> Scene:
    # In blocks, because the first block nearly always settles it.
    block = 65_536
    starts = range(0, len(soup.triangles), block)
    if all(degenerate_triangles(soup.triangles[start : start + block]).all() for start in starts):
        raise InputError(f"{label} holds only zero-area triangles")
    return Scene(soup.triangles, name, normals=soup.normals, texcoords=soup.texcoords)  # type: ignore[arg-type]
