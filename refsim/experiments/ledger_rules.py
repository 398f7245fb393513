"""The rules of the ledger: each makes a verdict of a claim and of what was measured.

    reproduced        what is said holds in all that was measured
    trend reproduced  not the number, or not everywhere, but its direction
    corrected         not as printed; with the erratum put right
    contradicted      neither
    cannot be reproduced: hardware | mesh missing | not enough said

Better agreement never makes a worse verdict: a trend that holds everywhere is a trend whatever is left open. Where
the paper leaves open what decides, and it decides, the verdict is `not enough said`. What is measured at no size of the
run is `not measured`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from refsim.experiments.ledger_file import Claim

REPRODUCED, TREND, CORRECTED, CONTRADICTED = "reproduced", "trend reproduced", "corrected", "contradicted"
HARDWARE, MISSING_MESH, UNSAID = (
    f"cannot be reproduced: {why}" for why in ("hardware", "mesh missing", "not enough said")
)
NOT_MEASURED = "not measured"
VERDICTS = (REPRODUCED, TREND, CORRECTED, CONTRADICTED, HARDWARE, MISSING_MESH, UNSAID)

# Units of what only the paper's machine can show
OF_MACHINES = ("ms", "s", "frames/s", "tests/s", "million rays/s", "thousand million nodes/s")
Values = Sequence[Any]


@dataclass(frozen=True)
class Finding:
    """A verdict, what was measured in a line, and why it is this verdict."""

    verdict: str
    measured: str
    why: str


@dataclass(frozen=True)
class Rule:
    """`sentence` says it with the claim's numbers; `judge(claim, values)` finds; `reads` if it needs a table."""

    sentence: str
    judge: Callable[[Claim, Values], Finding]
    reads: bool = True


def _spread(values: Values) -> str:
    low, high = min(values), max(values)
    span = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return span if len(values) == 1 else f"{span} ({len(values)} values)"


def _shares(claim: Claim, good: Sequence[bool], measured: str, trend: bool = False) -> Finding:
    """The verdict where a thing holds in some of what was measured."""
    held = f"holds in {sum(good)} of {len(good)}"
    if all(good):
        return Finding(REPRODUCED, measured, held)
    if trend:
        return Finding(TREND, measured, f"{held}; the direction is that of the paper")
    if any(good) and claim.open:
        return Finding(UNSAID, measured, f"{held}; the paper does not say {', '.join(claim.open)}")
    return Finding(TREND if any(good) else CONTRADICTED, measured, held)


def _on_side(claim: Claim, values: Values) -> bool:
    """Whether all values lie on the printed one's side of `trend`."""
    if claim.trend is None:
        return False
    printed = np.atleast_1d(claim.printed)[0]
    return all((value > claim.trend) == (printed > claim.trend) for value in values)


def _number(holds: Callable[[Claim, float], bool]) -> Callable[[Claim, Values], Finding]:
    def judge(claim: Claim, values: Values) -> Finding:
        good = [holds(claim, value) for value in values]
        if claim.corrected is not None and not any(good):
            right = replace(claim, printed=claim.corrected)
            if all(holds(right, value) for value in values):
                return Finding(CORRECTED, _spread(values), f"it is {claim.corrected:g}")
        return _shares(claim, good, _spread(values), _on_side(claim, values))

    return judge


def _slack(claim: Claim) -> float:
    return claim.tolerance * abs(claim.printed)


def _between(claim: Claim, value: float) -> bool:
    low, high = claim.printed
    return low * (1 - claim.tolerance) <= value <= high * (1 + claim.tolerance)


def _verdicts(claim: Claim, values: Values) -> Finding:
    """`depends` counts as neither: it holds in some."""
    counts = [f"{values.count(word)} {word}" for word in ("holds", "depends", "fails") if values.count(word)]
    good = [value == "holds" for value in values]
    some = any(value == "depends" for value in values)
    measured = ", ".join(counts)
    if some and claim.open:
        return Finding(UNSAID, measured, f"it depends, and the paper does not say {', '.join(claim.open)}")
    if values.count("depends") == len(values):
        return Finding(TREND, measured, "it holds in part of what was measured")
    return _shares(claim, good, measured)


