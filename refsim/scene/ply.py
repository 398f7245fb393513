"""PLY files, ASCII and binary of either byte order, read straight into NumPy.

Format as published by Greg Turk (Georgia Tech, "The PLY Polygon File Format", 1994). Polygons are split into fans in
file order. Vertex normals (nx ny nz) and texture coordinates (s t, u v, texture_u texture_v) are kept; colours, edges
and other elements are read over. Triangle strips are refused.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.scene.ply_body import BinaryBody, Columns, Element, Lists, Property, TextBody
from refsim.scene.polygons import RawMesh, fan

__all__ = ["ply_face_count", "read_ply"]

SCALARS = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TEXCOORD_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))


def read_ply(label: str, data: bytes) -> RawMesh:
    """The mesh in the bytes of a PLY file; ``InputError`` opens with ``label``."""
    order, elements, offset = _header(label, data)
    source: BinaryBody | TextBody
    source = TextBody(label, data[offset:]) if order == "" else BinaryBody(label, data, offset, order)
    tables = {element.name: source.read(element) for element in elements}
    vertex = tables.get("vertex")
    if vertex is None or not all(isinstance(vertex.get(axis), np.ndarray) for axis in "xyz"):
        raise InputError(f"{label} has no element vertex with the properties x, y and z")
    return RawMesh(
        np.stack([np.asarray(vertex[axis]) for axis in "xyz"], axis=1),
        _faces(label, tables),
        normals=_together(vertex, ("nx", "ny", "nz")),
        texcoords=next((both for names in TEXCOORD_NAMES if (both := _together(vertex, names)) is not None), None),
    )


def ply_face_count(data: bytes) -> int | None:
    """Number of faces that a PLY header declares; ``data`` need only hold the header; None if it has none."""
    try:
        _, elements, _ = _header("", data)
    except InputError:
        return None
    return next((element.rows for element in elements if element.name == "face"), None)


def _faces(label: str, tables: dict[str, Columns]) -> NDArray[np.int64]:
    columns = tables.get("face", {})
    lists = columns.get("vertex_indices", columns.get("vertex_index"))
    if not isinstance(lists, Lists):
        strips = " (its triangle strips are not read)" if "tristrips" in tables else ""
        raise InputError(f"{label} holds no triangles{strips}")
    short = lists.counts < 3
    if short.any():
        row = int(np.argmax(short))
        raise InputError(f"{label} has a face that is no polygon: face {row} has {lists.counts[row]} vertices")
    # An ASCII file may hold any number here, NaN and 1e300 too.
    values = lists.values
    sound = values.dtype.kind != "f" or bool((np.abs(values) < 2.0**62).all())
    whole = values.astype(np.int64) if sound else np.zeros(0, np.int64)
    if not sound or (whole != values).any():
        raise InputError(f"{label} has a vertex index that is no whole number in its element face")
    return fan(lists.counts, whole)


def _together(vertex: Columns, names: tuple[str, ...]) -> NDArray | None:
    if not all(isinstance(vertex.get(name), np.ndarray) for name in names):
        return None
    return np.stack([np.asarray(vertex[name]) for name in names], axis=1)


def _header(label: str, data: bytes) -> tuple[str, list[Element], int]:
    if data[:3] != b"ply" or data[3:4] not in (b"\n", b"\r", b" "):
        raise InputError(f"{label} is not a PLY file: it does not begin with the line 'ply'")
    end = data.find(b"end_header")
    stop = data.find(b"\n", end)
    if end < 0 or stop < 0:
        raise InputError(f"{label} is truncated: its header has no end_header line")
    order: str | None = None
    elements: list[Element] = []
    for line in data[:end].decode("latin-1").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in FORMATS:
            order = FORMATS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isdecimal() and len(words[2]) <= 18:
            elements.append(Element(words[1], int(words[2])))
        elif words[0] == "property" and elements and (column := _property(words)) is not None:
            elements[-1].properties.append(column)
        else:
            raise InputError(f"{label} has a PLY header line that cannot be read: {line.strip()!r}")
    if order is None:
        raise InputError(f"{label} has a PLY header without a format line")
    return order, elements, stop + 1


def _property(words: list[str]) -> Property | None:
    if len(words) == 3 and words[1] in SCALARS:
        return Property(words[2], SCALARS[words[1]])
    if len(words) == 5 and words[1] == "list" and words[2] in SCALARS and words[3] in SCALARS:
        count_kind = SCALARS[words[2]]
        return Property(words[4], SCALARS[words[3]], count_kind) if count_kind[0] != "f" else None
    return None
