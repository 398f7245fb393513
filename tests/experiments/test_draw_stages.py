"""Plan: what the taps say of one small draw is one story, told again from its first rows by the NumPy reference.

- Emitted vertices come from their vertices, triangles from emitted vertices, records from triangles, and where a
  position falls is where the reference puts it; fragments are the covered centres of the snapped corners.
- Discard, stencil, depth and blend, replayed one fragment after the other in submission order, give every fate, what
  the target held after each fragment, and the last picture; counters are numbers of rows.
- A buffer of any size takes whole triangles only; the rest is counted.
- Threads and taps change no bit.
- The committed tables are, byte for byte, what the draw gives; the picture shows them without texts that overlap.
- The topic has an index of its own, beside the paper's.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from refsim.experiments import draw_stages, experiments_of, reproduce, small_draw, style, topics
from refsim.experiments.files import csv_text
from refsim.reference import blend, interpolation, raster

FIGURES = Path(__file__).resolve().parents[2] / "figures"
SCREEN = (0, 0, small_draw.WIDTH, small_draw.HEIGHT)
VIEWPORT = (*SCREEN, 0, 1)
(CASE,) = draw_stages.cases(False)
F = np.float32
COLORS = ("red", "green", "blue", "alpha")


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    return json.loads(json.dumps(draw_stages.measure(**CASE)))


@pytest.fixture(scope="module")
def stages(rows) -> dict[str, list[dict]]:
    return draw_stages.tables(rows, {})


def part(stages, name: str) -> list[dict]:
    return stages[f"draw-stages-{name}"]


def clip_of(row: dict) -> list[float]:
    return [row[f"clip_{name}"] for name in "xyzw"]


def corners_in(row: dict) -> np.ndarray:
    return np.array([[row[f"corner_{k}_{axis}_256ths_px"] for axis in "xy"] for k in range(3)])


def test_emitted_vertices_come_from_their_vertices(stages) -> None:
    emitted = part(stages, "emitted")
    assert [row["emitted"] for row in emitted] == list(range(len(emitted)))
    order = [(row["invocation"], row["entry"]) for row in emitted]
    pieces = {row["vertex"]: row["pieces"] for row in part(stages, "vertices")}
    assert order == [(vertex, entry) for vertex, n in pieces.items() if n for entry in range(n + 2)]
    assert sorted(pieces.values()) == [0, 1, 2, 2]
    assert all(row["vertex"] == row["invocation"] for row in emitted)


def test_triangles_join_each_strip_and_turn_every_second_one(stages) -> None:
    emitted = part(stages, "emitted")
    expected = []
    for run in dict.fromkeys(row["invocation"] for row in emitted):
        strip = [row["emitted"] for row in emitted if row["invocation"] == run]
        expected += [(run, *(strip[k] for k in triangle)) for triangle in raster.strip_triangles(len(strip))]
    triangles = part(stages, "triangles")
    assert [(row["invocation"], *(row[f"emitted_{k}"] for k in range(3))) for row in triangles] == expected
    assert [row["primitive"] for row in triangles] == list(range(5))


def test_positions_fall_where_the_reference_puts_them(stages) -> None:
    for row in part(stages, "vertices") + part(stages, "emitted"):
        ndc, _ = raster.divide(np.array(clip_of(row), F))
        assert [F(row["screen_x_px"]), F(row["screen_y_px"])] == raster.to_screen(ndc, VIEWPORT).tolist()
    clip = np.array([clip_of(row) for row in part(stages, "emitted")], F)
    for row in part(stages, "triangles"):
        corners = raster.corners_of(clip[[row[f"emitted_{k}"] for k in range(3)]], VIEWPORT)
        assert row["front"] is bool(raster.faces_front(corners, "ccw")) is True
        assert sorted(map(tuple, corners_in(row).tolist())) == sorted(map(tuple, corners.tolist()))
        assert corners_in(row)[0].tolist() == corners[0].tolist()


def test_fragments_are_the_covered_centres(stages) -> None:
    heat = np.array([row["heat"] for row in part(stages, "emitted")])
    w = np.array([row["clip_w"] for row in part(stages, "emitted")])
    for triangle in part(stages, "triangles"):
        own = [row for row in part(stages, "fragments") if row["primitive"] == triangle["primitive"]]
        at = np.array([(row["y_px"], row["x_px"]) for row in own])
        corners = corners_in(triangle)
        assert at.tolist() == np.argwhere(raster.coverage(corners, SCREEN)).tolist()
        x0, y0, x1, y1 = (triangle[f"box_{edge}_px"] for edge in ("x0", "y0", "x1", "y1"))
        assert (at >= (y0, x0)).all() and (at < (y1, x1)).all()
        # The rasteriser turns a front face round, the first corner stays
        vertices = [triangle[f"emitted_{k}"] for k in (0, 2, 1)]
        weights = interpolation.perspective(interpolation.barycentrics(corners, at[:, 1], at[:, 0]), w[vertices])
        # Two products, two sums and the weights of order one, float32: eight units in the last place of 1
        assert np.abs(weights @ heat[vertices] - [row["heat"] for row in own]).max() < 8 * 2**-23
        assert {row["invocation"] for row in own} == {triangle["invocation"]}


def blended(row: dict, stored: np.ndarray) -> np.ndarray:
    """What the reference makes of a fragment's colour over the one stored."""
    source = np.array([row[name] for name in COLORS], F)
    alphas = np.full(4, source[3]), np.full(4, stored[3])
    zero = np.zeros(4, F)
    operands = blend.clamped(blend.Operands(source, stored, zero, zero, *alphas, zero))
    return blend.to_unorm8(blend.blend("add", "src-alpha", "one-minus-src-alpha", operands))


