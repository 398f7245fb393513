"""A small report with all that a page must show, and three pictures of three kinds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from refsim.experiments.ledger_rules import HARDWARE, MISSING_MESH, NOT_MEASURED, UNSAID

LINE = {"section": "3", "body": "blob_1000", "rule": "at most 20 percent are kept", "verdict": "holds"}
SETTINGS = [
    {"parameter": "camera", "setting": "front", "value": 1.2345678, "holds": "yes", "unit": "times"},
    {"parameter": "camera", "setting": "far & <near>", "value": 0.5, "holds": "no", "unit": "times"},
    {"parameter": "index", "setting": "1.33", "value": 4.625, "holds": "yes", "unit": "times"},
]
BARE = {
    "kind": "statement", "basis": "run", "item": "",
    "says": "it is so", "experiment": "", "table": "", "where": {}, "printed": None,
    "unit": "", "measured": "nothing", "evidence": [], "missing": 0, "rule": "only the paper's machine shows it",
    "tolerance": 0.0, "reason": "", "open": [], "erratum": "", "why": "so", "command": "", "sensitivity": None,
}  # fmt: skip


def entry(name: str, place: str, verdict: str, **parts: Any) -> dict[str, Any]:
    """An entry of the ledger."""
    return {**BARE, "id": name, "paper": name.partition(".")[0], "place": place, "verdict": verdict, **parts}


def experiment(name: str, topic: str, title: str, **parts: Any) -> dict[str, Any]:
    """An experiment with one table of two rows."""
    rows = [{"scene": "blob_1000", "nodes_per_ray": 12.345}, {"scene": "room", "nodes_per_ray": 1234567}]
    return {
        "id": name, "topic": topic, "title": title, "alt": f"Bars of {name}",
        "caption": f"Rays of `{name}`, 64² & more.", "picture": f"{name}.png", "timed": False, "missing": [],
        "command": f"refsim reproduce {topic} --only {name}", "substitutes": {}, "tables": {name: rows}, **parts,
    }  # fmt: skip


def ledger() -> list[dict[str, Any]]:
    """Entries of every verdict, kind and way to be shown."""
    seen = {
        "experiment": "figure-7",
        "table": "figure-7",
        "where": {"scene": "room"},
        "command": "refsim reproduce hre",
    }
    lines = {"experiment": "claims-hre", "table": "claims-hre", "rule": "every line of the table of verdicts holds"}
    sensitivity = {
        "headline": "saving", "holds": 2, "of": 3, "least": 0.5, "most": 4.625, "unit": "times", "settings": SETTINGS,
        "only_at": "",
    }  # fmt: skip
    beside = {"printed": "@published", "evidence": [[12.5, 25.0], [30, 40]], "measured": "× 0.5 to 0.75 (2 values)"}
    return [
        entry("hre.figure-7", "Figure 7", "reproduced", kind="figure", item="Figure 7", **seen),
        entry("hre.tests", "section 7", "trend reproduced", kind="number", printed=150000000.0, unit="tests/s",
              measured="1.507e+08", tolerance=0.02, reason="two digits", sensitivity=sensitivity, **seen),
        entry("hre.course", "section 9", "reproduced", item="Figure 7, course", basis="print"),
        entry("hre.text", "section 3", "reproduced", where={"section": "3"}, measured="1 holds", **lines),
        entry("hre.equation", "section 4", "corrected", kind="equation", erratum="HRE-E2", says="x_new < e & r"),
        entry("hre.rate", "section 8", HARDWARE, kind="number", printed=0.23, unit="frames/s"),
        entry("gsr.table-1", "Table 1", "contradicted", kind="table", item="Table 1, room", unit="percent", **beside),
        entry("gsr.mesh", "Table 1", MISSING_MESH, missing=2),
        entry("gsr.listing", "Listing 3", "corrected", kind="listing", erratum="GSR-E10"),
        entry("gsr.other", "Listing 3", "corrected", kind="listing", erratum="GSR-E2"),
        entry("bsh.open", "section 2", UNSAID, open=["which camera"], why="the paper does not say which camera"),
        entry("bsh.never", "section 5", NOT_MEASURED, printed=[5, 15], unit="percent"),
    ]  # fmt: skip


def make_report() -> dict[str, Any]:
    """A report of a full run."""
    entries = ledger()
    papers = {"hre": ("Ray Engine", 2006), "gsr": ("Geometry Shader", 2010), "bsh": ("Spheres", 2010)}
    counts: dict[str, dict[str, int]] = {paper: {} for paper in papers}
    for one in entries:
        own = counts[one["paper"]]
        own[one["verdict"]] = own.get(one["verdict"], 0) + 1
    packages = {"numpy": "2.4.6", "numba": "0.68.1"}
    return {
        "format": 1, "version": "0.1.0", "size": "full", "complete": True,
        "machine": {"processor": "AMD EPYC", "cores": 2, "python": "3.11.7", "platform": "Linux x86_64",
                    "packages": packages, "meshes": ["bunny"]},
        "papers": {p: {"title": t, "authors": "A. Author", "venue": "Here", "year": y} for p, (t, y) in papers.items()},
        "topics": [*({"id": p, "title": t} for p, (t, _) in papers.items()), {"id": "across", "title": "Across"}],
        "experiments": [
            experiment("cover", "hre", "The picture of the README"),
            experiment("figure-7", "hre", "Both engines", missing=["Fairy"], substitutes={"Buddha": "buddha_100k"}),
            experiment("claims-hre", "hre", "Claims", picture=None, alt="", tables={
                "claims-hre": [{**LINE, "claim": "few are kept", "measured": "12 percent"}]}),
            experiment("gsr-table-1", "gsr", "Table 1: shaders"),
            experiment("speed", "across", "By the clock", timed=True, picture="timings/speed.png"),
        ],
        "ledger": entries,
        "summary": counts,
        "in_print": {paper: {"reproduced": 1} if paper == "hre" else {} for paper in papers},
        "check": {"differs": [], "not_compared": []},
    }  # fmt: skip


def draw_pictures(out: Path, report: dict[str, Any], size: tuple[int, int] = (96, 48)) -> None:
    """A picture for each experiment: half of them with transparency or a palette."""
    across = np.linspace(0, 255, size[0], dtype=np.uint8)
    for place, one in enumerate(e for e in report["experiments"] if e["picture"]):
        values = np.zeros((size[1], size[0], 4), np.uint8)
        values[..., place % 3], values[..., 3] = across, 255 - across // 2
        mode = ("RGBA", "RGB", "P")[place % 3]
        (out / one["picture"]).parent.mkdir(exist_ok=True)
        Image.fromarray(values).convert(mode).save(out / one["picture"])
