"""The text's claims, each judged by a rule in code on the rows of the other experiments.

A verdict is `holds`, `fails`, or `depends` where the rule decides differently for other scenes, modes or warp widths.
What is said of milliseconds is judged on the paper's own tables, and where it gives a reason, on what is counted here.
Recursive Ray Tracing in Geometry Shader.
"""

from __future__ import annotations

from collections.abc import Mapping

from refsim.experiments import gsr_errata, gsr_moving_light, gsr_order, gsr_table_2
from refsim.experiments import gsr_published as published
from refsim.experiments.gsr_claims_method import buffer_claims, share_claims, work_claims
from refsim.experiments.gsr_claims_print import all_or_some, print_claims
from refsim.experiments.gsr_claims_stages import passes_claims, quotients, stage_claims
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.verdicts import claim

HIGH, SLIGHT = 2.0, 1.2  # "high variability", "highly dependent": twice the cost, a fifth more: choices of ours


def light_claims(rows: Rows) -> Rows:
    """Section 6, on the moving light: the picture's cost, and that of the shadow rays alone."""
    found = []
    for row in gsr_moving_light.summary(rows):
        for text, rays, ratio in (
            ("moving the light source incurs high variability", "eye and shadow rays together", row["picture_ratio"]),
            ("the cost of shadow rays is highly dependent on the light's position", "shadow rays", row["shadow_ratio"]),
        ):
            found.append(
                claim(
                    "6", text, row["view"],
                    f"{rays} cost at least {HIGH:g} times as much at the dearest place as at the cheapest; depends "
                    f"from {SLIGHT:g}",
                    f"x {ratio:g}", True if ratio >= HIGH else None if ratio >= SLIGHT else False,
                )
            )  # fmt: skip
    return found


def scope_claims(limits: Rows) -> Rows:
    """Section 4.4: what Eq. 1 composes, with the tables printed below it, and with a shadow that adds nothing."""
    found = []
    for targets, body in ((gsr_order.AS_PRINTED, "as printed, before a black clear colour"),
                          ("one target", "with a shadow that adds nothing")):  # fmt: skip
        rows = [
            row
            for row in limits
            if row["targets"] == targets and gsr_order.in_scope(row["passes"], row["lights"], row["secondary_rays"])
        ]
        found.append(
            claim(
                "4.4", "Eq. 1 composes a single point light, shadows and one bounce", body,
                "one target gives the same bits as layers, for one light and up to two passes",
                f"{sum(row['pixels_changed'] for row in rows)} pixels differ in {len(rows)} pictures",
                bool(rows) and all(row["pixels_changed"] == 0 for row in rows),
            )
        )  # fmt: skip
    return found


def order_claims(rows: Rows) -> Rows:
    """Sections 4.3 and 4.4."""
    limits, orders = gsr_order.of_part(rows, "limits"), gsr_order.of_part(rows, "orders")
    beyond = [
        row for row in limits
        if (row["lights"] > 1 and row["passes"] > 1) or (row["passes"] > 2 and row["secondary_rays"] != "none")
    ]  # fmt: skip
    one = [row for row in orders if row["targets"] == "one target" and row["passes"] == 2]
    other = [row for row in one if row["emission_order"] != "listed"]
    return [
        *scope_claims(limits),
        claim(
            "4.4", "more ray generations or lights require different compositing", "knot, cornell box",
            "one target differs from layers in every picture of several lights with shadows, or of more than two "
            "passes with secondary rays; depends where in some",
            f"differs in {sum(row['pixels_visibly_changed'] > 0 for row in beyond)} of {len(beyond)} pictures",
            all_or_some([row["pixels_visibly_changed"] > 0 for row in beyond]),
        ),
        claim(
            "4.3", "the processing order of rays must not be changed", "knot, one target",
            "each permuted emission order changes the picture of two passes, the listed one does not",
            "; ".join(f"{row['emission_order']}: {row['pixels_visibly_changed']} pixels" for row in one),
            all(row["pixels_visibly_changed"] > 0 for row in other)
            and all(row["pixels_changed"] == 0 for row in one if row["emission_order"] == "listed"),
        ),
    ]  # fmt: skip


