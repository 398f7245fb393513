"""Plan: glass against mirrors, and the readings of “16 × 16 tiles”.

- Eye rays are the same whatever the material; a convex mirror's rays never come back.
- On a flat body a mirror keeps the opening of the cones, and glass makes it 1/n of it; normals turn by what they do.
- “Kinder” is the smaller, and nothing where there is nothing.
- Both readings are one run at 16 times 16 pixels, and there alone; cone tests follow from the reading.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from refsim.experiments import glass_mirrors, style, tiles_16
from refsim.experiments.glass_mirrors import MATERIALS, normal_cones
from refsim.methods import trace
from refsim.scene import Scene, camera_rays

BODY: dict[str, Any] = {
    "size_px": 24, "tile_px": 8, "fill": 0.4, "generations": 3, "ior": 1.5, "backend": "numpy",
}  # fmt: skip


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    scenes = ("sphere_192", "torus_knot_100")
    return [row for scene in scenes for name in MATERIALS for row in glass_mirrors.measure(scene, name, **BODY)]


def test_eye_rays_know_no_material(rows) -> None:
    for scene in ("sphere_192", "torus_knot_100"):
        glass, mirror = ([r for r in rows if (r["scene"], r["material"]) == (scene, m)] for m in MATERIALS)
        assert glass[0] == {**mirror[0], "material": "glass"}
        assert glass[1]["rays"] == mirror[1]["rays"] > 0
        assert glass[1]["median_normals_half_angle_deg"] == mirror[1]["median_normals_half_angle_deg"]
        assert glass[1]["median_half_angle_deg"] < mirror[1]["median_half_angle_deg"]
        for row in (*glass, *mirror):
            assert row["bounded_tiles"] + row["unbounded_tiles"] + row["empty_tiles"] == 9
            assert row["triangle_tests"] <= row["ray_engine_tests_with_stencil"] <= row["ray_engine_tests"]


def test_no_ray_comes_back_to_a_convex_mirror(rows) -> None:
    own = [row for row in rows if (row["scene"], row["material"]) == ("sphere_192", "mirror")]
    assert [row["hits"] for row in own[1:]] == [0, 0]
    assert own[2]["rays"] == own[2]["triangle_tests"] == 0 and own[2]["median_half_angle_deg"] == ""


@pytest.mark.parametrize("material", MATERIALS)
def test_a_flat_body_bends_cones_as_predicted(material: str) -> None:
    wall = Scene(np.array([[[-4, -4, 0], [4, -4, 0], [0, 4, 0]]], np.float32))
    rays = camera_rays(Scene(wall.triangles / np.float32(4)), 16, 16, view=(0.0, 0.0, 1.0), fov=20.0)
    found = trace("hierarchical_ray_engine", wall, rays, generations=2, tile_size=8, material=material, ior=1.5,
                  backend="numpy")  # fmt: skip
    first, second = (g.cones.half_angle for g in found.generations)
    np.testing.assert_allclose(normal_cones(found, found.generations[0], 8), 0.0, atol=1e-6)
    # 10 degrees off at most: sin a / sin b = n leaves 1/n of angles within two percent
    np.testing.assert_allclose(second, first if material == "mirror" else first / 1.5, rtol=0.02)
    bounded = np.ones(4, np.bool_)
    row = glass_mirrors._predicted(found, found.generations[0], bounded, 8)
    assert row["predicted_half_angle_deg"] == pytest.approx(np.degrees(np.median(second)), rel=0.02)


@pytest.mark.parametrize(("material", "side"), [("mirror", 1.0), ("glass", -1.0)])
def test_a_fold_opens_cones_as_predicted(material: str, side: float) -> None:
    """A ridge seen from above spreads what it reflects, a valley what it refracts: there the terms add up."""
    fold = np.array([[[-4, -4, 0], [0, -4, 1], [0, 4, 1]], [[-4, -4, 0], [0, 4, 1], [-4, 4, 0]],
                     [[0, -4, 1], [4, -4, 0], [0, 4, 1]], [[4, -4, 0], [4, 4, 0], [0, 4, 1]]])  # fmt: skip
    scene = Scene((fold * [1.0, 1.0, side]).astype(np.float32))
    rays = camera_rays(Scene(scene.triangles / np.float32(4)), 8, 8, view=(0.0, 0.0, 1.0), fov=20.0)
    found = trace("hierarchical_ray_engine", scene, rays, generations=2, tile_size=8, material=material, ior=1.5,
                  backend="numpy")  # fmt: skip
    assert (found.hits.triangle >= 0).all()
    slope = np.degrees(np.arctan(0.25))
    assert normal_cones(found, found.generations[0], 8) == pytest.approx([slope], rel=1e-6)
    row = glass_mirrors._predicted(found, found.generations[0], np.ones(1, np.bool_), 8)
    came, goes = (float(np.degrees(g.cones.half_angle[0])) for g in found.generations)
    follows = came + 2.0 * slope if material == "mirror" else came / 1.5 + slope / 3.0
    assert row["predicted_half_angle_deg"] == pytest.approx(follows, abs=1e-4)
    # The widest eye rays point to the corners, and only across the fold do the terms add up
    assert 0.85 * follows < goes < 1.02 * follows


def test_kinder_is_less() -> None:
    def less(one: Any, other: Any) -> str:
        return glass_mirrors._less([{"x": one}, {"x": other}], "x")

    assert [less(1, 2), less(2, 1), less(1, 1), less("", 1), less(1, "")] == ["glass", "mirror", "alike", "", ""]


def test_the_comparison_follows_from_the_rows(rows) -> None:
    tables = glass_mirrors.EXPERIMENT.tables_of(rows, {})
    for line in tables["glass-mirrors-compared"]:
        own = [row for row in rows if (row["scene"], row["material"]) == (line["scene"], "mirror")]
        tests = sum(row["triangle_tests"] for row in own)
        assert line["mirror_triangle_tests"] == tests
        assert line["mirror_saving_without_stencil"] == round(24 * 24 * 3 * own[0]["triangles"] / tests, 3)
        assert line["kinder_by_first_bent_half_angle"] == "glass"
        assert line["kinder_by_triangle_tests"] == "mirror"


def tile_rows(sizes: tuple[int, ...]) -> list[dict]:
    return [
        row for size in sizes for reading in tiles_16.READINGS
        for row in tiles_16.measure("blob_100", size, reading, 4, 0.55, 2, "numpy")
    ]  # fmt: skip


@pytest.mark.parametrize(("reading", "size", "tile"), [
    ("size", 128, 16), ("size", 512, 16), ("count", 128, 8), ("count", 256, 16), ("count", 512, 32),
])  # fmt: skip
def test_a_reading_says_how_large_a_tile_is(reading: str, size: int, tile: int) -> None:
    assert tiles_16.tile_of(reading, size) == tile


def test_readings_agree_where_the_picture_is_their_product_and_there_alone() -> None:
    rows = tile_rows((8, 16, 32))
    tables = tiles_16.EXPERIMENT.tables_of(rows, {})
    lines = tables["tiles-16-readings"]
    assert [line["alike"] for line in lines] == ["no", "yes", "no"]
    assert [line["texels_are_16_by_16_if_size"] for line in lines] == ["no", "yes", "no"]
    assert {line["texels_are_16_by_16_if_count"] for line in lines} == {"yes"}
    for line in lines:
        assert line["cone_tests_count_by_size"] == (16 / line["size_px"]) ** 2
        assert line["read_back_bytes_count_by_size"] == line["cones_built_count_by_size"]
    assert lines[2]["triangle_tests_count_by_size"] > 1.0 > lines[0]["triangle_tests_count_by_size"]
    assert all(row["cone_tests"] == row["tiles"] * 100 * 2 for row in rows)
    assert all(row["read_back_bytes"] == 36 * row["cones_built"] for row in rows)


def test_pictures_are_drawn_from_the_rows(rows) -> None:
    with style.styled():
        pictures = ((glass_mirrors.EXPERIMENT, rows, 6), (tiles_16.EXPERIMENT, tile_rows((8, 16)), 3))
        for experiment, own, panels in pictures:
            assert experiment.plot is not None and experiment.alt
            assert len(experiment.plot(own).axes) == panels
