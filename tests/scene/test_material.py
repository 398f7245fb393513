"""Plan: the shares of light that a material mirrors and lets through.

- For any material: rho is what was given, tau is the rest where it is glass and 0 elsewhere, both between 0 and 1.
- Table of what each kind stands for when nothing is given, and of given ones, with the ends of the range.
- A reflectivity outside 0 to 1, or none at all, is refused by a sentence that names the material.
- It is part of the material's value: other reflectivities are other materials, copies are equal. The number that
  `optical_index` gives does not depend on it.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.errors import InputError
from refsim.scene import DIFFUSE, GLASS, MIRROR, Material
from refsim.scene.material import KINDS

SHARES = st.floats(0.0, 1.0)


@given(st.sampled_from(KINDS), SHARES)
def test_what_is_not_mirrored_goes_through_glass_alone(kind, rho) -> None:
    material = Material("m", kind, reflectivity=rho)
    assert material.rho == rho and type(material.rho) is float
    assert material.tau == (1.0 - rho if kind == "glass" else 0.0)
    assert 0.0 <= material.rho + material.tau <= 1.0


@given(st.sampled_from(KINDS), SHARES, SHARES)
def test_reflectivity_is_part_of_the_value(kind, one, other) -> None:
    a, b = Material("m", kind, reflectivity=one), Material("m", kind, reflectivity=other)
    assert (a == b) == (one == other) and a == replace(b, reflectivity=one) and hash(a) == hash(replace(a))
    assert a.optical_index(1.5) == b.optical_index(1.5) == Material("m", kind).optical_index(1.5)


# material: (rho, tau)
TABLE = {
    "glass": (GLASS, 0.1, 0.9),
    "mirror": (MIRROR, 1.0, 0.0),
    "diffuse": (DIFFUSE, 0.0, 0.0),
    "glass that mirrors nothing": (Material("m", "glass", reflectivity=0.0), 0.0, 1.0),
    "glass that mirrors all": (Material("m", "glass", reflectivity=1), 1.0, 0.0),
    "mirror that is black": (Material("m", "mirror", reflectivity=0), 0.0, 0.0),
    "polished": (Material("m", "diffuse", reflectivity=0.25), 0.25, 0.0),
    "least above 0": (Material("m", "diffuse", reflectivity=5e-324), 5e-324, 0.0),
    "greatest below 1": (Material("m", "glass", reflectivity=1 - 2**-53), 1 - 2**-53, 2**-53),
}


@pytest.mark.parametrize("row", TABLE)
def test_shares(row: str) -> None:
    material, rho, tau = TABLE[row]
    assert (material.rho, material.tau) == (rho, tau)


REFUSED = {
    "below 0": -5e-324,
    "above 1": 1 + 2**-52,
    "NaN": float("nan"),
    "infinite": float("inf"),
    "minus infinite": float("-inf"),
}


@pytest.mark.parametrize("row", REFUSED)
@pytest.mark.parametrize("kind", KINDS)
def test_other_reflectivities_are_refused(row: str, kind) -> None:
    with pytest.raises(InputError, match="reflectivity of material 'pond' must be a number from 0 to 1, not"):
        Material("pond", kind, reflectivity=REFUSED[row])
