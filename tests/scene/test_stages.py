"""Plan: any scene can be put above a ground; its triangles stay what and where they were.

- For random bodies: triangles, materials, normals and texture coordinates come first and keep their bits and order; two
  triangles follow, level, facing up, below everything and reaching beyond it by what was asked.
- A body twice as large, or elsewhere, gives the same picture: ground and light scale and move with it.
- Turning is a rotation: distances, winding and normals stay; known axes go where they should; four quarters are none.
- Meshes that lie on their side are turned without being asked; `up` says otherwise.
- Any scene's name with "_on_ground" behind it loads that.
- Wrong arguments are refused by name.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.scene import DIFFUSE, GLASS, MIRROR, PointLight, Scene, load_scene
from refsim.scene.stages import METAL, SILK, STANDING, TILES, on_ground, standing_up


def body(seed: int, count: int = 12, **fields: object) -> Scene:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3, 3)).astype(np.float32)
    triangles = rng.normal(size=(count, 3, 3)).astype(np.float32)
    ids = rng.integers(0, 2, count)
    given_fields = {"materials": (GLASS, MIRROR), "material_ids": ids, "normals": normals, **fields}
    return Scene(triangles, texcoords=rng.random((count, 3, 2)).astype(np.float32), **given_fields)


@given(st.integers(0, 2**32), st.floats(2**-9, 2.0), st.floats(0.1, 4.0))
def test_the_body_stays_and_a_ground_follows(seed: int, gap: float, half: float) -> None:
    bare = body(seed)
    scene = on_ground(bare, gap=gap, half=half)
    for field in ("triangles", "normals", "texcoords", "material_ids"):
        assert getattr(scene, field)[:-2].tobytes() == getattr(bare, field).tobytes(), field
    assert len(scene) == len(bare) + 2 and scene.materials == (GLASS, MIRROR, TILES)
    ground = scene.triangles[-2:].astype(np.float64)
    assert list(scene.material_ids[-2:]) == [2, 2] and len(np.unique(ground[:, :, 1])) == 1
    normal = np.cross(ground[:, 1] - ground[:, 0], ground[:, 2] - ground[:, 0])
    assert (normal[:, 1] > 0).all() and not normal[:, [0, 2]].any()
    np.testing.assert_array_equal(scene.normals[-2:], np.broadcast_to(np.float32([0, 1, 0]), (2, 3, 3)))
    near = {"atol": 1e-5 * (1 + half) * bare.diagonal}
    np.testing.assert_allclose(bare.lower[1] - ground[0, 0, 1], gap * bare.diagonal, **near)
    square = np.unique(ground.reshape(-1, 3)[:, [0, 2]], axis=0)
    np.testing.assert_allclose(np.ptp(square, axis=0), 2 * half * bare.diagonal, **near)
    np.testing.assert_allclose(square.mean(axis=0), bare.center[[0, 2]], **near)
    assert len(scene.lights) == 1 and scene.lights[0].position[1] > bare.upper[1]


@given(st.integers(0, 2**32), st.sampled_from([0.25, 0.5, 2.0, 1024.0]))
def test_size_and_place_do_not_matter(seed: int, factor: float) -> None:
    bare = body(seed)
    shift = np.float32([3.0, -2.0, 1.0])
    scene, large = on_ground(bare), on_ground(bare.replace(triangles=bare.triangles * np.float32(factor)))
    np.testing.assert_array_equal(large.triangles, scene.triangles * np.float32(factor))
    np.testing.assert_allclose(large.lights[0].position, np.array(scene.lights[0].position) * factor, rtol=1e-12)
    moved = on_ground(bare.replace(triangles=bare.triangles + shift))
    np.testing.assert_allclose(moved.triangles[-2:], scene.triangles[-2:] + shift, atol=1e-5)


@given(st.integers(0, 2**32), st.sampled_from(["y", "z"]), st.integers(-5, 5))
def test_turning_is_a_rotation(seed: int, up: str, quarters: int) -> None:
    scene = body(seed)
    turned = standing_up(scene, up, quarters)
    a = scene.triangles.reshape(-1, 3).astype(np.float64)
    b = turned.triangles.reshape(-1, 3).astype(np.float64)
    # The matrix that takes one to the other is exact: entries 0 and ±1, determinant 1.
    matrix = np.rint(np.linalg.lstsq(a, b, rcond=None)[0])
    np.testing.assert_array_equal(a @ matrix, b)
    np.testing.assert_array_equal(matrix @ matrix.T, np.eye(3))
    assert round(np.linalg.det(matrix)) == 1
    np.testing.assert_array_equal(turned.normals, scene.normals @ matrix.astype(np.float32))
    np.testing.assert_array_equal(turned.triangles, standing_up(scene, up, quarters % 4).triangles)


AXES = {
    ("y", 0): "x y z",
    ("y", 1): "-z y x",
    ("y", 2): "-x y -z",
    ("z", 0): "x -z y",
    ("z", 1): "-z -x y",
}


@pytest.mark.parametrize("row", AXES)
def test_where_the_axes_go(row) -> None:
    signs = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-z": (0, 0, -1)}
    scene = standing_up(Scene(np.eye(3, dtype=np.float32)[None]), *row)
    np.testing.assert_array_equal(scene.triangles[0], [signs[word] for word in AXES[row].split()])
    assert scene.normals is None


def test_a_mesh_that_lies_is_stood_up() -> None:
    for name, (up, quarters) in STANDING.items():
        lying = body(5, name=name)
        scene = on_ground(lying)
        np.testing.assert_array_equal(scene.triangles[:-2], standing_up(lying, up, quarters).triangles)
        np.testing.assert_array_equal(on_ground(lying, up="y").triangles[:-2], lying.triangles)


def test_materials_and_lights_are_what_is_asked() -> None:
    knot = load_scene("torus_knot_128")
    scene = on_ground(knot, material=METAL, ground=DIFFUSE)
    assert scene.materials == (METAL, DIFFUSE) and scene.normals is None and scene.name == knot.name
    assert list(scene.material_ids) == [0] * 128 + [1, 1]
    lamp = PointLight((1.0, 2.0, 3.0), (1.0, 0.5, 0.25), 2.0)
    assert on_ground(knot, light=lamp).lights == (lamp,)
    at = np.array(on_ground(knot, light=(0.0, 1.0, 0.5)).lights[0].position)
    np.testing.assert_allclose(at, knot.center + knot.diagonal * np.array([0, 1, 0.5]), rtol=1e-12)


WRONG = {
    "gap 0": ({"gap": 0.0}, "gap must be a finite number above 0, not 0.0"),
    "gap NaN": ({"gap": float("nan")}, "gap must be a finite number above 0"),
    "half": ({"half": -1.0}, "half must be a finite number above 0, not -1.0"),
    "half infinite": ({"half": float("inf")}, "half must be a finite number above 0"),
    "light": ({"light": (1.0, 2.0)}, "light must be three finite numbers"),
    "up": ({"up": "x"}, "up must be 'y' or 'z', not 'x'"),
}


@pytest.mark.parametrize("row", WRONG)
def test_wrong_arguments_are_refused(row: str) -> None:
    arguments, message = WRONG[row]
    with pytest.raises(InputError, match=message):
        on_ground(body(1), **arguments)


def test_half_a_quarter_is_refused() -> None:
    with pytest.raises(InputError, match=r"quarters must be a whole number of quarter turns, not 0\.5"):
        standing_up(body(1), "y", 0.5)


def test_any_named_scene_on_a_ground() -> None:
    """What `stages.on_ground` makes of the scene, in silk, under the name asked for."""
    made = load_scene("sphere_192_on_ground")
    expected = on_ground(load_scene("sphere_192"), material=SILK)
    assert made.name == "sphere_192_on_ground" and made.lights == expected.lights and len(made) == 194
    assert made.triangles.tobytes() == expected.triangles.tobytes() and made.materials == expected.materials
    for name, unknown in (("no_such_on_ground", "no_such"), ("_on_ground", "_on_ground")):
        with pytest.raises(InputError, match=f"unknown scene '{unknown}'"):
            load_scene(name)