def errata_claims(rows: Rows) -> Rows:
    """Appendix A and Eq. 1, on the errata."""
    own = {(row["errata"], row["color_format"]): row for row in rows}
    floats = {name: row for (name, form), row in own.items() if form == gsr_errata.FLOAT}
    changing = [name for name, row in floats.items() if name.startswith("GSR") and row["pixels_changed"]]
    found = [
        claim(
            "A", "the listings and Eq. 1 as printed make the picture", gsr_errata.VIEW,
            "the same bits as the corrected run", f"{floats['as_printed']['pixels_changed']} pixels differ; alone: "
            f"{', '.join(name.removeprefix('GSR-') for name in changing)} change pixels",
            floats["as_printed"]["pixels_changed"] == 0,
        )
    ]  # fmt: skip
    for form in (gsr_errata.FLOAT, gsr_errata.BYTES):
        for name, text in (("GSR-E1", "Eq. 1: a shadow fragment of (1, 1, 1) extinguishes"),
                           ("GSR-E1b", "Listing 5: a shadow fragment of -1 extinguishes")):  # fmt: skip
            row = own[name, form]
            found.append(
                claim(
                    "4.4", f"{text}, {form}", gsr_errata.VIEW, "the same bits as with a black one",
                    f"{row['pixels_changed']} pixels differ, by up to {row['largest_difference']:g}",
                    row["pixels_changed"] == 0,
                )
            )  # fmt: skip
    row = floats["GSR-E6"]
    found.append(
        claim(
            "GSR-E6", "a shadow ray need not find its nearest hit", gsr_errata.VIEW,
            "any hit gives the same picture with fewer tests",
            f"{row['triangle_tests']} tests for {row['triangle_tests_corrected']}; "
            f"{row['pixels_changed']} pixels differ",
            row["pixels_changed"] == 0 and row["triangle_tests"] > row["triangle_tests_corrected"],
        )
    )  # fmt: skip
    return found


def cases(quick: bool) -> list[Case]:
    """None: what is judged are the rows of other experiments."""
    return []


def measure() -> Rows:
    """Nothing of its own."""
    return []


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """The verdicts, and all numbers of the paper's text."""
    verdicts: list[Row] = [
        *print_claims(),
        *buffer_claims(others["gsr-figure-4"]),
        *work_claims(others["gsr-figure-1"], others["gsr-figure-4"]),
        *share_claims(others["gsr-table-1"]),
        *gsr_table_2.claims(others["gsr-table-2"]),
        *order_claims(others["gsr-order"]),
        *errata_claims(others["gsr-errata"]),
        *light_claims(others["gsr-moving-light"]),
        *passes_claims(others["gsr-paper-case"]),
        *stage_claims(others["gsr-table-1"], others["gsr-table-2"], others["gsr-table-3"]),
    ]
    return {
        "claims-gsr": verdicts,
        "claims-gsr-quotients": quotients(others["gsr-table-1"], others["gsr-table-2"]),
        "claims-gsr-published": published.published_rows(),
    }


EXPERIMENT = Experiment(
    "claims-gsr",
    "The paper's claims, and whether they hold here",
    "Each verdict is computed by the rule that stands beside it, from the tables above and from the paper's own "
    "numbers. Counts decide nothing about time; where the paper gives a reason for its times, the reason is judged. "
    "The other tables hold numbers of ours beside the paper's, and all numbers of the paper's text with their places.",
    cases,
    measure,
    None,
    tables,
    needs=(
        "gsr-figure-1", "gsr-figure-4", "gsr-table-1", "gsr-table-2", "gsr-table-3", "gsr-order", "gsr-errata",
        "gsr-moving-light", "gsr-paper-case",
    ),
)  # fmt: skip
