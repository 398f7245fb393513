"""The device's cones and sphere tests have the bits of their NumPy restatement in float32.

Plan
- For every single erratum as printed, none, and all: the same apex, axis, pair, slack and state, NaN where NaN, on
  bundles of every kind.
- The same for the sphere test, both forms, on spheres of every size and place, the apex inside included.
- Errata frozen as constants of a compiled draw give the bits of errata passed as values.
"""

import numpy as np
import pytest

from refsim.geometry.cone import Printed
from refsim.reference import cone as reference
from refsim.reference.cone import Errata
from tests.geometry.cone_bundles import bulk
from tests.geometry.device_loops import build, build_constant, meets

CHOICES = [(), *((name,) for name in Printed._fields), Printed._fields]


@pytest.fixture(scope="module")
def many():
    return bulk(seed=7, per_kind=400, n=8)


def same_bits(a, b):
    """Equal bit for bit, any NaN equal to any NaN, and of one dtype."""
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype != b.dtype or a.shape != b.shape:
        return False
    if a.dtype.kind != "f":
        return bool((a == b).all())
    return bool(((a.view(np.uint32) == b.view(np.uint32)) | (np.isnan(a) & np.isnan(b))).all())


@pytest.mark.parametrize("names", CHOICES, ids=lambda names: "+".join(names) or "corrected")
def test_cones(many, names):
    flags = {name: True for name in names}
    cones, slack = build(many.p, many.r, many.live, Printed(**flags))
    again, slack_again = reference.build(many.p, many.r, many.live, Errata(**flags))
    for name in cones._fields:
        assert same_bits(getattr(cones, name), getattr(again, name)), name
    assert same_bits(slack, slack_again)


@pytest.mark.parametrize("names", [(), ("E4",)], ids=["corrected", "E4"])
def test_sphere_test(many, names):
    flags = {name: True for name in names}
    cones, slack = build(many.p, many.r, many.live)
    rng = np.random.default_rng(3)
    outcomes = set()
    for power in range(-6, 7):
        centre = (cones.apex + rng.normal(size=cones.apex.shape) * 10.0**power).astype(np.float32)
        radius = (10.0**power * rng.uniform(0, 2, len(slack))).astype(np.float32)
        one = meets(cones, slack, centre, radius, Printed(**flags))
        two = reference.meets_sphere(cones, slack, centre, radius, Errata(**flags))
        assert np.array_equal(one, two)
        outcomes |= {(int(s), bool(m)) for s, m in zip(cones.state, one, strict=True)}
    assert outcomes == {(0, False), (1, False), (1, True), (2, True)}


@pytest.mark.parametrize("names", [(), Printed._fields], ids=["corrected", "all"])
def test_errata_as_constants(many, names):
    printed = Printed(**{name: True for name in names})
    cones, slack = build(many.p, many.r, many.live, printed)
    frozen, slack_frozen = build_constant(printed)(many.p, many.r, many.live)
    for name in cones._fields:
        assert same_bits(getattr(cones, name), getattr(frozen, name)), name
    assert same_bits(slack, slack_frozen)
