"""Options of `refsim render`, and what their values look like on a command line.

Options of a method are handed on as they are, if and only if they were given: defaults and checks live with the
methods.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


class Size(click.ParamType):
    """``256`` or ``320x240``: width and height in pixels. How large is too large is for the camera to say."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        numbers = value.lower().split("x")
        try:
            width, height = (int(n) for n in (numbers * 2 if len(numbers) == 1 else numbers))
        except ValueError:
            self.fail(f"{value!r} is not a size such as 256 or 320x240", param, ctx)
        if width < 1 or height < 1:
            self.fail(f"{value!r} has no pixels; give a size such as 256 or 320x240", param, ctx)
        return width, height


class Place(click.Path):
    """A file or folder to write. An empty name, which Python takes for the working folder, is none."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "":
            self.fail("an empty name is no place to write to; the folder that you are in is '.'", param, ctx)
        return super().convert(value, param, ctx)


class Vector(click.ParamType):
    """``x,y,z``."""

    name = "x,y,z"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float]:
        try:
            x, y, z = (float(n) for n in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not three numbers x,y,z", param, ctx)
        return x, y, z


class Cells(click.ParamType):
    """``32`` or ``32x16x8``: cells along the longest axis, or along each."""

    name = "cells"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | tuple[int, ...]:
        try:
            cells = tuple(int(n) for n in value.lower().split("x"))
        except ValueError:
            self.fail(f"{value!r} is not a number of cells such as 32 or 32x16x8", param, ctx)
        return cells[0] if len(cells) == 1 else cells


class Rows(click.ParamType):
    """``968`` or ``968,2000``: rows of the scene's triangles."""

    name = "rows"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(int(n) for n in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not a row number such as 968 or a list such as 968,2000", param, ctx)


METHOD_OPTIONS = (
    click.option("--generations", type=int, metavar="N", help="Length of a path, the eye ray included."),
    click.option("--ior", type=float, metavar="X", help="Index of refraction of glass."),
    click.option("--material", metavar="NAME", help="glass, mirror or diffuse, for every triangle."),
    click.option("--environment", metavar="NAME|FILE", help="What rays that leave see, in the ray engines."),
    click.option("--facing", metavar="WHICH", help="both or front: the sides of a triangle that are hit."),
    click.option("--shading", metavar="NORMAL", help="geometric or smooth."),
    click.option("--view", type=Vector(), help="Direction from the scene's centre to the camera."),
    click.option("--fov", type=float, metavar="DEGREES", help="Vertical field of view."),
    click.option("--fill", type=float, metavar="X", help="Distance, as a share of that which shows the whole scene."),
    click.option("--tile-size", type=int, metavar="N", help="Side of a tile of rays, in pixels."),
    click.option("--submission", metavar="ORDER", help="tile or primitive."),
    click.option("--early-tests", metavar="POLICY", help="ideal, mesa, none or forced."),
    click.option("--passes", type=int, metavar="P", help="Rendering passes: depth of the ray tree, shadows included."),
    click.option("--acceleration", metavar="NAME", help="grid, naive or bvh."),
    click.option("--resolution", type=Cells(), metavar="N|NxNxN", help="Cells of the grid."),
    click.option("--lights", type=int, metavar="N", help="How many of the scene's lights; 0: none."),
    click.option("--shadows/--no-shadows", default=None, help="Whether hits send rays to the lights."),
    click.option("--reflections/--no-reflections", default=None, help="Whether hits send on reflected rays."),
    click.option("--refractions/--no-refractions", default=None, help="Whether glass sends on refracted rays."),
    click.option("--background", type=Vector(), metavar="R,G,B", help="What rays that leave see."),
    click.option("--color-format", metavar="FORMAT", help="rgba32float or rgba8unorm."),
    click.option("--stages", metavar="WHICH", help="vertex, vertex_only or geometry: where rays are intersected."),
    click.option("--primary", metavar="WHICH", help="rays or raster: how the first hits are found."),
    click.option("--emission-order", metavar="ORDER", help="listed, reflected_first or reversed."),
    click.option("--capacity", type=int, metavar="N", help="Records that a vertex buffer holds."),
    click.option("--lists", type=int, metavar="N", help="1, 2, 6 or 8 traversal lists."),
    click.option("--order", metavar="POLICY", help="earliest_first or latest_last: how a list's siblings are sorted."),
    click.option("--culling", metavar="RULE", help="sextant_opposite, sextant_same, sextant_safe or octant."),
    click.option("--heads", metavar="KIND", help="simple or regular: per-polygon heads of the lists."),
    click.option("--screen-cells", type=int, metavar="N", help="Heads for N x N cells of the picture."),
    click.option("--head-rule", metavar="RULE", help="leaf or climb: which element becomes a head."),
    click.option("--packet/--no-packet", default=None, help="Whether 256 rays walk a list together."),
    click.option("--threshold", type=float, metavar="X", help="How big a triangle is that stays at its node, 0 to 1."),
    click.option("--layers", type=Rows(), metavar="ROW,...", help="Rows at which further layers of lists begin."),
    click.option("--stage", metavar="STAGE", help="fragment or vertex: lists walked in a shader of the pipeline."),
    click.option("--errata", metavar="WHICH", help="corrected, as_printed, or names such as GSR-E8, with commas."),
    click.option("--backend", metavar="NAME", help="numba or numpy."),
    click.option("--threads", type=int, metavar="N", help="Threads to run on."),
)


def method_options(command: Command) -> Command:
    """Add :data:`METHOD_OPTIONS`, in their order."""
    for option in reversed(METHOD_OPTIONS):
        command = option(command)
    return command