def _any_verdict(claim: Claim, values: Values) -> Finding:
    """One line that holds is enough."""
    lines = [value for value in values if value != "fails"]
    measured = f"{values.count('holds')} of {len(values)} lines hold, {values.count('depends')} depend"
    if "holds" in values:
        return Finding(REPRODUCED, measured, "there is one")
    if lines and claim.open:
        return Finding(UNSAID, measured, f"some would, and the paper does not say {', '.join(claim.open)}")
    return Finding(TREND if lines else CONTRADICTED, measured, "there is none")


def _left_open(claim: Claim, values: Values) -> Finding:
    """What the paper leaves open matters where a line says that it does not and fails."""
    good = [value in ("holds", "yes") for value in values]
    measured = f"it does not matter in {sum(good)} of {len(good)}"
    if all(good):
        return Finding(REPRODUCED, measured, "what is left open does not matter")
    return Finding(UNSAID, measured, f"it matters, and the paper does not say {', '.join(claim.open)}")


def _grows(claim: Claim, values: Values) -> Finding:
    steps = [b > a for a, b in pairwise(values)]
    if not steps:
        return Finding(NOT_MEASURED, _spread(values), "one value shows no growth")
    return _shares(claim, steps, " → ".join(f"{value:.4g}" for value in values))


def _follows(claim: Claim, values: Values) -> Finding:
    """Pairs (ours, printed): proportional, or at least in the same order."""
    if len(values) < 3:
        return Finding(MISSING_MESH, f"{len(values)} pairs", "fewer than three pairs show no course")
    ours, printed = np.array(values, np.float64).T
    ratio = ours / printed
    off = ratio / np.exp(np.mean(np.log(ratio)))
    measured = f"× {off.min():.3g} to × {off.max():.3g} of proportional ({len(values)} pairs)"
    if max(off.max(), 1 / off.min()) <= 1 + claim.tolerance:
        return Finding(REPRODUCED, measured, "proportional to what is printed")
    same = _in_order(values)
    share = f"{sum(same)} of {len(same)} pairs are in the printed order"
    return Finding(TREND if np.mean(same) >= 0.9 else CONTRADICTED, measured, share)


def _in_order(pairs: Values) -> list[bool]:
    """Whether ours and the printed one go the same way, for every two pairs that are printed apart."""
    return [(a[0] - b[0]) * (a[1] - b[1]) > 0 for a, b in combinations(pairs, 2) if a[1] != b[1]]


def _matches(claim: Claim, values: Values) -> Finding:
    """Pairs (ours, printed), each equal within the tolerance; the trend, if all go the same way."""
    good = [abs(ours - printed) <= claim.tolerance * abs(printed) for ours, printed in values]
    order = _in_order(values)
    measured = f"× {_spread([ours / printed for ours, printed in values])}"
    return _shares(claim, good, measured, bool(order) and all(order))


def _points(claim: Claim, values: Values) -> Finding:
    """Pairs (ours, printed) of percentages, each within `tolerance` percentage points."""
    off = [abs(ours - printed) for ours, printed in values]
    order = _in_order(values)
    measured = f"off by {_spread(off)} percentage points"
    return _shares(claim, [gap <= claim.tolerance for gap in off], measured, bool(order) and all(order))


def _consistent(claim: Claim, values: Values) -> Finding:
    """Pairs (ours, printed) where ours was chosen to agree: agreement says that a choice exists, no more."""
    good = [abs(ours - printed) <= claim.tolerance * abs(printed) for ours, printed in values]
    measured = f"× {_spread([ours / printed for ours, printed in values])}"
    if all(good):
        return Finding(UNSAID, measured, f"a choice of {' and '.join(claim.open)} gives it; the paper's is not said")
    return Finding(CONTRADICTED, measured, f"no choice of {' and '.join(claim.open)} that was tried gives it")


def _put_right(claim: Claim, values: Values) -> Finding:
    """Pairs (text, verdict): those whose text has the word of `printed` are runs as printed, the others corrected."""
    printed = [verdict == "holds" for text, verdict in values if claim.printed in text]
    corrected = [verdict == "holds" for text, verdict in values if claim.printed not in text]
    measured = f"printed holds in {sum(printed)} of {len(printed)}, corrected in {sum(corrected)} of {len(corrected)}"
    if all(printed):
        return Finding(REPRODUCED, measured, "it holds as printed")
    return Finding(CORRECTED if all(corrected) else CONTRADICTED, measured, f"with {claim.erratum or 'corrections'}")


