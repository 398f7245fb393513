"""Phong's light, the normals under it and the shadow rays: shaders against `refsim.reference.phong`, and laws.

Plan
- The shaders' functions and their NumPy twins give the same bits: random surfaces and lights, lights at the point and
  behind it, normals of no length, flat and smooth triangles, exponents up to 2²⁰.
- Laws, float64: a power is the product that it says; light is 0 from behind, grows with N·L and is the same seen from
  the other side of the surface; a shadow ray ends at its light and leaves on the light's side.
- Tables by hand: light from straight above, at 60 degrees, from behind; the highlight's peak and its fall.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from refsim import Material, Scene, load_scene
from refsim.papers.geometry_shader_rays import shading
from refsim.papers.geometry_shader_rays.triangle_textures import triangle_textures
from refsim.reference import phong as reference
from tests.hre.bits import same_bits

normal_of, facing, light_of, ambient, shadow_of = (
    shading.lookup_normal, shading.facing, shading.phong, shading.ambient, shading.shadow_ray,
)  # fmt: skip
UP = np.array([[0.0, 0.0, 1.0]])


@njit(error_model="numpy")
def vec(a: Any, i: int) -> Any:
    return a[i, 0], a[i, 1], a[i, 2]


@njit(error_model="numpy")
def _lit(point, d, normal, diffuse, specular, exponent, light, radiance, weight, epsilon, out):  # type: ignore[no-untyped-def]
    for i in range(len(point)):
        against = facing(vec(normal, i), vec(d, i))
        color = light_of(
            vec(point, i), vec(d, i), against, vec(diffuse, i), specular[i], exponent[i], vec(light, i),
            vec(radiance, i), weight[i],
        )  # fmt: skip
        always = ambient(vec(diffuse, i), weight[i])
        origin, direction, distance = shadow_of(
            vec(point, i), vec(normal, i), vec(normal, i), vec(light, i), epsilon, np.int32(0)
        )
        for k in range(3):
            out[i, k], out[i, 3 + k], out[i, 6 + k] = against[k], color[k], always[k]
            out[i, 9 + k], out[i, 12 + k] = origin[k], direction[k]
        out[i, 15] = distance


@njit(error_model="numpy")
def _normals(triangles, surfaces, triangle, u, v, smooth, out):  # type: ignore[no-untyped-def]
    for i in range(len(triangle)):
        flat, bent = normal_of(triangles, surfaces, triangle[i], u[i], v[i], smooth)
        for k in range(3):
            out[i, k], out[i, 3 + k] = flat[k], bent[k]


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def surfaces_and_lights(n: int) -> dict[str, np.ndarray]:
    """Random ones in float32, hard ones among them."""
    random = np.random.default_rng(11)
    columns = {
        "point": random.normal(size=(n, 3)) * 10.0 ** random.uniform(-3, 3, (n, 1)),
        "d": unit(random.normal(size=(n, 3))),
        "normal": unit(random.normal(size=(n, 3))),
        "diffuse": random.uniform(0, 1, (n, 3)),
        "specular": random.choice([0.0, 0.3, 1.0], n),
        "exponent": random.choice([0, 1, 2, 3, 7, 32, 100, 1000, 2**20], n),
        "light": random.normal(size=(n, 3)) * 3,
        "radiance": random.uniform(0, 2, (n, 3)),
        "weight": random.uniform(0, 1, n),
    }
    columns["light"][:50] = columns["point"][:50]  # a light on the surface
    columns["normal"][50:90] = 0.0
    columns["normal"][90:120] = np.nan
    # Lights where the mirrored eye ray goes: highlights
    d, m = columns["d"], columns["normal"]
    shining = slice(120, n // 2)
    mirrored = d - 2 * (d * m).sum(axis=1, keepdims=True) * m
    columns["light"][shining] = (columns["point"] + mirrored + random.normal(0, 0.05, (n, 3)))[shining]
    return {name: column.astype(np.float32) for name, column in columns.items()}


def test_shaders_and_numpy_agree_bit_for_bit() -> None:
    c, epsilon = surfaces_and_lights(20000), np.float32(2.0**-10)
    out = np.zeros((20000, 16), np.float32)
    _lit(*c.values(), epsilon, out)
    against = reference.facing(c["normal"], c["d"])
    exponent = c["exponent"].astype(np.int32)
    color = reference.phong(**{**c, "normal": against, "exponent": exponent})
    origin, direction, distance = reference.shadow_ray(c["point"], c["normal"], c["light"], epsilon)
    twins = {
        "facing": (out[:, 0:3], against),
        "phong": (out[:, 3:6], color),
        "ambient": (out[:, 6:9], reference.ambient(c["diffuse"], c["weight"])),
        "origin": (out[:, 9:12], origin),
        "direction": (out[:, 12:15], direction),
        "distance": (out[:, 15], distance),
    }
    for name, (ours, theirs) in twins.items():
        assert same_bits(ours, theirs), name
    dull = reference.phong(**{**c, "normal": against, "specular": 0 * c["weight"], "exponent": exponent})
    assert (color > dull).any(axis=1).sum() > 2000, "hardly any highlight was compared"


@pytest.mark.parametrize("smooth", [0, 1])
def test_normals_agree_bit_for_bit(smooth: int) -> None:
    scene = load_scene("blob_100")
    textures = triangle_textures(scene, 1.5)
    random = np.random.default_rng(3)
    u, v = random.uniform(0, 0.5, (2, 4000)).astype(np.float32)
    triangle = random.integers(0, len(scene), 4000).astype(np.int32)
    out = np.zeros((4000, 6), np.float32)
    _normals(textures.triangles, textures.surfaces, triangle, u, v, np.int32(smooth), out)
    bent = reference.interpolated_normal(scene.vertex_normals[triangle], u, v)
    assert same_bits(out[:, 3:], bent if smooth else out[:, :3])
    assert not np.array_equal(bent, out[:, :3])


def test_normals_of_a_vertex_without_one() -> None:
    """Opposite normals that cancel have no length: NaN, as in the shader, and no light."""
    corners = np.array([[[0, 0, 1], [0, 0, -1], [0, 0, -1]]], np.float32)
    half, none = np.array([0.5], np.float32), np.zeros(1, np.float32)
    bent = reference.interpolated_normal(corners, half, none)
    assert np.isnan(bent).all()
    one = {"diffuse": np.ones((1, 3)), "specular": np.ones(1), "exponent": np.ones(1, int), "weight": np.ones(1)}
    lit = reference.phong(np.zeros((1, 3)), -UP, bent.astype(float), light=UP[0], radiance=np.ones(3), **one)
    assert (lit == 0).all()


@given(st.floats(0, 1.5), st.integers(0, 3000))
def test_a_power_is_a_product(x: float, exponent: int) -> None:
    found = float(reference.power(np.array([x]), np.array([exponent]))[0])
    with np.errstate(over="ignore"):
        expected = float(np.float64(x) ** exponent)
    # At most 2 log2 e products, each within half a unit of the last place, whose errors the squarings double
    assert found == expected or abs(found - expected) <= 2.0**-52 * max(exponent, 1) * expected or expected < 1e-300


vectors = st.tuples(*[st.floats(-3, 3)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
# Not so close to the surface that rounding decides the side
clear = vectors.filter(lambda v: abs(v[2]) > 1e-3)


def lit(d: Any, light: Any, *, specular: float = 0.0, exponent: int = 1, normal: np.ndarray = UP) -> float:
    """What a white surface at the origin sends back along −d, one component."""
    d = unit(np.array([d], np.float64))
    against = reference.facing(normal, d)
    ones = np.ones(1)
    color = reference.phong(
        np.zeros((1, 3)), d, against, np.ones((1, 3)), ones * specular, np.array([exponent]), np.array(light, float),
        np.ones(3), ones,
    )  # fmt: skip
    return float(color[0, 0])


@given(clear, clear, st.floats(0, 1), st.integers(0, 40))
def test_laws_of_light(d: Any, light: Any, specular: float, exponent: int) -> None:
    value = lit(d, light, specular=specular, exponent=exponent)
    # The eye and the light on the two sides of the surface: nothing
    if (d[2] > 0) == (light[2] > 0):
        assert value == 0
    else:
        cosine = abs(light[2]) / np.linalg.norm(light)
        # 1e-12: some tens of float64 roundings of numbers up to 1, to the 40th power
        assert cosine - 1e-12 <= value <= cosine + specular + 1e-12
    assert lit(d, light, specular=specular, exponent=exponent, normal=-UP) == value


@given(vectors, vectors, st.floats(1e-6, 1e-2))
def test_laws_of_shadow_rays(normal: Any, light: Any, epsilon: float) -> None:
    n, place = unit(np.array([normal], np.float64)), np.array(light, np.float64)
    origin, direction, distance = reference.shadow_ray(np.zeros((1, 3)), n, place, np.float64(epsilon))
    assert abs(np.linalg.norm(origin) - epsilon) < 1e-12
    side = float(n[0] @ place)
    assert side == 0 or np.sign(float(n[0] @ origin[0])) == np.sign(side)
    assert np.abs(origin[0] + direction[0] * distance[0] - place).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "d", "light", "specular", "exponent", "value"),
    [
        ("control: from straight above", (0, 0, -1), (0, 0, 2), 0.0, 1, 1.0),
        ("at 60 degrees", (0, 0, -1), (3**0.5, 0, 1), 0.0, 1, 0.5),
        ("along the surface", (0, 0, -1), (1, 0, 0), 0.0, 1, 0.0),
        ("from behind", (0, 0, -1), (0, 0, -2), 0.0, 1, 0.0),
        ("eye and light both behind", (0, 0, 1), (0, 0, -2), 0.0, 1, 1.0),
        ("at the point", (0, 0, -1), (0, 0, 0), 1.0, 1, 0.0),
        ("highlight at its peak", (0, 0, -1), (0, 0, 2), 0.5, 9, 1.5),
        ("highlight in the mirrored direction", (0.6, 0, -0.8), (3.0, 0, 4.0), 0.25, 50, 0.8 + 0.25),
        ("highlight 60 degrees off", (0, 0, -1), (3**0.5, 0, 1), 1.0, 2, 0.5 + 0.25),
        ("exponent 0: everywhere before", (0, 0, -1), (0.6, 0, 0.8), 1.0, 0, 0.8 + 1.0),
    ],
)
def test_by_hand(name: str, d: Any, light: Any, specular: float, exponent: int, value: float) -> None:
    assert lit(d, light, specular=specular, exponent=exponent) == pytest.approx(value, abs=1e-14), name


def test_ambient_by_hand() -> None:
    found = reference.ambient(np.array([[0.5, 1.0, 0.25]]), np.array([0.5]))
    assert found.tolist() == [[0.05, 0.1, 0.025]]


def test_materials_in_the_textures() -> None:
    """Where the shaders' columns come from: ρ, τ, exponent, highlight and colour as `Shading` has them."""
    from refsim.reference.whitted import Shading

    materials = (
        Material("a", "diffuse", (0.1, 0.2, 0.3), specular=0.4, shininess=7.5, reflectivity=0.6),
        Material("b", "glass", (0.1, 0.2, 0.3), shininess=0.0),
        Material("c", "mirror", specular=0.7, shininess=2.5),
    )
    triangles = np.arange(36, dtype=np.float32).reshape(4, 3, 3) ** 2
    scene = Scene(triangles, "table", materials, np.array([2, 0, 1, 0], np.int32))
    found, t = Shading.of(scene), triangle_textures(scene, 1.5)
    rows = {"triangles": t.triangles.data[0, :4], "surfaces": t.surfaces.data[0, :4]}
    assert same_bits(found.rho, rows["triangles"][:, 1, 3]) and found.rho.tolist() == [1, *np.float32([0.6, 0.1, 0.6])]
    assert same_bits(found.tau, rows["triangles"][:, 2, 3]) and found.tau.tolist() == [0, 0, np.float32(0.9), 0]
    assert found.exponent.tolist() == rows["triangles"][:, 3, 3].tolist() == [2, 8, 0, 8]
    assert same_bits(found.specular, rows["surfaces"][:, 0, 3])
    assert same_bits(found.diffuse, rows["surfaces"][:, 3, :3]) and (found.diffuse[[0, 2]] == 0).all()
