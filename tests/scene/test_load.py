"""Plan: files keep their triangles in order to the last bit of float32, and bad ones are refused in one sentence.

- A soup written by trimesh as PLY (binary, ASCII), OBJ, STL (binary, ASCII) or GLB, or by hand as PLY of other layouts,
  loads with the same triangles in the same order; so do trimesh objects.
- Polygons of mixed sizes become fans in file order, in ASCII PLY and OBJ, those of one size in binary PLY too; OBJ
  indices may count back, and corners keep their own normals and texture coordinates.
- trimesh is imported for files, and for the library not.
- Transforms of a GLB scene are applied, and a mirroring one keeps fronts in front; two parts keep their order.
- Normals and texture coordinates of a source are kept.
- Names find real meshes in the folder, the library first; absent ones say where to put them.
- Real meshes at hand have their published numbers of triangles and load fast.
"""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from refsim.errors import InputError
from refsim.scene import GLASS, MIRROR, Scene, load_scene, missing_meshes, scene_names
from refsim.scene.known import KNOWN_MESHES
from tests.scenes_present import absent, present, real_scene

FLOATS = st.floats(-1e6, 1e6, width=32).filter(lambda x: x == 0 or abs(x) > 1e-6)


@st.composite
def meshes(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Vertices float32[v, 3] and faces [n, 3] with at least one triangle of some area."""
    vertices = draw(hnp.arrays(np.float32, st.tuples(st.integers(3, 12), st.just(3)), elements=FLOATS))
    vertices = np.concatenate([vertices, np.eye(3, dtype=np.float32)])
    count = len(vertices)
    index = st.integers(0, count - 1)
    faces = draw(st.lists(st.tuples(index, index, index), min_size=1, max_size=15))
    return vertices, np.array([*faces, (count - 3, count - 2, count - 1)])


def ply_big_endian(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """A binary PLY of the other byte order, with a colour, a flag before the list, and an element of edges in front."""
    head = (
        "ply\nformat binary_big_endian 1.0\ncomment made by hand\n"
        "element edge 2\nproperty int32 a\nproperty int32 b\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty uchar red\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty uchar flag\nproperty list ushort uint vertex_index\nend_header\n"
    )
    body = struct.pack(">4i", 0, 1, 1, 2)
    body += b"".join(struct.pack(">dBdd", x, 7, y, z) for x, y, z in vertices.tolist())
    body += b"".join(struct.pack(">BH3I", 1, 3, *face) for face in faces.tolist())
    return head.encode() + body


def obj_counting_back(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """An OBJ with one face at a time behind its own vertices, by negative indices, groups and materials in between."""
    lines = ["# made by hand", "mtllib none.mtl"]
    for number, face in enumerate(faces):
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices[face].astype(np.float64).tolist()]
        lines += [f"usemtl m{number % 2}", f"g part{number % 3}", "f -3 -2 \\", " -1"]
    return "\r\n".join(lines).encode()


def exported(kind: str, vertices: np.ndarray, faces: np.ndarray) -> tuple[str, bytes]:
    """Ending and bytes of a file of that kind."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    writers = {
        "binary PLY": lambda: (".ply", mesh.export(file_type="ply", vertex_normal=False)),
        "ASCII PLY": lambda: (".ply", mesh.export(file_type="ply", encoding="ascii", vertex_normal=False)),
        "ASCII PLY by hand": lambda: (".ply", ply_text(faces.tolist(), vertices.astype(np.float64).tolist())),
        "big-endian PLY": lambda: (".ply", ply_big_endian(vertices, faces)),
        "OBJ": lambda: (".obj", mesh.export(file_type="obj", digits=20, include_normals=False).encode()),
        "OBJ counting back": lambda: (".obj", obj_counting_back(vertices, faces)),
        "binary STL": lambda: (".stl", mesh.export(file_type="stl")),
        "ASCII STL": lambda: (".STL", ascii_stl(vertices[faces])),
        "GLB": lambda: (".glb", mesh.export(file_type="glb", include_normals=False)),
    }
    return writers[kind]()


