"""What the text of Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies says in numbers, and where.

Rates and times are those of a GTX 280; nothing here is one of ours. Numbers that follow from others say from which.
"""

from __future__ import annotations

from typing import NamedTuple

from refsim.experiments.registry import Rows

SIDE = 1024  # Figure 4: "at a resolution of 1024×1024"
WARP = 32  # lanes that a GTX 280 runs together
SAID_HEAVY = 19.8  # section 4: "impacting to as much as 19.8%"
SAID_CULLED_SEXTANT, SAID_CULLED_OCTANT = 16.67, 12.25  # section 2.1, percent
SAID_REDUNDANCY = 5  # section 2.1: "node redundancy is more like 5 than 6"
SAID_GAIN = (5.0, 15.0)  # section 4: "The gains of our approach range from 5% to 15%"
SAID_SMALL_SCENES = 10  # section 4: "small scenes ... offer 10 times higher framerates"


class Configuration(NamedTuple):
    """A row of Table 1; heads and cells are what `refsim.list_method` calls them."""

    order: str
    culled: bool
    heads: bool
    frustum: bool


class Rates(NamedTuple):
    """Frames, million rays and thousand million nodes a second."""

    fps: float
    mrays: float
    gnodes: float

    @property
    def nodes_per_ray(self) -> float:
        """Printed nodes a second by printed rays a second."""
        return 1000.0 * self.gnodes / self.mrays

    @property
    def rays_per_pixel(self) -> float:
        """Printed rays a second by printed frames a second, a pixel."""
        return 1e6 * self.mrays / (self.fps * SIDE * SIDE)


_TABLE_1 = """
latest last,disabled,disabled,enabled,6.81,8.43,15.02
latest last,disabled,disabled,disabled,6.81,8.43,14.54
latest last,disabled,regular,enabled,6.78,8.40,13.99
latest last,disabled,regular,disabled,6.78,8.40,16.41
latest last,enabled,disabled,enabled,6.81,8.43,13.05
latest last,enabled,disabled,disabled,6.78,8.40,14.85
latest last,enabled,regular,enabled,6.82,8.44,15.01
latest last,enabled,regular,disabled,6.81,8.43,13.92
earliest first,disabled,disabled,enabled,6.78,8.40,16.29
earliest first,disabled,disabled,disabled,6.81,8.43,13.52
earliest first,disabled,regular,enabled,6.79,8.41,15.32
earliest first,disabled,regular,disabled,6.81,8.43,14.87
earliest first,enabled,disabled,enabled,6.79,8.40,13.75
earliest first,enabled,disabled,disabled,6.78,8.40,16.17
earliest first,enabled,regular,enabled,6.81,8.43,13.39
earliest first,enabled,regular,disabled,6.81,8.43,14.65
"""


def _table_1() -> dict[Configuration, Rates]:
    rows = {}
    for line in _TABLE_1.split("\n")[1:-1]:
        order, culled, heads, frustum, *rates = line.split(",")
        settings = Configuration(order.replace(" ", "_"), culled == "enabled", heads == "regular", frustum == "enabled")
        rows[settings] = Rates(*map(float, rates))
    return rows


TABLE_1 = _table_1()

# Table 2: triangles, vertices, rates. Table 3: milliseconds of a copy and of a frame, percent
TABLE_2: dict[str, tuple[int, int, Rates]] = {
    "Cubes": (222, 124, Rates(31.36, 60.85, 70.52)),
    "Suzanne": (970, 511, Rates(22.87, 44.43, 48.20)),
    "Bunny": (69_453, 35_951, Rates(6.01, 11.52, 12.41)),
    "Happy Buddha": (293_234, 144_651, Rates(3.03, 5.69, 6.42)),
    "Dragon": (871_416, 437_649, Rates(3.20, 6.31, 6.96)),
}
TABLE_3: dict[str, tuple[float, float, float]] = {
    "Cubes": (12.6, 31.8, 39.5),
    "Suzanne": (12.7, 43.7, 29.1),
    "Bunny": (18.2, 167.0, 10.9),
    "Happy Buddha": (38.2, 329.0, 11.6),
    "Dragon": (88.5, 311.7, 28.3),
}


def published_rows() -> Rows:
    """All of it as one table: place, quantity, value, unit, origin."""
    rows: list[tuple[str, str, float | str, str, str]] = [
        ("2.1", "geometry culled, sextant list", SAID_CULLED_SEXTANT, "percent", "text"),
        ("2.1", "geometry culled, octant list", SAID_CULLED_OCTANT, "percent", "text"),
        ("2.1", "node redundancy of six lists", SAID_REDUNDANCY, "lists", "text"),
        ("4", "small scenes' frame rate against bigger ones'", SAID_SMALL_SCENES, "ratio", "text"),
        ("4", "incidence of the optimisations on nodes a ray", SAID_HEAVY, "percent", "text"),
        ("4", "gain of six lists against one, least", SAID_GAIN[0], "percent", "text"),
        ("4", "gain of six lists against one, most", SAID_GAIN[1], "percent", "text"),
    ]
    for settings, rates in TABLE_1.items():
        switches = [name for name in settings._fields[1:] if getattr(settings, name)]
        name = ", ".join([settings.order.replace("_", " "), *switches])
        rows += _rates("Table 1", name, rates)
    for scene, (triangles, vertices, rates) in TABLE_2.items():
        rows += [
            ("Table 2", f"triangles, {scene}", triangles, "triangles", "text"),
            ("Table 2", f"vertices, {scene}", vertices, "vertices", "text"),
            *_rates("Table 2", scene, rates),
        ]
    for scene, values in TABLE_3.items():
        units = (("scene copy", "ms"), ("frame rendering", "ms"), ("ratio", "percent"))
        rows += [
            ("Table 3", f"{name}, {scene}", value, unit, "text")
            for value, (name, unit) in zip(values, units, strict=True)
        ]
    return [dict(zip(("place", "quantity", "value", "unit", "origin"), row, strict=True)) for row in rows]


def _rates(place: str, name: str, rates: Rates) -> list[tuple[str, str, float | str, str, str]]:
    return [
        (place, f"frames, {name}", rates.fps, "1/s", "text"),
        (place, f"rays, {name}", rates.mrays, "million/s", "text"),
        (place, f"nodes, {name}", rates.gnodes, "thousand million/s", "text"),
        (place, f"nodes a ray, {name}", round(rates.nodes_per_ray, 1), "nodes", "nodes/s / rays/s"),
        (place, f"nodes a ray / {WARP}, {name}", round(rates.nodes_per_ray / WARP, 2), "nodes", f"the same / {WARP}"),
        (place, f"rays a pixel, {name}", round(rates.rays_per_pixel, 4), "rays", f"rays/s / (frames/s * {SIDE}^2)"),
    ]
