"""Every formula of The Hierarchical Ray Engine: sections 4 and 5. That of 7.1 is arithmetic: `published`.

What is checked of each: `hre_equations_checks` (the cone), `hre_equations_spheres` (all else).
"""

from __future__ import annotations

from refsim.experiments import equations
from refsim.experiments import hre_equations_checks as checks
from refsim.experiments import hre_equations_spheres as spheres
from refsim.experiments.equations import Item
from refsim.experiments.registry import Case, Experiment, Rows

FULL, QUICK = 20_000, 2_000
CONE = "cone after the step"
ITEMS: dict[str, Item] = {
    "extend-condition": Item("x · r < cos φ", "section 4, step 2(a)", "", CONE,
                             "in float64 true exactly where the direction is out of the cone", checks.condition),
    "extend-condition-float32": Item("x · r < cos φ", "section 4, step 2(a)", "", CONE,
                                     "in float32 true exactly where the direction is out of the cone",
                                     checks.condition_in_float32),
    "extend-q": Item("q", "section 4, step 2(a)", "", CONE, "unit, at right angles to the axis, away from the ray",
                     checks.away),
    "extend-e": Item("e", "section 4, step 2(a)", "", CONE, "the generator opposite to the ray", checks.generator),
    "extend-axis": Item("x_new", "section 4, step 2(a)", "HRE-E6", CONE,
                        "the new cone holds the old solid angle and the new direction", checks.new_axis),
    "extend-angle": Item("cos φ_new", "section 4, step 2(a)", "HRE-E6", CONE,
                         "half of the sum of the old half-angle and the ray's angle", checks.new_angle),
    "translate-q": Item("q", "section 4, step 2(b)", "HRE-E3", CONE, "unit, as in step 2(a)", checks.away_from_origin),
    "translate-e-n": Item("e and n", "section 4, step 2(b)", "", CONE,
                          "farthest and nearest generator, in the plane of axis and origin", checks.near_and_far),
    "translate-g": Item("g", "section 4, step 2(b)", "", CONE,
                        "at right angles to the nearest generator, as long as the gap", checks.distance_vector),
    "translate-sign": Item("t and a_new", "section 4, step 2(b)", "HRE-E1", CONE, "no ray leaves the cone",
                           checks.moved("E1")),
    "translate-mirrored": Item("t and a_new, origin in the mirrored cone", "section 4, step 2(b)", "HRE-E2", CONE,
                               "no ray leaves the cone", checks.moved("E2")),
    "translate-narrow": Item("t and a_new, φ = 0", "section 4, step 2(b)", "HRE-E5", CONE, "no ray leaves the cone",
                             checks.moved("E5")),
    "wide": Item("φ of 90 degrees and more", "section 4, step 2", "HRE-E7", CONE, "no ray leaves the cone",
                 checks.too_wide),
    "construction": Item("steps 1 and 2", "section 4", "HRE-E1, E2, E3, E5, E6, E7", CONE, "no ray leaves the cone",
                         checks.as_a_whole),
    "sphere-test": Item("φ > arccos[(v − a) · x] − arcsin[r / |v − a|]", "section 4", "HRE-E4", "decision",
                        "true exactly where cone and sphere meet, wrong either way", spheres.sphere_test),
    "enclosing-spheres": Item("enclosing spheres of primitives", "section 4", "", "centre and radius",
                              "the sphere holds the three vertices", spheres.enclosing),
    "vertex-data": Item("vertex data of a triangle primitive", "section 4", "", "position (centre, radius)",
                        "position, plane, vertices, normals and texture coordinates can be read back",
                        spheres.vertex_data),
    "stencil-bits": Item("a stencil bit an iteration", "section 5", "", "rays and hits of a run",
                         "no shader run without a ray, and some without the stencil", spheres.stencil_bits),
}  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case an item."""
    return equations.cases_of(ITEMS, quick, FULL, QUICK)


def measure(item: str, count: int) -> Rows:
    """One row."""
    return [equations.row_of("hre", item, ITEMS[item], count)]


EXPERIMENT = Experiment(
    "hre-equations",
    "Every formula of the Hierarchical Ray Engine",
    "Seeded random cones, rays, bundles and spheres (20,000; 2,000 with `--quick`; bundles of four rays). "
    "`twin_differs`: inputs on which the compiled code and its NumPy twin differ in a bit, corrected and as printed "
    "together. `printed_fails`, `corrected_fails`: inputs on which the item does not do what it must.",
    cases,
    measure,
    None,
    equations.table_of("hre-equations"),
)
