"""The enclosing cone of a bundle of rays, in NumPy: The Hierarchical Ray Engine, section 4, many bundles at a time.

Arrays: ``[b]`` bundles, vectors ``[b, 3]``, rays ``[b, n, 3]``; float32 gives the bits of the device functions,
float64 the bound they are held against. The margins are multiples of the dtype's own unit roundoff, so in float64 the
construction is exact for every practical purpose.
"""

from typing import NamedTuple

import numpy as np

from refsim.reference.vector import cross, dot, length, normalise

EMPTY, BOUNDED, UNBOUNDED = 0, 1, 2            # states
WIDEST_COS = 2.0**-3                # HRE-E7: a wider cone is unbounded
NARROWEST_SIN = 2.0**-10            # HRE-E5: a cone that must move is opened to this first
NARROWEST_COS = 1.0 - 2.0**-21
WORST_ANGLE = 2.0**-8               # a larger sine outside is no rounding: unbounded
MEASURE_ROUNDINGS = 16              # margins in units of roundoff, 2^-24 in float32
UNIT_MARGIN = 1.0 + 2.0**-11        # rays are unit to 1e-4 only
TEST_ROUNDINGS = 64


class Errata(NamedTuple):
    """Which errata stand as printed; E1 to E7 are the option's HRE-E1 to HRE-E7. Default: all corrected."""

    E1: bool = False
    E2: bool = False
    E3: bool = False
    E4: bool = False
    E5: bool = False
    E6: bool = False
    E7: bool = False


CORRECTED = Errata()


class Cones(NamedTuple):
    """b cones: apex, axis ``[b, 3]``; cos, sin of the half-angle ``[b]``; state int32 ``[b]``, see above."""

    apex: np.ndarray
    axis: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    state: np.ndarray


def unit_roundoff(dtype: type[np.floating]) -> float:
    """Half a unit in the last place of 1: 2^-24 or 2^-53."""
    return float(np.finfo(dtype).eps) / 2


def empty(b: int, dtype: type) -> Cones:
    """b cones of no ray."""
    axis: np.ndarray = np.zeros((b, 3), dtype)
    axis[:, 2] = 1
    return Cones(np.zeros((b, 3), dtype), axis, np.ones(b, dtype), np.zeros(b, dtype), np.zeros(b, np.int32))


def choose(mask: np.ndarray, a: Cones, b: Cones) -> Cones:
    """a where the mask holds, else b."""
    row = mask[:, None]
    return Cones(
        np.where(row, a.apex, b.apex),
        np.where(row, a.axis, b.axis),
        np.where(mask, a.cos, b.cos),
        np.where(mask, a.sin, b.sin),
        np.where(mask, a.state, b.state),
    )


def unbounded(cones: Cones) -> Cones:
    """The same cones, grown to all directions."""
    return cones._replace(
        cos=np.full_like(cones.cos, -1), sin=np.zeros_like(cones.sin), state=np.full_like(cones.state, UNBOUNDED)
    )


def half_angle(cones: Cones) -> np.ndarray:
    """Radians, float64 as in `vector.angle`; 180 degrees of an unbounded cone."""
    return np.asarray(np.where(cones.state == UNBOUNDED, np.pi, np.arctan2(cones.sin, cones.cos, dtype=np.float64)))


def outside(z: np.ndarray, w: np.ndarray, cos: np.ndarray, sin: np.ndarray) -> np.ndarray:
    """Angle atan2(w, z) > phi, by sin(angle - phi), or by its cosine past 90 degrees."""
    return (w * cos - z * sin > 0) | ((z * cos + w * sin < 0) & (z < 0))


def mirrored(z: np.ndarray, w: np.ndarray, cos: np.ndarray, sin: np.ndarray) -> np.ndarray:
    """The opposite vector lies in the cone: 180 degrees - angle <= phi."""
    return (z < 0) & (w * cos + z * sin <= 0)


def direction_away(x: np.ndarray, v: np.ndarray, along: np.ndarray) -> np.ndarray:
    """q = ((x.v) x - v) / |(x.v) x - v|, zero where it is undefined."""
    d = x * along[:, None] - v
    size = length(d)
    return np.where((size == 0)[:, None], 0, d / size[:, None]).astype(x.dtype)


def perpendicular(x: np.ndarray) -> np.ndarray:
    """Some unit vector at right angles to x."""
    zero = np.zeros_like(x[:, 0])
    first = np.stack([zero, x[:, 2], -x[:, 1]], axis=1)
    second = np.stack([-x[:, 2], zero, x[:, 0]], axis=1)
    return normalise(np.where((np.abs(x[:, 0]) < 0.5)[:, None], first, second))


