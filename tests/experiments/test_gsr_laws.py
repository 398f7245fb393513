"""Plan: rows of the geometry-shader paper's experiments obey what must be true of them whatever the scene.

- Full and quick cases are what `measure` takes, JSON can hold, and differ from each other.
- Naive and grid shoot the same rays; without the grid a ray that seeks its nearest hit in the box tests everything.
- Contributions add up: layers to the image, bit for bit; means of the parts to the mean of the whole.
- What a pass captures is what the next one draws, by kind, and never more than S_VB; a room of mirrors fills it.
- Both methods do the same cells and tests; bytes of rays follow from vertices and pixels.
- Shares add up to 100 percent; where all rays hit and search alike, configurations differ in lanes, not in work.
- Each erratum changes what its line says: nothing (E6, E7), the background alone is left (E3), on bytes −1 is black.
- One target equals layers for one light and two passes, and no further; orders matter on one target alone.
- A mesh that is not at hand reads `missing` and the panel says so; every picture can be drawn from its rows.
"""

from __future__ import annotations

import inspect
import json
from itertools import pairwise

import numpy as np
import pytest

from refsim.experiments import (
    experiments_of,
    gsr_errata,
    gsr_figure_3,
    gsr_figure_4,
    gsr_moving_light,
    gsr_order,
    gsr_table_1,
    gsr_table_2,
    gsr_table_3,
    style,
)
from refsim.experiments.gsr_runs import FRAGMENT_GRID, GEOMETRY_SHADER, MODES
from tests.experiments.gsr_tiny import SIZE, rows_of

NAMES = list(experiments_of("gsr"))
PIXELS = SIZE * SIZE


@pytest.mark.parametrize("quick", [False, True], ids=["full", "quick"])
@pytest.mark.parametrize("name", [name for name in NAMES if name != "claims-gsr"])
def test_cases_fit_the_measurement(name: str, quick: bool) -> None:
    experiment = experiments_of("gsr")[name]
    cases = experiment.cases(quick)
    assert cases
    assert len({json.dumps(case, sort_keys=True) for case in cases}) == len(cases)
    assert all(json.loads(json.dumps(case)) == case for case in cases)
    for case in cases:
        inspect.signature(experiment.measure).bind(**case)


def test_without_the_grid_a_ray_tests_everything() -> None:
    _, missing, grid, naive = rows_of("gsr-figure-1")
    same = ("eye_rays", "eye_rays_that_hit_percent", "shadow_rays", "reflected_rays", "rays")
    assert [grid[name] for name in same] == [naive[name] for name in same]
    # Rays that miss the box test nothing; a shadow ray stops at the first triangle that it hits
    entering, triangles = naive["rays"] - naive["box_rejections_rays"], naive["triangles"]
    searching = entering - naive["shadow_rays"]
    assert searching * triangles < naive["triangle_tests"] < entering * triangles
    assert grid["box_rejections_rays"] > 0 and naive["box_rejections_rays"] > 0
    assert naive["cells"] == 0 < grid["cells"]
    assert 10 * (grid["cells"] + grid["triangle_tests"]) < naive["triangle_tests"]
    for row in (grid, naive):
        median, largest = row["cells_and_tests_median_pixel"], row["cells_and_tests_largest_pixel"]
        assert triangles < largest <= 3 * triangles if row is naive else 0 < median < largest
        assert median * PIXELS / 2 <= row["cells"] + row["triangle_tests"] <= largest * PIXELS
    assert missing["triangles"] == "missing" and "rays" not in missing


def test_contributions_add_up() -> None:
    for view in ("knot", "cornell box"):
        own = {row["contribution"]: row for row in rows_of("gsr-figure-3") if row["view"] == view}
        assert {row["pixels_where_sum_of_layers_differs"] for row in own.values()} == {0}
        eye, secondary, shadow, whole = (own[name] for name, _ in gsr_figure_3.PANELS)
        means = [row["mean_linear_radiance"] for row in (eye, secondary, shadow)]
        # Each is rounded to six digits
        assert abs(sum(means) - whole["mean_linear_radiance"]) < 3e-6
        assert shadow["mean_linear_radiance"] < 0 < secondary["mean_linear_radiance"]
        assert eye["rays"] == PIXELS and shadow["rays"] == eye["rays_that_hit"]
        assert 0 < shadow["pixels_changed"] <= shadow["rays_that_hit"]
        assert whole["rays"] == eye["rays"] + secondary["rays"] + shadow["rays"]


def test_passes_hand_on_what_they_captured() -> None:
    rows = gsr_figure_4.of_part(rows_of("gsr-figure-4"), "a")
    for row, after in pairwise(rows):
        assert row["vertices_out"] == sum(row[f"{kind}_vertices"] for kind in gsr_figure_4.KINDS)
        assert row["bytes_out"] == 64 * row["vertices_out"]
        assert row["vertices_out"] <= row["largest_occupancy_vertices"] <= row["capacity_vertices"]
        if after["pass"]:
            passed = sum(row[f"{kind}_vertices"] for kind in gsr_figure_4.KINDS if kind.startswith("passed"))
            assert (after["vertices_in"], after["vertices_in_finished"]) == (row["vertices_out"], passed)
            spawned = row["spawned_shadow_vertices"] + row["spawned_reflected_vertices"]
            assert after["vertices_in"] - after["vertices_in_finished"] == spawned


