"""What the paper's own numbers and listings say of each other, each judged by a rule in code; nothing is run.

Used by `gsr_claims`, which says what a verdict is. Recursive Ray Tracing in Geometry Shader, sections 4 to 6, Tables 2
and 3, Listings 1, 3 to 5.
"""

from __future__ import annotations

from refsim.experiments import gsr_published as published
from refsim.experiments.registry import Row, Rows
from refsim.experiments.verdicts import claim

# Frames a second that a picture "at interactive rates" may need: choices of ours
INTERACTIVE, SLOW = 10.0, 1.0
FIGURE_1 = (("Dragon", "SC"), ("Horse", "RT"), ("Cornell Knot", "RT"))  # its scenes, and Table 3's
# Of Listing 1 and of the constructors in Listings 3 to 5
HIT_MEMBERS = ("pos", "orig", "dir", "uv", "t", "idx", "state", "type")
HIT_BUILT = ("u", "v", "t", "idx")
# What Listing 5 writes
COLORS = (
    "vec4(backgroundColor.rgb, 0.0)", "vec4(diffuse * NdotL, 1.0)", "vec4(-1,-1,-1, 0.0)",
    "vec4(diffuse*NdotL *0.25 1.0)",
)  # fmt: skip
HIGHLIGHT = ("pow(", "specular", "NdotH", "RdotV", "reflect(")
FIXED_ORDER, CITED = 4.2, 4.1  # the section that fixes the order of emission, and the one that 4.3 cites for it


def span(values: list[float]) -> str:
    """The least and the largest; one number where they look the same."""
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def all_or_some(answers: list[bool]) -> bool | None:
    """Whether all hold; None where some do."""
    return True if all(answers) else None if any(answers) else False


def table_2_time(name: str) -> float:
    """Milliseconds of a set-up of the pipeline."""
    return published.TABLE_2[name][1]


def of_methods() -> list[float]:
    """Table 3's times of the paper's method by those of the previous one, every scene and mode."""
    return [
        published.milliseconds(scene, mode, True) / published.milliseconds(scene, mode, False)
        for scene in published.TABLE_3 for mode in published.MODES
    ]  # fmt: skip


def print_claims() -> Rows:
    """All of them."""
    return [*_sizes_and_rates(), *_slower(), *_listings()]


def _sizes_and_rates() -> Rows:
    computed = published.buffer_bytes() / 2**20
    found = [
        claim(
            "4a", f"S_VB = 512 * 512 * (2 + 1) * 64 bytes = {published.SAID_BUFFER_MBYTES} Mbytes", "text",
            "the product is that many MiB", f"{computed:g} MiB", computed == published.SAID_BUFFER_MBYTES,
        )
    ]  # fmt: skip
    for name, (rate, time) in published.TABLE_2.items():
        shot = published.rate_of(time)
        found.append(
            claim(
                "Table 2", f"{rate:g} million rays a second, {name}", "text",
                "512 * 512 rays in the milliseconds printed beside, to the digits of the rate, cut or rounded",
                f"{shot:.6f} million/s", abs(shot - rate) < 1e-6,
            )
        )  # fmt: skip
    rates = [1e3 / published.milliseconds(scene, mode, True) for scene, mode in FIGURE_1]
    good = [True if rate >= INTERACTIVE else None if rate >= SLOW else False for rate in rates]
    found.append(
        claim(
            "Figure 1", "its pictures are made at interactive rates", "text",
            f"Table 3's times of its scenes are at least {INTERACTIVE:g} frames a second; depends from {SLOW:g}",
            f"{span(rates)} frames a second", True if all(good) else False if False in good else None,
        )
    )  # fmt: skip
    return found


def _slower() -> Rows:
    least, most = published.SAID_SLOWER
    fragment, alone, passing = (
        table_2_time(name) for name in ("fragment shader", "no geometry shader", "pass-through geometry shader")
    )
    quotients = of_methods()
    within = [least <= q <= most for q in quotients]
    rounded = [least <= round(q) <= most for q in quotients]
    return [
        claim(
            "6", "the vertex shader even without a geometry shader performs 2-3 times worse", "text",
            f"the quotient of Table 2's times is within {least} and {most}", f"{alone / fragment:.2f}",
            least <= alone / fragment <= most,
        ),
        claim(
            "4b", "2-3 fold worse performance than the previous work", "text",
            f"every quotient of Table 3's times is within {least} and {most}; depends where some are",
            f"{span(quotients)}; {sum(within)} of {len(within)} are, {sum(rounded)} round to {least} or {most}",
            all_or_some(within),
        ),
        claim(
            "6", "using the vertex shader for intersection is slower than using the pixel shader", "text",
            "every time of Tables 2 and 3 is longer than the one beside it",
            f"{span([*quotients, alone / fragment])} times", all(q > 1.0 for q in [*quotients, alone / fragment]),
        ),
        claim(
            "6", "the geometry shader has some overhead", "text", "Table 2's time with it is longer than without",
            f"{passing / alone:.2f} times", passing > alone,
        ),
        _shares_that_bind(),
    ]  # fmt: skip


def _shares_that_bind() -> Row:
    shares = [published.share(scene, "vertex", mode) for scene in published.TABLE_1 for mode in published.MODES]
    known = [share for share in shares if share is not None]
    return claim(
        "5", "with naive intersection computation is limited by the vertex shader", "text",
        "more than half of the instructions are the vertex shader's in every scene and mode; depends where in some",
        f"{span(known)} percent; more than half in {sum(share > 50 for share in known)} of {len(known)}",
        all_or_some([share > 50.0 for share in known]),
    )  # fmt: skip


def _listings() -> Rows:
    highlights = [word for word in HIGHLIGHT if any(word in color for color in COLORS)]
    return [
        claim(
            "4.2", "colour is calculated by the Phong shading model", "Listing 5",
            "a colour that Listing 5 writes has a highlight", f"{len(highlights)} of {len(COLORS)}: only N · L",
            bool(highlights),
        ),
        claim(
            "Listing 1", "Listing 1's Hit is the one that Listings 3 to 5 build", "Listings 1, 3, 4 and 5",
            "as many members as the constructor takes", f"{len(HIT_MEMBERS)} members; built of {len(HIT_BUILT)}",
            len(HIT_MEMBERS) == len(HIT_BUILT),
        ),
    ]  # fmt: skip