def average_direction(e: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x_new = (e + r)/|e + r|, cos phi_new = x_new . r, and sin phi_new = |x_new x r|."""
    x_new = normalise(e + r)
    return x_new, dot(x_new, r), length(cross(x_new, r))


def turned_direction(
    x: np.ndarray, u: np.ndarray, cos: np.ndarray, sin: np.ndarray, cos_theta: np.ndarray, sin_theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """HRE-E6: x turned towards u by (theta - phi)/2; cosine and sine of the new half-angle (phi + theta)/2 >= 90
    degrees."""
    half = x.dtype.type(0.5)
    difference = cos_theta * cos + sin_theta * sin
    total = cos_theta * cos - sin_theta * sin

    def root(value: np.ndarray) -> np.ndarray:
        return np.sqrt(np.where(value * half > 0, value * half, x.dtype.type(0)))

    x_new = x * root(1 + difference)[:, None] + u * root(1 - difference)[:, None]
    return x_new, -root(1 + total), root(1 - total)


def extend(cones: Cones, r: np.ndarray, printed: Errata = CORRECTED) -> Cones:
    """Step 2(a): widen bounded cones by the directions r ``[b, 3]``."""
    x, cos, sin = cones.axis, cones.cos, cones.sin
    cos_theta, sin_theta = dot(x, r), length(cross(x, r))
    needed = outside(cos_theta, sin_theta, cos, sin)

    q = direction_away(x, r, cos_theta)
    e = x * cos[:, None] + q * sin[:, None]
    x_new, cos_new, sin_new = average_direction(e, r)
    if not printed.E6:
        # (x x r) x x is -q, at right angles to x even where r is nearly opposite.
        u = cross(cross(x, r), x)
        u = np.where((sin_theta == 0)[:, None], perpendicular(x), normalise(u))
        turned = turned_direction(x, u, cos, sin, cos_theta, sin_theta)
        past = sin * cos_theta + cos * sin_theta <= 0
        x_new = np.where(past[:, None], turned[0], x_new)
        cos_new = np.where(past, turned[1], cos_new)
        sin_new = np.where(past, turned[2], sin_new)
    wider = cones._replace(axis=x_new, cos=cos_new, sin=sin_new)
    if not printed.E7:
        wider = choose(cos_new <= WIDEST_COS, unbounded(cones), wider)
    return choose(needed, wider, cones)


def translation(
    x: np.ndarray, c: np.ndarray, cos: np.ndarray, sin: np.ndarray, z: np.ndarray, w: np.ndarray, printed: Errata
) -> np.ndarray:
    """Step 2(b): the vector a_new - a = e t (HRE-E1: - e t as printed)."""
    if printed.E3:
        size = np.abs(z) * length(x - c)
        q = np.where((size == 0)[:, None], 0, (x * z[:, None] - c) / size[:, None]).astype(x.dtype)
    else:
        q = direction_away(x, c, z)
    e = x * cos[:, None] + q * sin[:, None]
    n = x * cos[:, None] + q * -sin[:, None]
    if printed.E1 or printed.E3 or printed.E5:
        g = c - n * dot(n, c)[:, None]
        t = dot(g, g) / dot(e, g)
    else:
        t = -(w * cos - z * sin) / (2 * sin * cos)
    return e * (-t if printed.E1 else t)[:, None]


def translate(cones: Cones, p: np.ndarray, printed: Errata = CORRECTED) -> Cones:
    """Step 2(b): move bounded cones so that they take in the origins p ``[b, 3]``."""
    x, cos, sin = cones.axis, cones.cos, cones.sin
    c = p - cones.apex
    z, w = dot(x, c), length(cross(x, c))
    needed = outside(z, w, cos, sin)

    if not printed.E5:
        opens = needed & (sin < NARROWEST_SIN) & (cos > 0)
        if not printed.E2:
            opens &= ~mirrored(z, w, cos, sin)
        cos = np.where(opens, x.dtype.type(NARROWEST_COS), cos)
        sin = np.where(opens, x.dtype.type(NARROWEST_SIN), sin)
        needed &= ~opens | outside(z, w, cos, sin)
    apex = cones.apex + translation(x, c, cos, sin, z, w, printed)
    if not printed.E2:
        apex = np.where(mirrored(z, w, cos, sin)[:, None], p, apex)
    return Cones(np.where(needed[:, None], apex, cones.apex), x, cos, sin, cones.state)


def include(cones: Cones, p: np.ndarray, r: np.ndarray, live: np.ndarray, printed: Errata = CORRECTED) -> Cones:
    """Steps 1 and 2 for one ray of every bundle, ``[b, 3]``; bundles whose ray is dead stay as they are."""
    wider = extend(cones, r, printed)
    moved = choose(wider.state == BOUNDED, translate(wider, p, printed), wider)
    alone = Cones(p, r, np.ones_like(cones.cos), np.zeros_like(cones.sin), np.full_like(cones.state, BOUNDED))
    after = choose(cones.state == BOUNDED, moved, choose(cones.state == EMPTY, alone, cones))
    return choose(live, after, cones)


def repairs(printed: Errata) -> bool:
    """Whether the second pass runs: only with every construction formula corrected."""
    return not any(getattr(printed, name) for name in ("E1", "E2", "E3", "E5", "E6", "E7"))


def excess(cones: Cones, p: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``(distance of p, sine of the angle of r)`` outside the cones; distance rounded up by 16 roundoffs of |p - a|;
    past 90 degrees sine 1."""
    real = cones.apex.dtype.type
    c = p - cones.apex
    z, w = dot(cones.axis, c), length(cross(cones.axis, c))
    gap = np.where(z * cones.cos + w * cones.sin >= 0, w * cones.cos - z * cones.sin, length(c))
    margin = real(MEASURE_ROUNDINGS * unit_roundoff(real))
    distance = np.where(gap > 0, gap, real(0)) * real(UNIT_MARGIN) + margin * (np.abs(z) + w)
    cos_theta, sin_theta = dot(cones.axis, r), length(cross(cones.axis, r))
    sine = (sin_theta * cones.cos - cos_theta * cones.sin) * real(UNIT_MARGIN)
    comparable = (cos_theta * cones.cos + sin_theta * cones.sin >= 0) & (sine <= 1)
    sine = np.where(comparable, np.where(sine > 0, sine, real(0)), real(1))
    return np.where(distance < np.inf, distance, real(np.inf)), sine


def repair(
    cones: Cones, distance: np.ndarray, sine: np.ndarray, printed: Errata = CORRECTED
) -> tuple[Cones, np.ndarray]:
    """``(cones, slack [b])``: widened by the worst sine; slack = worst distance, -inf for empty and +inf for
    unbounded cones."""
    real = cones.apex.dtype.type
    ends = np.where(cones.state == EMPTY, real(-np.inf), real(np.inf))
    if not repairs(printed):
        return cones, np.where(cones.state == BOUNDED, real(0), ends)
    bounded = cones.state == BOUNDED
    given_up = bounded & ~((sine <= WORST_ANGLE) & (distance < np.inf))
    turn = sine + real(MEASURE_ROUNDINGS * unit_roundoff(real))
    cos, sin = cones.cos - cones.sin * turn, cones.sin + cones.cos * turn
    size = np.sqrt(cos * cos + sin * sin)
    wider = choose(bounded, cones._replace(axis=normalise(cones.axis), cos=cos / size, sin=sin / size), cones)
    return choose(given_up, unbounded(cones), wider), np.where(bounded & ~given_up, distance, ends)


def build(p: np.ndarray, r: np.ndarray, live: np.ndarray, printed: Errata = CORRECTED) -> tuple[Cones, np.ndarray]:
    """``(cones, slack [b])`` of bundles of rays: origins p and unit directions r ``[b, n, 3]``, live ``[b, n]`` bool.

    Pass 1 includes the rays in order; pass 2, unless a construction formula is as printed, measures what rounding
    left outside.
    """
    b, n = live.shape
    cones = empty(b, p.dtype.type)
    distance, sine = np.zeros(b, p.dtype), np.zeros(b, p.dtype)
    with np.errstate(all="ignore"):
        for i in range(n):
            cones = include(cones, p[:, i], r[:, i], live[:, i], printed)
        if repairs(printed):
            for i in range(n):
                d, s = excess(cones, p[:, i], r[:, i])
                distance = np.where(live[:, i] & (d > distance), d, distance)
                sine = np.where(live[:, i] & (s > sine), s, sine)
        return repair(cones, distance, sine, printed)


def meets_sphere(
    cones: Cones, slack: np.ndarray, centre: np.ndarray, radius: np.ndarray, printed: Errata = CORRECTED
) -> np.ndarray:
    """Whether a ray of the cone may meet the sphere: centre ``[b, 3]``, radius ``[b]``, or anything that broadcasts
    with the cones."""
    real = cones.apex.dtype.type
    with np.errstate(all="ignore"):
        c = centre - cones.apex
        z = dot(cones.axis, c)
        if printed.E4:
            # phi > arccos A - arcsin B with A = (v - a) . x, B = r/|v - a|; an undefined arc is false.
            big_b = radius / length(c)
            cos_beta = np.sqrt(np.where(real(1) - big_b * big_b > 0, real(1) - big_b * big_b, real(0)))
            past = cones.sin * cos_beta + cones.cos * big_b < 0
            test = past | (z > cones.cos * cos_beta - cones.sin * big_b)
            return (slack == np.inf) | ((slack >= 0) & (np.abs(z) <= 1) & (big_b <= 1) & test)
        w = length(cross(cones.axis, c))
        reach = radius + slack + real(TEST_ROUNDINGS * unit_roundoff(real)) * (np.abs(z) + w + radius)
        ahead = z * cones.cos + w * cones.sin >= 0
        return np.where(ahead, w * cones.cos - z * cones.sin <= reach, (reach >= 0) & (dot(c, c) <= reach * reach))
