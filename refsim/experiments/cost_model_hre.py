"""What the three numbers of section 7.1 determine: 0.23 and 3 frames a second, and twice as fast at 100 triangles.

The Ray Engine's 0.23 fps is one price of a ray–triangle test. With it the hierarchical engine's tests are paid for;
what remains of its 333 ms has to be the cones: a part that every frame pays, and one that grows with the triangles
(cone–sphere tests). Three prices are as many as numbers: then nothing is left to predict, and all that can be said is
whether prices exist that no peak rate of the card forbids. With fewer prices the rest is predicted.

The paper's geometry is not known ("different geometries", "a refractive surface was visible in every pixel"), nor
whether its Ray Engine used the stencil: each body and reading is a row.
"""

from __future__ import annotations

from typing import Any

from refsim.experiments import cost_model_fit as fitting
from refsim.experiments import figure_7, published
from refsim.experiments.cost_model_devices import DEVICES
from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE

MANY, FEW = published.TRIANGLES, 100
RAY_ENGINE_MS, HIERARCHICAL_MS = (1e3 / published.FPS[name] for name in ("ray engine", "hierarchical"))
ROUNDING = 1e-9
SUBJECT = "hre section 7.1"
# Which prices there are besides that of a test
MODELS: dict[str, tuple[str, ...]] = {
    "tests": (),
    "tests + frame": ("frame",),
    "tests + cone tests": ("cone_tests",),
    "tests + cone tests + frame": ("cone_tests", "frame"),
}


def needed(rows: Rows) -> bool:
    """Whether there are runs with the paper's numbers of triangles, at its size."""
    return {MANY, FEW} <= {row["triangles"] for row in rows if row["size_px"] == published.SIDE}


def _one(rows: Rows, **wanted: Any) -> Row:
    (row,) = figure_7.select(rows, **wanted)
    return row


def solve(tests: dict[str, float], cones: dict[int, float], extra: tuple[str, ...]) -> dict[str, float]:
    """Prices in milliseconds that meet as many of the three numbers as there are prices.

    `tests`: ray–triangle tests, "ray engine" and "hierarchical", at 5,000 and (names with "100") at 100 triangles;
    `cones`: cone–sphere tests by triangles.
    """
    price = RAY_ENGINE_MS / tests["ray engine"]
    left = HIERARCHICAL_MS - price * tests["hierarchical"]
    if not extra:
        return {"test": price, "cone_tests": 0.0, "frame": 0.0}
    if extra == ("frame",):
        return {"test": price, "cone_tests": 0.0, "frame": left}
    if extra == ("cone_tests",):
        return {"test": price, "cone_tests": left / cones[MANY], "frame": 0.0}
    left_at_100 = price * (tests["ray engine 100"] / published.SAID_AT_100 - tests["hierarchical 100"])
    cone = (left - left_at_100) / (cones[MANY] - cones[FEW])
    return {"test": price, "cone_tests": cone, "frame": left - cone * cones[MANY]}