def _errata(claim: Claim, values: Values) -> Finding:
    """Triples: inputs on which kernel and twin differ, on which the printed form fails, and the corrected one; a blank
    where there is no twin or no such form."""
    differ, printed, corrected = (sum(value or 0 for value in column) for column in zip(*values, strict=True))
    mended = all(value[2] not in ("", None) for value in values)
    measured = f"printed fails {printed:g} times, " + (f"corrected {corrected:g}" if mended else "nothing corrects it")
    if differ:
        return Finding(CONTRADICTED, measured, f"kernel and reference differ {differ:g} times")
    if printed == 0 and corrected == 0:
        return Finding(REPRODUCED, measured, "it has the property that it must have")
    if corrected == 0 and mended:
        return Finding(CORRECTED, measured, f"it takes {claim.erratum or 'a correction'}")
    return Finding(CONTRADICTED, measured, "the corrected form fails too" if mended else "it does not hold as printed")


def _predicts(claim: Claim, values: Values) -> Finding:
    """Errors of a cost model, in percent, on rows left out of its fit."""
    sizes = [abs(value) for value in values]
    measured = f"off by {min(sizes):.3g} to {max(sizes):.3g} percent"
    if all(abs(value) <= claim.tolerance for value in values):
        return Finding(REPRODUCED, measured, "counters, priced on the other rows, predict it")
    return Finding(HARDWARE, measured, "no prices of our counters predict it")


def _hardware(claim: Claim, values: Values) -> Finding:
    if claim.unit not in OF_MACHINES:
        return Finding(UNSAID, "nothing", f"{claim.unit or 'it'} is no unit of a machine's time")
    return Finding(HARDWARE, "nothing", f"{claim.unit} are those of the paper's machine")


def _unsaid(claim: Claim, values: Values) -> Finding:
    return Finding(UNSAID, "nothing", f"the paper does not say {', '.join(claim.open)}")


def _all_made(claim: Claim, values: Values) -> Finding:
    """Rows that are there; a text is as good as a number."""
    if claim.open:
        return Finding(UNSAID, f"{len(values)} rows", f"the paper does not say {', '.join(claim.open)}")
    return Finding(REPRODUCED, f"{len(values)} rows", "all that is shown is made")


RULES: dict[str, Rule] = {
    "equals": Rule("equal within the tolerance", _number(lambda c, v: abs(v - c.printed) <= _slack(c))),
    "at least": Rule("at least as printed", _number(lambda c, v: v >= c.printed - _slack(c))),
    "at most": Rule("at most as printed", _number(lambda c, v: v <= c.printed + _slack(c))),
    "between": Rule("between the printed limits", _number(_between)),
    "rounds to": Rule(
        "rounds to what is printed",
        _number(lambda c, v: abs(v - c.printed) <= 0.5 * 10.0 ** -len(f"{c.printed!r}".partition(".")[2].rstrip("0"))),
    ),
    "verdicts": Rule("every line of the table of verdicts holds", _verdicts),
    "any verdict": Rule("a line of the table of verdicts holds", _any_verdict),
    "left open": Rule("what the paper leaves open does not matter", _left_open),
    "grows": Rule("grows from row to row", _grows),
    "follows": Rule("proportional to the printed numbers; the trend, if nine of ten pairs are in order", _follows),
    "matches": Rule("each equal to the number printed for it, within the tolerance", _matches),
    "points": Rule("each within so many percentage points of the number printed for it", _points),
    "chosen": Rule("a choice of what the paper leaves open gives the printed numbers", _consistent),
    "put right": Rule("every run as printed holds, or else every corrected one", _put_right),
    "errata": Rule("kernel, reference and property agree", _errata),
    "predicts": Rule("prices fitted on the other rows predict it", _predicts),
    "made": Rule("all of it is made", _all_made),
    "hardware": Rule("only the paper's machine shows it", _hardware, reads=False),
    "unsaid": Rule("the paper leaves open what would have to be run", _unsaid, reads=False),
}
