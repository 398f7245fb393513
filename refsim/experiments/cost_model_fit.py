"""Milliseconds as a sum of counters times prices: fitted without negative prices, judged on what was left out.

time = Σ price · counter, each price at least what the card's peak rates demand. Relative errors are made small (each
row is divided by its printed time), by non-negative least squares on what is above the bounds. A model is judged by
the worst row of a group (a scene) that the fit has not seen. Because the best of several models is chosen by just that
error, the verdict comes from a second loop: the choice is made anew without the group, and then tested on it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Percent. The paper of the geometry shader tells its methods apart by factors of 2 to 3, that of the sphere hierarchy
# its lists by 5 to 15 percent: past a quarter a prediction could not even tell neighbouring rows of a table apart
LIMIT = 25.0
PREDICTS, FITS, NONE = "predicts", "fits but does not predict", "no model"
SINGULAR = "singular"
LARGEST_MODEL = 3
Model = tuple[str, ...]
Array = NDArray[np.float64]


class Observation(NamedTuple):
    """A printed time and what was counted for it; rows of one group are left out together."""

    label: str
    group: str
    printed: float
    counters: Mapping[str, float]


@dataclass(frozen=True)
class Fit:
    """Prices of a model's counters, in milliseconds a unit, and which of them lie on their bounds."""

    model: Model
    prices: Array
    at_bound: tuple[bool, ...]

    def predict(self, rows: Sequence[Observation]) -> Array:
        """Milliseconds of each row."""
        return _matrix(rows, self.model) @ self.prices


def _matrix(rows: Sequence[Observation], model: Model) -> Array:
    return np.array([[row.counters[name] for name in model] for row in rows], dtype=np.float64)


def _printed(rows: Sequence[Observation]) -> Array:
    return np.array([row.printed for row in rows], dtype=np.float64)


def fit(rows: Sequence[Observation], model: Model, least: Callable[[str], float]) -> Fit:
    """The prices, none under `least`, with the smallest sum of squared relative errors."""
    from scipy.optimize import nnls

    printed, bounds = _printed(rows), np.array([least(name) for name in model])
    relative = _matrix(rows, model) / printed[:, None]
    # Columns differ by many orders of magnitude: each is solved for in units of its own length
    lengths = np.linalg.norm(relative, axis=0)
    lengths[lengths == 0.0] = 1.0
    above, _ = nnls(relative / lengths, 1.0 - relative @ bounds)
    return Fit(model, bounds + above / lengths, tuple((above == 0.0).tolist()))


def errors(rows: Sequence[Observation], found: Array) -> Array:
    """Percent of the printed times."""
    printed = _printed(rows)
    return np.asarray(100.0 * (found - printed) / printed)


def condition(rows: Sequence[Observation], model: Model) -> float | str:
    """Condition number of what the fit solves, columns of length 1: how far counters can be told apart; SINGULAR where
    they cannot in doubles, whose last bits are all that such a number would show."""
    relative = _matrix(rows, model) / _printed(rows)[:, None]
    lengths = np.linalg.norm(relative, axis=0)
    found = float(np.linalg.cond(relative / np.where(lengths == 0.0, 1.0, lengths)))
    return round(found, 3) if found * np.finfo(np.float64).eps < 1.0 else SINGULAR


def groups(rows: Sequence[Observation]) -> list[str]:
    """Each group once, in order."""
    return list(dict.fromkeys(row.group for row in rows))


def left_out(rows: Sequence[Observation], model: Model, least: Callable[[str], float]) -> Array:
    """Each row as the fit to all other groups predicts it."""
    found = np.zeros(len(rows))
    for group in groups(rows):
        seen = [row for row in rows if row.group != group]
        unseen = np.array([row.group == group for row in rows])
        found[unseen] = fit(seen, model, least).predict([row for row in rows if row.group == group])
    return found


def models(names: Sequence[str], rows: Sequence[Observation], spare: int = 1) -> list[Model]:
    """Every model of up to three counters that leaves `spare` more rows than prices when its largest group is out."""
    fewest = min(sum(row.group != group for row in rows) for group in groups(rows))
    sizes = range(1, 1 + min(LARGEST_MODEL, fewest - spare))
    return [model for size in sizes for model in itertools.combinations(names, size)]


def root_mean_square(values: Array) -> float:
    """Of percentages."""
    return float(math.sqrt(np.mean(values**2)))


def best(rows: Sequence[Observation], names: Sequence[str], least: Callable[[str], float], spare: int = 1) -> Model:
    """The model with the smallest left-out error; the first of several equals, so the one with fewest prices."""
    def judged(model: Model) -> float:
        return round(root_mean_square(errors(rows, left_out(rows, model, least))), 6)

    return min(models(names, rows, spare), key=judged)


def chosen_anew(rows: Sequence[Observation], names: Sequence[str], least: Callable[[str], float]) -> Array:
    """Each group's rows from a model that was chosen and fitted without them.

    With few rows the inner choice may take models with as many prices as rows: they too are tested on a row unseen.
    """
    found = np.zeros(len(rows))
    for group in groups(rows):
        seen = [row for row in rows if row.group != group]
        unseen = np.array([row.group == group for row in rows])
        model = best(seen, names, least, 0)
        found[unseen] = fit(seen, model, least).predict([row for row in rows if row.group == group])
    return found


def worst(values: Array) -> float:
    """The largest, whatever its sign."""
    return float(np.abs(values).max())


def verdict(fitted: Array, predicted: Array) -> str:
    """From errors in percent: of the chosen model's fit, and of predictions of what the choice had not seen."""
    if worst(predicted) <= LIMIT:
        return PREDICTS
    return FITS if worst(fitted) <= LIMIT else NONE
