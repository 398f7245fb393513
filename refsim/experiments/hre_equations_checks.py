"""Checks of the formulas of The Hierarchical Ray Engine, on seeded random cones, rays and spheres.

Cones and rays are float32, and the compiled step is held against its NumPy twin bit for bit, corrected and as printed.
What a formula must do is checked in float64, on the twin with the erratum as printed and with all corrected. A vector
that lives only inside a step (q, e, n, g) is held against the twin through the cone that the step returns.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.equations import Found, bits_differ, number
from refsim.experiments.hre_equations_kernels import step_cones
from refsim.geometry.cone import Printed
from refsim.jit import specialise
from refsim.reference import cone as twin
from refsim.reference.cone import BOUNDED, Cones, Errata, half_angle
from refsim.reference.vector import angle, cross, dot, length, normalise

ANGLE = 1e-6  # radians; float64 leaves 1e-8 of what an arccosine near 1 is asked
OUTSIDE = 1e-3  # radians: a bundle's ray that is further out is lost, whatever rounding does
AT = (0.0, 0.5, 1.0, 2.0, 5.0, 1e3, 1e6)  # where along a ray it is looked for in its cone
Vectors = NDArray[Any]


def unit(rng: np.random.Generator, count: int) -> Vectors:
    """Directions, f64[count, 3]."""
    v = rng.normal(size=(count, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


@lru_cache(maxsize=2)
def drawn(count: int) -> tuple[Cones, Vectors, Vectors]:
    """Bounded cones from 1e-4 to 82 degrees, and a ray for each: origins, directions; float32."""
    rng = np.random.default_rng(41)
    phi = np.where(rng.random(count) < 0.5, 10.0 ** rng.uniform(-4, 0, count), rng.uniform(0.0, 1.43, count))
    apex, axis = rng.normal(size=(count, 3)), unit(rng, count)
    spread = 10.0 ** rng.uniform(-3, 1, (count, 1))
    r = normalise(axis * rng.choice([-1.0, 1.0], (count, 1), p=[0.2, 0.8]) + unit(rng, count) * spread)
    p = apex + (axis * rng.normal(size=(count, 1)) + unit(rng, count)) * 10.0 ** rng.uniform(-2, 2, (count, 1))
    state = np.full(count, BOUNDED, np.int32)
    f = np.float32
    cones = Cones(apex.astype(f), axis.astype(f), np.cos(phi).astype(f), np.sin(phi).astype(f), state)
    return cones, p.astype(f), r.astype(f)


def doubled(cones: Cones) -> Cones:
    """The same in float64, axis and pair made exact."""
    axis, size = normalise(cones.axis.astype(np.float64)), np.hypot(cones.cos.astype(np.float64), cones.sin)
    return Cones(cones.apex.astype(np.float64), axis, cones.cos / size, cones.sin / size, cones.state)


def printed_only(*names: str) -> tuple[Printed, Errata]:
    """Errata as printed, for the compiled code and for the twin."""
    flags = dict.fromkeys(names, True)
    return Printed(**flags), Errata(**flags)


def steps_differ(count: int, step: int, names: tuple[str, ...]) -> int:
    """Cones on which the compiled step (0 extend, 1 translate, 2 both) and the twin differ, corrected or as printed."""
    cones, p, r = drawn(count)
    live = np.ones(count, np.bool_)
    total = 0
    for which in {(), names}:
        on_device, in_twin = printed_only(*which)
        out, states = np.zeros((3, count, 8), np.float32), np.zeros((3, count), np.int32)
        specialise(step_cones, {})(*cones[:4], p, r, on_device, out, states)
        with np.errstate(all="ignore"):
            again = (
                twin.extend(cones, r, in_twin) if step == 0
                else twin.translate(cones, p, in_twin) if step == 1
                else twin.include(cones, p, r, live, in_twin)
            )  # fmt: skip
        parts = zip((out[step, :, :3], out[step, :, 3:6], out[step, :, 6], out[step, :, 7], states[step]), again,
                    strict=True)  # fmt: skip
        differs = np.zeros(count, np.bool_)
        for ours, theirs in parts:
            differs |= bits_differ(np.ascontiguousarray(ours), np.ascontiguousarray(theirs))
        total += number(differs)
    return total


def condition(count: int) -> Found:
    """x · r < cos φ, in float64, exactly where the direction is out of the cone; the kernel has it by the sine."""
    clear, far, exact, _, near = _about_the_edge(count)
    r = normalise(near.astype(np.float64))
    by_sine = twin.outside(dot(exact.axis, r), length(cross(exact.axis, r)), exact.cos, exact.sin)
    wrong = [number((says != far) & clear) for says in (dot(exact.axis, r) < exact.cos, by_sine)]
    return Found(number(clear), steps_differ(count, 0, ()), *wrong)


def condition_in_float32(count: int) -> Found:
    """The same in float32, which cannot tell the cosine of a small angle from 1; corrected: by the sine as well."""
    clear, far, _, cones, near = _about_the_edge(count)
    along, across = dot(cones.axis, near), length(cross(cones.axis, near))
    by_sine = twin.outside(along, across, cones.cos, cones.sin)
    wrong = [number((says != far) & clear) for says in (along < cones.cos, by_sine)]
    return Found(number(clear), steps_differ(count, 0, ()), *wrong)


def _about_the_edge(count: int) -> tuple[Vectors, Vectors, Cones, Cones, Vectors]:
    """Which directions are clear of their cone's edge, by a hundredth of φ; which lie outside; the cones, float64 and
    float32; the directions, float32."""
    cones, _, _ = drawn(count)
    rng = np.random.default_rng(46)
    exact = doubled(cones)
    # Directions from the axis to twice the half-angle, so that narrow cones are asked of what is near
    aside = normalise(cross(exact.axis, unit(rng, count)))
    turn = np.tan(rng.uniform(0.0, 1.0, count) * half_angle(exact))
    near = normalise(exact.axis + 2.0 * turn[:, None] * aside).astype(np.float32)
    theta, phi = angle(exact.axis, normalise(near.astype(np.float64))), half_angle(exact)
    return np.abs(theta - phi) > 0.01 * phi, theta > phi, exact, cones, near


def away(count: int) -> Found:
    """q of step 2(a): a unit vector at right angles to the axis, away from the ray."""
    cones, _, r = drawn(count)
    exact, direction = doubled(cones), normalise(r.astype(np.float64))
    q = twin.direction_away(exact.axis, direction, dot(exact.axis, direction))
    wrong = (np.abs(length(q) - 1.0) > ANGLE) | (np.abs(dot(q, exact.axis)) > ANGLE) | (dot(q, direction) > 0.0)
    return Found(count, steps_differ(count, 0, ()), number(wrong), number(wrong))


def generator(count: int) -> Found:
    """e: of all generators the one furthest from the ray's direction."""
    cones, _, r = drawn(count)
    exact, direction = doubled(cones), normalise(r.astype(np.float64))
    theta = angle(exact.axis, direction)
    q = twin.direction_away(exact.axis, direction, np.cos(theta))
    e = exact.axis * exact.cos[:, None] + q * exact.sin[:, None]
    # In the plane of x and r, φ beyond x: φ + θ from r, or the rest of the full turn
    turn = half_angle(exact) + theta
    wrong = np.abs(angle(e, direction) - np.minimum(turn, 2.0 * np.pi - turn)) > ANGLE
    return Found(count, steps_differ(count, 0, ()), number(wrong), number(wrong))


