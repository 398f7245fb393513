"""STL files, binary and ASCII, in file order; the facet normals of the file are ignored."""

from __future__ import annotations

import numpy as np

from refsim.errors import InputError
from refsim.scene.polygons import RawMesh

__all__ = ["read_stl"]

HEADER = 84
FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(label: str, data: bytes) -> RawMesh:
    """The mesh in the bytes of an STL file; ``InputError`` opens with ``label``.

    A file whose length fits its binary header is binary, even if it begins with "solid", as some exporters write.
    """
    count = int.from_bytes(data[80:84], "little") if len(data) >= HEADER else -1
    if count >= 0 and len(data) == HEADER + count * FACET.itemsize:
        vertices = np.frombuffer(data, FACET, count, HEADER)["vertices"].reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        vertices = _text(label, data.decode("latin-1").lower().split())
    elif count >= 0:
        held = (len(data) - HEADER) / FACET.itemsize
        raise InputError(
            f"{label} is truncated or no STL file: its header says {count} triangles, and it holds {held:.6g}"
        )
    else:
        raise InputError(
            f"{label} is not an STL file: it is shorter than a binary header and does not begin with 'solid'"
        )
    return RawMesh(vertices, np.arange(len(vertices), dtype=np.int64).reshape(-1, 3))


def _text(label: str, words: list[str]) -> np.ndarray:
    if "endsolid" not in words:
        raise InputError(f"{label} is truncated: it has no endsolid")
    vertices: list[list[float]] = []
    corners = facets = 0
    position = 0
    while position < len(words):
        word = words[position]
        if word in ("solid", "endsolid"):
            # A name of any words follows; it ends where the next facet or solid begins.
            position += 1
            while position < len(words) and words[position] not in ("facet", "solid", "endsolid"):
                position += 1
            continue
        if word == "vertex":
            vertices.append(_point(label, words[position + 1 : position + 4]))
            corners += 1
            position += 3
        elif word == "endfacet":
            if corners != 3:
                raise InputError(f"{label} has a facet that is no triangle: facet {facets} has {corners} vertices")
            corners, facets = 0, facets + 1
        position += 1
    if corners:
        raise InputError(f"{label} is truncated: facet {facets} has no endfacet")
    return np.array(vertices, np.float64).reshape(-1, 3)


def _point(label: str, words: list[str]) -> list[float]:
    try:
        point = [float(word) for word in words]
    except ValueError:
        point = []
    if len(point) != 3:
        raise InputError(f"{label} has a vertex that is not 3 numbers: {' '.join(words)!r}")
    return point
