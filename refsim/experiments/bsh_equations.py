"""Every formula, rule and piece of pseudo-code of the paper on the bounding-sphere hierarchy, and its tables' sums.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, sections 2, 3, 4 and 5. Triangles and
directions are seeded random ones; rays are those of a small picture.
"""

from __future__ import annotations

from refsim.experiments import bsh_equations_lists as made
from refsim.experiments import bsh_equations_rays as shot
from refsim.experiments import equations
from refsim.experiments.equations import Item
from refsim.experiments.registry import Case, Experiment, Rows

# Triangles, directions, and pixels a side
FULL, QUICK = {"triangles": 300, "directions": 50_000, "size": 24}, {"triangles": 80, "directions": 20_000, "size": 16}
LISTS, TREE, RAYS = "escape indices and payloads", "spheres, parents, owners", "hits, nodes and tests of rays"
S = "section 2.1"
ITEMS: dict[str, tuple[str, Item]] = {
    "list-rules": ("triangles", Item("array in depth-first order, three rules", S, "", LISTS,
                                     "children follow their node, each where the one before ends", made.depth_first)),
    "escape-index": ("triangles", Item("relative escape index; 1, 0, −1", S, "", LISTS,
                                       "to the super-sibling; 1 for leaves alone; 0 and −1 where the list ends",
                                       made.escapes)),
    "element": ("triangles", Item("32 + 128 bits; shared vertices", S, "", LISTS,
                                  "20 bytes an element; indices give back the corners", made.element_bytes)),
    "pseudo-code": ("size", Item("pseudo-code of the traversal", S, "BSH-E5", RAYS,
                                 "brute force's hit for every eye ray", shot.pseudo_code)),
    "two-lists": ("triangles", Item("two lists, one the other reversed", S, "", LISTS,
                                    "each node's children in the reverse order", made.reversed_order)),
    "partition-2": ("directions", Item("two directions", S + ", Figure 2b", "", "list picked",
                                       "the list's direction is the nearest", made.partition(2))),
    "partition-6": ("directions", Item("sextants", S + ", Figure 2c", "", "list picked",
                                       "the list's direction is the nearest", made.partition(6))),
    "partition-8": ("directions", Item("octants", S + ", Figure 2d", "", "list picked",
                                       "the list's direction is the nearest", made.partition(8))),
    "culling-opposite": ("directions", Item("culling, the opposite sextant", S, "BSH-E1", "triangles left out",
                                            "no ray meets the front of what its list leaves out",
                                            made.culling("sextant_opposite", "sextant_safe", 6))),
    "culling-same": ("directions", Item("culling, the same sextant", S, "BSH-E1", "triangles left out",
                                        "no ray meets the front of what its list leaves out",
                                        made.culling("sextant_same", "sextant_safe", 6))),
    "culling-octant": ("directions", Item("culling, octants", S, "", "triangles left out",
                                          "no ray meets the front of what its list leaves out",
                                          made.culling("octant", "octant", 8))),
    "share-sextant": ("directions", Item("16.67 %", S, "BSH-E1", "",
                                         "share of normals that a list may leave out, within 0.05 points",
                                         made.sextant_share)),
    "share-octant": ("directions", Item("12.25 %", S, "BSH-E2", "",
                                        "share of normals that a list may leave out, within 0.05 points",
                                        made.octant_share)),
    "sphere": ("triangles", Item("C and the smallest sphere about it", "section 2.2", "", TREE,
                                 "C is the box's middle; the sphere holds the triangles and is no larger",
                                 made.smallest_spheres)),
    "big": ("triangles", Item("big enough compared to the node", "section 2.2", "BSH-E8 (open)", TREE,
                              "a triangle is the child of the first node that it is big in", made.big_triangles)),
    "octants": ("triangles", Item("sign of G − C", "section 2.2", "", TREE,
                                  "a child's barycentres lie in one octant", made.eight_groups)),
    "heads-simple": ("size", Item("what is behind the polygon", "section 3.1", "", RAYS, "no hit is lost",
                                  shot.simple_heads)),
    "heads-regular": ("size", Item("half-spaces of the sextant's planes", "section 3.1", "", RAYS, "no hit is lost",
                                   shot.regular_heads)),
    "heads-planes": ("size", Item("four additional planes", "section 3.1", "", "",
                                  "four, and no direction of the sextant leaves one", shot.side_planes)),
    "heads-sides": ("size", Item("rays that leave on the other side", "section 3.1", "BSH-E9", RAYS,
                                 "brute force's hit for every ray through glass", shot.polygon_heads)),
    "cells": ("size", Item("separating planes of a cell", "section 3.2", "", RAYS, "no hit is lost",
                           shot.screen_cells)),
    "earliest-first": ("triangles", Item("earliest first: ascending x_min", "section 4", "", LISTS,
                                         "siblings in that order", made.ordering("earliest_first"))),
    "latest-last": ("triangles", Item("latest last: ascending x_max", "section 4", "", LISTS,
                                      "siblings in that order", made.ordering("latest_last"))),
    "culled-rays": ("size", Item("culling at list construction", "section 4", "", RAYS, "no hit is lost",
                                 shot.safe_culling)),
    "nodes-a-ray": ("size", Item("traversed nodes/s by rays/s", "Table 2", "BSH-E3", "",
                                 "no more nodes than the list can have", shot.counter)),
    "heavy": ("size", Item("19.8 %", "section 4", "BSH-E4", "", "follows from Table 1's rates", shot.heavy)),
    "ground": ("size", Item("triangles of the scenes", "Table 2", "BSH-E6 (right)", "",
                            "two more than the mesh: a ground quad", shot.ground_quad)),
    "rays-a-pixel": ("size", Item("rays/s by frames/s", "Tables 1, 2", "BSH-E7 (right)", "",
                                  "between one and two a pixel", shot.eye_and_shadow)),
    "copy-ratio": ("size", Item("ratio of copy and frame", "Table 3", "", "", "to the digit printed",
                                shot.copy_ratio)),
    "frame-time": ("size", Item("frame rendering against fps", "Tables 2, 3", "", "", "within half a percent",
                                shot.frame_time)),
    "layers": ("size", Item("several lists in a row", "section 5", "", RAYS, "no hit is lost", shot.layers)),
    "refit": ("size", Item("vertices updated, structure kept", "section 5", "", "",
                           "spheres hold the moved triangles", shot.refits)),
}  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case an item."""
    counts = QUICK if quick else FULL
    return [{"item": key, "count": counts[unit]} for key, (unit, _) in ITEMS.items()]


def measure(item: str, count: int) -> Rows:
    """One row."""
    return [equations.row_of("bsh", item, ITEMS[item][1], count)]


EXPERIMENT = Experiment(
    "bsh-equations",
    "Every formula and rule of the bounding-sphere hierarchy's paper",
    "300 random triangles (80 with `--quick`), 50,000 directions (20,000), 24² eye rays and their shadow rays (16²). "
    "`twin_differs`: elements, nodes or rays in which the compiled code and its NumPy twin differ in a bit. "
    "`printed_fails`, `corrected_fails`: how many do not have the property, as printed and as corrected.",
    cases,
    measure,
    None,
    equations.table_of("bsh-equations"),
)
