"""Wavefront OBJ files: v, vn, vt and f lines, in file order.

Negative indices count back from the last vertex read so far. Polygons are split into fans. Objects, groups, materials,
lines and points are read over. Normals and texture coordinates count only when every face has them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene.polygons import RawMesh, fan

__all__ = ["read_obj"]

LENGTHS = {"v": 3, "vn": 3, "vt": 2}


def read_obj(label: str, data: bytes) -> RawMesh:
    """The mesh in the bytes of an OBJ file; ``InputError`` opens with ``label`` and names the line."""
    if b"\0" in data:
        raise InputError(f"{label} is not an OBJ file: it holds binary data")
    tables: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    corners: dict[str, list[int]] = {"v": [], "vt": [], "vn": []}
    counts: list[int] = []
    text = data.decode("latin-1").replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0] in LENGTHS:
            tables[words[0]].append(_numbers(label, number, words[0], words[1:]))
        elif words[0] == "f":
            if len(words) < 4:
                raise InputError(
                    f"{label} has a face with {len(words) - 1} vertices in line {number}, which is no polygon"
                )
            counts.append(len(words) - 1)
            for word in words[1:]:
                _corner(label, number, word, tables, corners)
    return _mesh(tables, corners, counts)


def _numbers(label: str, number: int, keyword: str, words: list[str]) -> list[float]:
    length = LENGTHS[keyword]
    try:
        values = [float(word) for word in words[:length]]
    except ValueError:
        values = []
    # A texture coordinate may have one number only; its second is then 0.
    if keyword == "vt" and len(values) == 1:
        values.append(0.0)
    if len(values) < length:
        raise InputError(
            f"{label} has a {keyword} line that is not {length} numbers, line {number}: {' '.join(words)!r}"
        )
    return values


def _corner(label: str, number: int, word: str, tables: dict[str, list], corners: dict[str, list[int]]) -> None:
    parts = word.split("/")
    for keyword, part in zip(("v", "vt", "vn"), parts, strict=False):
        if not part and keyword != "v":
            continue
        try:
            index = int(part)
        except ValueError:
            index = 0
        if index == 0 or len(parts) > 3:
            raise InputError(f"{label} has a face corner that is no index in line {number}: {word!r}")
        # Indices start at 1; a negative one counts back, and one that counts too far becomes -1, out of range for all.
        row = min(index - 1, 2**62) if index > 0 else max(len(tables[keyword]) + index, -1)
        corners[keyword].append(row)


def _mesh(tables: dict[str, list], corners: dict[str, list[int]], counts: list[int]) -> RawMesh:
    sizes = np.array(counts, np.int64)

    def column(keyword: str) -> NDArray[np.int64] | None:
        complete = len(corners[keyword]) == len(corners["v"])
        return fan(sizes, np.array(corners[keyword], np.int64)) if complete and counts else None

    normal_faces, texcoord_faces, faces = column("vn"), column("vt"), column("v")
    return RawMesh(
        np.array(tables["v"], np.float64).reshape(-1, 3),
        np.zeros((0, 3), np.int64) if faces is None else faces,
        None if normal_faces is None else np.array(tables["vn"], np.float64).reshape(-1, 3),
        normal_faces,
        None if texcoord_faces is None else np.array(tables["vt"], np.float64).reshape(-1, 2),
        texcoord_faces,
    )
