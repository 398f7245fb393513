"""The paper's textual claims, each judged by a rule in code on the rows of the other experiments.

A verdict is `holds`, `fails`, or `depends` where the rule decides differently for other bodies, prices or policies, or
where what was measured is between two limits that the paper's words leave open. Nothing here is typed in as a result:
what was measured stands beside each verdict.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

from refsim.experiments import dead_rays, errata, figure_4, figure_7, prototype, published, tile_size
from refsim.experiments.hre_claims_structure import growth_claims, later_claims, structure_claims, tightest_claims
from refsim.experiments.registry import Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE
from refsim.experiments.verdicts import claim

Limits = tuple[float, float]  # up to the first a claim holds, above the second it fails

# Degrees: the shares of all directions that such cones hold are 0.2 and 3 percent
ACCURATE: Limits = (5.0, 20.0)

# Off a slope of 1: at the first, twice the triangles cost twice the tests within 7 percent; past the second, growth is
# nearer to none, or to a square, than to linear
LINEAR: Limits = (0.1, 0.5)

# Percent of the pixels. A ray that grazes an edge may leave by the offset that keeps it from hitting there again: the
# outline of a body that fills 256² pixels is about 4 / 256 of them, and the offset a tenth of a pixel
GRAZING: Limits = (0.16, 1.6)


def within(value: float, limits: Limits) -> bool | None:
    """Whether a value is small enough; None between the limits."""
    return True if value <= limits[0] else None if value <= limits[1] else False


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
        first = {k: own[k]["median_half_angle_deg"] for k in (1, 2) if own[k]["median_half_angle_deg"] != ""}
        found.append(
            claim(
                "7.1", "the cones are extremely accurate in the first few steps", scene,
                f"median half-angle of bounded tiles in iterations 1 and 2 is at most {ACCURATE[0]:g} deg (0.2 percent "
                f"of all directions); depends up to {ACCURATE[1]:g} deg (3 percent)",
                "; ".join(f"{k}: {angle:g} deg" for k, angle in first.items()),
                within(max(first.values()), ACCURATE),
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
    """Sections 3, 7.1 and 8, on the runs of figure 7."""
    found = []
    for view in figure_7.views(rows):
        own = figure_7.of_view(rows, view)
        body = figure_7.label(view)
        ideal = figure_7.select(own, engine=HIERARCHICAL, early_tests="ideal")
        found += [_runs_not_increased(body, own), _two_iterations(body, ideal), *_linear(body, ideal)]
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
        f"every ray that enters hits again: generation 1 has fewer hits than generation 0 by at most {GRAZING[0]:g} "
        f"percent of the pixels (rays within the offset of an outline); depends up to {GRAZING[1]:g} (pixels on one)",
        f"at most {max(gaps):.3g} percent of the pixels fewer", within(max(gaps), GRAZING),
    )  # fmt: skip


def _linear(body: str, ideal: Rows) -> Rows:
    few, many = ideal[(len(ideal) - 1) // 2], ideal[-1]
    slope = math.log(many["triangle_tests"] / few["triangle_tests"]) / math.log(many["triangles"] / few["triangles"])
    rates = [row["cone_tests"] / row["triangles"] for row in ideal]
    return [
        claim(
            "8", "the algorithm is linear in the number of triangles: ray-triangle tests", body,
            f"slope of log(ray-triangle tests) over log(triangles) from {few['triangles']} to {many['triangles']} is "
            f"within {LINEAR[0]:g} of 1 (twice the triangles cost twice the tests within 7 percent); depends within "
            f"{LINEAR[1]:g} (beyond, growth is nearer to none or to a square)",
            f"{slope:.3f}", within(abs(slope - 1.0), LINEAR),
        ),
        claim(
            "8", "the algorithm is linear in the number of triangles: cone-sphere tests", body,
            "as many a triangle in every run", f"{min(rates):g} to {max(rates):g} a triangle", min(rates) == max(rates),
        ),
    ]  # fmt: skip


def dead_ray_claims(rows: Rows) -> Rows:
    """Section 5, on runs of its own."""
    found = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = {row["early_tests"]: row for row in rows if row["scene"] == scene}
        runs = {policy: row["shader_runs_without_ray"] for policy, row in own.items()}
        row = own["ideal"]
        found.append(
            claim(
                "5", "for pixels where there is no ray to trace, the pixel shader is not invoked at all", scene,
                f"no shader run on a pixel without a ray in generations 1 to {row['last_generation']} "
                f"({row['size_px']} * {row['size_px']} pixels); depends where it is so under the policy ideal alone",
                "; ".join(f"{policy}: {number} of {own[policy]['shader_runs']} runs" for policy, number in runs.items())
                + f"; {row['pixels_without_ray']} such pixels",
                False if runs["ideal"] else not any(runs.values()) or None,
            )
        )  # fmt: skip
    return found


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
                f"pixels * triangles * iterations * frames/s, with the digits said ({published.SAID_DIGITS[engine]})",
                f"{rate:.4g} tests/s", published.to_said_digits(engine) == said,
            )
        )  # fmt: skip
    least, most = published.speedup_allowed()
    found.append(
        claim(
            "8", f"a relative speedup of {published.SAID_SPEEDUP:g}", "text",
            "it is a quotient of rates that round to the two frame rates",
            f"{least:.2f} to {most:.2f}; {published.SPEEDUP:.2f} as printed",
            least <= published.SAID_SPEEDUP <= most,
        )
    )  # fmt: skip
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """The verdicts; `rows` are those of `dead_rays`, the others come from the experiments that are needed."""
    verdicts = [
        *cone_claims(others["figure-4"]),
        *tile_claims(others["tile-size"]),
        *ratio_claims(others["figure-7"]),
        *count_claims(others["figure-7"]),
        *structure_claims(others["figure-7"]),
        *growth_claims(others["figure-7"]),
        *later_claims(others["figure-4"]),
        *tightest_claims(others["tightest-cone"]),
        *dead_ray_claims(rows),
        *errata_claims(others["errata"]),
        *arithmetic_claims(),
        *prototype.claims(figure_7.ratios(others["figure-7"]), figure_4.summary(others["figure-4"])),
    ]
    return {"claims-hre": verdicts}


EXPERIMENT = Experiment(
    "claims-hre",
    "The paper's claims, and whether they hold here",
    "Each verdict is computed by the rule that stands beside it, from the tables above and, for section 5, from small "
    "runs of its own (128², tiles of 8 × 8). Lines of section `prototype` judge what a throw-away prototype counted "
    "before this code was written, not the paper. Speed-ups are ratios of counts: "
    "what they say of time is a matter of a cost model, which is not part of this table.",
    dead_rays.cases,
    dead_rays.measure,
    None,
    tables,
    needs=("figure-4", "tile-size", "figure-7", "errata", "tightest-cone"),
)
