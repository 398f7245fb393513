"""Checks of the Hierarchical Ray Engine beyond the cone: sphere test, vertex data, stencil bits, throughput.

Sections 4, 5 and 7.1; cones and rays are those of `hre_equations_checks`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import published
from refsim.experiments.equations import Found, bits_differ, number
from refsim.experiments.hre_equations_checks import ANGLE, angle, doubled, drawn, half_angle, printed_only, unit
from refsim.experiments.hre_equations_kernels import test_spheres
from refsim.geometry.sphere import enclosing_spheres
from refsim.jit import specialise
from refsim.reference import cone as twin
from refsim.reference import sphere as sphere_twin
from refsim.reference.cone import Errata
from refsim.reference.vector import cross, length, normalise


def sphere_test(count: int) -> Found:
    """A sphere about a point of a ray of the cone is met."""
    cones, _, _ = drawn(count)
    rng = np.random.default_rng(43)
    exact = doubled(cones)
    aside = normalise(cross(exact.axis, unit(rng, count))) * rng.uniform(0.0, 0.99, (count, 1))
    towards = normalise(exact.axis * exact.cos[:, None] + aside * exact.sin[:, None])
    radius = 10.0 ** rng.uniform(-2, 1, count)
    point = exact.apex + towards * 10.0 ** rng.uniform(-1, 1, (count, 1))
    centre = point + unit(rng, count) * (radius * rng.uniform(0.0, 0.99, count))[:, None]
    slack = np.zeros(count)
    inside = angle(exact.axis, towards) <= half_angle(exact)
    rejected = [
        number(~twin.meets_sphere(exact, slack, centre, radius, printed) & inside)
        for printed in (printed_only("E4")[1], Errata())
    ]
    f = np.float32
    differs = 0
    for names in ((), ("E4",)):
        on_device, in_twin = printed_only(*names)
        out = np.zeros(count, np.bool_)
        spheres = slack.astype(f), centre.astype(f), radius.astype(f)
        specialise(test_spheres, {})(*cones[:4], *spheres, on_device, out)
        differs += number(out != twin.meets_sphere(cones, *spheres, in_twin))
    return Found(number(inside), differs, *rejected)


def enclosing(count: int) -> Found:
    """Spheres of triangles hold their vertices."""
    rng = np.random.default_rng(44)
    triangles = (rng.normal(size=(count, 3, 3)) * 10.0 ** rng.uniform(-3, 1, (count, 1, 1))).astype(np.float32)
    ours, theirs = enclosing_spheres(triangles), sphere_twin.enclosing_spheres(triangles)
    differs = bits_differ(ours[0], theirs[0]) | bits_differ(ours[1], theirs[1])
    reach = length(triangles.astype(np.float64) - ours[0].astype(np.float64)[:, None]).max(axis=1)
    return Found(count, number(differs), corrected_fails=number(reach > ours[1]))


def vertex_data(count: int) -> Found:
    """The record of a triangle gives back its plane and its vertices."""
    from refsim.papers.hierarchical_ray_engine.vertices import triangle_vertices
    from refsim.scene import Scene

    rng = np.random.default_rng(45)
    triangles = rng.normal(size=(count, 3, 3)).astype(np.float32)
    found = triangle_vertices(Scene(triangles), 1.5).records()
    centre, radius = sphere_twin.enclosing_spheres(triangles)
    differs = bits_differ(found["position"][:, :3], centre) | bits_differ(found["position"][:, 3], radius)
    plane, corners = found["normal"].astype(np.float64), triangles.astype(np.float64)
    off = np.abs(np.einsum("nkc,nc->nk", corners, plane[:, :3]) - plane[:, 3:]).max(axis=1)
    # Float32 products of numbers up to 5: 16 roundings
    wrong = (off > 1e-5) | (np.abs(np.linalg.norm(plane[:, :3], axis=1) - 1.0) > ANGLE)
    wrong |= ~(found["texture0"][:, :3] == triangles[:, 0]).all(axis=1)
    return Found(count, number(differs), corrected_fails=number(wrong))


def stencil_bits(count: int) -> Found:
    """A pixel whose path ended is not shot again; compiled engine and NumPy engine agree on every ray."""
    from refsim.experiments.runs import HIERARCHICAL, run

    frame: dict[str, Any] = {"size": 16, "fill": 0.55, "generations": 4, "tile_size": 8}
    ours, theirs = (run(HIERARCHICAL, "torus_knot_100", backend=backend, **frame) for backend in ("numba", "numpy"))
    differs, again, cases = 0, 0, 0
    before = None
    for a, b in zip(ours.generations, theirs.generations, strict=True):
        parts = ("triangle", "t", "u", "v")
        off = bits_differ(a.rays.origin, b.rays.origin) | bits_differ(a.rays.direction, b.rays.direction)
        for name in parts:
            off |= bits_differ(getattr(a.hits, name), getattr(b.hits, name))
        differs += number(off & a.alive)
        again += 0 if before is None else number(a.alive & ~before)
        before = a.hits.triangle >= 0
        cases += number(a.alive)
    return Found(cases, differs, corrected_fails=again)


def throughput(count: int) -> Found:
    """256² × 5,000 × 2 × frames a second, against the figures that the text gives for them (two digits)."""
    wrong = [
        abs(rate / published.SAID_TESTS[engine] - 1.0) > 0.05 for engine, rate in published.TESTS_PER_SECOND.items()
    ]
    return Found(len(wrong), printed_fails=sum(wrong))
