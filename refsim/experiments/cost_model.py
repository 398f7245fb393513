"""The cost model: from counters to the papers' milliseconds, and where no honest model does it.

Rows of other experiments bring the counters, `cost_model_rows` the printed times beside them; `cost_model_fit` fits
prices, each at least what the card's published peaks demand, and tests them on scenes left out. The Hierarchical Ray
Engine's three numbers are `cost_model_hre`'s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from refsim.experiments import cost_model_fit as fitting
from refsim.experiments import cost_model_hre as ray_engines
from refsim.experiments.cost_model_devices import DEVICES, device_rows
from refsim.experiments.cost_model_fit import Model, Observation
from refsim.experiments.cost_model_plot import plot
from refsim.experiments.cost_model_rows import Subject, subjects
from refsim.experiments.cost_model_shares import share_verdict
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import MISSING

NEEDS = ("figure-7", "gsr-table-1", "gsr-table-2", "gsr-table-3", "bsh-table-2", "bsh-table-3", "bsh-locality")
# Groups without which leaving one out leaves nothing to compare
FEWEST_GROUPS = 3


def cases(quick: bool) -> list[Case]:
    """None: all counters are other experiments'."""
    return []


def measure() -> Rows:
    """Never called."""
    return []


def model_rows(subject: Subject) -> Rows:
    """A row a model: how it fits, and how it predicts scenes that it has not seen."""
    least = DEVICES[subject.device].least_ms
    chosen = fitting.best(subject.rows, subject.names, least)
    found: Rows = []
    for model in fitting.models(subject.names, subject.rows):
        fitted = fitting.fit(subject.rows, model, least)
        seen = fitting.errors(subject.rows, fitted.predict(subject.rows))
        unseen = fitting.errors(subject.rows, fitting.left_out(subject.rows, model, least))
        found.append(
            {
                **_head(subject),
                "model": " + ".join(model),
                "prices": len(model),
                "rows": len(subject.rows),
                "degrees_of_freedom": len(subject.rows) - len(model),
                "condition": fitting.condition(subject.rows, model),
                "prices_at_bound": sum(fitted.at_bound),
                **_both("fit", seen),
                **_both("left_out", unseen),
                "chosen": int(model == chosen),
                "verdict": fitting.verdict(seen, unseen),
            }
        )
    return sorted(found, key=lambda row: row["left_out_root_mean_square_error_percent"])


def _head(subject: Subject) -> Row:
    return {"subject": subject.id, "device": DEVICES[subject.device].name}


def _both(name: str, values: Any) -> Row:
    return {
        f"{name}_root_mean_square_error_percent": round(fitting.root_mean_square(values), 2),
        f"{name}_worst_error_percent": round(fitting.worst(values), 2),
    }


def judged(subject: Subject) -> tuple[Model, Row]:
    """The chosen model, and the verdict: of a choice made anew without each scene."""
    least = DEVICES[subject.device].least_ms
    model = fitting.best(subject.rows, subject.names, least)
    seen = fitting.errors(subject.rows, fitting.fit(subject.rows, model, least).predict(subject.rows))
    unseen = fitting.errors(subject.rows, fitting.left_out(subject.rows, model, least))
    anew = fitting.errors(subject.rows, fitting.chosen_anew(subject.rows, subject.names, least))
    row = {
        **_head(subject),
        "rows": len(subject.rows),
        "scenes": len(fitting.groups(subject.rows)),
        "missing": ", ".join(subject.missing),
        "models_compared": len(fitting.models(subject.names, subject.rows)),
        "chosen": " + ".join(model),
        **_both("fit", seen),
        **_both("left_out", unseen),
        **_both("chosen_anew", anew),
        "limit_percent": fitting.LIMIT,
        "verdict": fitting.verdict(seen, anew),
    }
    return model, row


def compared(subject: Subject, model: Model) -> Rows:
    """A row a printed time: fitted, predicted by the fit to the other scenes, and off by.

    `anew_error_percent` is of a model that was also chosen without the scene; a row that is never fitted had no part in
    the choice, so for it that is the prediction's error.
    """
    least = DEVICES[subject.device].least_ms
    fitted = fitting.fit(subject.rows, model, least)
    seen, unseen = fitted.predict(subject.rows), fitting.left_out(subject.rows, model, least)
    anew = fitting.chosen_anew(subject.rows, subject.names, least)
    rows = [
        _compared(subject, model, row, float(a), float(b), float(c))
        for row, a, b, c in zip(subject.rows, seen, unseen, anew, strict=True)
    ]
    if subject.further:
        rows += [
            _compared(subject, model, row, None, float(b), float(b))
            for row, b in zip(subject.further, fitted.predict(subject.further), strict=True)
        ]
    return rows + [
        {**_head(subject), "row": label, "mesh": MISSING, "model": " + ".join(model)} for label in subject.missing
    ]


