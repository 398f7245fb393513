"""Plan: the steps are the construction, the vectors are its own, and the counts say what is wrong as printed.

- Steps end in the cones of `cone.build`, to the last bit, in float32 and float64, with dead rays among the live; on a
  tile of a run, in those of the run.
- Figure 2's vectors give the wider cone bit for bit, Figure 3's the apex; the cone after a step holds the origin and
  the old apex, and the printed apex never holds the origin.
- No way shorter than `shortest` does it, on either side of 45 degrees, and one as short does.
- Rows: what is printed as numbers fits together; errata are counted where they are, and nothing else.
- Pictures are drawn from rows, also from the fewest.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.experiments import construction, figure_2, figure_3, style
from refsim.experiments.construction import vector
from refsim.experiments.runs import HIERARCHICAL, run
from refsim.reference import cone
from refsim.reference.cone_steps import extension, gap, steps, translation
from refsim.reference.vector import normalise

TINY = {"scene": "torus_knot_100", "size_px": 24, "tile_px": 8, "fill": 0.55, "generation": 1, "backend": "numpy"}
# float64 of numbers near 1, through a handful of operations; rows keep nine digits
CLOSE, WRITTEN = 1e-12, 1e-7


def bundle(seed: int, spread: float, dtype: type = np.float64) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Six bundles of nine rays, a few of them dead."""
    rng = np.random.default_rng(seed)
    r = normalise(rng.normal(size=(6, 1, 3)) + spread * rng.normal(size=(6, 9, 3)))
    p = rng.normal(size=(6, 9, 3)) * 0.1
    return p.astype(dtype), r.astype(dtype), rng.random((6, 9)) < 0.8


BUNDLES = (st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.01, 0.3, 1.0, 3.0]))


@given(*BUNDLES, st.sampled_from([np.float32, np.float64]))
def test_steps_are_the_construction(seed: int, spread: float, dtype: type) -> None:
    p, r, live = bundle(seed, spread, dtype)
    taken = list(steps(p, r, live))
    last = taken[-1].after
    for before, step in zip([None, *taken], taken, strict=False):
        for part, same in zip(step.before, before.after if before else cone.empty(6, dtype), strict=True):
            np.testing.assert_array_equal(part, same)
    with np.errstate(all="ignore"):
        out = [cone.excess(last, p[:, i], r[:, i]) for i in range(9)]
        worst = [np.where(live.T, [pair[k] for pair in out], 0).max(axis=0).astype(dtype) for k in (0, 1)]
        ours, slack = cone.repair(last, *worst)
    theirs, its_slack = cone.build(p, r, live)
    for part, same in zip((*ours, slack), (*theirs, its_slack), strict=True):
        np.testing.assert_array_equal(part, same)


@given(*BUNDLES)
def test_vectors_give_the_cones_and_hold(seed: int, spread: float) -> None:
    for step in steps(*bundle(seed, spread)):
        way = extension(step.before, step.r)
        half = step.extended & (step.wider.state == cone.BOUNDED) & (step.wider.cos > 0)
        axis, cos, sin = cone.average_direction(way.e, step.r)
        for part, same in ((axis, step.wider.axis), (cos, step.wider.cos), (sin, step.wider.sin)):
            np.testing.assert_array_equal(part[half], same[half])
        one = figure_3.moved(step)
        along, size = one.along, np.linalg.norm(one.way.c, axis=1)
        np.testing.assert_array_equal(one.way.a_new[along], step.after.apex[along])
        np.testing.assert_array_equal(step.after.apex[one.mirrored], step.p[one.mirrored])
        assert (gap(step.after, step.p) <= construction.ROUNDING * size)[along].all()
        assert (gap(step.after, one.cones.apex) <= construction.ROUNDING * size)[along].all()
        assert (gap(one.cones._replace(apex=one.way.a_printed), step.p) > gap(one.cones, step.p) * 1.5)[along].all()
        assert not (one.along & one.mirrored).any() and not (one.along & one.opened).any()


