"""What the text of Recursive Ray Tracing in Geometry Shader says in numbers, each with its place in the paper.

Times are milliseconds of an NVIDIA card of 2007 or 2008; nothing here is one of ours. Figure 4b's bars are in a picture
that the text does not hold, of the benchmark of Table 3, whose numbers stand here.
"""

from __future__ import annotations

from refsim.experiments.registry import Rows

SIDE = 512  # "All images are ray traced in 512×512 viewport"
RECORD_BYTES = 64  # section 4: "which is 64 bytes in our case"
LARGEST_GENERATIONS = (2, 1)  # Figure 4a's G and G'
SAID_BUFFER_MBYTES = 48  # Figure 4a: "= 48 Mbytes"
SAID_SLOWER = (2, 3)  # section 6: "performs 2-3 times worse than the fragment shader"

MODES = ("RC", "SC", "RT")  # ray casting, shadow casting, shadow casting with single reflections
SHADERS = ("vertex", "geometry", "fragment")

# Table 1: percent of the executed instructions, RC / SC / RT; None where it prints NA
TABLE_1: dict[str, tuple[int, dict[str, tuple[float | None, ...]]]] = {
    "room": (12, {"vertex": (67.43, 48.07, 54.73), "geometry": (1.14, 5.15, 5.05), "fragment": (31.51, 46.79, 40.21)}),
    "cornell_box": (
        36,
        {"vertex": (85.34, 77.43, 72.70), "geometry": (0.50, 2.47, 2.68), "fragment": (14.14, 20.16, 24.62)},
    ),
    "knight_in_box": (
        646,
        {"vertex": (99.20, 98.51, None), "geometry": (0.03, 0.18, None), "fragment": (0.76, 1.32, None)},
    ),
}

# Table 2: million rays a second, milliseconds; 512² rays, the torus knot of 1,024 triangles
TABLE_2: dict[str, tuple[float, float]] = {
    "pass-through geometry shader": (3.322484, 78.9),
    "no geometry shader": (4.890746, 53.6),
    "fragment shader": (10.485760, 25.0),
}

# Table 3 (and Figure 4b): milliseconds RC, SC, RT of "our method" and of "previous"
TABLE_3: dict[str, tuple[int, tuple[float, float, float], tuple[float, float, float]]] = {
    "Cornell Box": (36, (64.4, 213, 353), (17.5, 48.5, 119)),
    "Cornell Knot": (1_024, (104, 381, 664), (26.8, 75.3, 222)),
    "Dragon": (871_414, (481, 824, 2284), (149, 327, 1334)),
    "Fairy Forest": (174_117, (926, 1512, 2314), (590, 712, 1623)),
    "Happy Buddha": (1_087_716, (1283, 1390, 1497), (777, 708, 1082)),
    "Horse": (96_966, (526, 714, 878), (211, 312, 594)),
    "Stanford Bunny": (69_451, (295, 419, 529), (109, 182, 381)),
}


def buffer_bytes() -> int:
    """S_VB of Figure 4a: w · h · (G + G') · 64."""
    return SIDE * SIDE * sum(LARGEST_GENERATIONS) * RECORD_BYTES


def rate_of(milliseconds: float) -> float:
    """Million rays a second that 512² rays in so many milliseconds are."""
    return SIDE * SIDE / milliseconds / 1e3


def share(scene: str, shader: str, mode: str) -> float | None:
    """Table 1's percentage."""
    return TABLE_1[scene][1][shader][MODES.index(mode)]


def milliseconds(scene: str, mode: str, ours: bool) -> float:
    """Table 3's time of the paper's method (`ours`) or of the previous one."""
    _, our_method, previous = TABLE_3[scene]
    return (our_method if ours else previous)[MODES.index(mode)]


def published_rows() -> Rows:
    """All of it as one table: place, quantity, value, unit."""
    side = f"{SIDE} * {SIDE}"
    rows: list[tuple[str, str, float | str, str, str]] = [
        ("Figure 4a", "S_VB, said", SAID_BUFFER_MBYTES, "MiB", "text"),
        ("Figure 4a", "S_VB, computed", buffer_bytes() / 2**20, "MiB", f"{side} * (2 + 1) * {RECORD_BYTES} / 2^20"),
    ]
    for scene, (_, shares) in TABLE_1.items():
        rows += [
            ("Table 1", f"{shader} shader, {scene}, {mode}", "NA" if value is None else value, "percent", "text")
            for shader, values in shares.items()
            for mode, value in zip(MODES, values, strict=True)
        ]
    for name, (rate, time) in TABLE_2.items():
        rows += [
            ("Table 2", f"rays, {name}", rate, "million/s", "text"),
            ("Table 2", f"time, {name}", time, "ms", "text"),
            ("Table 2", f"rays from the time, {name}", round(rate_of(time), 6), "million/s", f"{side} / {time} ms"),
        ]
    for scene, (_, ours, previous) in TABLE_3.items():
        rows += [
            ("Table 3", f"{method}, {scene}, {mode}", value, "ms", "text")
            for method, values in (("our method", ours), ("previous", previous))
            for mode, value in zip(MODES, values, strict=True)
        ]
    return [dict(zip(("place", "quantity", "value", "unit", "origin"), row, strict=True)) for row in rows]
