"""Which triangles a list leaves out (section 2.1): those whose normal says that no ray of its partition meets their
front. Triangles are one-sided here: a front hit has d · n < 0.

sextant_opposite  the text, read literally: a normal of the sextant opposite to the list's is culled. Those triangles
                  face the list's rays: what is visible vanishes (BSH-E1)
sextant_same      what must be meant: a normal of the list's own sextant. True in two dimensions, not in three:
                  d = (1, .9, .9) and n = (1, −.9, −.9) share a sextant and d · n < 0 (BSH-E1)
sextant_safe      n_a ≥ |n_b| + |n_c|, a the list's axis: then d · n ≥ d_a (n_a − |n_b| − |n_c|) ≥ 0 for every d of the
                  sextant; arcsin(1/3)/π = 10.8 % of all normals instead of the 16.67 % printed
octant            s_a n_a ≥ 0 for every component, s the list's signs: d · n ≥ 0; 12.5 %, where the text prints
                  12.25 % (BSH-E2)

The normal is the float32 one that the intersection test reads. It decides with d · n in float32, which may differ in
sign from the exact product by rounding: three products and two sums are off by 3 eps |d| at most, eps = 2⁻²⁴. So the
safe rules ask for a surplus of 8 eps, which makes d · n at least 8 eps |d| in an octant, 4.6 eps |d| in a sextant.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError

RULES = ("sextant_opposite", "sextant_same", "sextant_safe", "octant")
SAFE = ("sextant_safe", "octant")
EPS = 2.0**-24
SURPLUS = 8.0 * EPS


def check_culling(culling: str | None, lists: int, facing: str) -> None:
    """Raises `InputError` for no such rule, one of another number of lists, or where both sides can be hit."""
    if culling is None:
        return
    if culling not in RULES:
        raise InputError(f"culling is {culling!r}; it must be None or one of {', '.join(map(repr, RULES))}.")
    needed = 8 if culling == "octant" else 6
    if lists != needed:
        raise InputError(f"culling={culling!r} needs lists={needed}, not lists={lists}.")
    if facing != "front":
        raise InputError(f"culling={culling!r} needs facing='front': the back of a triangle may be hit by any ray.")


def kept_triangles(
    normals: NDArray[np.float32], usable: NDArray[np.bool_], direction: NDArray[np.float64], culling: str | None
) -> NDArray[np.bool_]:
    """Which triangles the list along `direction` keeps, bool[n].

    `normals` f32[n, 3], unit; `usable` bool[n]: false for zero area, whose triangles are hit from nowhere.
    """
    if culling is None:
        return np.ones(len(normals), np.bool_)
    n = normals.astype(np.float64)
    if culling == "octant":
        return ~(usable & (n * direction >= SURPLUS).all(axis=1))
    axis = int(np.abs(direction).argmax())
    along = n[:, axis] * direction[axis]
    others = np.abs(np.delete(n, axis, axis=1))
    if culling == "sextant_opposite":
        along = -along
    if culling == "sextant_safe":
        return ~(usable & (along >= others.sum(axis=1) + SURPLUS))
    return ~(usable & (along >= others.max(axis=1)))