def ascii_stl(triangles: np.ndarray) -> bytes:
    """An ASCII STL of one solid whose name holds a keyword."""
    lines = ["solid my vertex"]
    for triangle in triangles.astype(np.float64).tolist():
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x!r} {y!r} {z!r}" for x, y, z in triangle)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid my vertex"]).encode()


KINDS = [
    "binary PLY",
    "ASCII PLY",
    "ASCII PLY by hand",
    "big-endian PLY",
    "OBJ",
    "OBJ counting back",
    "binary STL",
    "ASCII STL",
    "GLB",
]


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mesh=meshes())
def test_files_keep_triangles_in_order(kind: str, tmp_path: Path, mesh: tuple[np.ndarray, np.ndarray]) -> None:
    vertices, faces = mesh
    ending, data = exported(kind, vertices, faces)
    path = tmp_path / f"soup{ending}"
    path.write_bytes(data)
    for source in (path, str(path)):
        scene = load_scene(source)
        # trimesh writes eight digits behind the point to ASCII PLY, which cannot name every float32.
        slack = 1e-8 if kind == "ASCII PLY" else 0.0
        np.testing.assert_allclose(scene.triangles, vertices[faces], rtol=10 * slack, atol=slack)
        assert scene.name == "soup" and scene.materials == (GLASS,)


@settings(max_examples=25, deadline=None)
@given(meshes())
def test_trimesh_objects_keep_triangles_in_order(mesh: tuple[np.ndarray, np.ndarray]) -> None:
    vertices, faces = mesh
    body = trimesh.Trimesh(vertices, faces, process=False)
    np.testing.assert_array_equal(load_scene(body).triangles, vertices[faces])
    both = load_scene(trimesh.Scene([body, body.copy().apply_translation([1, 2, 3])]), material=MIRROR)
    assert len(both) == 2 * len(faces) and both.materials == (MIRROR,)
    np.testing.assert_array_equal(both.triangles[: len(faces)], vertices[faces])
    moved = np.add(vertices[faces].astype(np.float64), (1, 2, 3))
    np.testing.assert_array_equal(both.triangles[len(faces) :], moved.astype(np.float32))


PENTAGON = [(0, 0, 0), (2, 0, 0), (3, 1, 0), (1, 3, 0), (-1, 1, 0), (0, 0, 5)]
MIXED = [(0, 1, 5), (0, 1, 2, 3, 4), (1, 2, 5), (0, 2, 3, 4)]
FANS = [(0, 1, 5), (0, 1, 2), (0, 2, 3), (0, 3, 4), (1, 2, 5), (0, 2, 3), (0, 3, 4)]


def ply_text(polygons: list[tuple[int, ...]], vertices: list[tuple[float, ...]] = PENTAGON) -> bytes:
    """An ASCII PLY."""
    head = f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n"
    head += "property float x\nproperty float y\nproperty float z\n"
    head += f"element face {len(polygons)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(str, vertex)) for vertex in vertices] + [" ".join(map(str, (len(p), *p))) for p in polygons]
    return (head + "\n".join(rows) + "\n").encode()


def ply_binary(polygons: list[tuple[int, ...]], vertices: list[tuple[float, ...]] = PENTAGON) -> bytes:
    """A little-endian PLY."""
    head = ply_text(polygons, vertices).split(b"end_header\n")[0].replace(b"ascii", b"binary_little_endian")
    body = b"".join(struct.pack("<3f", *vertex) for vertex in vertices)
    body += b"".join(struct.pack(f"<B{len(p)}i", len(p), *p) for p in polygons)
    return head + b"end_header\n" + body


def obj_text(polygons: list[tuple[int, ...]], vertices: list[tuple[float, ...]] = PENTAGON) -> bytes:
    """An OBJ."""
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + ["f " + " ".join(str(k + 1) for k in p) for p in polygons]
    return "\n".join(lines).encode()


