"""Construction of the enclosing cone of a bundle of rays: The Hierarchical Ray Engine, section 4, steps 1 and 2.

Device functions on float32, one ray at a time; ``cone.py`` has what follows the last ray (repair) and the sphere test.

A cone is an apex a, a unit axis x and the pair (cos phi, sin phi) of its half-angle. float32 cannot tell cos 2e-4 from
1, so the cosine alone, as printed, loses narrow bundles; the sines come from cross products.

Each printed formula stands here beside its correction, switched by a compile-time constant (``Printed``).
"""

import math
from typing import NamedTuple

import numpy as np

from refsim.geometry.vector import add, add_scaled, cross, divide, dot, length, normalise, scale, sub
from refsim.jit import func

# States of a cone.
EMPTY = np.int32(0)
BOUNDED = np.int32(1)
UNBOUNDED = np.int32(2)

ZERO = np.float32(0)
HALF = np.float32(0.5)
ONE = np.float32(1)
TWO = np.float32(2)

WIDEST_COS = np.float32(2.0**-3)                # HRE-E7: a wider cone is unbounded
NARROWEST_SIN = np.float32(2.0**-10)            # HRE-E5: a cone that must move is opened to this first
NARROWEST_COS = np.float32(1.0 - 2.0**-21)


class Printed(NamedTuple):
    """Which errata of the paper's section 4 stand as printed; the default corrects all. Constants of a compiled draw.

    E1 the apex moves against e by a negative distance; E2 the translation always goes along e, also for an origin in
    the mirrored cone; E3 q of the translation is divided by |x.c| |x - c|; E4 the sphere test takes the arccosine of
    a vector that is not unit and knows no apex inside the sphere; E5 a zero-angle cone is translated as any other; E6
    the mean direction flips past 180 degrees; E7 half-angles past 90 degrees are kept.
    """

    E1: bool = False
    E2: bool = False
    E3: bool = False
    E4: bool = False
    E5: bool = False
    E6: bool = False
    E7: bool = False


class Cone(NamedTuple):
    """apex, axis: three float32 each; cos, sin of the half-angle: float32; state: int32, see above."""

    apex: tuple
    axis: tuple
    cos: np.float32
    sin: np.float32
    state: np.int32


@func
def empty():
    """The cone of no ray."""
    return Cone((ZERO, ZERO, ZERO), (ZERO, ZERO, ONE), ONE, ZERO, EMPTY)


@func
def positive(value):
    """The value, or 0 where it is negative or NaN."""
    return value if value > ZERO else ZERO


@func
def first(p, r):
    """Step 1: the zero-angle cone of the first ray, origin p and unit direction r."""
    return Cone(p, r, ONE, ZERO, BOUNDED)


@func
def unbounded(apex, axis):
    """The cone of all directions: it culls nothing."""
    return Cone(apex, axis, -ONE, ZERO, UNBOUNDED)


@func
def outside(along, across, cos_phi, sin_phi):
    """Whether a vector of components along and across the axis points out of the cone: its angle exceeds phi.

    The sine of the difference decides; where the difference is past 90 degrees (the sine of an opposite vector is 0)
    its cosine does.
    """
    beyond = across * cos_phi - along * sin_phi > ZERO
    behind = (along * cos_phi + across * sin_phi < ZERO) & (along < ZERO)
    return beyond | behind


@func
def mirrored(along, across, cos_phi, sin_phi):
    """Whether minus the vector points into the cone."""
    return (along < ZERO) & (across * cos_phi + along * sin_phi <= ZERO)


@func
def perpendicular(x):
    """A unit vector at right angles to the unit vector x."""
    return normalise((ZERO, x[2], -x[1]) if abs(x[0]) < HALF else (-x[2], ZERO, x[0]))


