"""Traversal lists as a file that says what it is: written whole or not at all, refused where a byte is wrong.

    magic      8 bytes, b"refsimTL"                        version    u32, 1
    order      u32, row of `lists.ORDERS`, from 0          culling    u32, 0 none, else 1 + row of `culling.RULES`
    lists      u32                                         elements, vertices, nodes, triangles   u64 each
    directions f64[lists, 3]                               heads      i64[lists + 1]
    escape     i32[elements]                               payload    i32 or f32[elements, 4]
    vertices   f32[vertices, 4]                            parent     i32[nodes]
    owner      i32[triangles]                              corners    i32[triangles, 3], rows of vertices
    checksum   SHA-256 of all bytes before it

Little-endian throughout, row by row as above, without padding; elements are those of all lists. The parts from heads on
are those of `byte_layout.ListBytes`.
"""

from __future__ import annotations

import hashlib
import os
import struct
import tempfile
from pathlib import Path

from refsim.errors import InputError
from refsim.papers.sphere_hierarchy.byte_layout import (
    ESCAPE_BYTES,
    HEAD_BYTES,
    PAYLOAD_BYTES,
    VERTEX_BYTES,
    ListBytes,
    from_bytes,
    to_bytes,
)
from refsim.papers.sphere_hierarchy.culling import RULES
from refsim.papers.sphere_hierarchy.directions import LISTS, list_directions
from refsim.papers.sphere_hierarchy.lists import ORDERS, TraversalLists

MAGIC, VERSION = b"refsimTL", 1
HEADER = struct.Struct("<8s4I4Q")
CHECKSUM_BYTES = 32
CULLINGS = (None, *RULES)


def write_lists(path: str | Path, lists: TraversalLists) -> None:
    """Writes lists to `path`; an older file survives any failure. Raises `InputError` where it cannot be written."""
    path = Path(path)
    data = file_bytes(lists)
    try:
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
            # mkstemp makes files private; lists get the mode that any new file would have
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(name, 0o666 & ~mask)
            os.replace(name, path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except (OSError, ValueError) as error:  # a name with a null byte is a ValueError
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot write lists to {str(path)!r}: {reason}.") from error


def file_bytes(lists: TraversalLists) -> bytes:
    """The whole file."""
    parts, h = to_bytes(lists), lists.hierarchy
    codes = ORDERS.index(lists.order), CULLINGS.index(lists.culling), lists.count
    counts = len(lists.escape), len(lists.vertices.positions), len(h), len(h.triangles)
    body = b"".join(
        [
            HEADER.pack(MAGIC, VERSION, *codes, *counts), lists.directions.astype("<f8").tobytes(), parts.heads,
            parts.escape, parts.payload, parts.vertices, parts.parent, parts.owner, parts.corners,
        ]
    )  # fmt: skip
    return body + hashlib.sha256(body).digest()


def read_lists(path: str | Path) -> TraversalLists:
    """The lists in a file. Raises `InputError` for one that cannot be read, is cut, damaged or something else."""
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read lists from {str(path)!r}: {reason}.") from error
    try:
        return lists_of_file(data)
    except InputError as error:
        raise InputError(f"{str(path)!r} holds no traversal lists: {error}") from None


def lists_of_file(data: bytes) -> TraversalLists:
    """The lists in a file's bytes."""
    if data[: len(MAGIC)] != MAGIC[: len(data)] or not data:
        raise InputError("it does not begin as a file of lists does.")
    if len(data) < HEADER.size:
        raise InputError(f"it is cut off in its header, after {len(data)} bytes.")
    _, version, order, culling, lists, elements, vertices, nodes, triangles = HEADER.unpack_from(data)
    if version != VERSION:
        raise InputError(f"its version is {version}, and only {VERSION} can be read.")
    if order >= len(ORDERS) or culling >= len(CULLINGS) or lists not in LISTS:
        raise InputError(f"its header names order {order}, culling {culling} and {lists} lists.")
    sizes = {
        "directions": 24 * lists, "heads": HEAD_BYTES * (lists + 1), "escape": ESCAPE_BYTES * elements,
        "payload": PAYLOAD_BYTES * elements, "vertices": VERTEX_BYTES * vertices, "parent": 4 * nodes,
        "owner": 4 * triangles, "corners": 12 * triangles,
    }  # fmt: skip
    whole = HEADER.size + sum(sizes.values()) + CHECKSUM_BYTES
    if len(data) != whole:
        raise InputError(f"it has {len(data)} bytes, and its header asks for {whole}.")
    body = memoryview(data)[:-CHECKSUM_BYTES]
    if hashlib.sha256(body).digest() != data[-CHECKSUM_BYTES:]:
        raise InputError("its checksum is not that of its bytes.")
    parts, at = {}, HEADER.size
    for name, size in sizes.items():
        parts[name], at = bytes(body[at : at + size]), at + size
    if parts.pop("directions") != list_directions(lists).astype("<f8").tobytes():
        raise InputError(f"its directions are not those of {lists} lists.")
    return from_bytes(ListBytes(**parts), ORDERS[order], CULLINGS[culling])
