"""What the text of The Hierarchical Ray Engine says in numbers, and what follows from it by arithmetic (section 7.1).

Figure 7's points are in a picture that the text does not hold; none of them is here.
"""

from __future__ import annotations

from refsim.experiments.registry import Rows

SIDE, TRIANGLES, ITERATIONS = 256, 5000, 2  # "With 256×256 pixels, 5000 triangles, 2 iterations"
FPS = {"ray engine": 0.23, "hierarchical": 3.0}  # "an FPS of 0.23", "achieving 3 FPS"
SAID_TESTS = {"ray engine": 150e6, "hierarchical": 2e9}  # "150M intersections per second", "this figure reaches 2G"
SAID_DIGITS = {"ray engine": 2, "hierarchical": 1}  # of these that count
LAST_DIGIT = {"ray engine": 0.01, "hierarchical": 1.0}  # of the frame rates
SAID_SPEEDUP = 15.0  # section 8: "a relative speedup of 15"
SAID_AT_100 = 2.0  # "already at a triangle count of 100, the new algorithm runs twice as fast"

TESTS_PER_FRAME = SIDE * SIDE * TRIANGLES * ITERATIONS
TESTS_PER_SECOND = {engine: TESTS_PER_FRAME * fps for engine, fps in FPS.items()}
SPEEDUP = FPS["hierarchical"] / FPS["ray engine"]


def to_said_digits(engine: str) -> float:
    """The product, with as many digits as the text gives."""
    return float(f"{TESTS_PER_SECOND[engine]:.{SAID_DIGITS[engine] - 1}e}")


def speedup_allowed() -> tuple[float, float]:
    """The quotients of all rates that round to the two."""
    low, high = ({name: FPS[name] + side * LAST_DIGIT[name] / 2 for name in FPS} for side in (-1, 1))
    return low["hierarchical"] / high["ray engine"], high["hierarchical"] / low["ray engine"]


def published_rows() -> Rows:
    """The text's numbers as a table: quantity, value, unit, how it comes about."""
    frame = f"{SIDE} * {SIDE} * {TRIANGLES} * {ITERATIONS}"
    rates = [
        (f"tests per second, {engine}", round(rate), "tests/s", f"{frame} * {FPS[engine]}")
        for engine, rate in TESTS_PER_SECOND.items()
    ]
    shown = [(f"frames per second, {engine}, {TRIANGLES} triangles", fps, "frames/s") for engine, fps in FPS.items()]
    said = [
        (f"tests per second, {engine}, to the digits said", to_said_digits(engine), "tests/s", "the product, rounded")
        for engine in FPS
    ]
    lines = [
        *((*line, "text") for line in shown),
        *rates,
        *said,
        ("speed-up, from the frame rates", round(SPEEDUP, 2), "1", f"{FPS['hierarchical']} / {FPS['ray engine']}"),
        *((f"speed-up, {side} that rates rounding to these have", round(value, 2), "1", "the rates' last digits")
          for side, value in zip(("least", "most"), speedup_allowed(), strict=True)),
        ("speed-up, as said in section 8", SAID_SPEEDUP, "1", "text"),
        ("speed-up at 100 triangles, as said", SAID_AT_100, "1", "text"),
    ]
    return [dict(zip(("quantity", "value", "unit", "origin"), line, strict=True)) for line in lines]
