"""Every equation, listing and formula of Recursive Ray Tracing in Geometry Shader.

What is checked of each: `gsr_equations_checks`, and for colours `gsr_equations_colours`.
"""

from __future__ import annotations

from refsim.experiments import equations
from refsim.experiments import gsr_equations_checks as checks
from refsim.experiments import gsr_equations_colours as colours
from refsim.experiments.equations import Item
from refsim.experiments.registry import Case, Experiment, Rows

FULL, QUICK = 24, 16  # pixels a side
HITS, RAYS, PIXELS = "hits of all rays", "rays emitted", "pixels"
A = "appendix A, "
ITEMS: dict[str, Item] = {
    "s-vb": Item("S_VB", "section 4, Figure 4a", "GSR-E7 (right)", "", "48 MiB; no buffer overflows",
                 checks.buffer_size),
    "listing-1-2": Item("Listings 1 and 2", "section 3", "", "", "64 bytes; unpacked it is what was packed",
                        checks.record_layout),
    "listing-1-type": Item("Listing 1: state and type", "section 3", "", "",
                           "every ray of a tree has a type of its own, from which kind and node follow",
                           checks.types_of_rays),
    "passes": Item("P", "section 4.3", "", RAYS, "as many generations of rays as passes", checks.passes_of),
    "listing-3-eye": Item("Listing 3: eye rays", A + "Listing 3", "GSR-E12", HITS, "they are the camera's",
                          checks.eye_rays),
    "listing-3-search": Item("Listing 3: intersect_grid", A + "Listing 3", "", HITS,
                             "the triangle that a search without grid finds", checks.nearest_hit),
    "listing-3-shadow": Item("Listing 3: shadow rays", A + "Listing 3", "GSR-E6", HITS,
                             "whether the light is reached (as printed right, for more tests)", checks.shadow_search),
    "listing-4-miss": Item("Listing 4: hit.idx == −1", A + "Listing 4", "GSR-E2", RAYS,
                           "a ray that misses shows the background", checks.misses),
    "listing-4-pass": Item("Listing 4: emitPassThrough", A + "Listing 4", "GSR-E3", RAYS,
                           "each ray that hits is shaded, once", checks.passed_through),
    "listing-4-spawn": Item("Listing 4: type != 0", A + "Listing 4", "GSR-E5", RAYS,
                            "each surface hit before the last pass sends its shadow ray", checks.spawned),
    "listing-4-offset": Item("Listing 4: hitP", A + "Listing 4", "GSR-E11", RAYS,
                             "a shadow ray starts on the side that it travels to", checks.offset),
    "listing-5-rho": Item("Listing 5: 0.25", A + "Listing 5", "GSR-E4", RAYS, "a reflection weighs the material's ρ",
                          checks.quarter),
    "listing-5-shadow": Item("Listing 5: (−1, −1, −1, 0)", A + "Listing 5", "GSR-E1b", PIXELS,
                             "a shadow adds no light, and no pixel is below 0", colours.negative_shadows),
    "equation-1": Item("Eq. 1", "section 4.4", "", PIXELS, "source + α of the source · destination",
                       colours.equation_1),
    "equation-1-order": Item("Eq. 1 in a single pass", "section 4.4", "GSR-E8", PIXELS,
                             "within half an 8-bit step of the sum of the rays' light", colours.blending),
    "alpha-eye": Item("α_src, eye rays", "section 4.4", "GSR-E9", PIXELS, "no background through what is hit",
                      colours.opaque),
    "alpha-shadow": Item("α_src, shadow rays", "section 4.4", "GSR-E10", PIXELS, "ambient light stays",
                         colours.ambient_light),
    "rgb-shadow": Item("RGB_src, shadow rays", "section 4.4", "GSR-E1", PIXELS, "a shadow adds no light",
                       colours.white_shadows),
    "rgb-reflected": Item("RGB_src, reflected rays: ρ", "section 4.4", "", RAYS,
                          "a reflection weighs the material's ρ", checks.rho_of_the_material),
    "table-2-rates": Item("Table 2: rays a second", "Table 2", "GSR-E7 (right)", "",
                          "512² rays by the printed time, to all digits", checks.rates),
}  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case an item; `count` is the side of the picture."""
    return equations.cases_of(ITEMS, quick, FULL, QUICK)


def measure(item: str, count: int) -> Rows:
    """One row."""
    return [equations.row_of("gsr", item, ITEMS[item], count)]


EXPERIMENT = Experiment(
    "gsr-equations",
    "Every equation and listing of recursive ray tracing in the geometry shader",
    "24² pixels (16² with `--quick`) of the Cornell box with a mirror and a block of glass, three passes, one light. "
    "`twin_differs`: rays or pixels in which the compiled tracer and the NumPy one differ in a bit. `printed_fails`, "
    "`corrected_fails`: rays or pixels on which the item does not do what it must, that erratum as printed and all "
    "corrected.",
    cases,
    measure,
    None,
    equations.table_of("gsr-equations"),
)