def _extended(count: int, printed: Errata) -> tuple[Cones, Cones, Vectors]:
    cones, _, r = drawn(count)
    exact, direction = doubled(cones), normalise(r.astype(np.float64))
    with np.errstate(all="ignore"):
        return exact, twin.extend(exact, direction, printed), direction


def _forgets(count: int, printed: Errata) -> int:
    """Cones that, extended, no longer hold all directions of the old cone and the new one."""
    old, new, direction = _extended(count, printed)
    reach = np.maximum(angle(new.axis, old.axis) + half_angle(old), angle(new.axis, direction))
    return number((reach > half_angle(new) + ANGLE) & (new.state == BOUNDED))


def new_axis(count: int) -> Found:
    """x_new: with its half-angle, holds the old solid angle and the new direction."""
    _, printed = printed_only("E6")
    return Found(count, steps_differ(count, 0, ("E6",)), _forgets(count, printed), _forgets(count, Errata()))


def new_angle(count: int) -> Found:
    """cos φ_new: half of the old half-angle and the ray's angle together."""
    def wrong(printed: Errata) -> int:
        old, new, direction = _extended(count, printed)
        theta = angle(old.axis, direction)
        wanted = np.maximum(half_angle(old), 0.5 * (half_angle(old) + theta))
        return number((np.abs(half_angle(new) - wanted) > ANGLE) & (new.state == BOUNDED))

    _, printed = printed_only("E6")
    return Found(count, steps_differ(count, 0, ("E6",)), wrong(printed), wrong(Errata()))


