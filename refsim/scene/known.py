"""Real meshes that refsim knows by name: what they are and how to tell the file.

They are not part of the package. A mesh is found by its bare name as a file in the folder that the environment variable
REFSIM_SCENES names; while that is not set, in the user's cache, where `refsim scenes fetch` puts what it fetches.
``sha256`` is that of the binary PLY file used here.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

from refsim.errors import InputError

__all__ = [
    "FORMATS",
    "KNOWN_MESHES",
    "KnownMesh",
    "cache_folder",
    "check_scenes_folder",
    "find_mesh",
    "is_known_file",
    "meshes_folder",
    "scenes_folder",
]

FOLDER_VARIABLE = "REFSIM_SCENES"
FORMATS = (".ply", ".obj", ".stl", ".glb")


@dataclass(frozen=True)
class KnownMesh:
    """Name of the file without ending, title of the source, triangles, and sha256 of the file."""

    name: str
    source: str
    triangles: int
    sha256: str


_STANFORD = "Stanford 3D Scanning Repository"
KNOWN_MESHES: dict[str, KnownMesh] = {
    mesh.name: mesh
    for mesh in (
        KnownMesh("bunny", f"Stanford Bunny (bun_zipper), {_STANFORD}", 69_451,
                  "7d4bb402ff6a817eed8151557f9128629807f065604915a5b02a49f99e93dc22"),
        KnownMesh("bunny_closed", "Stanford Bunny with its holes filled, glmark2 project", 69_666,
                  "eae8edb2aeac27ade8e9a278cc8a89f741c4a7f912e5fa7a107dcac09e81109d"),
        KnownMesh("dragon", f"Stanford Dragon (dragon_vrip), {_STANFORD}", 871_414,
                  "2ee2b988133e7a0183ca034ca8daa2f51cada30b484b45550fc8c29c0055fc9c"),
        KnownMesh("dragon_res2", f"Stanford Dragon (dragon_vrip_res2), {_STANFORD}", 202_520,
                  "681463165b3bf5ea087e950065b9e549ecfd4e481048cb998d5e4e8381242691"),
        KnownMesh("dragon_res3", f"Stanford Dragon (dragon_vrip_res3), {_STANFORD}", 47_794,
                  "e5fa63fd7067e4f676486e10e02a716ab25732cab141534b8ca1f97a16bbed32"),
        KnownMesh("dragon_res4", f"Stanford Dragon (dragon_vrip_res4), {_STANFORD}", 11_102,
                  "6b730946c4fa5a26648e3c946a86b34ecf86323c76a9f9ce1e4bc54f2091f013"),
        KnownMesh("dragon_100k", "Stanford Dragon decimated to 100,000 triangles, repository nwtnni/photon", 100_000,
                  "1cd47e1563b5096f6c30ce9bb672b343316e169aea6fd1dfd1208835d2b6a8d9"),
        KnownMesh("buddha_100k", "Stanford Happy Buddha decimated to 100,000 triangles, repository nwtnni/photon",
                  100_000, "35bfb04f2ebb684903f922e6c2f0945a85959aed6eca1862f9e5e7e0cfbba261"),
        KnownMesh("horse", "Horse, Georgia Tech Large Geometric Models Archive", 96_966,
                  "10e17620631409c1ec31b044ee052629a8968b0f3fa69300e8b550d04184bc54"),
        KnownMesh("suzanne", "Suzanne, Blender's monkey, repository alecjacobson/common-3d-test-models", 968,
                  "4bf2585b43eb6ae30d60c8041317c4fb72d16e2326f9e93f831b4de0b2b5663b"),
        KnownMesh("teapot", "Utah teapot, repository alecjacobson/common-3d-test-models", 6_320,
                  "b2aa5e827e8f6bbe5e3d945db799f3d41cc1b7ad8e1d05ea430a590a92f9e68d"),
        KnownMesh("armadillo_52k", "Stanford Armadillo reduced to 52,000 triangles, CGAL demo data", 52_000,
                  "db15e949c4d0202206e460be4e69e85d77273dc4da5742f27d9a4379d7182d9b"),
        KnownMesh("lucy_100k", "Stanford Lucy reduced to 99,970 triangles, repository pyvista/vtk-data", 99_970,
                  "84f2062f58a7bfde62caaeb5ac83284dd637a251945fa1012d2611078a4ade8b"),
        KnownMesh("igea", "Igea, repository alecjacobson/common-3d-test-models", 268_686,
                  "8888e96f2fb8c69dd3d328554c9f91f0770379b8a13e50224300ca48c44cc1a6"),
        KnownMesh("elephant_89k", "Elephant (refined_elephant), CGAL sample data", 88_928,
                  "04dceeb6c22b105ec70fb8feddee7107d6e555504e5665ffcad580b1e47a4566"),
        KnownMesh("knot_cgal", "Knot (knot2), CGAL sample data", 11_520,
                  "deb91fc596779a543da80442ae3e3e12d3ee9bd7d7cae856394f9700cfbcd929"),
        KnownMesh("sponza_atrium_56k", "Sponza atrium by Marko Dabrovic, repository ElDigoXD/cgh", 56_100,
                  "e007ffe3cbf5419e00d276a527ec5323003863351aa51cd8ccb737f1067cfab5"),
    )
}  # fmt: skip


def scenes_folder() -> Path | None:
    """The folder that REFSIM_SCENES names, None where it is unset or empty."""
    folder = os.environ.get(FOLDER_VARIABLE, "")
    return Path(folder).expanduser() if folder else None


def check_scenes_folder() -> None:
    """Raise `InputError` where REFSIM_SCENES names what is not a folder: every mesh would be missing in silence."""
    folder = scenes_folder()
    if folder is not None and not folder.is_dir():
        raise InputError(f"{FOLDER_VARIABLE} names {str(folder)!r}, which is not a folder.")


def cache_folder() -> Path | None:
    """The user's own folder of fetched meshes, there or not: refsim/scenes in XDG_CACHE_HOME, or else in ~/.cache.

    None for a user without a home.
    """
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "refsim" / "scenes"
    except RuntimeError:
        return None


def meshes_folder() -> Path | None:
    """Where real meshes are looked for and fetched to: `scenes_folder`, or `cache_folder` where that is None."""
    return scenes_folder() or cache_folder()


def find_mesh(name: str) -> Path | None:
    """The file of a bare mesh name in the folder of real meshes: the first of name.ply, .obj, .stl, .glb; or None."""
    folder = meshes_folder()
    if folder is None:
        return None
    return next((path for ending in FORMATS if (path := folder / (name + ending)).is_file()), None)


def is_known_file(path: Path) -> bool:
    """The file is, byte for byte, the mesh that refsim knows by its name."""
    known = KNOWN_MESHES.get(path.stem)
    return known is not None and hashlib.sha256(path.read_bytes()).hexdigest() == known.sha256