def _compared(
    subject: Subject, model: Model, row: Observation, fitted: float | None, unseen: float, anew: float
) -> Row:
    def off(value: float) -> float:
        return round(100.0 * (value / row.printed - 1.0), 2)

    return {
        **_head(subject),
        "row": row.label,
        "mesh": subject.meshes[row.label],
        "model": " + ".join(model),
        "in_the_fit": int(fitted is not None),
        "published_ms": round(row.printed, 3),
        "fitted_ms": "" if fitted is None else round(fitted, 3),
        "fit_error_percent": "" if fitted is None else off(fitted),
        "predicted_unseen_ms": round(unseen, 3),
        "prediction_error_percent": off(unseen),
        "anew_error_percent": off(anew),
    }


def coefficients(subject: Subject, model: Model) -> Rows:
    """A row a price of the chosen model: nanoseconds a unit, beside what the peaks demand."""
    card = DEVICES[subject.device]
    fitted = fitting.fit(subject.rows, model, card.least_ms)
    return [
        {
            **_head(subject),
            "model": " + ".join(model),
            "counter": name,
            "ns_a_unit": _short(1e6 * float(price)),
            "bound_ns_a_unit": _short(1e6 * card.least_ms(name)),
            "times_the_bound": _short(float(price) / card.least_ms(name)) if card.least_ms(name) else "",
            "at_bound": int(held),
        }
        for name, price, held in zip(model, fitted.prices, fitted.at_bound, strict=True)
    ]


def _short(value: float) -> float:
    """Five figures, whatever the size."""
    return float(f"{value:.5g}")


def _absent(subject: Subject) -> Row:
    """Too few scenes to leave one out."""
    line = {"rows": len(subject.rows), "scenes": len(fitting.groups(subject.rows)), "verdict": MISSING}
    return {**_head(subject), **line, "missing": ", ".join(subject.missing)}


def hre_verdict(rows: Rows) -> Row:
    """Bodies with a surface in every pixel: for how many the three numbers agree at all, and the best of fewer prices.

    The choice of a body and of a reading is free, so the best of them is not a prediction.
    """
    head: Row = {"subject": ray_engines.SUBJECT, "device": DEVICES["hre"].name}
    own = [row for row in rows if row["surface_in_every_pixel"]]
    if not own:
        return {**head, "missing": f"runs with {MISSING} triangle counts", "verdict": MISSING}
    exact = [row for row in own if not row["numbers_left_to_predict"]]
    fewer = [row for row in own if row["numbers_left_to_predict"]]
    allowed = sum(row["prices_allowed"] for row in exact)
    verdicts = [row["verdict"] for row in fewer]
    every = all(verdict == fitting.PREDICTS for verdict in verdicts)
    return {
        **head,
        "rows": 3,
        "scenes": len(exact),
        "models_compared": len(ray_engines.MODELS),
        "chosen": f"prices for all three numbers: allowed for {allowed} of {len(exact)} bodies and readings",
        "limit_percent": fitting.LIMIT,
        "verdict": fitting.PREDICTS if every else fitting.NONE,
    }


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Printed against predicted; prices; all models; verdicts; the three numbers of the ray engines; cards."""
    every = subjects(others)
    able: Sequence[Subject] = [s for s in every if len(fitting.groups(s.rows)) >= FEWEST_GROUPS]
    chosen = [(subject, *judged(subject)) for subject in able]
    figure_7_rows = others["figure-7"]
    hre = ray_engines.hre_rows(figure_7_rows) if ray_engines.needed(figure_7_rows) else []
    verdicts = [verdict for _, _, verdict in chosen] + [_absent(s) for s in every if s not in able]
    return {
        "cost-model": [
            *(row for subject, model, _ in chosen for row in compared(subject, model)),
            *ray_engines.compared(hre),
            *({**_head(s), "row": row.label, "mesh": MISSING} for s in every if s not in able for row in s.rows),
        ],
        "cost-model-coefficients": [row for subject, model, _ in chosen for row in coefficients(subject, model)],
        "cost-model-models": [row for subject in able for row in model_rows(subject)],
        "cost-model-verdicts": [*verdicts, share_verdict(others["gsr-table-1"]), hre_verdict(hre)],
        "cost-model-hre": hre or [{"body": MISSING}],
        "cost-model-devices": device_rows(),
    }


EXPERIMENT = Experiment(
    "cost-model",
    "From counters to the papers' milliseconds",
    "Times are sums of counters times prices, no price under what the card's published peak rates demand; of all "
    "models of up to three counters the one that predicts unseen scenes best is drawn. Filled: fitted to all scenes; "
    "open: predicted by the fit to the other scenes; open alone: never fitted (a stand-in's row, or another table's). "
    "Grey: within a quarter of the printed time. Verdicts are of models chosen anew without the scene they predict. "
    "The paper's cameras are not known. For the Hierarchical Ray Engine, a point a body: the price of a test comes "
    "from the Ray Engine's 0.23 frames a second.",
    cases,
    measure,
    plot,
    tables,
    needs=NEEDS,
    drawn="cost-model",
    alt="Logarithmic scatter plots of predicted against printed milliseconds, a panel a graphics card, with a grey "
    "band of a quarter about the diagonal; open markers of unseen scenes lie further from it than filled ones.",
)
