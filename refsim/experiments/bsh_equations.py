"""Every formula, rule and piece of pseudo-code of the paper on the bounding-sphere hierarchy, and its tables' sums.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, sections 2, 3, 4 and 5. Triangles and
directions are seeded random ones; rays are those of a small picture.
"""

from __future__ import annotations

import numpy as np

from refsim.experiments import bsh_equations_lists as made
from refsim.experiments import bsh_equations_rays as shot
from refsim.experiments import equations
from refsim.experiments.equations import Found, Item, number
from refsim.experiments.registry import Case, Experiment, Rows
from refsim.papers.sphere_hierarchy.culling import kept_triangles
from refsim.papers.sphere_hierarchy.directions import list_directions, list_of_rays

# Triangles, directions, and pixels a side
FULL, QUICK = {"triangles": 300, "directions": 50_000, "size": 24}, {"triangles": 80, "directions": 20_000, "size": 16}
LISTS, TREE, RAYS = "escape indices and payloads", "spheres, parents, owners", "hits, nodes and tests of rays"
S = "section 2.1"


def _reversed(count: int) -> Found:
    """Two lists, one the reverse of the other: families for which that is not so (BSH-E10).

    Printed: both by earliest first, each along its own direction. Corrected: the reverse of a list by earliest first,
    descending x_min, is one along −x by latest last. Of the same sort both ways, lists differ where siblings overlap.
    """
    first = made.lists_of(count, 2, "earliest_first")
    h = first.hierarchy
    parent = np.concatenate([h.parent, h.owner])
    fails = []
    for order in made.ORDERS:
        other = made.lists_of(count, 2, order)
        # Members of each family in the order of their list, as numbers of nodes and triangles
        items = [np.concatenate([lists.node_at[k], lists.triangle_at[k]]) for lists, k in ((first, 0), (other, 1))]
        below = [np.flatnonzero(parent == node) for node in range(len(h))]
        fails.append(sum(
            not np.array_equal(rows[np.argsort(items[0][rows])], rows[np.argsort(items[1][rows])][::-1])
            for rows in below
        ))  # fmt: skip
    return Found(len(h), made.lists_differ(count), *fails)


def _octants(count: int) -> Found:
    """What is said of the opposite sextant, said of octants (the same rule on turned normals), and the safe rule."""
    found: Found = made.culling("octant", "octant", 8)(count)
    d, n = made.directions(count), made.directions(2 * count)[count:]
    out = np.stack([
        ~kept_triangles(-n, np.ones(count, np.bool_), along, "octant") for along in list_directions(8)
    ])  # fmt: skip
    facing = (d.astype(np.float64) * n).sum(axis=1) < 0.0
    return found._replace(printed_fails=number(out[list_of_rays(d, 8), np.arange(count)] & facing))


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
    "two-lists": ("triangles", Item("two lists, one the other reversed", S, "BSH-E10", LISTS,
                                    "each node's children in the reverse order", _reversed)),
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
    "culling-octant": ("directions", Item("culling, octants", S, "BSH-E1", "triangles left out",
                                          "no ray meets the front of what its list leaves out", _octants)),
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
