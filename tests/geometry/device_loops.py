"""Plain loops around the device functions, so that NumPy arrays can be put through them."""

import numpy as np
from numba import njit

from refsim.geometry import cone, optics, triangle
from refsim.reference.cone import Cones

Cone, BOUNDED = cone.Cone, cone.BOUNDED
empty, include, excess, repair, repairs, meets_sphere = (
    cone.empty, cone.include, cone.excess, cone.repair, cone.repairs, cone.meets_sphere,
)
intersect, next_ray = triangle.intersect, optics.next_ray


@njit(error_model="numpy")
def vec(a, i):
    return a[i, 0], a[i, 1], a[i, 2]


@njit(error_model="numpy")
def _build(p, r, live, printed, out, state):
    zero = np.float32(0)
    for b in range(len(p)):
        cone = empty()
        for i in range(p.shape[1]):
            if live[b, i]:
                cone = include(cone, vec(p[b], i), vec(r[b], i), printed)
        distance, sine = zero, zero
        if repairs(printed):
            for i in range(p.shape[1]):
                if live[b, i]:
                    d, s = excess(cone, vec(p[b], i), vec(r[b], i))
                    distance = d if d > distance else distance
                    sine = s if s > sine else sine
        cone, slack = repair(cone, distance, sine, printed)
        for k in range(3):
            out[b, k] = cone.apex[k]
            out[b, 3 + k] = cone.axis[k]
        out[b, 6] = cone.cos
        out[b, 7] = cone.sin
        out[b, 8] = slack
        state[b] = cone.state


def build(p, r, live, printed=cone.Printed()):  # noqa: B008 (immutable)
    """Cones and slack of bundles ``[b, n, 3]`` by the device functions; printed is a run-time value here."""
    out, state = np.zeros((len(p), 9), np.float32), np.zeros(len(p), np.int32)
    _build(p, r, live, printed, out, state)
    return Cones(out[:, :3], out[:, 3:6], out[:, 6], out[:, 7], state), out[:, 8]


@njit(error_model="numpy")
def _excess(apex, axis, cos, sin, p, r, out):
    for i in range(len(p)):
        one = Cone(vec(apex, i), vec(axis, i), cos[i], sin[i], BOUNDED)
        out[0, i], out[1, i] = excess(one, vec(p, i), vec(r, i))


def excesses(cones, p, r):
    """``(distance, sine)`` by which rays ``[b, 3]`` are outside their cones ``[b]``, by the device function."""
    out = np.zeros((2, len(p)), np.float32)
    _excess(cones.apex, cones.axis, cones.cos, cones.sin, p, r, out)
    return out


def build_constant(printed):
    """The same loop with the errata frozen as constants, as a compiled draw has them."""

    @njit(error_model="numpy")
    def loop(p, r, live, out, state):
        _build(p, r, live, printed, out, state)

    def run(p, r, live):
        out, state = np.zeros((len(p), 9), np.float32), np.zeros(len(p), np.int32)
        loop(p, r, live, out, state)
        return Cones(out[:, :3], out[:, 3:6], out[:, 6], out[:, 7], state), out[:, 8]

    return run


@njit(error_model="numpy")
def _meets(apex, axis, cos, sin, slack, centre, radius, printed, out):
    for i in range(len(apex)):
        one = Cone(vec(apex, i), vec(axis, i), cos[i], sin[i], BOUNDED)
        out[i] = meets_sphere(one, slack[i], vec(centre, i), radius[i], printed)


def meets(cones, slack, centre, radius, printed=cone.Printed()):  # noqa: B008
    """The device's sphere test row by row: cones and slack ``[b]``, centre ``[b, 3]``, radius ``[b]``."""
    out = np.zeros(len(slack), np.bool_)
    _meets(cones.apex, cones.axis, cones.cos, cones.sin, slack, centre, radius, printed, out)
    return out


@njit(error_model="numpy")
def _intersect(o, d, t_max, v0, n, m1, m2, hit, out):
    for i in range(len(o)):
        h, t, u, v, den = intersect(vec(o, i), vec(d, i), t_max[i], vec(v0, i), vec(n, i), vec(m1, i), vec(m2, i))
        hit[i] = h
        out[0, i] = t
        out[1, i] = u
        out[2, i] = v
        out[3, i] = den


def hits(o, d, t_max, records):
    """The device's ray-triangle test row by row: ``(hit, t, u, v, den)``."""
    hit, out = np.zeros(len(o), np.bool_), np.zeros((4, len(o)), np.float32)
    _intersect(o, d, t_max, records.v0, records.n, records.m1, records.m2, hit, out)
    return hit, *out


@njit(error_model="numpy")
def _next(o, d, t, n_g, n_s, ior, epsilon, origin, direction, kind, alive):
    for i in range(len(o)):
        a, b, k, lives = next_ray(vec(o, i), vec(d, i), t[i], vec(n_g, i), vec(n_s, i), ior[i], epsilon)
        for j in range(3):
            origin[i, j] = a[j]
            direction[i, j] = b[j]
        kind[i] = k
        alive[i] = lives


def next_rays(o, d, t, n_g, n_s, ior, epsilon):
    """The device's next ray row by row: ``(origin, direction, kind, alive)``."""
    out = np.zeros_like(o), np.zeros_like(o), np.zeros(len(o), np.int32), np.zeros(len(o), np.bool_)
    _next(o, d, t, n_g, n_s, ior, np.float32(epsilon), *out)
    return out