def test_fates_and_colours_are_those_of_a_replay(stages) -> None:
    pixels = {(row["x_px"], row["y_px"]): row for row in part(stages, "pixels")}
    color = {at: np.array([F(row[f"before_{n}"]) / F(255) for n in COLORS], F) for at, row in pixels.items()}
    depth = {at: F(row["before_depth"]) for at, row in pixels.items()}
    for row in part(stages, "fragments"):
        at = row["x_px"], row["y_px"]
        expected = "written"
        if not abs(F(row["heat"]) - F(0.5)) > small_draw.BAND:
            expected = "discarded"
        elif pixels[at]["before_stencil"] != 0:
            expected = "stencil failed"
        elif not F(row["depth"]) < depth[at]:
            expected = "depth failed"
        assert row["fate"] == expected
        if expected == "written":
            color[at], depth[at] = blended(row, color[at]), F(row["depth"])
        assert [F(row[f"stored_{name}"]) for name in COLORS] == color[at].tolist()
    for at, row in pixels.items():
        assert [row[f"after_{name}"] for name in COLORS] == np.rint(color[at] * F(255)).tolist()
        assert (F(row["after_depth"]), row["after_stencil"]) == (depth[at], row["before_stencil"])


def test_the_draw_is_worth_a_look(stages) -> None:
    """Every fate occurs, a written fragment covers another one, and a vertex emits nothing."""
    fragments = part(stages, "fragments")
    assert {row["fate"] for row in fragments} == {"written", "discarded", "stencil failed", "depth failed"}
    written = [(row["x_px"], row["y_px"]) for row in fragments if row["fate"] == "written"]
    assert len(written) - len(set(written)) > 5


def test_counters_are_numbers_of_rows(stages) -> None:
    counts = {row["counter"]: row["count"] for row in stages["draw-stages"]}
    fragments = part(stages, "fragments")
    assert counts["vertex.invocations"] == counts["geometry.invocations"] == len(part(stages, "vertices"))
    assert counts["geometry.vertices_out"] == len(part(stages, "emitted"))
    assert counts["geometry.primitives_out"] == counts["raster.drawn"] == len(part(stages, "triangles"))
    assert counts["stream_output.primitives"] * 3 == sum("heat" in row for row in part(stages, "records"))
    assert counts["raster.fragments"] == counts["fragment.invocations"] == len(fragments)
    for name, fate in (("fragment.discarded", "discarded"), ("stencil.failed", "stencil failed"),
                       ("depth.failed", "depth failed"), ("fragment.written", "written")):  # fmt: skip
        assert counts[name] == sum(row["fate"] == fate for row in fragments)
    assert counts["blend.fragments"] == counts["fragment.written"]


