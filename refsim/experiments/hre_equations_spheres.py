"""Checks of the Hierarchical Ray Engine beyond the cone: sphere test, spheres, vertex data, stencil bits.

Sections 4 and 5; cones are those of `hre_equations_checks`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.equations import Found, bits_differ, number
from refsim.experiments.hre_equations_checks import ANGLE, doubled, drawn, printed_only, unit
from refsim.experiments.hre_equations_kernels import test_spheres
from refsim.geometry.sphere import enclosing_spheres
from refsim.jit import specialise
from refsim.reference import cone as twin
from refsim.reference import sphere as sphere_twin
from refsim.reference.cone import Errata, half_angle
from refsim.reference.vector import angle, length
from refsim.results import Trace

# Of distance and radius: the corrected test lets in what float32 may miss, 2⁻¹⁸ of both
MARGIN = 2.0**-16


def sphere_test(count: int) -> Found:
    """Spheres all about the apex, and some that hold it: met where the cone comes nearer than the radius, and nowhere
    else. Spheres within `MARGIN` of touching are not counted."""
    cones, _, _ = drawn(count)
    rng = np.random.default_rng(43)
    exact = doubled(cones)
    away = unit(rng, count)
    distance = 10.0 ** rng.uniform(-1, 1, count)
    radius = distance * rng.uniform(0.01, 1.2, count)
    centre = exact.apex + away * distance[:, None]
    beyond = angle(exact.axis, away) - half_angle(exact)
    # Nearest point of the cone: within it, along a generator, or, more than a right angle beyond, the apex
    gap = distance * np.where(beyond < 0.0, 0.0, np.where(beyond < np.pi / 2, np.sin(beyond), 1.0))
    clear = np.abs(gap - radius) > MARGIN * (distance + radius)
    slack = np.zeros(count)
    wrong = [
        number((twin.meets_sphere(exact, slack, centre, radius, printed) != (gap < radius)) & clear)
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
    return Found(number(clear), differs, *wrong)


def enclosing(count: int) -> Found:
    """Spheres of triangles hold their vertices."""
    rng = np.random.default_rng(44)
    triangles = (rng.normal(size=(count, 3, 3)) * 10.0 ** rng.uniform(-3, 1, (count, 1, 1))).astype(np.float32)
    ours, theirs = enclosing_spheres(triangles), sphere_twin.enclosing_spheres(triangles)
    differs = bits_differ(ours[0], theirs[0]) | bits_differ(ours[1], theirs[1])
    reach = length(triangles.astype(np.float64) - ours[0].astype(np.float64)[:, None]).max(axis=1)
    return Found(count, number(differs), corrected_fails=number(reach > ours[1]))


def vertex_data(count: int) -> Found:
    """The record of a triangle gives back its plane, its vertices, their normals and texture coordinates."""
    from refsim.papers.hierarchical_ray_engine.vertices import triangle_vertices
    from refsim.scene import Scene

    rng = np.random.default_rng(45)
    triangles = rng.normal(size=(count, 3, 3)).astype(np.float32)
    normals = unit(rng, 3 * count).reshape(count, 3, 3).astype(np.float32)
    texcoords = rng.random((count, 3, 2)).astype(np.float32)
    found = triangle_vertices(Scene(triangles, normals=normals, texcoords=texcoords), 1.5).records()
    centre, radius = sphere_twin.enclosing_spheres(triangles)
    differs = bits_differ(found["position"][:, :3], centre) | bits_differ(found["position"][:, 3], radius)
    plane, corners = found["normal"].astype(np.float64), triangles.astype(np.float64)
    off = np.abs(np.einsum("nkc,nc->nk", corners, plane[:, :3]) - plane[:, 3:]).max(axis=1)
    # Float32 products of numbers up to 5: 16 roundings
    wrong = (off > 1e-5) | (np.abs(np.linalg.norm(plane[:, :3], axis=1) - 1.0) > ANGLE)
    wrong |= edges_differ(found, corners) | ~(found["texture0"][:, :3] == triangles[:, 0]).all(axis=1)
    for k in range(3):
        # A scene makes its normals unit once more, in float64: one rounding
        wrong |= (np.abs(found[f"normal{k}"] - normals[:, k]) > 2.0**-24).any(axis=1)
        wrong |= bits_differ(found[f"texcoord{k}"], texcoords[:, k])
    return Found(count, number(differs), corrected_fails=number(wrong))


def edges_differ(found: Any, corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Triangles whose vertices 1 and 2 textures 1 and 2 do not give back.

    These hold m1 and m2, with m1 · e1 = m2 · e2 = 1 and m1 · e2 = m2 · e1 = 0 for edges e1, e2 from vertex 0, all in
    the plane: so with the normal n they are two rows of the inverse of (e1, e2, n).
    """
    rows = np.stack([found[name].astype(np.float64)[:, :3] for name in ("texture1", "texture2", "normal")], axis=1)
    edges = np.linalg.inv(rows)[:, :, :2].transpose(0, 2, 1)
    off = np.abs(edges - (corners[:, 1:] - corners[:, :1])).max(axis=(1, 2))
    # Each row is rounded once: by as much the inverse is off, times its condition and size
    allowed = 3.0 * 2.0**-24 * np.linalg.cond(rows) * np.abs(corners[:, 1:] - corners[:, :1]).max(axis=(1, 2))
    return np.asarray(off > allowed)


def stencil_bits(count: int) -> Found:
    """With a bit an iteration no shader runs on a pixel without a ray; without the stencil some do, or else this shows
    nothing. Compiled engine and NumPy engine agree on every ray."""
    from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE, run

    frame: dict[str, Any] = {"size": 16, "fill": 0.55, "generations": 4}
    ours, theirs = (
        run(HIERARCHICAL, "torus_knot_100", backend=backend, tile_size=8, **frame) for backend in ("numba", "numpy")
    )
    differs, cases = 0, 0
    for a, b in zip(ours.generations, theirs.generations, strict=True):
        off = bits_differ(a.rays.origin, b.rays.origin) | bits_differ(a.rays.direction, b.rays.direction)
        for name in ("triangle", "t", "u", "v"):
            off |= bits_differ(getattr(a.hits, name), getattr(b.hits, name))
        differs += number(off & a.alive)
        cases += number(~a.alive)
    without, tested = (_idle_runs(run(RAY_ENGINE, "torus_knot_100", stencil=on, **frame)) for on in (False, True))
    idle = _idle_runs(ours) + tested
    return Found(cases, differs, corrected_fails=idle if without else cases)


def _idle_runs(found: Trace) -> int:
    """Shader runs on pixels without a ray."""
    return sum(int(passed.per_ray["triangle_tests"][~passed.alive].sum()) for passed in found.generations)
