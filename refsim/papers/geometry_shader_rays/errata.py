"""What stands as printed in the listings and Eq. 1: the option `errata`.

`"corrected"` (default) corrects all, `"as_printed"` none but E3. Anything else lists the errata to take as printed
while the others are corrected: `"GSR-E1"`, `"GSR-E1,GSR-E4"` or a sequence of such names.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from refsim.errors import InputError
from refsim.pipeline.layout import i32


class Printed(NamedTuple):
    """1 where the printed text stands; the shaders read these as uniforms.

    On 8-bit targets E8 and E10 also round otherwise: what lies in one target together is rounded once. Not switched:
    ambient and specular light, which the text's Phong model has and Listing 5 lacks.

    E1   a shadow fragment adds (1, 1, 1): shadows are white (Eq. 1). Corrected: it adds nothing
    E1b  it adds (−1, −1, −1) (Listing 5): black on a fixed-point target, −1 on a float one
    E2   rays that miss end in the geometry shader, so only the clear colour is background and mirrors show black
         (Listing 4). Corrected: reflected and refracted rays that miss are passed on and shaded with the background
    E3   `emitPassThrough`, which is not listed, passes a ray on unchanged. Nothing ever reaches state 3: the picture
         stays empty and the same rays are shot once more, up to the hit that they have, and end. Corrected: it sets
         state 3
    E4   reflections weigh 0.25 on every surface (Listing 5). Corrected: the material's ρ (Eq. 1)
    E5   only eye rays spawn rays, so one bounce is all whatever P is (Listing 4). Corrected: every surface ray does
    E6   a shadow ray looks for its nearest hit (Listing 3). Corrected: any hit before the light ends the search
    E7   the text's numbers for S_VB and Table 2: they are right, so this switch changes nothing
    E8   everything is blended into one target by Eq. 1, in buffer order: a shadow extinguishes all that its pixel
         holds. Corrected: a target a light, a layer a surface of the pixel's ray tree
    E9   eye fragments have α = 1 and add to the clear colour (Eq. 1, Listing 5). Corrected: α = 0
    E10  a shadow erases ambient light too. Corrected: ambient light has a target of its own
    E11  new rays start along the shading normal, on its side (Listing 4). Corrected: along the geometric normal, on the
         side they travel to
    E12  the eye ray's direction is (x, y, −1) turned: 90 degrees across whatever the picture's shape (Listing 3).
         Corrected: the rays are those given
    """

    E1: i32 = 0  # type: ignore[assignment]
    E1b: i32 = 0  # type: ignore[assignment]
    E2: i32 = 0  # type: ignore[assignment]
    E3: i32 = 0  # type: ignore[assignment]
    E4: i32 = 0  # type: ignore[assignment]
    E5: i32 = 0  # type: ignore[assignment]
    E6: i32 = 0  # type: ignore[assignment]
    E7: i32 = 0  # type: ignore[assignment]
    E8: i32 = 0  # type: ignore[assignment]
    E9: i32 = 0  # type: ignore[assignment]
    E10: i32 = 0  # type: ignore[assignment]
    E11: i32 = 0  # type: ignore[assignment]
    E12: i32 = 0  # type: ignore[assignment]


CORRECTED = Printed()
NAMES = tuple(f"GSR-{name}" for name in Printed._fields)
# E3 has no printed text to run, and E1b is another reading of E1
AS_PRINTED = Printed(**{name: int(name not in ("E3", "E1b")) for name in Printed._fields})  # type: ignore[arg-type]


def printed_text(errata: str | Sequence[str]) -> Printed:
    """The switches for an `errata` option; `InputError` names what is not an erratum."""
    if errata == "corrected":
        return CORRECTED
    if errata == "as_printed":
        return AS_PRINTED
    several = errata.split(",") if isinstance(errata, str) else errata
    names = several if isinstance(several, Sequence) else [several]
    short = {name.upper(): name for name in Printed._fields}
    switches = {}
    for name in names:
        field = short.get(str(name).strip().upper().removeprefix("GSR-"))
        if field is None:
            known = ", ".join(("corrected", "as_printed", *NAMES))
            raise InputError(f"errata {name!r} is not known; choose from {known}.")
        switches[field] = 1
    if switches.get("E1") and switches.get("E1b"):
        raise InputError("errata GSR-E1 and GSR-E1b are two readings of one thing; choose one.")
    return Printed(**switches)  # type: ignore[arg-type]
