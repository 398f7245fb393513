"""Loops around the device functions of the enclosing cone, row by row. Templates of `refsim.jit`."""

from __future__ import annotations

import numpy as np

from refsim.geometry.cone import BOUNDED, Cone, extend, include, meets_sphere, translate

U = np.uintp


def step_cones(apex, axis, cos, sin, p, r, printed, out, states):  # type: ignore[no-untyped-def]
    """Each cone [n] by one ray: widened (out[0]), moved (out[1]), both (out[2]): apex, axis, cos, sin, and its state.

    out f32[3, n, 8], states i32[3, n]; `printed`: errata as values.
    """
    for k in range(apex.shape[0]):
        i = U(k)
        one = Cone(
            (apex[i, 0], apex[i, 1], apex[i, 2]), (axis[i, 0], axis[i, 1], axis[i, 2]), cos[i], sin[i], BOUNDED
        )
        origin, direction = (p[i, 0], p[i, 1], p[i, 2]), (r[i, 0], r[i, 1], r[i, 2])
        for step in range(3):
            if step == 0:
                new = extend(one, direction, printed)
            elif step == 1:
                new = translate(one, origin, printed)
            else:
                new = include(one, origin, direction, printed)
            for j in range(3):
                out[step, i, j] = new.apex[j]
                out[step, i, j + 3] = new.axis[j]
            out[step, i, 6], out[step, i, 7] = new.cos, new.sin
            states[step, i] = new.state


def test_spheres(apex, axis, cos, sin, slack, centre, radius, printed, out):  # type: ignore[no-untyped-def]
    """The sphere test of each cone and sphere, out bool[n]."""
    for k in range(apex.shape[0]):
        i = U(k)
        one = Cone(
            (apex[i, 0], apex[i, 1], apex[i, 2]), (axis[i, 0], axis[i, 1], axis[i, 2]), cos[i], sin[i], BOUNDED
        )
        out[i] = meets_sphere(one, slack[i], (centre[i, 0], centre[i, 1], centre[i, 2]), radius[i], printed)
