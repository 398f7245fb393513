"""``fetch_meshes``: real meshes from their original archives into a folder, checked, each whole or not at all.

An archive holds a mesh as its publisher wrote it, in text or with columns that nothing here reads. It is written anew
as the binary PLY file whose SHA-256 refsim knows: a float32 position a vertex, three int32 a triangle, both in the
archive's order. Whatever the archive's address, age or owner: the hash decides.

All of it happens in a hidden folder beside the destination, and the last step is a rename. Of an archive one regular
file is read, into memory; nothing is unpacked to a path that the archive names.
"""

from __future__ import annotations

import contextlib
import difflib
import errno
import gzip
import hashlib
import os
import tarfile
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene.archives import ORIGINALS, UNSEEN, Original, why_not
from refsim.scene.download import Report, downloader
from refsim.scene.known import FOLDER_VARIABLE, KNOWN_MESHES, KnownMesh, meshes_folder
from refsim.scene.library import LIBRARY
from refsim.scene.trimesh_source import read_ply

__all__ = ["Fetched", "fetch_meshes", "plain_ply"]

# Three ways to write a triangle the other way round; the archive's publisher does not say which corner comes first.
TURNS = ((0, 2, 1), (2, 1, 0), (1, 0, 2))
BROKEN = (EOFError, gzip.BadGzipFile, tarfile.TarError, zlib.error)
# Eight times the largest file there is; a small download that swells beyond it is no mesh.
LARGEST = 1 << 28


@dataclass(frozen=True)
class Fetched:
    """The file, where it came from, and whether it was there already."""

    path: Path
    mesh: KnownMesh
    original: Original
    already_there: bool


def fetch_meshes(
    names: Iterable[str], folder: Path | None = None, *, force: bool = False, progress: Report | None = None
) -> Iterator[Fetched]:
    """The real meshes ``names`` as ``folder``/name.ply, one after the other; None is where ``load_scene`` looks.

    A right file that is there is left alone; a wrong one is replaced only with ``force``. ``progress`` hears of bytes.
    ``InputError`` says what went wrong: before anything is fetched if a name is wrong, and the folder is then as it
    was; later with what had arrived in place, and nothing else.
    """
    wanted = [_known(name) for name in dict.fromkeys(names)]
    folder = folder or meshes_folder()
    if folder is None:
        raise InputError(f"no folder for meshes: set {FOLDER_VARIABLE} in the environment, or say --to FOLDER")
    title = ", ".join(mesh.name for mesh, _ in wanted)
    with _refusing(f"{title} cannot be put into folder {str(folder)!r}"):
        rows = [(folder / f"{mesh.name}.ply", mesh, original) for mesh, original in wanted]
        there = {path: _is_there(path, mesh, force) for path, mesh, _ in rows}
        if all(there.values()):
            yield from (Fetched(path, mesh, original, True) for path, mesh, original in rows)
            return
        download = downloader()
        archives: dict[str, Path] = {}
        with _workplace(folder) as work:
            for path, mesh, original in rows:
                if not there[path]:
                    if original.url not in archives:
                        file = work / f"archive-{len(archives)}"
                        archives[original.url] = download(original.url, file, progress, f"fetching {mesh.name}, bytes")
                    ready = work / path.name
                    ready.write_bytes(_content(archives[original.url], mesh, original))
                    os.replace(ready, path)
                yield Fetched(path, mesh, original, there[path])


def plain_ply(vertices: NDArray[Any], faces: NDArray[Any]) -> bytes:
    """The bytes of a binary PLY file of positions float32[v, 3] and triangles int32[n, 3], and nothing else."""
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{axes}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    return header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes()


def _known(name: str) -> tuple[KnownMesh, Original]:
    if name in ORIGINALS:
        return KNOWN_MESHES[name], ORIGINALS[name]
    if name in KNOWN_MESHES or name in UNSEEN:
        raise InputError(why_not(name))
    if name in LIBRARY:
        raise InputError(f"scene {name!r} needs no fetching: refsim makes it itself")
    close = difflib.get_close_matches(name, [*ORIGINALS, *KNOWN_MESHES, *UNSEEN], n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    raise InputError(f"unknown mesh {name!r}; {hint}those that can be fetched are {', '.join(ORIGINALS)}")


def _is_there(path: Path, mesh: KnownMesh, force: bool) -> bool:
    if path.is_dir():
        raise InputError(f"{str(path)!r} is a folder, where the mesh would go")
    if not path.exists():
        return False
    if hashlib.sha256(path.read_bytes()).hexdigest() == mesh.sha256:
        return True
    if not force:
        raise InputError(f"file {str(path)!r} is there and is not the mesh {mesh.name!r}; --force replaces it")
    return False


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    # The sentence for a disk that is full, a folder that takes no file, a path through a file.
    try:
        yield
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        reason = "the disk is full" if full else error.strerror or type(error).__name__
        raise InputError(f"{what}: {reason}") from None


@contextmanager
def _workplace(folder: Path) -> Iterator[Path]:
    # A hidden folder in ``folder``, which is made if need be; after a failure what was made is gone again.
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".fetch-") as work:
            yield Path(work)
    except BaseException:
        with contextlib.suppress(OSError):
            for place in made:
                place.rmdir()
        raise


def _content(archive: Path, mesh: KnownMesh, original: Original) -> bytes:
    # The mesh in the archive as the plain PLY file that is known, or a refusal.
    label = f"the archive {original.url}"
    raw = read_ply(label, _member(label, archive, original.member))
    counts = len(raw.faces), len(raw.vertices)
    if counts != (mesh.triangles, original.vertices):
        raise InputError(
            f"{label} does not hold the mesh {mesh.name!r}: it has {counts[0]:,} triangles and {counts[1]:,} vertices, "
            f"not {mesh.triangles:,} and {original.vertices:,}"
        )
    for turn in TURNS if original.turned else ((0, 1, 2),):
        result = plain_ply(raw.vertices, raw.faces[:, turn])
        if hashlib.sha256(result).hexdigest() == mesh.sha256:
            return result
    raise InputError(f"{label} does not hold the mesh {mesh.name!r}: its SHA-256 is not {mesh.sha256}")


def _member(label: str, archive: Path, member: str | None) -> bytes:
    try:
        data = _compressed(archive) if member is None else _in_tar(archive, member)
    except KeyError:
        raise InputError(f"{label} has no file {member!r}") from None
    except BROKEN:
        raise InputError(f"{label} is broken or cut off; try again") from None
    if len(data) > LARGEST:
        raise InputError(f"{label} swells to more than {LARGEST:,} bytes, which no mesh here has")
    return data


def _compressed(archive: Path) -> bytes:
    # A server may have said that the compression is one of the transfer; then it is undone already.
    with archive.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
        file.seek(0)
        return gzip.open(file).read(LARGEST + 1) if packed else file.read(LARGEST + 1)


def _in_tar(archive: Path, member: str) -> bytes:
    with tarfile.open(archive) as tar:
        entry = tar.getmember(member)
        # A link could lead to itself, and nothing that is expected here is one.
        file = tar.extractfile(entry) if entry.isreg() else None
        if file is None:
            raise KeyError(member)
        return file.read(LARGEST + 1)
