"""Plan: rows of the sphere hierarchy's experiments obey what must be true of them whatever the scene.

- Full and quick cases are what `measure` takes, JSON can hold, and differ from each other.
- The drawn list is a depth-first walk: an escape leads past the subtree; special values stand where the paper has them.
- Shares of directions and of culled normals are those of geometry: 1/n, 1/6, arcsin(1/3)/π, 1/8.
- Safe rules cull no hit, all structures find the same ones, and sums and quotients of counts fit each other.
- A permutation test calls an order an order and chance chance; consistent renaming is found; effects come in 32 pairs.
- A mesh that is not at hand reads `missing` and the picture says so; every picture can be drawn from its rows.
"""

from __future__ import annotations

import inspect
import json
import math

import numpy as np
import pytest

from refsim.experiments import (
    bsh_figure_1,
    bsh_growth,
    bsh_histogram,
    bsh_holes,
    bsh_lists,
    bsh_table_1,
    bsh_table_1_statistics,
    bsh_table_2,
    bsh_table_3,
    experiments_of,
    style,
)
from refsim.experiments import bsh_published as published
from tests.experiments.bsh_tiny import rows_of

NAMES = list(experiments_of("bsh"))


@pytest.mark.parametrize("quick", [False, True], ids=["full", "quick"])
@pytest.mark.parametrize("name", NAMES)
def test_cases_fit_the_measurement(name: str, quick: bool) -> None:
    experiment = experiments_of("bsh")[name]
    cases = experiment.cases(quick)
    assert cases
    assert len({json.dumps(case, sort_keys=True) for case in cases}) == len(cases)
    assert all(json.loads(json.dumps(case)) == case for case in cases)
    for case in cases:
        inspect.signature(experiment.measure).bind(**case)


def test_the_drawn_list_is_a_depth_first_walk() -> None:
    rows = rows_of("bsh-figure-1")
    assert [row["element"] for row in rows] == list(range(len(rows)))
    assert sorted(row["number"] for row in rows if row["kind"] == "triangle") == list(range(9))
    for row in rows:
        below = [other["element"] for other in rows if _is_below(rows, other, row)]
        after = row["element"] + 1 + len(below)
        assert below == list(range(row["element"] + 1, after))
        assert row["leads_to"] == ("end" if after == len(rows) else after)
        wanted = after - row["element"] if after < len(rows) else -1 if row["kind"] == "sphere" else 0
        assert row["escape_index"] == wanted
        assert bsh_figure_1.depth_of(rows, row) <= 4


def _is_below(rows: list[dict], row: dict, above: dict) -> bool:
    while row["parent_element"] != "":
        row = rows[row["parent_element"]]
        if row is above:
            return True
    return False


def test_shares_are_those_of_geometry() -> None:
    # 1,000 even directions: a share's border of length L holds some sqrt(n) L / 2 of them, and half of these may err
    slack = 1.5
    wanted = {"sextant_opposite": 100 / 6, "sextant_same": 100 / 6, "octant": 100 / 8, "octant_opposite": 100 / 8,
              "sextant_safe": 100 * math.asin(1 / 3) / math.pi}  # fmt: skip
    for row in rows_of("bsh-figure-2"):
        assert abs(row["share_percent"] - 100 / row["lists"]) < slack
        for rule, percent in wanted.items():
            if f"{rule}_culled_percent" in row:
                assert abs(row[f"{rule}_culled_percent"] - percent) < slack
                safe = rule in ("sextant_safe", "octant")
                assert (row[f"{rule}_pairs_facing_percent"] == 0) is safe
                assert (row[f"{rule}_unsafe_percent_of_culled"] == 0) is safe


def test_heads_skip_what_is_rejected() -> None:
    for part in ("triangle", "cell"):
        own = [row for row in rows_of("bsh-figure-3") if row["part"] == part and "element" in row]
        skipped = [row for row in own if row["before_head"]]
        assert 0 < len(skipped) < len(own)
        assert [row["element"] for row in skipped] == list(range(len(skipped)))
        assert all(row["rejected"] for row in skipped if row["what"] == "triangle")
        first = own[len(skipped)]
        assert first["what"] == "triangle" and not first["rejected"]
    planes = [row for row in rows_of("bsh-figure-3") if row["what"] == "half-space"]
    assert [row["part"] for row in planes] == ["triangle"] * 5 + ["cell"] * 5


