"""Plan: whatever is wrong with a mesh file or name, one sentence says so, and the same file without the fault loads.

- Each row of the table is a file and a fragment of the sentence; control rows load.
- Each file cut short anywhere, or with any byte changed, loads or is refused with InputError, never another error.
- Sources that are no files: folders, other objects, trimesh objects without triangles or with wrong indices.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.scene import Scene, load_scene
from tests.scene.mesh_bytes import (
    ASCII_STL,
    CORNERS,
    FACES,
    GARBAGE,
    POINTS,
    STRIPS,
    glb,
    glb_of,
    glb_with_index,
    obj,
    ply,
    stl,
    with_vertex,
)

# Row: file name, content, fragment of the sentence (None: a control row that loads).
TABLE: dict[str, tuple[str, bytes, str | None]] = {
    "control PLY": ("a.ply", ply(), None),
    "control binary PLY": ("a.ply", ply(text=False), None),
    "control OBJ": ("a.obj", obj(), None),
    "control STL": ("a.stl", stl(), None),
    "control ASCII STL": ("a.stl", ASCII_STL, None),
    "control OBJ far back": ("a.obj", obj("v 9 9 9", faces=("f -4 -3 -2", "f 1 2 4")), None),
    "control OBJ of materials": ("a.obj", obj("usemtl a", "f 2 3 4", "usemtl b", "f 1 3 4"), None),
    "control OBJ of two forms": ("a.obj", obj("vt 1 1", "f 1/1 2/1 3/1", faces=("f 1 2 3", "f 1 2 4")), None),
    "control OBJ hexagon": ("a.obj", obj("vt 1 1", "f 1 2 3 1 2 3", faces=("f 1/1 2/1 3/1",)), None),
    "control OBJ comment": ("a.obj", obj().replace(b"v 0.0 0.0 1.0", b"  v\t0 0 1 # usemtl here"), None),
    "control PLY blank lines": ("a.ply", ply().replace(b"1.0 0.0 0.0\n", b"1.0 0.0 0.0\n  \n\n"), None),
    "control PLY comment": ("a.ply", ply(text=False).replace(b"ply\n", b"ply\ncomment ascii end_header\n"), None),
    "control PLY small ints": ("a.ply", ply().replace(b"int vertex_", b"char vertex_"), None),
    "control STL name": ("a.stl", ASCII_STL.replace(b"solid s", b"solid vertex 1 2 3 \xe9"), None),
    "control GLB": ("a.glb", glb(), None),
    "control capital ending": ("a.PLY", ply(), None),
    "empty PLY": ("a.ply", b"", "is empty"),
    "empty GLB": ("a.glb", b"", "is empty"),
    "garbage PLY": ("a.ply", GARBAGE, "does not begin with the line 'ply'"),
    "garbage OBJ": ("a.obj", GARBAGE, "is not an OBJ file: it holds binary data"),
    "garbage STL": ("a.stl", GARBAGE, "truncated or no STL file"),
    "garbage GLB": ("a.glb", GARBAGE, "cannot be read as GLB"),
    "prose OBJ": ("a.obj", b"once upon a time\n", "holds no triangles"),
    "prose STL": ("a.stl", b"once upon a time\n", "is not an STL file"),
    "unknown ending": ("a.txt", ply(), "is of no format that can be read: a mesh ends in .ply, .obj, .stl, .glb"),
    "no ending": ("mesh", ply(), "is of no format that can be read"),
    "header cut": ("a.ply", ply()[:60], "truncated: its header has no end_header"),
    "vertices cut": ("a.ply", ply(text=False)[:-40], "its length is not what its header and first rows ask for"),
    "faces cut": ("a.ply", ply(text=False)[:-1], "its length is not what its header and first rows ask for"),
    "all faces cut": ("a.ply", ply(text=False)[:-26], "truncated: it ends before its faces"),
    "binary rest": ("a.ply", ply(text=False) + b"\n", "its length is not what its header and first rows ask for"),
    "ASCII faces cut": ("a.ply", ply()[:-8], "truncated: it ends inside its 2 rows of element face"),
    "ASCII face cut": ("a.ply", ply()[:-4], "wrong row 1 in its element face: '3 0 '"),
    "ASCII face longer": ("a.ply", ply()[:-1] + b" 2\n", "wrong row 1 in its element face: '3 0 1 3 2'"),
    "ASCII rest": ("a.ply", ply() + b"3 1 2 3\n", "row that its header does not declare: '3 1 2 3'"),
    "absurd count": (
        "a.ply",
        ply(text=False, count=10**17),
        "its length is not what its header and first rows ask for",
    ),
    "absurd ASCII count": ("a.ply", ply(count=10**17), "truncated: it ends inside"),
    "count beyond int64": ("a.ply", ply(count=10**40), "header line that cannot be read"),
    "STL cut": ("a.stl", stl()[:-10], "its header says 2 triangles, and it holds 1.8"),
    "STL claims more": ("a.stl", stl(count=2**32 - 1), "its header says 4294967295 triangles"),
    "ASCII STL cut": (
        "a.stl",
        ASCII_STL[:-10],
        "truncated or no ASCII STL of triangles, an item a line: behind 1 facets stands 'e'",
    ),
    "ASCII STL without end": ("a.stl", ASCII_STL[:-11], "behind 1 facets stands '', neither facet nor endsolid"),
    "second ASCII STL cut": ("a.stl", ASCII_STL + ASCII_STL[:-20], "behind 1 facets stands 'facet normal 0 0 1 outer"),
    "ASCII STL of quads": (
        "a.stl",
        ASCII_STL.replace(b"endloop", b"vertex 1 1 1\nendloop"),
        "vertex 0 1 0 vertex 1 1 1",
    ),
    "ASCII STL words": ("a.stl", ASCII_STL.replace(b"vertex 0 1 0", b"vertex 0 one 0"), "vertex 0 one 0 endloop"),
    "ASCII STL in a line": ("a.stl", ASCII_STL.replace(b"\n", b" "), "behind 0 facets stands ''"),
    "GLB cut": ("a.glb", glb()[:-30], "cannot be read as GLB"),
    "OBJ face cut": ("a.obj", obj("f 1 2"), "face with 2 vertices in line 7"),
    "OBJ vertex cut": ("a.obj", obj("v 1 2"), "line 7: '1 2'"),
    "OBJ words": ("a.obj", obj("v 1 2 three"), "line 7: '1 2 three'"),
    "OBJ corner words": ("a.obj", obj("f 1 2 c"), "corner that is no index in line 7: 'c'"),
    "OBJ corner of four": ("a.obj", obj("f 1/ 2/ 3///"), "corner that is no index in line 7: '3///'"),
    "OBJ corner zero": ("a.obj", obj("f 0 1 2"), "corner that is no index in line 7: '0'"),
    "PLY words": (
        "a.ply",
        ply().replace(b"1.0 0.0 0.0", b"1.0 zero 0.0"),
        "wrong row 1 in its element vertex: '1.0 zero 0.0'",
    ),
    "PLY without x": ("a.ply", ply().replace(b"float x", b"float w"), "no element vertex with the properties x, y"),
    "PLY format": ("a.ply", ply().replace(b"ascii", b"ebcdic"), "cannot be read: 'format ebcdic 1.0'"),
    "PLY type": ("a.ply", ply().replace(b"float x", b"half x"), "cannot be read: 'property half x'"),
    "PLY format behind": (
        "a.ply",
        ply().replace(b"format ascii 1.0\n", b"").replace(b"end_h", b"format ascii 1.0\nend_h"),
        "without a format line at its top",
    ),
    "PLY two x": ("a.ply", ply().replace(b"float y", b"float x"), "for the second time: 'property float x'"),
    "PLY no format": ("a.ply", ply().replace(b"format ascii 1.0\n", b""), "without a format line"),
    "point cloud": ("a.ply", POINTS, "holds no triangles"),
    "no faces": ("a.ply", ply(faces=[]), "holds no triangles"),
    "strips": ("a.ply", STRIPS, "its triangle strips are not read"),
    "lines": ("a.ply", ply(faces=[(0, 1, 2), (0, 1)]), "no polygon: face 1 has 2 vertices"),
    "binary lines": ("a.ply", ply(faces=[(0, 1), (1, 2)], text=False), "no polygon: face 0 has 2 vertices"),
    "binary lines between": ("a.ply", ply(faces=[(0, 1, 2), (0, 1)], text=False), "its polygons differ in size"),
    "OBJ points": ("a.obj", obj(faces=()), "holds no triangles"),
    "OBJ lines": ("a.obj", obj(faces=("l 1 2", "p 3")), "holds no triangles"),
    "STL of nothing": ("a.stl", stl(triangles=[]), "holds no triangles"),
    "ASCII STL of nothing": ("a.stl", b"solid\nendsolid\n", "holds no triangles"),
    "GLB points": ("a.glb", glb_of(trimesh.PointCloud(CORNERS)), "holds no triangles"),
    "GLB lines": ("a.glb", glb_of(trimesh.load_path(CORNERS[:2])), "holds no triangles"),
    "PLY NaN": ("a.ply", ply(with_vertex(2, math.nan), text=False), "not finite in float32: vertex 2 is [0.0, nan,"),
    "ASCII PLY NaN": ("a.ply", ply(with_vertex(2, math.nan)), "vertex 2 is [0.0, nan, 0.0]"),
    "PLY infinite": ("a.ply", ply(with_vertex(3, -math.inf), text=False), "vertex 3 is [0.0, -inf, 1.0]"),
    "PLY beyond float32": ("a.ply", ply([*CORNERS[:3].tolist(), (0, 1e39, 0)]), "vertex 3 is [0.0, 1e+39, 0.0]"),
    "unused NaN": ("a.ply", ply([*CORNERS.tolist(), (0, 0, math.nan)]), "vertex 4 is"),
    "OBJ NaN": ("a.obj", obj(vertices=with_vertex(1, math.nan)), "vertex 1 is [1.0, nan, 0.0]"),
    "OBJ unused NaN": ("a.obj", obj("v 0 0 nan"), "vertex 4 is [0.0, 0.0, nan]"),
    "OBJ infinite": ("a.obj", obj(vertices=with_vertex(1, math.inf)), "vertex 1 is [1.0, inf, 0.0]"),
    "STL NaN": ("a.stl", stl(with_vertex(3, math.nan)[np.array(FACES)]), "vertex 5 is [0.0, nan, 1.0]"),
    "STL signalling NaN": ("a.stl", stl()[:-6] + b"\1\0\x80\x7f\0\0", "vertex 5 is [0.0, 0.0, nan]"),
    "GLB NaN": ("a.glb", glb(with_vertex(3, math.nan)), "vertex 3 is [0.0, nan, 1.0]"),
    "index beyond": (
        "a.ply",
        ply(faces=[FACES[0], (0, 1, 4)], text=False),
        "triangle 1 refers to vertex 4, but only 0 to 3",
    ),
    "index negative": ("a.ply", ply(faces=[(0, 1, 2), (0, 1, -1)], text=False), "triangle 1 refers to vertex -1"),
    "index 2**32 - 1": ("a.ply", ply(faces=[(0, 1, 2**32 - 1)], text=False, kind="uint"), "refers to vertex 42949"),
    "ASCII index negative": ("a.ply", ply(faces=[(-1, 1, 2)]), "triangle 0 refers to vertex -1"),
    "index 1.5": ("a.ply", ply(faces=[(0, 1, 1.5)]), "vertex index that is no whole number"),
    "index NaN": ("a.ply", ply(faces=[(0, 1, math.nan)]), "vertex index that is no whole number"),
    "index 1e300": ("a.ply", ply(faces=[(0, 1, 1e300)]), "vertex index that is no whole number"),
    "list of -1": ("a.ply", ply().replace(b"3 0 1 3", b"-1 0 1 3"), "wrong row 1 in its element face: '-1 0 1 3'"),
    "OBJ index beyond": ("a.obj", obj("f 1 2 5"), "no index in line 7: '5' (of 4 v, 0 vt, 0 vn lines)"),
    "OBJ index far beyond": ("a.obj", obj(f"f 1 2 {10**40}"), "no index in line 7: '1000"),
    "OBJ counts back too far": ("a.obj", obj("f -1 -2 -5"), "no index in line 7: '-5'"),
    "OBJ counts back far too far": ("a.obj", obj(f"f -1 -2 -{10**40}"), "no index in line 7: '-1000"),
    "OBJ normal beyond": (
        "a.obj",
        obj("vn 0 0 1", faces=("f 1//1 2//1 3//2",)),
        "line 5: '3//2' (of 4 v, 0 vt, 1 vn lines)",
    ),
    "GLB index beyond": ("a.glb", glb_with_index(4), "index out of range: triangle 1"),
    "uchar index 256": ("a.ply", ply(faces=[(0, 1, 256)]).replace(b"int vertex_", b"uchar vertex_"), "vertex 256"),
    "zero area": ("a.ply", ply(faces=[(0, 0, 1), (2, 2, 2)]), "holds only zero-area triangles"),
    "zero area OBJ": ("a.obj", obj(faces=("f 1 1 1",)), "holds only zero-area triangles"),
    "zero area STL": ("a.stl", stl(np.ones((3, 3, 3))), "holds only zero-area triangles"),
}


@pytest.mark.parametrize("row", TABLE)
def test_bad_files(row: str, tmp_path: Path) -> None:
    name, content, fragment = TABLE[row]
    path = tmp_path / name
    path.write_bytes(content)
    if fragment is None:
        np.testing.assert_array_equal(load_scene(path).triangles[0], CORNERS[:3])
        return
    with pytest.raises(InputError) as caught:
        load_scene(path)
    sentence = str(caught.value)
    assert fragment in sentence and str(path) in sentence and "\n" not in sentence, sentence


SOUND = {row: TABLE[row] for row in TABLE if row.startswith("control")}


@pytest.mark.parametrize("row", SOUND)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_load_or_are_refused(row: str, tmp_path: Path, data: st.DataObject) -> None:
    name, content, _ = SOUND[row]
    damaged = bytearray(content[: data.draw(st.integers(1, len(content)))])
    for place in data.draw(st.lists(st.integers(0, len(damaged) - 1), max_size=3)):
        damaged[place] = data.draw(st.integers(0, 255))
    path = tmp_path / name
    path.write_bytes(damaged)
    try:
        scene = load_scene(path)
    except InputError as error:
        assert "\n" not in str(error) and str(path) in str(error)
    else:
        assert isinstance(scene, Scene) and np.isfinite(scene.triangles).all()


def two_parts(face: tuple[int, int, int]) -> trimesh.Scene:
    """Two meshes, the first with a face that may point into the second."""
    parts = [trimesh.Trimesh(CORNERS, faces, process=False) for faces in ([face], FACES)]
    return trimesh.Scene(parts)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere.ply' does not exist"):
        load_scene(tmp_path / "nowhere.ply")


def test_folder(tmp_path: Path) -> None:
    for source in (tmp_path, str(tmp_path) + "/", tmp_path / "named.ply"):
        Path(source).mkdir(exist_ok=True)
        with pytest.raises(InputError, match="is a folder, not a mesh"):
            load_scene(source)


@pytest.mark.parametrize(
    ("source", "fragment"),
    [
        ("", "unknown scene ''"),
        ("bunyn", "did you mean bunny"),
        ("xyzzy", "the library has cornell_box, torus_knot, room, cubes, sphere, blob"),
        (7, "not a int"),
        (None, "not a NoneType"),
        (np.zeros((1, 3, 3)), "not a ndarray"),
        ("a\0b.ply", "cannot be read"),
        (trimesh.Scene(), "the trimesh object holds no triangles"),
        (trimesh.PointCloud(CORNERS), "the trimesh object holds no triangles"),
        (trimesh.Trimesh(CORNERS, [(0, 1, 4)], process=False), "index out of range: triangle 0"),
        (trimesh.Trimesh(CORNERS, [(0, 1, -1)], process=False), "index out of range: triangle 0"),
        (two_parts((0, 1, 4)), "index out of range: triangle 0"),
        (two_parts((0, 1, -1)), "index out of range: triangle 0"),
        (trimesh.Trimesh(CORNERS, [(1, 1, 1)], process=False), "holds only zero-area triangles"),
        (trimesh.Trimesh(with_vertex(3, math.nan), FACES, process=False), "vertex 3 is"),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_other_sources(source: object, fragment: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene(source)  # type: ignore[arg-type]
    assert fragment in str(caught.value) and "\n" not in str(caught.value), caught.value


def test_unreadable_file_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    path = tmp_path / "locked.ply"
    path.write_bytes(ply())
    assert len(load_scene(path)) == 2
    # The superuser may read everything, so the refusal is acted.
    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(InputError, match=r"locked.ply' cannot be read: Permission denied"):
        load_scene(path)
