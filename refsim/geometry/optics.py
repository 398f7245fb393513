"""The ray that leaves a hit: refraction, total internal reflection, mirror reflection, or none.

The Hierarchical Ray Engine traces ideal reflections and refractions (section 5) and writes "the ray defining the
next segment of the refraction path" to the render target (section 3); the formulas are Snell's law and the law of
reflection in vector form. Not here: Fresnel weights, colour, and the choice of what a missing ray sees.
"""

import math

import numpy as np

from refsim.geometry.vector import add_scaled, divide, dot, scale, select
from refsim.jit import func

ZERO = np.float32(0)
ONE = np.float32(1)
TWO = np.float32(2)
NONE = np.int32(0)
REFLECTED = np.int32(2)
REFRACTED = np.int32(3)


@func
def next_ray(o, d, t, n_g, n_s, ior_surface, epsilon):
    """The ray of the next generation: ``(origin, direction, kind, alive)``.

    o, d, n_g, n_s are tuples of three float32: ray origin and unit direction, unit geometric normal (it decides the
    side of the offset) and unit shading normal (it decides the new direction; pass n_g for flat shading). t is the
    hit's parameter. The outside of the body is where the normals point. ior_surface: > 0 glass (index of the inside
    against the outside), 0 mirror, < 0 diffuse: the path ends. epsilon: offset in scene units.

    kind is int32 2 (reflected: mirror or total internal reflection) or 3 (refracted), 0 with a zero direction when
    not alive. Branch-free: everything is computed, then selected.
    """
    # Orient the normal against the ray.
    dn = dot(d, n_s)
    entering = dn < ZERO
    sign = ONE if entering else -ONE
    m = scale(n_s, sign)
    c = -dn * sign                                              # cosine of the angle of incidence

    # Snell's law in vector form: r = eta d + (eta c - sqrt k) m, k the squared cosine of the angle of refraction.
    index = ior_surface if ior_surface > ZERO else ONE
    eta = ONE / index if entering else index
    k = ONE - eta * eta * (ONE - c * c)
    root = math.sqrt(k if k > ZERO else ZERO)
    refracted = add_scaled(scale(d, eta), m, eta * c - root)

    # Mirror reflection: r = d + 2 c m.
    reflected = add_scaled(d, m, TWO * c)

    # Total internal reflection where Snell's law has no solution.
    reflects = (ior_surface == ZERO) | (k < ZERO)
    direction = select(reflects, reflected, refracted)
    direction = divide(direction, math.sqrt(dot(direction, direction)))

    # Offset along the geometric normal, to the side the ray travels to.
    step = epsilon if dot(direction, n_g) > ZERO else -epsilon
    origin = add_scaled(add_scaled(o, d, t), n_g, step)

    alive = ior_surface >= ZERO
    kind = REFLECTED if reflects else REFRACTED
    return origin, select(alive, direction, (ZERO, ZERO, ZERO)), kind if alive else NONE, alive