@pytest.mark.parametrize(("passes", "records", "over"), [(1, 1, 1.0), (2, 3, 1.0), (3, 4, 4 / 3), (4, 4, 4 / 3)])
def test_a_room_of_mirrors_fills_the_buffers(passes: int, records: int, over: float) -> None:
    rows = [row for row in gsr_figure_4.of_part(rows_of("gsr-figure-4"), "a") if row["passes"] == passes]
    assert {row["capacity_vertices"] for row in rows} == {records * PIXELS}
    assert {row["over_allocation"] for row in rows if row["view"] == "mirroring room"} == {round(over, 4)}


def test_both_methods_do_the_same_work() -> None:
    rows = gsr_figure_4.of_part(rows_of("gsr-figure-4"), "b") + [
        row for row in rows_of("gsr-table-3") if row["triangles"] != "missing"
    ]
    pairs = {(row["view"], row["mode"]) for row in rows}
    same = ("rays", "eye_rays_that_hit_percent", "cells", "triangle_tests", "box_rejections_rays")
    for pair in pairs:
        found = {row["method"]: [row[name] for name in same] for row in rows if (row["view"], row["mode"]) == pair}
        assert found[GEOMETRY_SHADER] == found[FRAGMENT_GRID]
    assert len(pairs) == 2 * len(MODES)


def test_bytes_follow_from_vertices_and_pixels() -> None:
    rows = gsr_figure_4.of_part(rows_of("gsr-figure-4"), "b")
    for row in rows:
        if (row["view"], row["mode"], row["method"]) == ("cornell box", "RC", GEOMETRY_SHADER):
            # Every ray hits: read once, captured once; each fragment blends two targets, two blending passes follow
            assert (row["ray_bytes_read"], row["ray_bytes_written"]) == (64 * PIXELS, 64 * PIXELS)
            assert row["color_bytes"] == 16 * PIXELS * (2 * 2 + 2 * 3)
        if (row["mode"], row["method"]) == ("RC", FRAGMENT_GRID):
            # One pass shoots, two light; a texel of 16 bytes each for origin, direction and hit, one for an occluder
            assert row["draw_calls"] == 3
            assert row["ray_bytes_read"] == 16 * PIXELS * (3 + 2 * 4)
            assert row["ray_bytes_written"] == 48 * PIXELS
            assert row["color_bytes"] == 32 * 2 * PIXELS


def test_shares_add_up_and_grow_with_triangles() -> None:
    table = gsr_table_1.distribution(rows_of("gsr-table-1"))
    assert len(table) == 9
    for row in table:
        for suffix in ("", "_fetch_8"):
            shares = [row[f"{name}_percent{suffix}"] for name in ("vertex", "geometry", "fragment")]
            assert abs(sum(shares) - 100.0) < 2e-3  # three numbers of three digits
        assert row["operations"] > 0 and row["vertex_arithmetic_per_fetch"] > 1
    for mode in MODES:
        shares = [row["vertex_percent"] for row in table if row["mode"] == mode]
        assert shares == sorted(shares) and shares[-1] > 99
    assert {row["eye_rays_that_hit_percent"] for row in rows_of("gsr-table-1")} == {100.0}


def test_the_grid_is_built_for_every_frame() -> None:
    first, other = gsr_table_1.frames_of(rows_of("gsr-table-1"))
    assert (first["frame"], other["frame"]) == (0, 66)
    assert first["grid_references"] != other["grid_references"] and first["grid_references"] >= 646
    assert first["triangle_tests"] != other["triangle_tests"]
    assert all(0 < row["grid_triangle_tests"] < row["triangle_tests"] / 10 for row in (first, other))


def test_configurations_differ_in_lanes_alone() -> None:
    rows = rows_of("gsr-table-2")
    cast = [row for row in gsr_table_2.of_part(rows, "counters") if row["mode"] == "RC"]
    assert [row["configuration"] for row in cast] == list(gsr_table_2.CONFIGURATIONS)
    assert len({(row["rays"], row["cells"], row["triangle_tests"]) for row in cast}) == 1
    assert [row["geometry_shader_runs"] for row in cast] == [PIXELS, 0, 0, PIXELS]
    for row in gsr_table_2.of_part(rows, "warps"):
        assert row["issued_lane_steps"] >= row["working_lane_steps"] > 0
        assert row["issued_before_shading_lane_steps"] <= row["issued_lane_steps"]
    meets, apart = gsr_table_2.RECONVERGE
    for name in gsr_table_2.CONFIGURATIONS:
        issued = [gsr_table_2.one(rows, name, "RC", width, meets)["issued_lane_steps"] for width in gsr_table_2.WIDTHS]
        assert issued == sorted(issued) and issued[0] < issued[-1]
    # Where paths meet after each branch, a warp issues the same blocks in one shader as in two
    assert set(gsr_table_2.losses(rows, meets).values()) == {1.0}
    assert max(gsr_table_2.losses(rows, apart).values()) > 1.0


