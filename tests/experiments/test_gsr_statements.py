"""Plan: the paper's own set-up and its sentences on the stages are checked by what could fail.

- At the paper's set-up the pipeline is the recursive tracer, bit for bit; of what is printed, two tables change pixels
  there (a white shadow, a quarter for ρ), and the listings alone are right where every surface mirrors a quarter.
- The composition in NumPy notices another α; a background that is not the clear colour is noticed.
- P passes are the recursion of depth P, and of no other; one bounce with shadows in it is another picture.
- Every statement gives what the ledger expects; break what it is about, and it does not.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from refsim.experiments import gsr_paper_case, gsr_set_up, gsr_stages
from refsim.papers.geometry_shader_rays import errata
from refsim.scene.light import PointLight
from tests.experiments.gsr_tiny import SIZE, rows_of

CHANGING = {"listing-4-miss", "listing-5-rho", "rgb-shadow", "as-printed", "as-printed-listings"}
# What each statement counts: the sentence holds where it is this number
EXPECTED = {
    "emission-order": 0, "most-outputs": 3, "finished-emit": 0, "new-rays-drawn": 0, "misses-drawn": 0,
    "pixels-covered": 0, "buffer-order": 0, "packed": 0, "kinds-of-quads": 1, "kinds-of-points": 2,
    "draws": 1, "one-buffer": 0, "rasterised": 0, "lists": 0, "indirections": 0, "world-space": 0, "slices": 4,
}  # fmt: skip


def statements() -> dict[str, dict]:
    rows = gsr_stages.of_part(rows_of("gsr-stages"), "statements")
    return {row["id"]: row for row in rows + gsr_set_up.of_part(rows_of("gsr-set-up"), "statements")}


def test_at_the_papers_set_up_the_pipeline_is_the_recursive_tracer() -> None:
    rows = {row["id"]: row for row in gsr_paper_case.of_part(rows_of("gsr-paper-case"), "items")}
    assert list(rows) == list(gsr_paper_case.ITEMS)
    for name, row in rows.items():
        assert row["twin_differs"] == row["corrected_fails"] == 0 < row["cases"], name
        assert (row["printed_fails"] > 0) is (name in CHANGING), name
    assert rows["listing-4-miss"]["printed_fails"] == rows["listing-4-miss"]["cases"]


def test_all_errata_that_have_a_printed_form_are_run() -> None:
    run = {name for item in gsr_paper_case.ITEMS.values() for name in item.printed.split(",") if name}
    assert run == set(errata.NAMES) - {"GSR-E3", "GSR-E7"}
    for name in ("as-printed", "as-printed-listings"):
        shadow = "GSR-E1" if name == "as-printed" else "GSR-E1b"
        own = set(gsr_paper_case.ITEMS[name].printed.split(","))
        assert own == run - {"GSR-E1", "GSR-E1b"} | {shadow}


def test_another_alpha_is_noticed() -> None:
    right = gsr_paper_case.recursive(SIZE).picture()
    assert gsr_paper_case.differ(gsr_paper_case.composed(SIZE), right) == 0
    assert gsr_paper_case.differ(gsr_paper_case.composed(SIZE, alpha_reflected=0.0), right) > 0


def test_the_papers_set_up_has_neither_ambient_light_nor_highlights() -> None:
    """A pixel whose light is all in shadow is black, and no light is clipped but by the target."""
    scene = gsr_paper_case.paper_scene()
    assert {material.specular for material in scene.materials} == {0.0}
    assert 0.2 * max(max(material.color) for material in scene.materials) < 0.5 / 255.0
    out = (PointLight(scene.lights[0].position, intensity=0.0),)
    assert not gsr_paper_case.image(gsr_paper_case.run(SIZE, lights=out)).any()
    lit = gsr_paper_case.image(gsr_paper_case.run(SIZE))
    assert lit.max() <= 1.0 and (lit.max(axis=1) > 0.1).sum() > SIZE * SIZE / 8


def test_passes_are_the_depth() -> None:
    rows = gsr_paper_case.of_part(rows_of("gsr-paper-case"), "passes")
    assert [row["passes"] for row in rows if row["as_deep"]] == list(range(1, gsr_paper_case.MOST_PASSES + 1))
    for row in rows:
        assert (row["pixels_changed"] == 0) is bool(row["as_deep"]), row
    assert [row["deepest_hits_shadowed"] for row in rows] == [0] * (len(rows) - 1) + [1]


def test_statements_count_what_the_ledger_expects() -> None:
    found = statements()
    assert {name: found[name]["measured"] for name in EXPECTED} == EXPECTED
    assert all(row["of"] > 0 and row["counted"] for row in found.values())
    assert found["reversed-order"]["measured"] > 0
    assert found["intermixed"]["measured"] > 2
    assert found["rasterised-hits"]["measured"] <= 0.01 * found["rasterised-hits"]["of"]
    assert found["rasterised-steps"]["measured"] < found["rasterised-steps"]["of"]


def test_full_buffers_hold_three_records_a_pixel() -> None:
    rows = gsr_set_up.of_part(rows_of("gsr-set-up"), "room")
    assert {row["triangles"] for row in rows} == {12, 258, 1024}
    for row in rows:
        assert row["all_hit_and_mirror"] == 1 and row["records_a_pixel"] == row["records_of_s_vb_a_pixel"] == 3.0


def test_stages_hand_on_what_they_made() -> None:
    first, second = gsr_stages.of_part(rows_of("gsr-stages"), "passes")
    assert second["vertex_invocations"] == first["stream_output_primitives"] > first["vertex_invocations"]
    for row in (first, second):
        assert row["fragment_discarded"] + row["fragment_written"] == row["fragment_invocations"]
    assert first["fragment_discarded"] > 0 == second["fragment_discarded"]


@pytest.mark.parametrize(
    ("statement", "options"),
    [
        (gsr_stages.emission_order, {"emission_order": "reversed"}),
        (gsr_stages.misses_drawn, {"errata": "corrected", "background": (0.5, 0.5, 0.5)}),
    ],
)
def test_a_broken_run_is_noticed(statement, options: dict, monkeypatch) -> None:
    """The same statement on a run that is not as it says."""
    whole = gsr_stages.tapped
    monkeypatch.setattr(gsr_stages, "tapped", lambda view, size, *_: whole(view, size, **options))
    assert statement(SIZE)[0] > 0


def test_broken_records_are_noticed(monkeypatch) -> None:
    """One record that is not the ray that was shot; one new ray that is drawn."""
    found, taps = gsr_stages.tapped(gsr_stages.BOX, SIZE)
    slot = found.generations[1].slot[0]
    monkeypatch.setitem(taps.stream_output[0].records, "orig_t", taps.stream_output[0].records["orig_t"].copy())
    taps.stream_output[0].records["orig_t"][slot, 3] += 1
    assert gsr_stages.packed(SIZE)[0] == 1
    monkeypatch.setattr(gsr_stages, "FragmentFate", SimpleNamespace(DISCARDED=-1))
    drawn, of = gsr_stages.new_rays_drawn(SIZE)
    assert drawn == of > 0


def test_broken_textures_are_noticed(monkeypatch) -> None:
    prepared = gsr_set_up.prepared_of(gsr_set_up.BOX)
    grid, textures = prepared.accelerator.structure, prepared.textures
    cells, texels = grid.cells.copy(), np.array(textures.triangles.data)
    cells[..., 0] += 1
    texels[0, 3, 0, 0] += 1
    broken = SimpleNamespace(
        accelerator=SimpleNamespace(structure=grid._replace(cells=cells)),
        textures=textures._replace(triangles=SimpleNamespace(data=texels)),
    )
    monkeypatch.setattr(gsr_set_up, "prepared_of", lambda _: broken)
    assert gsr_set_up.lists(SIZE)[0] == cells[..., 0].size
    assert gsr_set_up.indirections(SIZE)[0] > 0
    assert gsr_set_up.world_space(SIZE)[0] == 1
