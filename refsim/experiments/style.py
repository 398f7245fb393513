"""One look for all figures: colours that colour-blind readers can tell apart, sizes that stay readable at README width.

matplotlib is imported when a figure is made, never with the package; figures are made without pyplot, so no backend
or window is involved and nothing global is changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

DPI = 150
WIDTH = 8.0  # inches; 1,200 pixels

# Okabe and Ito 2008
BLUE, VERMILION, GREEN, ORANGE, SKY, PURPLE, BLACK = (
    "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9", "#CC79A7", "#000000",
)  # fmt: skip
CYCLE = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
MARKERS = ("o", "s", "^", "D", "v", "P")
INK = "#222222"
FAINT = "#8a8a8a"

RC = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "lines.linewidth": 1.8,
    "lines.markersize": 5.0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "hatch.linewidth": 0.6,
}


@contextmanager
def styled() -> Iterator[None]:
    """The style, for as long as a figure is made and saved."""
    import matplotlib

    options: Any = RC
    with matplotlib.rc_context(options):
        yield


def new_figure(height: float, width: float = WIDTH, **options: Any) -> Any:
    """An empty figure of `width` × `height` inches, laid out so that nothing overlaps."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), **{"layout": "constrained", **options})
    FigureCanvasAgg(figure)
    return figure


def no_frame(axes: Any) -> None:
    """An axes that holds a picture: no ticks, no grid, no lines around it."""
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(False)


def count_ticks(axis: Any) -> None:
    """Large numbers as 10k, 2M, 3G."""
    from matplotlib.ticker import EngFormatter, NullFormatter

    axis.set_major_formatter(EngFormatter(sep=""))
    axis.set_minor_formatter(NullFormatter())


def plain_ticks(axis: Any) -> None:
    """A logarithmic axis with 1, 2, 5, 10, 20, … written out."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullLocator

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FormatStrFormatter("%g"))


def body_name(scene: str) -> str:
    """`torus_knot_1024` -> `torus knot`."""
    head, _, tail = scene.rpartition("_")
    return (head if tail.isdigit() and head else scene).replace("_", " ")