def test_table_2_wants_every_ray_to_hit() -> None:
    with pytest.raises(AssertionError, match="every eye ray"):
        gsr_table_2.measure("cornell box from afar", SIZE, gsr_table_2.PASS_THROUGH, "RC")


def test_table_3_has_a_row_for_what_is_missing() -> None:
    rows = rows_of("gsr-table-3")
    (absent,) = [row for row in rows if row["triangles"] == "missing"]
    assert absent["published_scene"] == "Horse" and "cells" not in absent
    full = experiments_of("gsr")["gsr-table-3"].cases(False)
    assert [case["mesh"] for case in full if case["published_scene"] == "Fairy Forest"] == ["missing"]
    for row in gsr_table_3.ratios(rows):
        assert row["steps_ratio_of_methods"] == 1.0
        assert row["steps_ratio_to_rc"] >= 1.0 and row["published_ms_ratio_of_methods"] > 1.0


def test_each_erratum_changes_what_its_line_says() -> None:
    rows = rows_of("gsr-errata")
    floats = {row["errata"]: row for row in rows if row["color_format"] == gsr_errata.FLOAT}
    eight = {row["errata"]: row for row in rows if row["color_format"] == gsr_errata.BYTES}
    assert list(floats) == list(gsr_errata.ABOUT) and list(eight) == list(gsr_errata.ON_BYTES)
    changed = {name: row["pixels_changed"] > 0 for name, row in floats.items()}
    assert {name for name, other in changed.items() if not other} == {"corrected", "GSR-E6", "GSR-E7"}
    assert floats["GSR-E6"]["triangle_tests"] > floats["corrected"]["triangle_tests"]
    assert {**floats["GSR-E7"], "errata": ""} == {**floats["corrected"], "errata": ""}
    assert floats["GSR-E1"]["brightest_channel"] > 1.0 > 0.0 > floats["GSR-E1b"]["darkest_channel"]
    assert eight["GSR-E1b"]["pixels_changed"] == 0 < eight["GSR-E1"]["pixels_changed"]
    case = {"view": gsr_errata.VIEW, "passes": gsr_errata.PASSES, "color_format": gsr_errata.FLOAT}
    image, _ = gsr_errata.traced(size=SIZE, errata="GSR-E3", **case)
    assert np.unique(image.reshape(-1, 3), axis=0).tolist() == [np.float32([0.1, 0.12, 0.15]).tolist()]


def test_one_target_is_enough_for_one_light_and_two_passes() -> None:
    rows = gsr_order.of_part(rows_of("gsr-order"), "limits")
    for row in rows:
        enough = row["passes"] <= 2 or row["secondary_rays"] == "none"
        # As printed a shadow adds white
        white = row["targets"] == gsr_order.AS_PRINTED and row["passes"] > 1
        assert (row["pixels_changed"] == 0) is (enough and not white), row
    assert sum(row["targets"] == gsr_order.AS_PRINTED for row in rows) == 4
    assert {row["lights"] for row in rows} == {1}


@pytest.mark.parametrize(("lights", "passes", "equal"), [(2, 1, True), (2, 2, False)])
def test_two_lights_need_targets_of_their_own(lights: int, passes: int, equal: bool) -> None:
    (row,) = gsr_order.measure("knot", SIZE, passes, lights, "none")
    assert (row["pixels_changed"] == 0) is equal


def test_orders_matter_on_one_target_alone() -> None:
    for row in gsr_order.of_part(rows_of("gsr-order"), "orders"):
        right = row["targets"] == "layers" or (row["emission_order"], row["passes"]) == ("listed", 2)
        assert (row["pixels_changed"] == 0) is right, row


def test_moving_light_moves_shadow_rays_alone() -> None:
    rows = rows_of("gsr-moving-light")
    assert len(rows) == 5
    assert len({(row["eye_cells_and_tests"], row["shadow_rays"]) for row in rows}) == 1
    assert len({(row["light_x"], row["light_y"], row["light_z"]) for row in rows}) == 5
    (extremes,) = gsr_moving_light.summary(rows)
    assert extremes["shadow_ratio"] > extremes["picture_ratio"] > 1.0
    costs = [row["shadow_cells"] + row["shadow_tests"] for row in rows]
    assert costs[extremes["dearest_step"]] == max(costs) and costs[extremes["cheapest_step"]] == min(costs)


@pytest.mark.parametrize("name", [name for name in NAMES if experiments_of("gsr")[name].plot is not None])
def test_pictures_are_drawn_from_rows(name: str) -> None:
    experiment, rows = experiments_of("gsr")[name], rows_of(name)
    with style.styled():
        figure = experiment.plot(rows)
        figure.draw_without_rendering()
    said = " ".join(text.get_text() for text in figure.findobj(lambda each: hasattr(each, "get_text")))
    assert ("missing" in said) is any(row.get("triangles") == "missing" for row in rows)
    tables = experiment.tables_of(rows, {})
    assert name in tables and all(tables.values())