@pytest.mark.parametrize("degrees", [1.0, 20.0, 44.0, 46.0, 60.0, 80.0])
def test_no_shorter_way_will_do(degrees: float) -> None:
    rng = np.random.default_rng(7)
    n, phi = 4000, np.radians(degrees)
    one = np.ones(n)
    cones = cone.Cones(np.zeros((n, 3)), np.tile([0.0, 0.0, 1.0], (n, 1)), np.cos(phi) * one, np.sin(phi) * one,
                       np.full(n, cone.BOUNDED, np.int32))  # fmt: skip
    # An origin beside the cone: neither in it nor in its mirror
    beside = rng.uniform(phi + 0.01, np.pi - phi - 0.01)
    p = np.tile([np.sin(beside), 0.0, np.cos(beside)], (n, 1))
    way = translation(cones, p)
    least = figure_3.shortest(cones, way)
    assert (np.abs(way.t) > least * (1 + 1e-9)).all() == (degrees > 45.0)

    def holds(apex: np.ndarray) -> np.ndarray:
        there = cones._replace(apex=apex)
        return (gap(there, p) <= CLOSE) & (gap(there, cones.apex) <= CLOSE)

    assert holds(way.g if degrees > 45.0 else way.a_new).all()
    # Every direction, most of them about the best
    noise = 0.3 * rng.normal(size=(n // 4, 3))
    near = [way.g[: n // 4] + noise, way.a_new[: n // 4] + noise]
    tried = normalise(np.concatenate([rng.normal(size=(n // 2, 3)), *near]))
    assert not holds(tried * 0.99 * least[:, None]).any()


def test_steps_of_a_tile_are_those_of_the_run() -> None:
    frame = {key: TINY[key] for key in ("scene", "fill", "backend")}
    found = run(HIERARCHICAL, frame["scene"], 24, frame["fill"], generations=3, tile_size=8, backend=frame["backend"])
    passed = found.generations[1]
    here = construction.bundles("torus_knot_100", 24, 8, 0.55, 1, "numpy")
    p, live = here.p.astype(np.float32), here.live
    assert passed.cones is not None
    own = passed.rays.direction[construction.Tiles(24, 24, 8).pixels[here.tile]]
    last = list(steps(p, own, live))[-1].after
    bounded = last.state == cone.BOUNDED
    # Repair leaves the apex as it is
    np.testing.assert_array_equal(last.apex[bounded], passed.cones.apex[here.tile][bounded])
    assert bounded.sum() > 3


@pytest.fixture(scope="module")
def rows() -> dict[str, list[dict]]:
    return {"figure-2": figure_2.measure(**TINY), "figure-3": figure_3.measure(**TINY)}


def test_rows_of_figure_2_fit_together(rows) -> None:
    tables = figure_2.EXPERIMENT.tables_of(rows["figure-2"], {})
    assert len(tables["figure-2"]) >= 3
    for row in tables["figure-2"]:
        x, r, q, e, new = (vector(row, name) for name in ("x", "r", "q", "e", "x_new"))
        assert np.allclose(q, ((x @ r) * x - r) / np.linalg.norm((x @ r) * x - r), atol=1e-5)
        assert np.allclose(e, x * row["cos_phi"] + q * row["sin_phi"], atol=WRITTEN)
        assert np.allclose(new, (e + r) / np.linalg.norm(e + r), atol=WRITTEN)
        assert row["phi_deg"] < row["theta_deg"]
        assert abs(row["phi_new_deg"] - 0.5 * (row["phi_deg"] + row["theta_deg"])) < 1e-5
    (counts,) = tables["figure-2-counts"]
    assert counts["extensions"] >= len(tables["figure-2"])
    assert [counts[name] for name in ("ray_outside", "old_cone_outside", "wider_than_needed")] == [0, 0, 0]


def test_rows_of_figure_3_fit_together_and_count_the_errata(rows) -> None:
    tables = figure_3.EXPERIMENT.tables_of(rows["figure-3"], {})
    assert len(tables["figure-3"]) >= 2
    for row in tables["figure-3"]:
        a, p, c, e, n, g = (vector(row, name) for name in ("a", "p", "c", "e", "n", "g"))
        size = np.linalg.norm(c)
        assert np.allclose(c, p - a, atol=WRITTEN * max(1.0, size))
        assert np.allclose(g, c - (n @ c) * n, atol=WRITTEN * size)
        assert row["t"] < 0
        assert np.allclose(vector(row, "a_new"), a + e * row["t"], atol=WRITTEN * max(1.0, -row["t"]))
        assert np.allclose(vector(row, "a_printed"), a - e * row["t"], atol=WRITTEN * max(1.0, -row["t"]))
        assert (row["printed_outside"], row["corrected_outside"]) == (1, 0)
    (counts,) = tables["figure-3-counts"]
    assert counts["translations"] == counts["printed_outside"] == counts["printed_old_apex_outside"] > 20
    assert counts["corrected_outside"] == counts["corrected_old_apex_outside"] == 0
    assert 0 < counts["printed_q_outside"] <= counts["translations"]
    assert counts["longer_than_needed"] == counts["wider_than_45_deg"]


def test_a_step_that_cannot_be_told_is_no_step() -> None:
    """One ray makes a cone and changes none; parallel rays open it (HRE-E5); a ray straight behind becomes the apex."""
    z = np.array([[[0.0, 0.0, 1.0]] * 3])
    p = np.array([[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, -900.0]]])
    taken = list(steps(p, z, np.ones((1, 3), np.bool_)))
    assert [bool(step.extended[0]) for step in taken] == [False, False, False]
    assert [bool(step.moved[0]) for step in taken] == [False, True, True]
    kinds = [figure_3.moved(step) for step in taken]
    assert [(bool(k.along[0]), bool(k.mirrored[0])) for k in kinds] == [(False, False), (True, False), (False, True)]


def test_pictures_are_drawn_from_the_rows(rows) -> None:
    with style.styled():
        for experiment in (figure_2.EXPERIMENT, figure_3.EXPERIMENT):
            own = rows[experiment.id]
            assert experiment.plot is not None and experiment.alt
            text = [axes.get_title("center") for axes in experiment.plot(own).axes]
            assert len(text) >= 4 and any("before" in line for line in text)
            few = [row for row in own if "step" in row][:1] + own[-1:]
            assert len(experiment.plot(few).axes) == 3


def test_the_strip_keeps_first_and_last() -> None:
    line = [{"worth": worth} for worth in (1, 9, 2, 8, 3)]
    assert [row["worth"] for row in construction.telling(line, lambda row: row["worth"], 4)] == [1, 9, 8, 3]
    assert construction.telling(line[:1], lambda row: row["worth"], 4) == line[:1]
