"""Plan: prices that make counters into milliseconds, and verdicts that a lucky fit cannot buy.

- Properties: rows made with known prices give these prices back; no price is under its bound, whatever the times; what
  is predicted of a scene does not depend on that scene's own times, with the choice of the model in the loop or not.
- Times that have nothing to do with the counters: no model, for every seed.
- With as many prices as numbers the ray engines' numbers are met exactly; with fewer, as many as there are prices.
- Tables: verdicts at their limit; bounds are peaks; rows without a mesh are listed and not fitted.
- On the committed rows: every subject has a verdict, copies are predicted, the vertex shader's fetches are a texel a
  cell and five a test, as the bounds say.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.experiments import cost_model, gsr_published, published, style
from refsim.experiments import cost_model_fit as fitting
from refsim.experiments import cost_model_hre as ray_engines
from refsim.experiments.cost_model_devices import DEVICES, NEEDS, device_rows
from refsim.experiments.cost_model_fit import Observation
from refsim.experiments.files import read_csv
from refsim.experiments.registry import Rows

FIGURES = Path(__file__).parents[2] / "figures"
NAMES = ("a", "b", "c")
FILES = {
    "figure-7": ("figure-7",), "gsr-table-1": ("gsr-table-1-runs",), "gsr-table-2": ("gsr-table-2",),
    "gsr-table-3": ("gsr-table-3",), "bsh-table-2": ("bsh-table-2", "bsh-table-2-readings"),
    "bsh-table-3": ("bsh-table-3",), "bsh-locality": ("bsh-locality",),
}  # fmt: skip
prices = st.tuples(*[st.floats(0.1, 10.0)] * 3)


@pytest.fixture(scope="module")
def others() -> dict[str, Rows]:
    return {name: [row for stem in stems for row in read_csv(FIGURES / f"{stem}.csv")] for name, stems in FILES.items()}


@pytest.fixture(scope="module")
def tables(others):
    return cost_model.tables([], others)


def observations(times: list[float], seed: int = 3) -> list[Observation]:
    """Rows of three counters, two rows a group, with these times."""
    rng = np.random.default_rng(seed)
    return [
        Observation(f"row {k}", f"group {k // 2}", time, dict(zip(NAMES, rng.uniform(1, 100, 3), strict=True)))
        for k, time in enumerate(times)
    ]


def priced(price, rows):
    """The rows with the times that the prices make."""
    made = [sum(p * row.counters[name] for p, name in zip(price, NAMES, strict=True)) for row in rows]
    return [row._replace(printed=time) for row, time in zip(rows, made, strict=True)]


def free(_name: str) -> float:
    return 0.0


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(prices, st.integers(0, 1000))
def test_known_prices_come_back(price, seed):
    rows = priced(price, observations([1.0] * 12, seed))
    found = fitting.fit(rows, NAMES, free)
    # Relative to the largest price: the columns' condition is under 20 here, and doubles leave 1e-16 of it
    assert np.abs(found.prices - price).max() < 1e-9 * max(price)
    assert fitting.worst(fitting.errors(rows, fitting.left_out(rows, NAMES, free))) < 1e-6
    assert fitting.best(rows, NAMES, free) == NAMES


def test_counters_that_follow_from_each_other_have_no_condition():
    rows = observations([1.0] * 12, 1)
    assert 1.0 < fitting.condition(rows, NAMES) < 20.0
    twice = [row._replace(counters={**row.counters, NAMES[1]: 2.0 * row.counters[NAMES[0]]}) for row in rows]
    assert fitting.condition(twice, NAMES) == fitting.SINGULAR


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(st.lists(st.floats(1e-3, 1e3), min_size=8, max_size=8), st.floats(0.0, 5.0))
def test_no_price_is_under_its_bound(times, bound):
    found = fitting.fit(observations(times), NAMES, lambda name: bound if name == "b" else 0.0)
    assert (found.prices >= [0.0, bound, 0.0]).all()
    assert all(price == least for price, least, held in
               zip(found.prices, (0.0, bound, 0.0), found.at_bound, strict=True) if held)  # fmt: skip


@settings(max_examples=10, deadline=None, derandomize=True, database=None)
@given(st.lists(st.floats(1.0, 100.0), min_size=8, max_size=8), st.integers(0, 3), st.floats(1.0, 1e4))
def test_a_prediction_has_not_seen_what_it_predicts(times, group, other):
    rows = observations(times)
    changed = [row._replace(printed=other) if row.group == f"group {group}" else row for row in rows]
    own = np.array([row.group == f"group {group}" for row in rows])
    for predict in (lambda r: fitting.left_out(r, NAMES[:2], free), lambda r: fitting.chosen_anew(r, NAMES, free)):
        assert np.array_equal(predict(rows)[own], predict(changed)[own])


@pytest.mark.parametrize("seed", range(8))
def test_of_noise_there_is_no_model(seed):
    rng = np.random.default_rng(seed)
    rows = observations([float(time) for time in 10.0 ** rng.uniform(0.0, 2.0, 12)], seed)
    chosen = fitting.fit(rows, fitting.best(rows, NAMES, free), free)
    anew = fitting.errors(rows, fitting.chosen_anew(rows, NAMES, free))
    assert fitting.verdict(fitting.errors(rows, chosen.predict(rows)), anew) == fitting.NONE


@pytest.mark.parametrize(
    ("fitted", "unseen", "verdict"),
    [
        (1.0, 25.0, fitting.PREDICTS), (1.0, -25.0, fitting.PREDICTS), (1.0, 25.01, fitting.FITS),
        (25.0, -90.0, fitting.FITS), (25.01, 26.0, fitting.NONE),
    ],
)  # fmt: skip
def test_verdicts_change_at_the_limit(fitted, unseen, verdict):
    assert fitting.verdict(np.array([0.0, fitted]), np.array([unseen, 0.0])) == verdict


def test_models_leave_more_rows_than_prices():
    assert max(map(len, fitting.models(NAMES, observations([1.0] * 6)))) == 3
    assert max(map(len, fitting.models(NAMES, observations([1.0] * 4)))) == 1
    assert fitting.models(NAMES, observations([1.0] * 4), spare=0)[-1] == ("b", "c")


counts = st.floats(1e6, 1e9)


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(st.tuples(counts, counts, counts, counts), st.floats(1e5, 1e7))
def test_prices_meet_as_many_numbers_as_there_are_prices(tests, cones):
    names = ("ray engine", "hierarchical", "ray engine 100", "hierarchical 100")
    counted, spheres = dict(zip(names, tests, strict=True)), {5000: cones, 100: cones / 50}
    for extra in ray_engines.MODELS.values():
        price = ray_engines.solve(counted, spheres, extra)
        milliseconds, ratio = ray_engines.predictions(counted, spheres, price)
        assert price["test"] * counted["ray engine"] == pytest.approx(1e3 / published.FPS["ray engine"])
        # Sums of numbers up to a million times larger than the result
        if len(extra) >= 1:
            assert milliseconds == pytest.approx(1e3 / published.FPS["hierarchical"], rel=1e-6)
        if len(extra) == 2:
            assert ratio == pytest.approx(published.SAID_AT_100, rel=1e-6)


def test_bounds_are_peaks():
    gsr, bsh, hre = DEVICES["gsr"], DEVICES["bsh"], DEVICES["hre"]
    assert gsr.least_ms("cells") == pytest.approx(1e3 / 10.8e9) == gsr.least_ms("triangle_tests") / 5
    assert bsh.least_ms("copied_bytes") == pytest.approx(1e3 / 8e9)
    assert hre.least_ms("cone_tests") == pytest.approx(1e3 / 525e6)
    assert gsr.least_ms("frames") == 0.0
    assert all(need[0] in DEVICES[paper].peaks for paper, needs in NEEDS.items() for need in needs.values())
    assert {row["device"] for row in device_rows()} == {"NV6800GT", "GeForce 8600", "GTX 260", "GTX 280"}


def test_fetches_are_a_texel_a_cell_and_five_a_test(others):
    for row in others["gsr-table-2"]:
        if row["vertex_fetches"]:
            assert row["vertex_fetches"] == row["cells"] + 5 * row["triangle_tests"]


def test_tables_follow_from_the_committed_rows(tables):
    verdicts = {row["subject"]: row["verdict"] for row in tables["cost-model-verdicts"]}
    assert verdicts == {
        "gsr Table 3, our method": fitting.NONE,
        "gsr Table 3, previous": fitting.NONE,
        "bsh Table 2, a frame": fitting.NONE,
        "bsh Table 3, a copy": fitting.PREDICTS,
        "gsr Table 1, shares": fitting.NONE,
        "hre section 7.1": fitting.NONE,
    }
    fitted = [row for row in tables["cost-model"] if row.get("in_the_fit")]
    assert not any("stand-in" in row["mesh"] for row in fitted)
    chosen = {row["subject"]: row for row in tables["cost-model-models"] if row["chosen"]}
    for name, line in chosen.items():
        off = [abs(row["prediction_error_percent"]) for row in fitted if row["subject"] == name]
        assert max(off) == line["left_out_worst_error_percent"]
        anew = [abs(row["anew_error_percent"]) for row in fitted if row["subject"] == name]
        (judged,) = [row for row in tables["cost-model-verdicts"] if row["subject"] == name]
        assert max(anew) == judged["chosen_anew_worst_error_percent"] >= 0.0
        assert len(off) == line["rows"] == line["degrees_of_freedom"] + line["prices"]
    assert all(row["ns_a_unit"] >= row["bound_ns_a_unit"] for row in tables["cost-model-coefficients"])


def test_what_the_ray_engines_numbers_determine(tables):
    rows = [row for row in tables["cost-model-hre"] if row["surface_in_every_pixel"]]
    exact = [row for row in rows if row["prices_allowed"] and not row["numbers_left_to_predict"]]
    # Every body that fills the picture and both shadings, but one: there the stencil leaves cone tests no price
    assert {(row["body"], row["shading"], row["ray_engine_stencil"]) for row in rows} - {
        (row["body"], row["shading"], row["ray_engine_stencil"]) for row in exact
    } == {("blob", "geometric", "on")}
    assert len(exact) == 7
    assert all(row["verdict"] == fitting.NONE for row in exact)
    assert not any(row["verdict"] == fitting.PREDICTS for row in rows)


def test_missing_meshes_are_listed_and_not_fitted(others):
    made = {"Cornell Box", "Cornell Knot"}
    absent = {
        **others,
        "gsr-table-3": [
            row if row["published_scene"] in made else {**row, "triangles": "missing"} for row in others["gsr-table-3"]
        ],
        "bsh-table-2": [row for row in others["bsh-table-2"] if row["published_scene"] == "Cubes"],
        "bsh-table-3": [],
        "figure-7": [row for row in others["figure-7"] if row["triangles"] < 5000],
    }
    tables = cost_model.tables([], absent)
    verdicts = {row["subject"]: row["verdict"] for row in tables["cost-model-verdicts"]}
    assert set(verdicts.values()) == {"missing", fitting.NONE}
    assert verdicts["hre section 7.1"] == "missing" and verdicts["gsr Table 1, shares"] == fitting.NONE
    (first,) = [row for row in tables["cost-model-verdicts"] if row["subject"] == "gsr Table 3, our method"]
    assert all(f"Dragon, {mode}" in first["missing"] for mode in gsr_published.MODES)
    assert not tables["cost-model-models"] and all(row["mesh"] == "missing" for row in tables["cost-model"])
    assert cost_model.plot(tables["cost-model"]).axes


def test_a_panel_a_subject(tables):
    with style.styled():
        figure = cost_model.plot(tables["cost-model"])
    subjects = {row["subject"] for row in tables["cost-model"]}
    # One more says what the marks mean
    assert sum(axes.get_visible() for axes in figure.axes) == len(subjects) + 1