@pytest.mark.parametrize(("ending", "write"), [(".ply", ply_text), (".ply", ply_binary), (".obj", obj_text)])
def test_polygons_become_fans_in_order(tmp_path: Path, ending: str, write) -> None:
    path = tmp_path / f"mixed{ending}"
    path.write_bytes(write(MIXED))
    if write is ply_binary:
        with pytest.raises(InputError, match="its polygons differ in size, which is read from ASCII PLY only"):
            load_scene(path)
    else:
        np.testing.assert_array_equal(load_scene(path).triangles, np.float32(PENTAGON)[np.array(FANS)])
    path.write_bytes(write([(0, 1, 2, 3), (0, 1, 3, 5)]))
    fans = [(0, 1, 2), (0, 2, 3), (0, 1, 3), (0, 3, 5)]
    np.testing.assert_array_equal(load_scene(path).triangles, np.float32(PENTAGON)[np.array(fans)])
    path.write_bytes(write([(0, 1, 2, 3, 4), (4, 3, 2, 1, 5)]))
    fans = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (4, 3, 2), (4, 2, 1), (4, 1, 5)]
    np.testing.assert_array_equal(load_scene(path).triangles, np.float32(PENTAGON)[np.array(fans)])


def test_binary_ply_of_mixed_polygons_that_fill_the_bytes_of_equal_ones_is_refused(tmp_path: Path) -> None:
    # Four corners, five, three: as many bytes as three times four.
    path = tmp_path / "mixed.ply"
    path.write_bytes(ply_binary([(0, 1, 2, 3), (0, 1, 2, 3, 4), (0, 1, 2)]))
    with pytest.raises(InputError, match="lists of several lengths in its element face, read"):
        load_scene(path)


def test_obj_corners_keep_their_own_normals_and_texture_coordinates(tmp_path: Path) -> None:
    # One vertex has several normals and texture coordinates; the second material's faces stand between the first's.
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "vn 1 0 0", "vn 0 1 0", "vn 0 0 1", "vt 0 0", "vt 1 0", "vt 0 1"]
    corners = [((0, 1, 2), (0, 1, 2)), ((1, 2, 0), (2, 2, 1)), ((2, 0, 1), (1, 0, 0))]
    for number, (texcoords, normals) in enumerate(corners):
        slots = zip((1, 2, 3), texcoords, normals, strict=True)
        lines += [f"usemtl m{number % 2}", "f " + " ".join(f"{v}/{t + 1}/{n + 1}" for v, t, n in slots)]
    path = tmp_path / "own.obj"
    path.write_text("\n".join(lines))
    scene = load_scene(path)
    np.testing.assert_array_equal(scene.triangles, [np.float32([(0, 0, 0), (1, 0, 0), (0, 1, 0)])] * 3)
    np.testing.assert_array_equal(scene.vertex_normals, np.eye(3)[[normals for _, normals in corners]])
    plane = np.float32([(0, 0), (1, 0), (0, 1)])
    np.testing.assert_array_equal(scene.texcoords, plane[np.array([texcoords for texcoords, _ in corners])])


def test_obj_normals_and_texture_coordinates_of_some_faces_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "some.obj"
    tables = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nvt 0.5 1\n"
    for faces in ("f 1/1 2/1 3/1\nf 1//1 2//1 3//1", "f 1//1 2//1 3//1\nf 1/1 2/1 3/1", "f 1/1/1 2 3", "f 1 2 3/1/1"):
        path.write_text(tables + faces)
        scene = load_scene(path)
        assert (scene.triangles == np.float32([(0, 0, 0), (1, 0, 0), (0, 1, 0)])).all()
        assert (scene.texcoords == 0).all() and (scene.vertex_normals == (0, 0, 1)).all()


def test_trimesh_is_imported_only_for_files(tmp_path: Path) -> None:
    path = tmp_path / "one.ply"
    path.write_bytes(ply_text([(0, 1, 2)]))
    script = "import sys; from refsim.scene import load_scene, scene_names; scene_names(); load_scene('cubes')\n"
    script += "before = 'trimesh' in sys.modules; load_scene(sys.argv[1]); print(before, 'trimesh' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_glb_parts_are_placed_and_mirrors_keep_fronts(tmp_path: Path) -> None:
    body = trimesh.creation.icosahedron()
    scene = trimesh.Scene()
    scene.add_geometry(body, node_name="first", transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    scene.add_geometry(body.copy(), node_name="second", transform=np.diag([-2.0, 1.0, 1.0, 1.0]))
    path = tmp_path / "two.glb"
    path.write_bytes(scene.export(file_type="glb"))
    triangles = load_scene(path).triangles.astype(np.float64)
    assert len(triangles) == 40
    first, second = triangles[:20] - [5, 0, 0], triangles[20:]
    np.testing.assert_allclose(first, body.triangles, atol=1e-6)
    for part in (first, second):
        normal = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0])
        assert ((normal * part.mean(axis=1)).sum(axis=1) > 0).all()


