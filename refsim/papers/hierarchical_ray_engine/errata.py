"""Which formulas of section 4 stand as printed: the option `errata`.

`"corrected"` (default) corrects all, `"as_printed"` none. Anything else lists the errata to take as printed while the
others are corrected: `"HRE-E1"`, `"HRE-E1,HRE-E4"` or a sequence of such names. What each is about:
`refsim.geometry.cone.Printed`.
"""

from __future__ import annotations

from collections.abc import Sequence

from refsim.errors import InputError
from refsim.geometry.cone import Printed

NAMES = tuple(f"HRE-{name}" for name in Printed._fields)


def printed_formulas(errata: str | Sequence[str]) -> Printed:
    """The switches for an `errata` option; `InputError` names what is not an erratum."""
    if errata == "corrected":
        return Printed()
    if errata == "as_printed":
        return Printed(*[True] * len(NAMES))
    names = errata.split(",") if isinstance(errata, str) else list(errata)
    switches = {}
    for name in names:
        short = str(name).strip().upper().removeprefix("HRE-")
        if short not in Printed._fields:
            known = ", ".join(("corrected", "as_printed", *NAMES))
            raise InputError(f"errata {name!r} is not known; choose from {known}.")
        switches[short] = True
    return Printed(**switches)
