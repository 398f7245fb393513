"""Small mesh files as bytes, sound ones and ones with a fault, for the table of bad files."""

from __future__ import annotations

import struct

import numpy as np
import trimesh

CORNERS = np.float32([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
FACES = [(0, 1, 2), (0, 1, 3)]
SOUP = CORNERS[np.array(FACES)]
GARBAGE = bytes(np.random.default_rng(7).integers(0, 256, 500, dtype=np.uint8))


def ply(vertices=CORNERS, faces=FACES, *, text: bool = True, count: int | None = None, kind: str = "int") -> bytes:
    """A PLY file; ``count`` is the number of faces that the header claims."""
    head = f"ply\nformat {'ascii' if text else 'binary_little_endian'} 1.0\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(faces) if count is None else count}\nproperty list uchar {kind} vertex_indices\n"
    head += "end_header\n"
    if text:
        rows = [" ".join(map(str, row)) for row in vertices] + [" ".join(map(str, (len(f), *f))) for f in faces]
        return (head + "\n".join(rows) + "\n").encode()
    code = {"int": "i", "uint": "I"}[kind]
    return (
        head.encode()
        + b"".join(struct.pack("<3f", *row) for row in vertices)
        + b"".join(struct.pack(f"<B{len(f)}{code}", len(f), *f) for f in faces)
    )


def obj(*extra: str, vertices=CORNERS, faces: tuple[str, ...] = ("f 1 2 3", "f 1 2 4")) -> bytes:
    """An OBJ file."""
    return "\n".join([*("v " + " ".join(map(str, row)) for row in vertices), *faces, *extra]).encode()


def stl(triangles=SOUP, count: int | None = None) -> bytes:
    """A binary STL file; ``count`` is the number of triangles that the header claims."""
    head = b"\0" * 80 + struct.pack("<I", len(triangles) if count is None else count)
    return head + b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(t), 0) for t in triangles)


def glb(vertices=CORNERS, faces=FACES) -> bytes:
    """A GLB file."""
    return trimesh.Trimesh(vertices, faces, process=False).export(file_type="glb", include_normals=False)


def glb_of(geometry: object) -> bytes:
    return trimesh.Scene([geometry]).export(file_type="glb")


def with_vertex(number: int, value: float) -> np.ndarray:
    """The corners with one component changed."""
    corners = CORNERS.copy()
    corners[number, 1] = value
    return corners


def glb_with_index(index: int) -> bytes:
    """A GLB whose last index is changed in the binary chunk."""
    data = glb()
    at = data.index(np.array(FACES, np.uint32).tobytes())
    return data[: at + 20] + struct.pack("<I", index) + data[at + 24 :]


ASCII_STL = (
    b"solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    b"endloop\nendfacet\nendsolid s\n"
)
POINTS = ply()[: ply().index(b"element face")] + b"end_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
STRIPS = POINTS.replace(b"end_h", b"element tristrips 0\nproperty int a\nend_h")
