"""Plan: the library's scenes have the triangles they promise, are closed, wound outward, and always the same.

- A name with a size has exactly that many triangles, or is refused with the nearest sizes, which work.
- Every directed edge of a body occurs once, and its reverse once: closed and consistently wound.
- Bodies enclose a positive volume; sphere and blob are star-shaped, every triangle turned away from the origin.
- Each ray of the default view at fill 0.55 hits a blob of any size.
- torus_knot_1024 equals the knot of the shared meshes, and golden numbers that stand for it where they are absent.
- knot_on_ground is the knot, bit for bit, above a ground that shows the knot's shadow in the default view, and lit
  parts too.
- Composition of each scene: triangles, vertices, materials, lights, triangles of zero area.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.scene import Scene, camera_rays, load_scene
from refsim.scene.known import scenes_folder
from refsim.scene.library import LIBRARY, grid_of

SIZED = [name for name, entry in LIBRARY.items() if entry.ideal is not None]
CLOSED = ["sphere_6", "sphere_192", "sphere", "sphere_1760", "blob_100", "blob_500", "blob", "blob_5000"]
KNOTS = ["torus_knot_500", "torus_knot", "torus_knot_5000"]


def edges(triangles: np.ndarray) -> Counter[tuple[bytes, bytes]]:
    """Directed edges between positions; adding zero makes -0.0 and 0.0 one position."""
    corners = [[vertex.tobytes() for vertex in triangle] for triangle in triangles + np.float32(0.0)]
    return Counter((t[i], t[(i + 1) % 3]) for t in corners for i in range(3))


def volume(triangles: np.ndarray) -> float:
    a, b, c = np.moveaxis(triangles.astype(np.float64), 1, 0)
    return float((a * np.cross(b, c)).sum() / 6.0)


def hit(triangles: np.ndarray, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """bool[n]: the ray from ``origin`` pierces a triangle, by the signs of three volumes, in float64."""
    a, b, c = np.moveaxis(triangles.astype(np.float64) - origin, 1, 0)
    found = np.zeros(len(directions), bool)
    for start in range(0, len(directions), 256):
        d = directions[start : start + 256].astype(np.float64)
        signs = np.stack([d @ np.cross(p, q).T for p, q in ((b, c), (c, a), (a, b))])
        # The volume of origin and triangle has the sign of the side that is seen, so hits behind do not count.
        side = np.sign((a * np.cross(b, c)).sum(axis=1))
        found[start : start + 256] = ((signs * side >= 0) & (side != 0)).all(axis=0).any(axis=1)
    return found


@settings(max_examples=60)
@given(st.sampled_from(SIZED), st.integers(1, 3000))
def test_a_size_is_exact_or_refused_with_sizes_that_work(name: str, half: int) -> None:
    scene = f"{name}_{2 * half}"
    try:
        triangles = len(load_scene(scene))
    except InputError as error:
        words = str(error).replace(",", "").split()
        offers = [int(word) for word in words if word.isdecimal() and int(word) != 2 * half and int(word) > 5]
        for size in offers[-2:]:
            if size <= 10_000:
                assert len(load_scene(f"{name}_{size}")) == size
        assert offers
    else:
        assert triangles == 2 * half


def test_grids_of_known_sizes() -> None:
    knots = {100: (10, 5), 500: (50, 5), 1024: (64, 8), 5000: (125, 20), 100_000: (625, 80)}
    assert {n: grid_of("k", n, 8, 3) for n in knots} == knots
    spheres = {192: (16, 6), 896: (32, 14), 1760: (44, 20), 9600: (100, 48)}
    assert {n: grid_of("s", n, 2) for n in spheres} == spheres


@pytest.mark.parametrize("name", [*CLOSED, *KNOTS])
def test_bodies_are_closed_and_wound_outward(name: str) -> None:
    scene = load_scene(name)
    counts = edges(scene.triangles)
    assert set(counts.values()) == {1}
    assert all((end, start) in counts for start, end in counts)
    assert volume(scene.triangles) > 0 and not scene.degenerate.any()


@pytest.mark.parametrize("name", CLOSED)
def test_sphere_and_blob_turn_every_triangle_away_from_the_origin(name: str) -> None:
    a, b, c = np.moveaxis(load_scene(name).triangles.astype(np.float64), 1, 0)
    assert ((a * np.cross(b, c)).sum(axis=1) > 0).all()


@pytest.mark.parametrize("name", KNOTS)
def test_knot_faces_away_from_its_centre_line(name: str) -> None:
    # A fine knot's smooth normals leave the tube: 0.01 along them a point is outside, 0.01 against them inside.
    scene = load_scene(name)
    point, normal = scene.triangles[::97].mean(axis=1), scene.vertex_normals[::97].mean(axis=1)
    for side, inside in ((-0.01, True), (0.01, False)):
        for start in point + np.float32(side) * normal:
            a, b, c = np.moveaxis(scene.triangles.astype(np.float64) - start, 1, 0)
            lengths = [np.linalg.norm(v, axis=1) for v in (a, b, c)]
            # Solid angle of a triangle: van Oosterom and Strackee (1983); their sum over 4 pi is the winding number.
            below = lengths[0] * lengths[1] * lengths[2]
            for (p, q), r in zip(((a, b), (b, c), (c, a)), (lengths[2], lengths[0], lengths[1]), strict=True):
                below = below + (p * q).sum(axis=1) * r
            turns = np.arctan2((a * np.cross(b, c)).sum(axis=1), below).sum() / (2 * np.pi)
            assert round(turns) == inside, turns


@pytest.mark.parametrize("size", [100, 500, 1000, 5000])
def test_every_ray_of_the_default_view_hits_a_blob(size: int) -> None:
    scene = load_scene(f"blob_{size}")
    rays = camera_rays(scene, 24, 24, fill=0.55)
    assert hit(scene.triangles, rays.origin[0].astype(np.float64), rays.direction).all()
    # The body is star-shaped about its middle, so its outline is too: the rim of a fine picture settles the rest.
    fine = camera_rays(scene, 256, 256, fill=0.55)
    rim = np.zeros((256, 256), bool)
    rim[[0, -1]] = rim[:, [0, -1]] = True
    assert hit(scene.triangles, fine.origin[0].astype(np.float64), fine.direction[rim.ravel()]).all()
    far = camera_rays(scene, 24, 24, fill=1.0)
    assert not hit(scene.triangles, far.origin[0].astype(np.float64), far.direction).all(), "the test can fail"


def test_knot_equals_the_shared_mesh() -> None:
    knot = load_scene("torus_knot_1024")
    folder = scenes_folder()
    file = None if folder is None else folder / "torus_knot_1024.ply"
    if file is None or not file.is_file():
        print("torus_knot_1024.ply: missing")  # the golden numbers below stand in
    else:
        shared = load_scene(file)
        assert shared.triangles.shape == knot.triangles.shape
        assert np.abs(shared.triangles - knot.triangles).max() <= 1e-5


def test_knot_is_golden() -> None:
    triangles = load_scene("torus_knot_1024").triangles.astype(np.float64)
    assert triangles.shape == (1024, 3, 3)
    wanted = {
        (0, 0): (1.10001230, -0.00279995, -0.00139999),
        (0, 1): (1.06980073, 0.17767161, 0.08916963),
        (0, 2): (1.21716595, 0.12451293, -0.25397131),
    }
    for (triangle, vertex), position in wanted.items():
        np.testing.assert_allclose(triangles[triangle, vertex], position, atol=1e-6)
    # Numbers that change when order or winding changes anywhere.
    weight = np.sin(np.arange(1.0, 1025.0) ** 2)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    np.testing.assert_allclose(weight @ triangles[:, 0], (-0.28464, 5.45028, -2.97794), atol=2e-4)
    np.testing.assert_allclose(weight @ normal, (1.570673, 0.222158, 1.093199), atol=2e-5)
    np.testing.assert_allclose(volume(triangles), 7.06991, atol=1e-4)


@pytest.mark.parametrize("size", [502, 1026, 5002])
def test_knot_on_ground_is_the_knot_above_two_triangles(size: int) -> None:
    scene, knot = load_scene(f"knot_on_ground_{size}"), load_scene(f"torus_knot_{size - 2}")
    assert scene.triangles[:-2].tobytes() == knot.triangles.tobytes()
    ground = scene.triangles[-2:]
    assert len(np.unique(ground[:, :, 1])) == 1 and ground[0, 0, 1] < knot.lower[1] - 8 * scene.epsilon
    assert (np.cross(ground[:, 1] - ground[:, 0], ground[:, 2] - ground[:, 0])[:, 1] > 0).all()
    assert [material.rho for material in scene.materials] == [0.25, 0.25]


def test_the_default_view_shows_the_shadow_of_the_knot_on_the_ground() -> None:
    scene = load_scene("knot_on_ground")
    rays = camera_rays(scene, 48, 48, fill=0.55)
    eye, direction = rays.origin[0].astype(np.float64), rays.direction.astype(np.float64)
    on_knot = hit(scene.triangles[:-2], eye, direction)
    seen = hit(scene.triangles[-2:], eye, direction) & ~on_knot
    point = eye + direction[seen] * ((scene.lower[1] - eye[1]) / direction[seen, 1])[:, None]
    light = np.array(scene.lights[0].position)
    # The ground is the lowest part, so whatever lies on the way from the light lies between.
    dark = hit(scene.triangles[:-2], light, point - light)
    assert on_knot.mean() > 0.12 and dark.mean() > 0.15 and (~dark).mean() > 0.3
    assert (dark.sum() + on_knot.sum()) < 0.5 * len(direction), "the test can fail"
    assert (light - scene.center) @ (eye - scene.center) > 0, "it lights what is seen"


COMPOSITION = {
    # name: triangles, positions, triangles of each material, lights
    "cornell_box": (36, 28, {"white": 6, "red": 2, "green": 2, "lamp": 2, "mirror": 12, "glass": 12}, 1),
    "room": (12, 12, {"red": 2, "green": 2, "white": 6, "mirror": 2}, 1),
    "cubes": (222, 124, {"white": 220, "ground": 2}, 1),
    "sphere": (896, 450, {"glass": 896}, 1),
    "blob": (1000, 502, {"glass": 1000}, 1),
    "torus_knot": (1024, 512, {"glass": 1024}, 1),
    "knot_on_ground": (1026, 516, {"silk": 1024, "ground": 2}, 1),
    "knight_in_box": (
        646,
        368,
        {"wall": 6, "left wall": 2, "right wall": 2, "steel": 388, "cloth": 116, "gold": 132},
        1,
    ),
}


@pytest.mark.parametrize("name", COMPOSITION)
def test_composition(name: str) -> None:
    triangles, positions, materials, lights = COMPOSITION[name]
    scene = load_scene(name)
    assert len(scene) == LIBRARY[name].triangles == triangles
    assert len(np.unique(scene.triangles.reshape(-1, 3), axis=0)) == positions
    assert dict(Counter(scene.materials[k].name for k in scene.material_ids)) == materials
    assert len(scene.lights) == lights and not scene.degenerate.any()
    again = load_scene(name)
    assert scene.triangles.tobytes() == again.triangles.tobytes() and scene.name == name


def parts(scene: Scene, name: str) -> np.ndarray:
    ids = [k for k, material in enumerate(scene.materials) if material.name == name]
    return scene.triangles[np.isin(scene.material_ids, ids)]


def test_glass_and_mirror_of_the_cornell_box_are_closed_and_off_the_floor() -> None:
    box = load_scene("cornell_box")
    for name in ("glass", "mirror"):
        body = parts(box, name)
        counts = edges(body)
        assert set(counts.values()) == {1} and all((end, start) in counts for start, end in counts)
        assert volume(body) > 0
        assert body[:, :, 1].min() > -1 + 4 * box.epsilon
        assert np.abs(body).max() < 1 - 4 * box.epsilon


def test_walls_face_inward_and_the_front_is_open() -> None:
    for name in ("cornell_box", "room"):
        walls = load_scene(name).triangles[:10].astype(np.float64)
        normal = np.cross(walls[:, 1] - walls[:, 0], walls[:, 2] - walls[:, 0])
        assert ((normal * walls.mean(axis=1)).sum(axis=1) < 0).all()
        assert not (normal[:, 2] < 0).any()


def test_cubes_are_five_closed_bodies_on_a_ground() -> None:
    bodies = parts(load_scene("cubes"), "white")
    for start in range(0, 220, 44):
        counts = edges(bodies[start : start + 44])
        assert set(counts.values()) == {1} and all((end, start) in counts for start, end in counts)
        np.testing.assert_allclose(volume(bodies[start : start + 44]), 5.0, rtol=1e-5)
    ground = parts(load_scene("cubes"), "ground").astype(np.float64)
    assert (np.cross(ground[:, 1] - ground[:, 0], ground[:, 2] - ground[:, 0])[:, 1] > 0).all()


REFUSED = {
    "torus_knot_0": "sizes from 18 to 10000000",
    "torus_knot_-4": "sizes from 18 to 10000000",
    "torus_knot_16": "sizes from 18 to 10000000",
    "sphere_4": "sizes from 6 to 10000000",
    "knot_on_ground_18": "sizes from 20 to 10000000",
    "knot_on_ground_1025": "sound grid and 2; the nearest sizes are",
    "knight_in_box_198": "always has 646 triangles",
    "blob_10000002": "sizes from 6 to 10000000",
    "blob_99999999999999999999": "sizes from 6 to 10000000",
    "sphere_101": "nearest sizes are",
    "sphere_2018": "nearest sizes are 2016 and 2020",
    "cubes_224": "always has 222 triangles",
    "cornell": "did you mean cornell_box",
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_names(name: str) -> None:
    with pytest.raises(InputError, match=REFUSED[name]):
        load_scene(name)