def _row(rows: Rows, view: figure_7.View, stencil: str, model: str) -> Row:
    own = figure_7.of_view(rows, view, early_tests="ideal")
    few, many = (figure_7.select(own, triangles=count) for count in (FEW, MANY))
    tests = {
        f"{engine}{mark}": float(_one(part, engine=method, stencil=switch)["triangle_tests"])
        for mark, part in ((" 100", few), ("", many))
        for engine, method, switch in (("ray engine", RAY_ENGINE, stencil), ("hierarchical", HIERARCHICAL, "on"))
    }
    cones = {count: float(_one(part, engine=HIERARCHICAL)["cone_tests"]) for count, part in ((FEW, few), (MANY, many))}
    extra = MODELS[model]
    price = solve(tests, cones, extra)
    milliseconds, ratio = predictions(tests, cones, price)
    free = 1 + len(extra)
    least = DEVICES["hre"].least_ms
    bounds = {"test": least("triangle_tests"), "cone_tests": least("cone_tests") if "cone_tests" in extra else 0.0}
    allowed = all(price[name] >= bounds.get(name, 0.0) * (1.0 - ROUNDING) - ROUNDING for name in price)
    off = {
        "hierarchical": 100.0 * (milliseconds / HIERARCHICAL_MS - 1.0) if free < 2 else 0.0,
        "ratio": 100.0 * (ratio / published.SAID_AT_100 - 1.0) if free < 3 else 0.0,
    }
    return {
        "body": view[0], "fill": view[1], "shading": view[2],
        "surface_in_every_pixel": int(many[0]["hits_in_generation_0_percent"] == 100.0),
        "ray_engine_stencil": stencil,
        "model": model,
        "prices": free,
        "numbers_left_to_predict": 3 - free,
        "ns_a_test": round(1e6 * price["test"], 4),
        "least_ns_a_test": round(1e6 * bounds["test"], 4),
        "ns_a_cone_test": round(1e6 * price["cone_tests"], 4),
        "least_ns_a_cone_test": round(1e6 * bounds["cone_tests"], 4),
        "frame_ms": round(price["frame"], 3),
        "prices_allowed": int(allowed),
        "hierarchical_ms": round(milliseconds, 3) if allowed else "",
        "published_hierarchical_ms": round(HIERARCHICAL_MS, 3),
        "hierarchical_predicted": int(free < 2),
        "times_as_fast_at_100": round(ratio, 4) if allowed else "",
        "published_times_as_fast_at_100": published.SAID_AT_100,
        "times_as_fast_predicted": int(free < 3),
        "worst_prediction_error_percent": round(max(map(abs, off.values())), 2) if free < 3 and allowed else "",
        "verdict": verdict_of(free, allowed, max(map(abs, off.values()))),
    }  # fmt: skip


def predictions(tests: dict[str, float], cones: dict[int, float], price: dict[str, float]) -> tuple[float, float]:
    """The hierarchical engine's milliseconds at 5,000 triangles, and how much faster it is at 100."""
    def hierarchical(mark: str, count: int) -> float:
        return price["test"] * tests[f"hierarchical{mark}"] + price["cone_tests"] * cones[count] + price["frame"]

    at_100 = hierarchical(" 100", FEW)
    return hierarchical("", MANY), price["test"] * tests["ray engine 100"] / at_100 if at_100 > 0.0 else float("inf")


def verdict_of(prices: int, allowed: bool, worst: float) -> str:
    """As many prices as numbers say nothing, and neither do prices that are forbidden."""
    if not allowed or prices == 3:
        return fitting.NONE
    return fitting.PREDICTS if worst <= fitting.LIMIT else fitting.FITS


def hre_rows(rows: Rows) -> Rows:
    """A row a body, reading of the Ray Engine, and model."""
    return [
        _row(rows, view, stencil, model)
        for view in figure_7.views(rows) for stencil in ("off", "on") for model in MODELS
    ]  # fmt: skip


def compared(found: Rows) -> Rows:
    """The frame times as rows of the comparison: the Ray Engine's gives the price, the other is predicted by it."""
    rows: Rows = []
    for row in found:
        if row["model"] != "tests" or not row["surface_in_every_pixel"]:
            continue
        smooth = " smooth" if row["shading"] == "smooth" else ""
        body = f"{row['body']} {row['fill']:g}{smooth} stencil {row['ray_engine_stencil']}"
        head = {"subject": SUBJECT, "device": DEVICES["hre"].name}
        predicted, printed = row["hierarchical_ms"], row["published_hierarchical_ms"]
        rows.append(
            {
                **head, "row": f"{body}, hierarchical at {MANY:,} triangles", "mesh": "a body, not the paper's",
                "model": row["model"], "in_the_fit": 0, "published_ms": printed, "fitted_ms": "",
                "fit_error_percent": "", "predicted_unseen_ms": predicted,
                "prediction_error_percent": round(100.0 * (predicted / printed - 1.0), 2),
            }
        )  # fmt: skip
    return rows