def test_normals_and_texture_coordinates_are_kept(tmp_path: Path) -> None:
    ply = ply_text([(0, 1, 2)], [(0, 0, 0, 0, 0, 2, 0.5, 1), (1, 0, 0, 0, 3, 0, 0.25, 0), (0, 1, 0, 4, 0, 0, 0, 0)])
    columns = "".join(f"property float {name}\n" for name in ("nx", "ny", "nz", "s", "t"))
    ply = ply.replace(b"float z\n", b"float z\n" + columns.encode())
    obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\nvt .5 1\nvt .25 0\nvt 0 0\nf 1/1/3 2/2/2 3/3/1"
    for name, data in (("n.ply", ply), ("n.obj", obj)):
        (tmp_path / name).write_bytes(data)
        scene = load_scene(tmp_path / name)
        np.testing.assert_array_equal(scene.vertex_normals, np.float32([[[0, 0, 1], [0, 1, 0], [1, 0, 0]]]))
        np.testing.assert_array_equal(scene.texcoords, np.float32([[[0.5, 1], [0.25, 0], [0, 0]]]))
    body = trimesh.creation.icosphere(subdivisions=1)
    path = tmp_path / "n.glb"
    path.write_bytes(body.export(file_type="glb", include_normals=True))
    np.testing.assert_allclose(load_scene(path).vertex_normals, body.vertex_normals[body.faces], atol=1e-6)


def test_triangles_of_zero_area_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "some.ply"
    path.write_bytes(ply_text([(0, 0, 1), (0, 1, 2), (3, 3, 3)]))
    assert load_scene(path).degenerate.tolist() == [True, False, True]


def test_names_find_files_in_the_folder_and_the_library_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REFSIM_SCENES", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    for name in ("suzanne", "mine", "room"):
        (tmp_path / f"{name}.ply").write_bytes(ply_text([(0, 1, 2)]))
    (tmp_path / "teapot.obj").write_bytes(obj_text([(0, 1, 2), (0, 1, 3)]))
    assert len(load_scene("suzanne")) == len(load_scene("mine")) == len(load_scene("room.ply")) == 1
    assert len(load_scene("teapot")) == 2 and len(load_scene("room")) == 12
    names = scene_names()
    assert names["mine"] == 1 and names["room"] == 12 and names["teapot"] is None and names["cubes"] == 222
    assert set(missing_meshes()) == set(KNOWN_MESHES) - {"suzanne", "teapot"}


@pytest.mark.parametrize("folder", ["", "nowhere"])
def test_a_missing_real_mesh_says_what_to_put_where(folder: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REFSIM_SCENES", folder)
    monkeypatch.setattr("refsim.scene.known.cache_folder", lambda: None)
    message = r"'bunny' is missing: put bunny.ply into .*REFSIM_SCENES.*Stanford.*69451"
    with pytest.raises(InputError, match=message) as caught:
        load_scene("bunny")
    assert (folder or "not set") in str(caught.value)
    assert "bunny" not in scene_names() and missing_meshes() == list(KNOWN_MESHES)


def test_real_meshes_at_hand_are_the_published_ones() -> None:
    for name in absent():
        print(f"{name}: missing")
    for name in present():
        scene = load_scene(name)
        assert len(scene) == KNOWN_MESHES[name].triangles == scene_names()[name], name
    dragon = real_scene("dragon")
    assert dragon is None or int(dragon.degenerate.sum()) == 108  # as the source publishes
    assert isinstance(load_scene("cubes"), Scene), "the library is there in any case"
