"""The enclosing cone of a bundle of rays and its sphere test: The Hierarchical Ray Engine, section 4, on float32.

A tile's shader is two short loops over its live rays::

    cone = empty()
    for each live ray: cone = include(cone, p, r, printed)          # section 4, steps 1, 2(a), 2(b)
    if repairs(printed):
        for each live ray: distance, angle = the larger of each so far and excess(cone, p, r)
    cone, slack = repair(cone, distance, angle, printed)

and the vertex shader asks ``meets_sphere(cone, slack, centre, radius, printed)``.

Guarantee of the corrected cone, whatever the number of rays and their order: after ``repair`` every ray, followed to
infinity, stays within ``slack`` of the float32 cone read as exact numbers. With eps = 2^-24, ``excess`` errs by at most
11 eps |p - a| (distance) and 12 eps (sine) in the worst case; 2^-20 = 16 eps of each is added. slack is at most
2^-19 of the farthest origin's |p - a| plus 2^-22 of the apex' largest coordinate (measured; tested).

The sphere test allows 2^-18 (d + r) = 64 eps (d + r) on top, d the distance of the sphere from the apex: 10 eps d for
its own rounding, and eps (11 t + 18 r) for what lies between a float32 hit at parameter t and the triangle
(``triangle.py``, ``sphere.py``). In a cone of half-angle phi, t <= (d + r) / sin 2 phi; this is why a cone wider than
cos phi = 1/8 (82.8 degrees, 1 / sin 2 phi = 4.03) counts as unbounded.
"""

import math

import numpy as np

from refsim.geometry.cone_construction import (
    BOUNDED,
    EMPTY,
    NARROWEST_COS,
    NARROWEST_SIN,
    ONE,
    UNBOUNDED,
    WIDEST_COS,
    ZERO,
    Cone,
    Printed,
    empty,
    extend,
    first,
    include,
    mirrored,
    outside,
    positive,
    translate,
    unbounded,
)
from refsim.geometry.vector import cross, dot, length, normalise, sub
from refsim.jit import func

__all__ = [
    "BOUNDED",
    "EMPTY",
    "NARROWEST_COS",
    "NARROWEST_SIN",
    "UNBOUNDED",
    "WIDEST_COS",
    "Cone",
    "Printed",
    "empty",
    "excess",
    "extend",
    "first",
    "include",
    "meets_sphere",
    "mirrored",
    "outside",
    "repair",
    "repairs",
    "translate",
    "unbounded",
]

INFINITY = np.float32(np.inf)
MEASURE_MARGIN = np.float32(2.0**-20)           # rounding of excess: sine, and distance relative to |p - a|
UNIT_MARGIN = np.float32(1.0 + 2.0**-11)        # rays are unit to 1e-4 only; axis and pair inherit it
TEST_MARGIN = np.float32(2.0**-18)              # rounding of the sphere test and of the hits it stands for
WORST_ANGLE = np.float32(2.0**-8)               # a larger sine outside is no rounding: given up as unbounded


@func
def repairs(printed):
    """Whether the second loop runs: not with a construction formula as printed, whose faults it would mend."""
    return not (printed.E1 or printed.E2 or printed.E3 or printed.E5 or printed.E6 or printed.E7)


@func
def excess(cone, p, r):
    """By how much a ray is outside a bounded cone: ``(distance of p, sine of the angle of r)``, both >= 0.

    Rounded upwards: the distance is in scene units and holds 2^-20 |p - a| for its own rounding. The sine is 1 past
    90 degrees; NaN counts as far outside.
    """
    c = sub(p, cone.apex)
    z = dot(cone.axis, c)
    w = length(cross(cone.axis, c))
    ahead = z * cone.cos + w * cone.sin >= ZERO                     # else the apex is the nearest point of the cone
    gap = w * cone.cos - z * cone.sin if ahead else length(c)
    distance = positive(gap) * UNIT_MARGIN + MEASURE_MARGIN * (abs(z) + w)
    cos_theta = dot(cone.axis, r)
    sin_theta = length(cross(cone.axis, r))
    sine = (sin_theta * cone.cos - cos_theta * cone.sin) * UNIT_MARGIN
    comparable = (cos_theta * cone.cos + sin_theta * cone.sin >= ZERO) & (sine <= ONE)
    return distance if distance < INFINITY else INFINITY, positive(sine) if comparable else ONE


@func
def repair(cone, worst_distance, worst_angle, printed):
    """``(cone, slack)``: the cone widened by the worst ``excess``, and the distance within which it holds its rays.

    slack is -inf for an empty cone (meets nothing), +inf for an unbounded one (meets everything), else >= 0, in scene
    units; it says all that the sphere test needs to know of the state. Axis and pair are normalised: rays may be unit
    to 1e-4 only, and the sphere test measures by them. With a construction formula as printed: the cone as it is,
    slack 0.
    """
    if cone.state == EMPTY:
        return cone, -INFINITY
    if cone.state == UNBOUNDED:
        return cone, INFINITY
    if not repairs(printed):
        return cone, ZERO
    if not ((worst_angle <= WORST_ANGLE) & (worst_distance < INFINITY)):
        return unbounded(cone.apex, cone.axis), INFINITY
    turn = worst_angle + MEASURE_MARGIN
    cos_new = cone.cos - cone.sin * turn
    sin_new = cone.sin + cone.cos * turn
    size = math.sqrt(cos_new * cos_new + sin_new * sin_new)
    return Cone(cone.apex, normalise(cone.axis), cos_new / size, sin_new / size, cone.state), worst_distance


@func
def within(cone, slack, centre, radius):
    """The sphere test as a distance: the centre lies within radius, slack and margin of the cone."""
    c = sub(centre, cone.apex)
    z = dot(cone.axis, c)
    w = length(cross(cone.axis, c))
    reach = radius + slack + TEST_MARGIN * (abs(z) + w + radius)
    ahead = z * cone.cos + w * cone.sin >= ZERO                     # else the apex is the nearest point of the cone
    near_side = w * cone.cos - z * cone.sin <= reach
    near_apex = (reach >= ZERO) & (dot(c, c) <= reach * reach)
    return (ahead & near_side) | ((not ahead) & near_apex)


@func
def within_printed(cone, slack, centre, radius):
    """HRE-E4: phi > arccos[(v - a) . x] - arcsin[r / |v - a|] as printed, without the arc functions.

    With A = (v - a) . x and B = r / |v - a| = sin beta: false where |A| or B exceeds 1 (an undefined arc), else true
    where phi + beta > 180 degrees, else where A > cos(phi + beta).
    """
    c = sub(centre, cone.apex)
    a = dot(cone.axis, c)
    b = radius / length(c)
    cos_beta = math.sqrt(positive(ONE - b * b))
    past_half_turn = cone.sin * cos_beta + cone.cos * b < ZERO
    defined = (abs(a) <= ONE) & (b <= ONE)
    meets = defined & (past_half_turn | (a > cone.cos * cos_beta - cone.sin * b))
    return (slack == INFINITY) | ((slack >= ZERO) & meets)


@func
def meets_sphere(cone, slack, centre, radius, printed):
    """Whether the sphere may be met by a ray of the cone: centre three float32, radius float32, slack from ``repair``.

    Branch-free; reads no state. printed.E4 chooses the form and has to be a constant.
    """
    if printed.E4:
        return within_printed(cone, slack, centre, radius)
    return within(cone, slack, centre, radius)
