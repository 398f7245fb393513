"""The papers' graphics cards: published peak rates, and what they say a unit of work must cost at least.

A peak is a bound, not a measurement: no texel comes faster than the texture units' clock allows, no byte faster than
the memory's. Bounds are of work that nothing else hides. Peaks are those of the makers' reference boards, as reviews of
the time print them; a peak that is nowhere printed is clock × units, and its source says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from refsim.experiments.registry import Rows

# What a unit of each counter needs at the very least: how much of which peak
NEEDS: dict[str, dict[str, tuple[str, float]]] = {
    # gsr-table-2's fetches are cells + 5 × tests: a texel a cell, five a triangle test
    "gsr": {
        "cells": ("texels", 1.0), "triangle_tests": ("texels", 5.0), "rays": ("operations", 1.0),
        "secondary_rays": ("operations", 1.0), "ray_bytes": ("bytes", 1.0),
    },
    # A node is a texel of its escape index and one of its sphere or indices (section 2.1)
    "bsh": {
        "nodes": ("texels", 2.0), "lane_steps": ("operations", 1.0), "rays": ("operations", 1.0),
        "memory_bytes": ("bytes", 1.0), "copied_bytes": ("link_bytes", 1.0),
    },
    "hre": {"triangle_tests": ("fragments", 1.0), "cone_tests": ("vertices", 1.0)},
}  # fmt: skip


@dataclass(frozen=True)
class Device:
    """A card; peaks a second."""

    name: str
    paper: str
    peaks: Mapping[str, float]
    source: str
    note: str = ""
    links: tuple[str, ...] = field(default=())

    def least_ms(self, counter: str) -> float:
        """Milliseconds that a unit of a counter costs at least; 0 where no peak bounds it."""
        need = NEEDS[self.paper].get(counter)
        return 1e3 * need[1] / self.peaks[need[0]] if need and need[0] in self.peaks else 0.0


DEVICES = {
    "hre": Device(
        "NV6800GT", "hre",
        {"fragments": 16 * 350e6, "vertices": 525e6, "texels": 5.6e9, "bytes": 32.0e9},
        "16 pixel pipelines at 350 MHz, 256-bit memory at 2 x 500 MHz (Guru3D's review); 525 million vertices/s "
        "(data-base entries of the NV40, 6800 GT)",
        "a fragment of one instruction a pipeline and clock",
        ("https://www.guru3d.com/articles-pages/geforce-6800-gt-pci-express,3.html",),
    ),
    "gsr": Device(
        "GeForce 8600", "gsr",
        {"operations": 32 * 1.45e9, "texels": 10.8e9, "bytes": 32.0e9},
        "32 stream processors at 1.45 GHz, 10.8 G texels/s, 32 GB/s: the GTS (PCStats', TechSpot's reviews)",
        "the paper does not say which 8600; the GT (1.19 GHz, 8.6 G texels/s, 22.4 GB/s) is slower, so the GTS's "
        "peaks bound both",
        ("https://pcstats.com/articles/2105/2.html", "http://www.techspot.com/review/51-nvidia-geforce-8600/page2.html"),
    ),
    "gsr, Table 1": Device(
        "GTX 260", "gsr",
        {"operations": 192 * 1.242e9, "texels": 36.9e9, "bytes": 111.9e9},
        "192 stream processors at 1.242 GHz, 36.9 G texels/s, 111.9 GB/s (HotHardware's review)",
        "the paper prints shares of its instructions, no time",
        ("https://hothardware.com/reviews/nvidia-geforce-gtx-280-and-gtx-260-unleashed?page=3",),
    ),
    "bsh": Device(
        "GTX 280", "bsh",
        {"operations": 240 * 1.296e9, "texels": 48.2e9, "bytes": 141.7e9, "link_bytes": 8.0e9},
        "240 stream processors at 1.296 GHz, 48.2 G texels/s, 141.7 GB/s (HotHardware's review); PCI Express 2.0 × 16",
        "an operation a processor and clock",
        ("https://hothardware.com/reviews/nvidia-geforce-gtx-280-and-gtx-260-unleashed?page=3",),
    ),
}  # fmt: skip


def device_rows() -> Rows:
    """A row a card and peak."""
    return [
        {"device": card.name, "peak": name, "millions_per_second": round(rate / 1e6, 3), "source": card.source,
         "note": card.note, "links": " ".join(card.links)}
        for card in DEVICES.values() for name, rate in card.peaks.items()
    ]  # fmt: skip