def _to_move(count: int) -> tuple[Cones, Vectors, Vectors, Vectors]:
    """Cones that an origin is outside of (and out of the mirrored cone), with c, (x · c) x − c and its length."""
    cones, p, _ = drawn(count)
    exact = doubled(cones)
    c = p.astype(np.float64) - exact.apex
    z, w = dot(exact.axis, c), length(cross(exact.axis, c))
    moves = twin.outside(z, w, exact.cos, exact.sin) & ~twin.mirrored(z, w, exact.cos, exact.sin)
    picked = Cones(*(part[moves] for part in exact))
    return picked, c[moves], z[moves], w[moves]


def away_from_origin(count: int) -> Found:
    """q of step 2(b) is a unit vector, as in step 2(a)."""
    exact, c, z, _ = _to_move(count)
    printed = (exact.axis * z[:, None] - c) / (np.abs(z) * length(exact.axis - c))[:, None]
    corrected = twin.direction_away(exact.axis, c, z)
    wrong = [number(np.abs(length(q) - 1.0) > ANGLE) for q in (printed, corrected)]
    return Found(len(c), steps_differ(count, 1, ("E3",)), *wrong)


def near_and_far(count: int) -> Found:
    """n and e: generators in the plane of the axis and the origin, n the nearer one."""
    exact, c, z, _ = _to_move(count)
    q = twin.direction_away(exact.axis, c, z)
    e = exact.axis * exact.cos[:, None] + q * exact.sin[:, None]
    n = exact.axis * exact.cos[:, None] - q * exact.sin[:, None]
    apart = np.abs(angle(n, c) - (angle(exact.axis, c) - half_angle(exact))) > ANGLE
    wrong = apart | (angle(e, c) < angle(n, c) - ANGLE) | (np.abs(angle(e, n) - 2.0 * half_angle(exact)) > ANGLE)
    return Found(len(c), steps_differ(count, 1, ()), number(wrong), number(wrong))


def distance_vector(count: int) -> Found:
    """g: from the nearest generator to the origin, at right angles to it, as long as the gap."""
    exact, c, z, w = _to_move(count)
    n = exact.axis * exact.cos[:, None] - twin.direction_away(exact.axis, c, z) * exact.sin[:, None]
    g = c - n * dot(n, c)[:, None]
    gap = np.abs(w * exact.cos - z * exact.sin)
    size = length(c)
    wrong = (np.abs(dot(g, n)) > ANGLE * size) | (np.abs(length(g) - gap) > ANGLE * size)
    return Found(len(c), steps_differ(count, 1, ()), number(wrong), number(wrong))


def _bundles(count: int) -> tuple[Vectors, Vectors, NDArray[np.bool_]]:
    """Bundles of four rays, from tight to all directions; half of them parallel or behind one another; float64."""
    rng = np.random.default_rng(42)
    number_of = count // 4
    axis = unit(rng, number_of)[:, None]
    spread = 10.0 ** rng.uniform(-3, 1, (number_of, 1, 1))
    spread[: number_of // 4] = 0.0
    noise = rng.normal(size=(number_of, 4, 3))
    r = normalise(axis + noise * spread)
    p = rng.normal(size=(number_of, 4, 3))
    behind = slice(number_of // 4, number_of // 2)
    p[behind] = axis[behind] * rng.normal(size=(number_of // 4, 4, 1)) * 5.0 + 0.1 * p[behind]
    return p, r, np.ones((number_of, 4), np.bool_)


def lost(count: int, printed: Errata) -> int:
    """Bundles of which a ray leaves the cone built for it, by more than rounding."""
    p, r, live = _bundles(count)
    cones, slack = twin.build(p, r, live, printed)
    out = np.zeros(len(p), np.bool_)
    phi = half_angle(cones)[:, None]
    with np.errstate(all="ignore"):
        for t in AT:
            c = p + r * t - cones.apex[:, None]
            axis = np.broadcast_to(cones.axis[:, None], c.shape)
            held = (angle(axis, c) <= phi + OUTSIDE) | (length(c) <= OUTSIDE + slack[:, None])
            out |= ~held.all(axis=1)
    return number(out & (cones.state == BOUNDED))


def moved(name: str) -> Any:
    def check(count: int) -> Found:
        _, printed = printed_only(name)
        return Found(count // 4, steps_differ(count, 1, (name,)), lost(count, printed), lost(count, Errata()))

    return check


def too_wide(count: int) -> Found:
    """φ of 90 degrees and more."""
    _, printed = printed_only("E7")
    return Found(count // 4, steps_differ(count, 2, ("E7",)), lost(count, printed), lost(count, Errata()))


def as_a_whole(count: int) -> Found:
    """Steps 1 and 2, all as printed."""
    names = ("E1", "E2", "E3", "E5", "E6", "E7")
    _, printed = printed_only(*names)
    return Found(count // 4, steps_differ(count, 2, names), lost(count, printed), lost(count, Errata()))
