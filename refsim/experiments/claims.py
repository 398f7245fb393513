"""The paper's textual claims, each judged by a rule in code on the rows of the other experiments.

A verdict is `holds`, `fails`, or `depends` where the rule decides differently for other bodies, prices or policies.
Nothing here is typed in as a result: what was measured stands beside each verdict.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

from refsim.experiments import errata, figure_4, figure_7, published, tile_size
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE

ACCURATE = 10.0  # degrees: what "extremely accurate" is taken to mean, as a median half-angle

# Percent of the pixels: rays that graze an edge may leave by the offset that keeps them from hitting it again
GRAZING = 0.05


def cases(quick: bool) -> list[Case]:
    """None: the rows come from the experiments that are needed."""
    return []


def measure() -> Rows:
    """Nothing is run for this table itself."""
    return []


def claim(section: str, text: str, body: str, rule: str, measured: str, holds: bool | None) -> Row:
    """One line of the table; None is `depends`."""
    verdict = {True: "holds", False: "fails", None: "depends"}[holds]
    return {"section": section, "claim": text, "body": body, "rule": rule, "measured": measured, "verdict": verdict}


def cone_claims(rows: Rows) -> Rows:
    """Section 7.1, on figure 4."""
    found = []
    table = figure_4.summary(rows)
    for scene in dict.fromkeys(row["scene"] for row in table):
        own = {row["iteration"]: row for row in table if row["scene"] == scene}
        means = {k: row["mean_half_angle_deg"] for k, row in own.items()}
        shown = [(k, means[k]) for k in figure_4.SHOWN if means.get(k, "") != ""]
        angles = [angle for _, angle in shown]
        found.append(
            claim(
                "7.1", "the opening angle of the cones increases with consequent refractions", scene,
                "mean half-angle of bounded tiles grows over iterations 1, 2, 4, 8, where there are any",
                "; ".join(f"{k}: {angle:g} deg" for k, angle in shown),
                all(a < b for a, b in pairwise(angles)),
            )
        )  # fmt: skip
        median = [own[k]["median_half_angle_deg"] for k in (1, 2)]
        found.append(
            claim(
                "7.1", "the cones are extremely accurate in the first few steps", scene,
                f"median half-angle of bounded tiles is at most {ACCURATE:g} deg in iterations 1 and 2",
                "; ".join(f"{k}: {angle:g} deg" for k, angle in zip((1, 2), median, strict=True)),
                all(angle <= ACCURATE for angle in median),
            )
        )  # fmt: skip
    return found


def tile_claims(rows: Rows) -> Rows:
    """Section 7.1, on the tile-size table."""
    found = []
    least, most = min(tile_size.PRICES), max(tile_size.PRICES)
    middle = max(tile // 2 for tile in {row["tile_px"] for row in rows} if tile <= 32)
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = {row["tile_px"]: row for row in rows if row["scene"] == scene}
        price = tile_size.break_even(own[middle], own[middle // 2])
        found.append(
            claim(
                "7.1", f"decreasing the tile size further ({middle} to {middle // 2}) loses performance", scene,
                f"the cone tests added cost more than the ray-triangle tests saved, if one costs {least:g} of those; "
                f"depends if it takes {most:g}",
                f"loses where a cone test costs more than {price:.3g} ray-triangle tests",
                True if price < least else None if price < most else False,
            )
        )  # fmt: skip
    return found


def ratio_claims(rows: Rows) -> Rows:
    """Sections 3, 7.1 and 8, on figure 7."""
    table = figure_7.ratios(rows)
    found = []
    least = min(row["triangles"] for row in table)
    for view in figure_7.views(table):
        own = figure_7.of_view(table, view)
        body = figure_7.label(view)
        plain, tested = "ratio_to_ray_engine_without_stencil", "ratio_to_ray_engine_with_stencil"
        best = max(own, key=lambda row: row[plain])
        found.append(
            claim(
                "8", "the hierarchical ray engine can achieve a relative speedup of 15", body,
                f"Ray Engine tests (no stencil) / hierarchical tests reaches {published.SAID_SPEEDUP:g} at up to "
                f"{own[-1]['triangles']} triangles",
                f"{best[plain]:g} at {best['triangles']} triangles; "
                f"with stencil at most {max(row[tested] for row in own):g}",
                best[plain] >= published.SAID_SPEEDUP,
            )
        )  # fmt: skip
        first = own[0]
        found.append(
            claim(
                "7.1", f"already at a triangle count of {least}, the new algorithm runs twice as fast", body,
                f"Ray Engine tests / hierarchical tests is at least {published.SAID_AT_100:g} (no stencil; depends "
                "where it is less with stencil)",
                f"{first[plain]:g}; with stencil {first[tested]:g}",
                _all_or_some([first[plain], first[tested]], published.SAID_AT_100),
            )
        )  # fmt: skip
    return found


def _all_or_some(ratios: list[float], least: float) -> bool | None:
    """Whether all reach `least`; None where some do."""
    reached = [ratio >= least for ratio in ratios]
    return None if any(reached) and not all(reached) else all(reached)


def count_claims(rows: Rows) -> Rows:
    """Sections 3, 5, 7.1 and 8, on the runs of figure 7."""
    found = []
    for view in figure_7.views(rows):
        own = figure_7.of_view(rows, view)
        body = figure_7.label(view)
        ideal = figure_7.select(own, engine=HIERARCHICAL, early_tests="ideal")
        found += [_runs_not_increased(body, own), _two_iterations(body, ideal), _linear(body, ideal)]
        if figure_7.select(own, early_tests="mesa"):
            found.append(_never_invoked(body, own))
    return found


def _runs_not_increased(body: str, own: Rows) -> Row:
    shares = []
    for row in figure_7.select(own, engine=HIERARCHICAL):
        (other,) = figure_7.select(
            own, engine=RAY_ENGINE, stencil="on", early_tests=row["early_tests"], triangles=row["triangles"]
        )
        shares.append(row["fragment_shader_runs"] / other["fragment_shader_runs"])
    return claim(
        "3", "the number of pixel shader runs is by no means increased", body,
        "hierarchical fragment shader runs, cone construction included, are at most the Ray Engine's with stencil "
        "under the same policy, in every run",
        f"{100 * min(shares):.3g} to {100 * max(shares):.3g} percent", max(shares) <= 1.0,
    )  # fmt: skip


def _two_iterations(body: str, ideal: Rows) -> Row:
    gaps = [row["hits_in_generation_0_percent"] - row["hits_in_generation_1_percent"] for row in ideal]
    return claim(
        "7.1", "it takes at least two iterations to discard a path that has entered an object", body,
        f"every ray that enters hits again: hits of generations 0 and 1 differ by {GRAZING:g} percent of the pixels",
        f"at most {max(gaps):.3g} percent of the pixels fewer", max(gaps) <= GRAZING,
    )  # fmt: skip


def _linear(body: str, ideal: Rows) -> Row:
    few, many = ideal[(len(ideal) - 1) // 2], ideal[-1]
    step = math.log(many["triangles"] / few["triangles"])
    slopes = {name: math.log(many[name] / few[name]) / step for name in ("cone_tests", "triangle_tests")}
    return claim(
        "8", "the algorithm is linear in the number of triangles", body,
        f"slope of log(tests) over log(triangles) from {few['triangles']} to {many['triangles']} is within 0.15 of 1",
        "; ".join(f"{name}: {slope:.3f}" for name, slope in slopes.items()),
        all(abs(slope - 1.0) <= 0.15 for slope in slopes.values()),
    )  # fmt: skip


def _never_invoked(body: str, own: Rows) -> Row:
    def early(policy: str) -> int:
        runs = figure_7.select(own, engine=HIERARCHICAL, early_tests=policy)
        return sum(row["stencil_rejected_early_fragments"] for row in runs)

    ideal, mesa = early("ideal"), early("mesa")
    return claim(
        "5", "for pixels where there is no ray to trace, the pixel shader is not invoked at all", body,
        "fragments are rejected by the stencil before the shader; depends where the policy decides",
        f"ideal: {ideal}; mesa (no early test for a shader that writes depth): {mesa}",
        None if ideal and not mesa else bool(ideal),
    )  # fmt: skip


def errata_claims(rows: Rows) -> Rows:
    """Section 4, on the errata table."""
    found = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        for variant in ("corrected", "as_printed"):
            own = [row for row in rows if row["scene"] == scene and row["errata"] == variant]
            bad = sum(row["lost_on_its_own_hits"] + row["wrong_on_its_own_hits"] for row in own)
            found.append(
                claim(
                    "4", f"it is conservative ({errata.ABOUT[variant]})", scene,
                    "no hit of any generation is lost or another one, on the rays of the corrected run",
                    f"{bad} of {sum(row['hits'] for row in own)} hits", bad == 0,
                )
            )  # fmt: skip
    return found


def arithmetic_claims() -> Rows:
    """Sections 7.1 and 8, on the text's own numbers."""
    found = []
    for engine, said in published.SAID_TESTS.items():
        rate = published.TESTS_PER_SECOND[engine]
        found.append(
            claim(
                "7.1", f"{said:.3g} intersections per second, {engine}", "text",
                "pixels * triangles * iterations * frames/s is within 2 percent", f"{rate:.4g} tests/s",
                abs(rate / said - 1.0) <= 0.02,
            )
        )  # fmt: skip
    found.append(
        claim(
            "8", f"a relative speedup of {published.SAID_SPEEDUP:g}", "text",
            "the quotient of the two frame rates rounds to it", f"{published.SPEEDUP:.2f}",
            round(published.SPEEDUP) == published.SAID_SPEEDUP,
        )
    )  # fmt: skip
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """The verdicts."""
    verdicts = [
        *cone_claims(others["figure-4"]),
        *tile_claims(others["tile-size"]),
        *ratio_claims(others["figure-7"]),
        *count_claims(others["figure-7"]),
        *errata_claims(others["errata"]),
        *arithmetic_claims(),
    ]
    return {"claims-hre": verdicts}


EXPERIMENT = Experiment(
    "claims-hre",
    "The paper's claims, and whether they hold here",
    "Each verdict is computed from the tables above by the rule that stands beside it. Speed-ups are ratios of counts: "
    "what they say of time is a matter of a cost model, which is not part of this table.",
    cases,
    measure,
    None,
    tables,
    needs=("figure-4", "tile-size", "figure-7", "errata"),
)
