"""Each equation of section 4 fails as printed, shown by the smallest example that shrinking finds.

Plan
- With one construction erratum as printed and the rest corrected, hypothesis finds a bundle of whole-numbered rays
  that the float64 cone does
  not hold; shrunk, it is printed, fails in float32 on the device too, and holds with the erratum corrected.
- With the sphere test as printed, it finds a ray and a sphere that the ray meets and the test rejects.
- The same for all errata together, the paper as it stands.
"""

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, find, settings
from hypothesis import strategies as st

from refsim.geometry.cone import Printed
from refsim.reference import cone as reference
from refsim.reference.cone import Errata
from tests.geometry.device_loops import build, meets

CONSTRUCTION = ("E1", "E2", "E3", "E5", "E6", "E7")
SEARCH = settings(
    max_examples=20000, derandomize=True, database=None, deadline=None, phases=[Phase.generate, Phase.shrink],
    suppress_health_check=list(HealthCheck),
)
whole = st.tuples(*[st.integers(-3, 3)] * 3)
ray = st.tuples(whole, whole.filter(any))
rays = st.lists(ray, min_size=1, max_size=4)


def arrays_of(example, dtype):
    """One bundle ``(p, r, live)`` from a list of (origin, direction) in whole numbers; directions are made unit."""
    p = np.array([[o for o, _ in example]], dtype=np.float64)
    r = np.array([[d for _, d in example]], dtype=np.float64)
    r /= np.linalg.norm(r, axis=-1, keepdims=True)
    return p.astype(dtype), r.astype(dtype), np.ones(p.shape[:2], bool)


def leaves(cones, slack, example):
    """Whether a ray of the example leaves the first cone: by an angle over 1e-3, as seen from the apex, at some t;
    NaN leaves."""
    if cones.state[0] != 1:
        return False
    p, r, _ = arrays_of(example, np.float64)
    apex, axis = (np.asarray(x[0], np.float64) for x in cones[:2])
    phi = np.arctan2(float(cones.sin[0]), float(cones.cos[0]))
    for t in (0.0, 0.5, 1.0, 2.0, 5.0, 1e3, 1e6):
        with np.errstate(invalid="ignore", over="ignore"):
            c = p[0] + r[0] * t - apex
            z, w = c @ axis, np.linalg.norm(np.cross(c, axis), axis=1)
            held = (np.arctan2(w, z) <= phi + 1e-3) | (np.linalg.norm(c, axis=1) <= 1e-3 + slack[0])
        if not held.all():
            return True
    return False


def fails(example, printed):
    """Whether the float64 cone of the example, with these errata as printed, loses a ray."""
    return leaves(*reference.build(*arrays_of(example, np.float64), printed), example)


def printed_only(*names):
    """The errata named, as printed: for the device and for the reference."""
    flags = {name: True for name in names}
    return Printed(**flags), Errata(**flags)


def describe(name, example):
    """The example on one line, for people."""
    print(f"HRE-{name} as printed loses a ray of:", "; ".join(f"from {o} along {d}" for o, d in example))


@pytest.mark.parametrize("names", [*((name,) for name in CONSTRUCTION), (*CONSTRUCTION, "E4")], ids="+".join)
def test_construction_as_printed_loses_a_ray(names):
    on_device, in_reference = printed_only(*names)
    example = find(rays, lambda bundle: fails(bundle, in_reference), settings=SEARCH)
    describe("+".join(names), example)
    assert fails(example, in_reference)
    assert not fails(example, Errata())
    arrays = arrays_of(example, np.float32)
    assert leaves(*build(*arrays, on_device), example)
    assert not leaves(*build(*arrays), example)
    assert len(example) <= 3


def meeting(example):
    """A ray and a sphere in whole numbers that the ray surely meets: ``(p, r, centre, radius)`` or None."""
    (origin, along), centre, radius = example
    p, r, _ = arrays_of([(origin, along)], np.float64)
    c = np.array(centre, np.float64) - p[0, 0]
    nearest = max(float(c @ r[0, 0]), 0.0)
    return np.linalg.norm(c - nearest * r[0, 0]) < radius - 1e-3


def rejected(example, printed):
    """Whether the float64 test with these errata rejects the sphere for the cone of the one ray."""
    bundle, centre, radius = example
    cones, slack = reference.build(*arrays_of([bundle], np.float64))
    return not reference.meets_sphere(
        cones, slack, np.array([centre], np.float64), np.array([radius], np.float64), printed
    )[0]


@pytest.mark.parametrize("apex", ["inside", "outside"])
def test_sphere_test_as_printed_rejects_a_sphere_that_the_ray_meets(apex):
    on_device, in_reference = printed_only("E4")

    def wrong(example):
        (origin, _), centre, radius = example
        inside = np.linalg.norm(np.subtract(centre, origin)) <= radius
        return meeting(example) and inside == (apex == "inside") and rejected(example, in_reference)

    example = find(st.tuples(ray, whole, st.integers(1, 3)), wrong, settings=SEARCH)
    (origin, along), centre, radius = example
    print(f"HRE-E4, apex {apex}: from {origin} along {along} rejects the sphere at {centre} of radius {radius}")
    assert not rejected(example, Errata())
    cones, slack = build(*arrays_of([example[0]], np.float32))
    sphere = np.array([centre], np.float32), np.array([radius], np.float32)
    assert not meets(cones, slack, *sphere, on_device)[0]
    assert meets(cones, slack, *sphere)[0]