def test_records_are_the_triangles_in_order(stages) -> None:
    emitted, records = part(stages, "emitted"), part(stages, "records")
    triangles = part(stages, "triangles")
    assert [row["offset_bytes"] for row in records] == [20 * k for k in range(CASE["capacity"])]
    order = [row[f"emitted_{k}"] for row in triangles for k in range(3)][: CASE["capacity"] // 3 * 3]
    assert len(order) < len(records)
    for record, vertex in zip(records, order, strict=False):
        assert [record[name] for name in "xyzw"] == clip_of(emitted[vertex])
        assert record["heat"] == emitted[vertex]["heat"]
        assert record["invocation"] == emitted[vertex]["invocation"]
    assert all("x" not in row for row in records[len(order) :])


@pytest.mark.parametrize(("capacity", "written"), [(0, 0), (2, 0), (3, 1), (12, 4), (14, 4), (15, 5), (99, 5)])
def test_a_buffer_takes_whole_triangles(capacity: int, written: int) -> None:
    drawn = small_draw.drawn(capacity, threads=1)
    assert (drawn.counters["stream_output.primitives"], drawn.captured.rows) == (written, 3 * written)
    assert drawn.counters["stream_output.overflowed"] == drawn.captured.overflowed == 5 - written
    assert drawn.counters["raster.primitives"] == 5


def test_threads_and_taps_change_no_bit() -> None:
    first, *others = (small_draw.drawn(13, threads, tapped) for threads in (1, 2) for tapped in (True, False))
    for other in others:
        for name in ("floats", "depth", "stencil", "invocations"):
            assert getattr(other.target, name).tobytes() == getattr(first.target, name).tobytes()
        assert other.captured.records().tobytes() == first.captured.records().tobytes()
        assert dict(other.counters) == dict(first.counters)


def test_committed_tables_are_what_the_draw_gives(stages) -> None:
    for stem, table in stages.items():
        assert (FIGURES / f"{stem}.csv").read_text(encoding="utf-8") == csv_text(table)
    assert {path.stem for path in FIGURES.glob("draw-stages*.csv")} == set(stages)


def test_texts_of_the_picture_do_not_overlap(rows) -> None:
    with style.styled():
        figure = draw_stages.EXPERIMENT.plot(rows)
        figure.canvas.draw()
        assert len(figure.axes) == 8
        boxes = []
        for axes in figure.axes:
            titles = [axes.title, axes._left_title, *axes.texts, *axes.get_xticklabels(), *axes.get_yticklabels()]
            legend = axes.get_legend()
            texts = [text for text in titles + (legend.get_texts() if legend else []) if text.get_text()]
            boxes += [(text.get_text(), text.get_window_extent()) for text in texts]
    width, height = figure.canvas.get_width_height()
    assert [name for name, box in boxes if box.x0 < 0 or box.y0 < 0 or box.x1 > width or box.y1 > height] == []
    # Numbers stand on the marks and in the cells that they belong to; words must not meet
    words = [(name, box) for name, box in boxes if len(name) > 4]
    pairs = [(a, b) for k, (a, box) in enumerate(words) for b, other in words[k + 1 :] if box.overlaps(other)]
    assert pairs == []


def test_the_topic_has_an_index_of_its_own(rows, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    experiment = replace(draw_stages.EXPERIMENT, measure=lambda capacity: rows)
    monkeypatch.setitem(topics.TOPICS, "pipeline", (experiment,))
    (tmp_path / "index.md").write_text("the paper's")
    paths = list(reproduce("pipeline", out=tmp_path))
    assert (tmp_path / "index.md").read_text() == "the paper's"
    assert paths[-1].name == "index-pipeline.md"
    assert all(path.name in paths[-1].read_text() for path in paths[:-1])
    assert {path.name for path in paths} == {path.name for path in tmp_path.glob("*.*")} - {"index.md", ".resume"}
    assert (FIGURES / "index-pipeline.md").read_text(encoding="utf-8") == paths[-1].read_text(encoding="utf-8")
    assert set(experiments_of("pipeline")) == {"draw-stages"}