def test_counts_fit_each_other() -> None:
    for row in (*rows_of("bsh-figure-4"), *rows_of("bsh-table-1"), *rows_of("bsh-lists"), *rows_of("bsh-holes")):
        if row["triangles"] == "missing" or row.get("rule") == bsh_holes.LITERAL_OCTANT:
            continue
        rays = row["eye_rays"] + row["shadow_rays"]
        assert row["rays_per_pixel"] == round(rays / row["size_px"] ** 2, 4)
        split = row["eye_rays"] * row["eye_nodes_per_ray"] + row["shadow_rays"] * row["shadow_nodes_per_ray"]
        assert abs(split - row["nodes"]) <= 5e-4 * rays + 1e-6  # means of three digits
        assert row["triangle_tests"] <= row["nodes"]
    (cubes,) = [row for row in rows_of("bsh-figure-4") if row["triangles"] != "missing"]
    assert (cubes["triangles"], cubes["vertices"]) == (222, 124)
    assert cubes["same_eye_hits_percent"] == 100.0


def test_safe_rules_lose_nothing() -> None:
    rows = {(row["camera"], row["rule"]): row for row in rows_of("bsh-holes") if row["triangles"] != "missing"}
    for (_, rule), row in rows.items():
        assert (row["wrong_pixels"] == 0) or rule in ("sextant_opposite", "sextant_same", bsh_holes.LITERAL_OCTANT)
        assert row.get("lost_pixels", 0) <= row["wrong_pixels"] <= row["size_px"] ** 2
    camera = bsh_holes.SEEN[0]
    assert rows[camera, "sextant_opposite"]["wrong_pixels"] > 0 < rows[camera, bsh_holes.LITERAL_OCTANT]["wrong_pixels"]
    culled = [rows[camera, rule]["culled_percent"] for rule in ("none", "sextant_safe", "sextant_same")]
    assert culled[0] == 0 < culled[1] < culled[2]


def test_every_structure_finds_the_same_hits() -> None:
    rows = [row for row in rows_of("bsh-compared") if row["triangles"] != "missing"]
    assert len(rows) == 9 and all(row["same_hits"] == 1 for row in rows)
    own = {row["structure"]: row for row in rows}
    assert own["kd-tree, stack"]["tests_per_ray"] == own["kd-tree, restart"]["tests_per_ray"]
    assert own["kd-tree, stack"]["nodes_per_ray"] <= own["kd-tree, restart"]["nodes_per_ray"]


def test_bins_hold_every_ray() -> None:
    rows = rows_of("bsh-histogram")
    for row in rows:
        drawn = row.get("lists") == 6 and row.get("screen_cells") in ("", bsh_histogram.DRAWN_CELLS)
        if row["part"] == "summary" and row["triangles"] != "missing" and drawn:
            bins = [other["ray_count"] for other in rows if other["part"] == "bins"
                    and (other["rays"], other["ground"]) == (row["rays"], row["ground"])
                    and other["configuration"] == f"{row['heads']}, {row['head_rule']}"]  # fmt: skip
            assert sum(bins) == row["ray_count"] > 0
            assert row["more_percent"] + row["fewer_percent"] <= 100.001
            assert (row["most_more"] > 0) is (row["more_percent"] > 0)


def test_gains_are_against_one_list() -> None:
    rows = [row for row in rows_of("bsh-lists") if row["triangles"] != "missing"]
    table = bsh_lists.gains(rows)
    assert {row["lists"] for row in table} == {2, 6, 8}
    doubled = [{**row, "nodes_per_ray": 2 * row["nodes_per_ray"]} if row["lists"] == 1 else row for row in rows]
    for row, other in zip(table, bsh_lists.gains(doubled), strict=True):
        # Both gains are rounded to three digits
        assert abs(other["gain_percent"] - (50 + row["gain_percent"] / 2)) < 2e-3


def test_laws_find_their_own_kind() -> None:
    n = [100 * 4**k for k in range(6)]
    log = [{"family": "log", "triangles": x, "nodes_per_ray": 3 + 2 * math.log2(x)} for x in n]
    power = [{"family": "power", "triangles": x, "nodes_per_ray": 2 * x**0.3} for x in n]
    first, second = bsh_growth.laws(log + power)
    assert (first["better"], first["log_a"], first["log_b"]) == ("log", 3.0, 2.0)
    assert (second["better"], second["power_c"], second["power_p"]) == ("power", 2.0, 0.3)
    assert bsh_growth.laws(log[:2]) == []


