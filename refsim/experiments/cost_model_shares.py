"""The GTX 260: Table 1 prints shares of the executed instructions and no time, so that only a quotient can be fitted.

One price: what a texel fetched costs in operations. A shader's share of all cost is (a + p f) / (A + p F), which is
linear in p once multiplied out. Recursive Ray Tracing in Geometry Shader, section 5.
"""

from __future__ import annotations

import numpy as np

from refsim.experiments import cost_model_fit as fitting
from refsim.experiments import gsr_published
from refsim.experiments.cost_model_devices import DEVICES
from refsim.experiments.registry import Row, Rows

# Percentage points: Table 1's columns are told apart by 5 and more
LIMIT_POINTS = 5.0


def _lines(rows: Rows) -> list[tuple[str, float, float, float, float, float]]:
    """Scene, printed share, a shader's operations and fetches, and all shaders': a line a scene, mode and shader."""
    found = []
    for view in dict.fromkeys(row["view"] for row in rows):
        for mode in gsr_published.MODES:
            own = [row for row in rows if (row["view"], row["mode"]) == (view, mode)]
            work = {
                (name, what): float(sum(row[f"{name}_{what}"] for row in own))
                for name in gsr_published.SHADERS for what in ("arithmetic", "fetches")
            }  # fmt: skip
            totals = [sum(work[name, what] for name in gsr_published.SHADERS) for what in ("arithmetic", "fetches")]
            for name in gsr_published.SHADERS:
                said = gsr_published.share(own[0]["scene"], name, mode)
                if said is not None:
                    found.append((view, said, work[name, "arithmetic"], work[name, "fetches"], totals[0], totals[1]))
    return found


def price_of(lines: list[tuple[str, float, float, float, float, float]]) -> float:
    """Operations that a fetch costs, not negative, by least squares."""
    from scipy.optimize import nnls

    numbers = np.array([line[1:] for line in lines])
    share, arithmetic, fetches, all_arithmetic, all_fetches = numbers.T
    left = (share / 100.0 * all_fetches - fetches) / all_arithmetic
    right = (arithmetic - share / 100.0 * all_arithmetic) / all_arithmetic
    return float(nnls(left[:, None], right)[0][0])


def points_off(lines: list[tuple[str, float, float, float, float, float]], price: float) -> list[float]:
    """Computed less printed share, percentage points."""
    return [100.0 * (a + price * f) / (all_a + price * all_f) - said for _, said, a, f, all_a, all_f in lines]


def share_verdict(rows: Rows) -> Row:
    """A price fitted to all scenes, and to all but one in turn."""
    lines = _lines(rows)
    price = price_of(lines)
    seen = np.array(points_off(lines, price))
    unseen: list[float] = []
    for view in dict.fromkeys(line[0] for line in lines):
        others = [line for line in lines if line[0] != view]
        unseen += points_off([line for line in lines if line[0] == view], price_of(others))
    scale = fitting.LIMIT / LIMIT_POINTS
    return {
        "subject": "gsr Table 1, shares",
        "device": DEVICES["gsr, Table 1"].name,
        "rows": len(lines),
        "scenes": len({line[0] for line in lines}),
        "models_compared": 1,
        "chosen": f"a fetch costs {price:.4g} operations",
        "fit_worst_error_points": round(fitting.worst(seen), 2),
        "left_out_worst_error_points": round(fitting.worst(np.array(unseen)), 2),
        "limit_points": LIMIT_POINTS,
        "verdict": fitting.verdict(scale * seen, scale * np.array(unseen)),
    }