@func
def extend(cone, r, printed):
    """Step 2(a): widen a bounded cone to take in the direction r (unit)."""
    x = cone.axis
    cos_phi = cone.cos
    sin_phi = cone.sin
    cos_theta = dot(x, r)
    normal = cross(x, r)
    sin_theta = length(normal)
    if not outside(cos_theta, sin_theta, cos_phi, sin_phi):         # "x . r < cos phi"
        return cone

    # q = ((x.r) x - r) / |(x.r) x - r|
    away = sub(scale(x, cos_theta), r)
    size = length(away)
    q = (ZERO, ZERO, ZERO) if size == ZERO else divide(away, size)
    # e = x cos phi + q sin phi
    e = add_scaled(scale(x, cos_phi), q, sin_phi)
    total = add(e, r)

    past_half_turn = sin_phi * cos_theta + cos_phi * sin_theta <= ZERO
    if past_half_turn and not printed.E6:
        # HRE-E6: half-angle (phi + theta) / 2, axis turned towards r by eta = (theta - phi) / 2.
        towards = perpendicular(x) if sin_theta == ZERO else normalise(cross(normal, x))
        cos_difference = cos_theta * cos_phi + sin_theta * sin_phi
        cos_sum = cos_theta * cos_phi - sin_theta * sin_phi
        cos_eta = math.sqrt(positive((ONE + cos_difference) * HALF))
        sin_eta = math.sqrt(positive((ONE - cos_difference) * HALF))
        x_new = add_scaled(scale(x, cos_eta), towards, sin_eta)
        cos_new = -math.sqrt(positive((ONE + cos_sum) * HALF))
        sin_new = math.sqrt(positive((ONE - cos_sum) * HALF))
    else:
        # x_new = (e + r) / |e + r|, cos phi_new = x_new . r
        x_new = normalise(total)
        cos_new = dot(x_new, r)
        sin_new = length(cross(x_new, r))

    # HRE-E7: half a space or more is not convex, and what lies between is of no use to the sphere test (cone.py).
    if cos_new <= WIDEST_COS and not printed.E7:
        return unbounded(cone.apex, x)
    return Cone(cone.apex, x_new, cos_new, sin_new, cone.state)


@func
def translate(cone, p, printed):
    """Step 2(b): move a bounded cone so that it takes in the origin p and all it held."""
    x = cone.axis
    cos_phi = cone.cos
    sin_phi = cone.sin
    c = sub(p, cone.apex)
    z = dot(x, c)
    w = length(cross(x, c))
    if not outside(z, w, cos_phi, sin_phi):
        return cone

    # HRE-E5: no zero-angle cone holds two parallel rays; open it to a small angle, then see whether it has to move.
    if sin_phi < NARROWEST_SIN and cos_phi > ZERO and not printed.E5 and (
        printed.E2 or not mirrored(z, w, cos_phi, sin_phi)
    ):
        cos_phi = NARROWEST_COS
        sin_phi = NARROWEST_SIN
        if not outside(z, w, cos_phi, sin_phi):
            return Cone(cone.apex, x, cos_phi, sin_phi, cone.state)

    # HRE-E2: the old apex is in the cone that p is the apex of.
    if mirrored(z, w, cos_phi, sin_phi) and not printed.E2:
        return Cone(p, x, cos_phi, sin_phi, cone.state)

    # q = ((x.c) x - c) / |(x.c) x - c|;  HRE-E3 as printed: / (|x.c| |x - c|)
    away = sub(scale(x, z), c)
    size = abs(z) * length(sub(x, c)) if printed.E3 else length(away)
    q = (ZERO, ZERO, ZERO) if size == ZERO else divide(away, size)
    # e = x cos phi + q sin phi, n = x cos phi - q sin phi
    e = add_scaled(scale(x, cos_phi), q, sin_phi)
    n = add_scaled(scale(x, cos_phi), q, -sin_phi)
    if printed.E1 or printed.E3 or printed.E5:
        # g = c - (n.c) n, t = g^2 / (e.g)
        g = sub(c, scale(n, dot(n, c)))
        t = dot(g, g) / dot(e, g)
    else:
        # The same with |g| = w cos phi - z sin phi and e.g = -|g| sin 2 phi: the difference of vectors loses its sign
        # far from the apex.
        t = -(w * cos_phi - z * sin_phi) / (TWO * sin_phi * cos_phi)
    # HRE-E1: a_new = a + e t; as printed a_new = a - e t
    a_new = add_scaled(cone.apex, e, -t if printed.E1 else t)
    return Cone(a_new, x, cos_phi, sin_phi, cone.state)


@func
def include(cone, p, r, printed):
    """Steps 1 and 2: the cone that also holds the ray from p along r (unit); the caller skips dead rays."""
    if cone.state == EMPTY:
        return first(p, r)
    if cone.state == UNBOUNDED:
        return cone
    wider = extend(cone, r, printed)
    if wider.state == UNBOUNDED:
        return wider
    return translate(wider, p, printed)
