"""Plan: a scene keeps its triangles and derives box, epsilon, degenerate marks and smooth normals from them.

- Triangles come back bit for bit; box, centre, diagonal and epsilon are the vertices'; a scale of 2**k is exact.
- A triangle is degenerate exactly when rational arithmetic finds its edges collinear (integer grid, float64 is exact).
- Smooth normals equal a slow sum over vertices of equal position, and do not depend on the order of triangles.
- Smooth normals of a sphere point away from its centre; a source's own normals go first, normalised.
- Materials, ids and other fields are checked; with_materials and replace change what they say and nothing else.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from refsim.errors import InputError
from refsim.scene import DIFFUSE, GLASS, MIRROR, Material, PointLight, Scene, load_scene
from refsim.scene.mesh import area_weighted_normals, degenerate_triangles

COUNTS = st.integers(1, 12)
FLOATS = st.floats(-1000.0, 1000.0, width=32)
SOUPS = hnp.arrays(np.float32, st.tuples(COUNTS, st.just(3), st.just(3)), elements=FLOATS)
# A tiny grid makes collinear, coincident and repeated vertices common.
GRIDS = hnp.arrays(np.float32, st.tuples(COUNTS, st.just(3), st.just(3)), elements=st.integers(-2, 2).map(float))


@given(SOUPS, st.integers(-20, 20))
def test_box_and_epsilon(triangles: np.ndarray, exponent: int) -> None:
    scene = Scene(triangles)
    assert scene.triangles.tobytes() == triangles.tobytes()
    points = triangles.reshape(-1, 3).astype(np.float64)
    np.testing.assert_array_equal(scene.lower, points.min(axis=0))
    np.testing.assert_array_equal(scene.upper, points.max(axis=0))
    assert (points >= scene.lower).all() and scene.lower.dtype == np.float32
    np.testing.assert_allclose(scene.diagonal, np.linalg.norm(points.max(axis=0) - points.min(axis=0)), rtol=1e-15)
    np.testing.assert_array_equal(scene.center, (points.max(axis=0) + points.min(axis=0)) / 2)
    assert scene.epsilon == np.float32(scene.diagonal / 4096.0) and scene.epsilon.dtype == np.float32


@given(GRIDS, st.integers(-20, 20))
def test_scaling_by_a_power_of_two_is_exact(triangles: np.ndarray, exponent: int) -> None:
    scale = np.float32(2.0**exponent)
    scene, scaled = Scene(triangles), Scene(triangles * scale)
    assert scaled.epsilon == scene.epsilon * scale and scaled.diagonal == scene.diagonal * float(scale)
    np.testing.assert_array_equal(scaled.degenerate, scene.degenerate)
    np.testing.assert_array_equal(scaled.vertex_normals, scene.vertex_normals)


@given(GRIDS)
def test_degenerate_is_collinear(triangles: np.ndarray) -> None:
    def collinear(triangle: np.ndarray) -> bool:
        a, b, c = ([Fraction(float(x)) for x in vertex] for vertex in triangle)
        e, f = ([q - p for p, q in zip(a, end, strict=True)] for end in (b, c))
        return all(e[i] * f[j] == e[j] * f[i] for i, j in ((0, 1), (0, 2), (1, 2)))

    assert degenerate_triangles(triangles).tolist() == [collinear(triangle) for triangle in triangles]


@pytest.mark.parametrize(
    ("size", "degenerate"),
    [(1.0, False), (2.0**-126, False), (1e-37, False), (1e-40, True), (1e19, False), (3e38, False)],
)
def test_a_plane_beyond_float32_is_degenerate(size: float, degenerate: bool) -> None:
    # The inverse of an edge of 1e-40 does not fit in float32.
    triangle = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]) * size
    assert Scene(triangle).degenerate.tolist() == [degenerate]


@given(GRIDS, st.randoms(use_true_random=False))
def test_smooth_normals_are_the_slow_sum(triangles: np.ndarray, random) -> None:
    sums: dict[tuple[float, ...], np.ndarray] = {}
    areas = [np.cross(t[1] - t[0], t[2] - t[0]) for t in triangles.astype(np.float64)]
    for triangle, area in zip(triangles, areas, strict=True):
        for vertex in triangle:
            key = tuple(float(x) for x in vertex)
            sums[key] = sums.get(key, np.zeros(3)) + area
    wanted = np.zeros(triangles.shape)
    for i, (triangle, area) in enumerate(zip(triangles, areas, strict=True)):
        for j, vertex in enumerate(triangle):
            total = sums[tuple(float(x) for x in vertex)]
            total = total if total.any() else area
            wanted[i, j] = total / (np.linalg.norm(total) or 1.0)
    normals = Scene(triangles).vertex_normals
    np.testing.assert_allclose(normals, wanted, atol=1e-7)
    order = list(range(len(triangles)))
    random.shuffle(order)
    np.testing.assert_array_equal(Scene(triangles[order]).vertex_normals, normals[order])


def test_minus_zero_is_the_same_position() -> None:
    triangles = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[-0.0, 0, 0], [0, 1, 0], [0, 0, 1]]], np.float32)
    normals = area_weighted_normals(triangles)
    np.testing.assert_array_equal(normals[0, 0], normals[1, 0])


def test_a_sheet_with_two_sides_keeps_its_own_normals() -> None:
    front = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    normals = area_weighted_normals(np.concatenate([front, front[:, ::-1]]))
    np.testing.assert_array_equal(normals, np.repeat([[[0, 0, 1]], [[0, 0, -1]]], 3, axis=1))


def test_smooth_normals_of_a_sphere_point_outward() -> None:
    sphere = load_scene("sphere_9600")
    assert ((sphere.vertex_normals * sphere.triangles).sum(axis=2) > 0.999).all()
    assert sphere.vertex_normals is sphere.vertex_normals, "they are computed once"


def test_the_source_normals_go_first() -> None:
    triangles = load_scene("cornell_box").triangles
    given_normals = np.tile(np.float32([0, 3, 4]), (36, 3, 1))
    given_normals[5, 1] = 0.0  # no direction: the area-weighted one stands in
    given_normals[6, 2] = np.nan
    normals = Scene(triangles, normals=given_normals).vertex_normals
    smooth = Scene(triangles).vertex_normals
    np.testing.assert_array_equal(normals[5, 1], smooth[5, 1])
    np.testing.assert_array_equal(normals[6, 2], smooth[6, 2])
    np.testing.assert_allclose(normals[7], np.tile([0, 0.6, 0.8], (3, 1)), atol=1e-7)
    assert normals.dtype == np.float32


def test_one_material_throughout() -> None:
    box = load_scene("cornell_box")
    mirror = box.with_materials(MIRROR)
    assert mirror.materials == (MIRROR,) and not mirror.material_ids.any() and len(set(box.material_ids)) == 6
    assert mirror.triangles is box.triangles and mirror.lights == box.lights
    diffuse = box.with_materials([DIFFUSE] * 6)
    np.testing.assert_array_equal(diffuse.material_ids, box.material_ids)
    assert box.replace(name="other").name == "other"
    with pytest.raises(InputError, match="no field 'colour'"):
        box.replace(colour=1)


def test_optical_indices_follow_the_materials() -> None:
    triangles = load_scene("room").triangles[:4]
    scene = Scene(triangles, "s", (GLASS, MIRROR, DIFFUSE, Material("ice", "glass", ior=1.31)), [2, 0, 3, 1])
    np.testing.assert_array_equal(scene.optical_indices(1.5), np.float32([-1.0, 1.5, 1.31, 0.0]))
    np.testing.assert_array_equal(scene.optical_indices(2.0), np.float32([-1.0, 2.0, 1.31, 0.0]))


ONE = np.float32([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
NAN = np.where(ONE == 1, np.nan, ONE)
WRONG = {
    "control": ({"triangles": ONE, "material_ids": [0]}, None),
    "one material alone": ({"triangles": ONE, "materials": MIRROR}, None),
    "no triangles": ({"triangles": ONE[:0]}, "holds no triangles"),
    "flat": ({"triangles": ONE[0]}, r"must have shape \[n, 3, 3\]"),
    "quads": ({"triangles": np.zeros((2, 4, 3))}, r"must have shape \[n, 3, 3\]"),
    "words": ({"triangles": "cube"}, "must be numbers"),
    "NaN": ({"triangles": np.concatenate([ONE, NAN])}, "triangle 1 of scene 'scene' has a vertex that is not finite"),
    "beyond float32": ({"triangles": ONE.astype(np.float64) * 1e39}, "triangle 0 of scene .* not finite"),
    "normals of two": ({"triangles": ONE, "normals": np.zeros((2, 3, 3))}, r"normals .* shape \[1, 3, 3\]"),
    "three texture coordinates": ({"triangles": ONE, "texcoords": np.zeros((1, 3, 3))}, r"texcoords .* \[1, 3, 2\]"),
    "no materials": ({"triangles": ONE, "materials": ()}, "at least one material"),
    "id beyond": ({"triangles": ONE, "material_ids": [1]}, "triangle 0 has material 1"),
    "id below": ({"triangles": ONE, "material_ids": [-1]}, "triangle 0 has material -1"),
    "ids of two": ({"triangles": ONE, "material_ids": [0, 0]}, "must be 1 integers"),
    "half an id": ({"triangles": ONE, "material_ids": [0.0]}, "must be 1 integers"),
}


@pytest.mark.parametrize("row", WRONG)
def test_fields(row: str) -> None:
    fields, message = WRONG[row]
    if message is None:
        assert len(Scene(**fields)) == 1
        return
    with pytest.raises(InputError, match=message):
        Scene(**fields)


VALUES = {
    "material": (Material, {}, None),
    "kind": (Material, {"kind": "water"}, "kind must be one of glass, mirror, diffuse, not 'water'"),
    "color": (Material, {"color": (1, 2)}, "color of material 'glass' must be three finite numbers"),
    "negative color": (Material, {"color": (1, -1, 0)}, "must not be negative"),
    "ior 0": (Material, {"ior": 0.0}, "ior of material 'glass' must be a finite number above 0"),
    "ior NaN": (Material, {"ior": float("nan")}, "ior of material 'glass'"),
    "specular": (Material, {"specular": -0.5}, "specular of material"),
    "shininess": (Material, {"shininess": float("inf")}, "shininess of material"),
    "light": (PointLight, {"position": (0, 1, 2)}, None),
    "no place": (PointLight, {"position": (0, float("inf"), 2)}, "position of a point light"),
    "black hole": (PointLight, {"position": (0, 1, 2), "color": (-1, 0, 0)}, "color of a point light"),
    "intensity": (PointLight, {"position": (0, 1, 2), "intensity": -1}, "intensity of a point light"),
}


@pytest.mark.parametrize("row", VALUES)
def test_materials_and_lights(row: str) -> None:
    kind, fields, message = VALUES[row]
    if message is None:
        value = kind(**fields)
        assert value == kind(**fields) and hash(value) == hash(kind(**fields))
        return
    with pytest.raises(InputError, match=message):
        kind(**fields)


def test_light_radiance() -> None:
    assert PointLight((0, 0, 0), (1.0, 0.5, 0.25), 4.0).radiance == (4.0, 2.0, 1.0)