def test_a_link_is_fitted_to_scenes_of_the_papers_size() -> None:
    scenes = list(published.TABLE_3)
    rows = [
        {"published_scene": scene, "triangles": k if k != 3 else 7, "published_triangles": k, "bytes": 10**k,
         "bytes_with_heads": 2 * 10**k, "published_copy_ms": 2.0 + 10**k / 1e3, "published_frame_ms": 9.0}
        for k, scene in enumerate(scenes)
    ]  # fmt: skip
    one, two = bsh_table_3.links(rows)
    assert (one["scenes"], one["fixed_ms"], one["rate_mb_per_s"]) == (4, 2.0, 1.0)
    assert (two["fixed_ms"], two["rate_mb_per_s"], two["largest_residual_ms"]) == (2.0, 2.0, 0.0)
    (cubes,) = [row for row in rows_of("bsh-table-3") if row["triangles"] != "missing"]
    assert 5.0 < cubes["redundancy_of_elements"] < 6.0
    assert cubes["bytes_with_heads"] - cubes["bytes"] == 24 * 222


def combinations(nodes, printed) -> list[dict]:
    rows = [settings._asdict() for settings in published.TABLE_1]
    both = zip(rows, nodes, printed, strict=True)
    return [{**row, "nodes_per_ray": float(a), "published_nodes_per_ray": float(b)} for row, a, b in both]


def test_statistics_call_an_order_an_order() -> None:
    weights = {"culled": 5.0, "heads": 11.0, "frustum": 3.0}
    nodes = [
        100 - sum(weight * getattr(settings, name) for name, weight in weights.items())
        + (1.0 if settings.order == "latest_last" else 0.0) for settings in published.TABLE_1
    ]  # fmt: skip
    same = {row["statistic"]: row for row in bsh_table_1_statistics.statistics(combinations(nodes, nodes))}
    assert all(row["observed"] == 1.0 and row["p_value"] < 0.01 for row in same.values())
    # Heads and screen cells exchanged: not the same order, but the same after renaming
    index = {settings: k for k, settings in enumerate(published.TABLE_1)}
    swapped = [nodes[index[s._replace(heads=s.frustum, frustum=s.heads)]] for s in published.TABLE_1]
    told = {row["statistic"]: row for row in bsh_table_1_statistics.statistics(combinations(nodes, swapped))}
    assert told["rank correlation"]["observed"] < 0.9
    assert told["rank correlation, best relabelling"]["observed"] == 1.0
    noise = np.random.default_rng(3).random(16)
    chance = {row["statistic"]: row for row in bsh_table_1_statistics.statistics(combinations(nodes, noise))}
    assert chance["rank correlation, best relabelling"]["p_value"] > 0.05
    assert abs(chance["additive share, printed"]["chance_mean"] - 4 / 15) < 0.01


def test_effects_are_32_pairs_and_relabellings_384() -> None:
    rows = bsh_table_1.compared(rows_of("bsh-table-1"))
    assert len(rows) == 16
    pairs = bsh_table_1_statistics.effects(rows)
    assert len(pairs) == 32 and {pair["switch"] for pair in pairs} == {"order", "culled", "heads", "frustum"}
    codes = bsh_table_1_statistics._codes(rows)
    renamed = bsh_table_1_statistics.relabellings(codes)
    assert renamed.shape == (384, 16) and len({tuple(each) for each in renamed.tolist()}) == 384
    assert (np.sort(renamed, axis=1) == np.arange(16)).all()


def test_readings_of_one_scene_are_what_they_are_called() -> None:
    rows = rows_of("bsh-table-2")
    (counters,) = [row for row in bsh_table_2.of_part(rows, "counters") if row["triangles"] != "missing"]
    told = {row["reading"]: row["ours"] for row in bsh_table_2.of_part(rows, "readings")}
    assert told["nodes"] == counters["nodes_per_ray"]
    assert told["nodes × width"] == pytest.approx(32 * counters["nodes_per_ray"], abs=32 * 5e-4)
    assert told["nodes × width"] <= told["iterations × width²"]
    assert counters["published_nodes_per_ray"] > counters["longest_list_elements"]


@pytest.mark.parametrize("name", [name for name in NAMES if experiments_of("bsh")[name].plot is not None])
def test_pictures_are_drawn_from_rows(name: str) -> None:
    experiment, rows = experiments_of("bsh")[name], rows_of(name)
    with style.styled():
        figure = experiment.plot(rows)
        figure.draw_without_rendering()
    said = " ".join(text.get_text() for text in figure.findobj(lambda each: hasattr(each, "get_text")))
    shown = name not in ("bsh-holes",)  # whose picture is of the last scene alone
    assert ("missing" in said) is (shown and any(row.get("triangles") == "missing" for row in rows))
    tables = experiment.tables_of(rows, {})
    assert name in tables and all(tables.values())
