"""What stands as printed in the paper: the option `errata`.

`"corrected"` (default) corrects all, `"as_printed"` none. Anything else lists the errata to take as printed while the
others are corrected: `"BSH-E5"`, `"BSH-E5,BSH-E9"` or a sequence of such names. BSH-E1 and E2 are the culling rules
(`culling`); E3, E4, E6 and E7 are statements about numbers; E8 is the threshold (`hierarchy`); E10 and E11 are
sentences that no code follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from refsim.errors import InputError
from refsim.jit import func

F0 = np.float32(0)


class Printed(NamedTuple):
    """True where the printed text stands.

    E5  a sphere's "intersection parameter" is taken for the exit root: spheres that reach beyond the best hit are
        skipped with what they hold before it. Corrected: the entry root, clamped at the ray's start
    E9  per-polygon heads serve every ray that leaves a polygon: refracted ones, and those that hit its back, lose what
        lies behind. Corrected: only rays that leave on the normal's side
    """

    E5: bool = False
    E9: bool = False


NAMES = tuple(f"BSH-{name}" for name in Printed._fields)


def printed_text(errata: str | Sequence[str]) -> Printed:
    """The switches for an `errata` option; `InputError` names what is not an erratum."""
    if errata == "corrected":
        return Printed()
    if errata == "as_printed":
        return Printed(*[True] * len(NAMES))
    several = errata.split(",") if isinstance(errata, str) else errata
    names = several if isinstance(several, Sequence) else [several]
    switches = {}
    for name in names:
        field = str(name).strip().upper().removeprefix("BSH-")
        if field not in Printed._fields:
            known = ", ".join(("corrected", "as_printed", *NAMES))
            raise InputError(f"errata {name!r} is not known; choose from {known}.")
        switches[field] = True
    return Printed(**switches)


def slots_of(printed: Printed) -> dict[str, Any]:
    """Device functions of `traversal` that an erratum replaces."""
    return {"misses_sphere": misses_by_exit_root} if printed.E5 else {}


@func
def misses_by_exit_root(o, d, w, slack, param, x, y, z, radius):  # type: ignore[no-untyped-def]
    """BSH-E5 as printed: the ball is not hit, or its exit root is not below param."""
    x, y, z = x - o[0], y - o[1], z - o[2]
    k = x * w[0] + y * w[1] + z * w[2]
    x, y, z = x - k * d[0], y - k * d[1], z - k * d[2]
    reach = radius + slack
    half = reach * reach - (x * x + y * y + z * z)
    leaves = k + np.sqrt(half if half > F0 else F0)
    return not ((half >= F0) & (leaves > F0) & (leaves < param))
