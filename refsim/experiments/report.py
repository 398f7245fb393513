"""report.json: all that a run found, in one file that the page, the README's table and the documents read."""

from __future__ import annotations

import json
import platform
from pathlib import Path
from typing import Any

import refsim
from refsim import doctor
from refsim.experiments.files import replace_file
from refsim.experiments.ledger import Judgement
from refsim.experiments.ledger_file import papers
from refsim.experiments.outcome import Outcome
from refsim.experiments.registry import Experiment, Rows
from refsim.experiments.runs import MISSING, PRESENT, mesh_state
from refsim.experiments.topics import TITLES, TOPICS
from refsim.scene.known import KNOWN_MESHES

FORMAT = 1
NAME = "report.json"
SAME = ("", MISSING, PRESENT, "made", "the paper's mesh")
PACKAGES = ("numpy", "numba", "scipy", "trimesh", "matplotlib")


def make_report(outcome: Outcome, judgement: Judgement) -> dict[str, Any]:
    """The report of a run; the same run gives the same report but for `machine` and timed tables."""
    return {
        "format": FORMAT,
        "version": refsim.__version__,
        "size": outcome.size,
        "complete": outcome.complete,
        "machine": machine(),
        "papers": {
            name: {"title": paper.title, "authors": paper.authors, "venue": paper.venue, "year": paper.year}
            for name, paper in papers().items()
        },
        "topics": [{"id": topic, "title": TITLES[topic]} for topic in TOPICS],
        "experiments": [
            _experiment(topic, experiment, outcome)
            for topic, own in TOPICS.items() for experiment in own if experiment.id in outcome.tables
        ],
        "ledger": judgement.entries,
        "summary": judgement.summary(),
        "in_print": judgement.summary("print"),
        "check": {"differs": judgement.differs, "not_compared": judgement.not_compared},
    }  # fmt: skip


def machine() -> dict[str, Any]:
    """What the run was made on; no names of hosts or folders."""
    processor = doctor.processor()
    return {
        "processor": processor["model"],
        "cores": processor["cores"],
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "packages": {name: doctor.installed_version(name) for name in PACKAGES},
        "meshes": sorted(name for name in KNOWN_MESHES if mesh_state(name) == PRESENT),
    }


def _experiment(topic: str, experiment: Experiment, outcome: Outcome) -> dict[str, Any]:
    tables = outcome.tables[experiment.id]
    quick = " --quick" if outcome.quick else ""
    picture = outcome.pictures.get(experiment.id)
    return {
        "id": experiment.id,
        "topic": topic,
        "title": experiment.title,
        "caption": experiment.caption,
        "alt": experiment.alt,
        "picture": picture.relative_to(outcome.out).as_posix() if picture else None,
        "command": f"refsim reproduce {topic}{quick} --only {experiment.id}",
        "timed": experiment.timed,
        "missing": _missing(tables),
        "substitutes": _substitutes(tables),
        "tables": tables,
    }


def _missing(tables: dict[str, Rows]) -> list[str]:
    """Scenes that the rows name and lack."""
    names = [
        str(row.get("published_scene") or row.get("row") or row.get("scene") or "")
        for rows in tables.values() for row in rows if MISSING in row.values()
    ]  # fmt: skip
    return sorted({name for name in names if name})


def _substitutes(tables: dict[str, Rows]) -> dict[str, str]:
    """The paper's scene -> ours, where rows name both and say that another one stands in for it."""
    found = {}
    for rows in tables.values():
        for row in rows:
            theirs, ours = str(row.get("published_scene", "")), str(row.get("scene", ""))
            how = str(row.get("substitute", "")) or str(row.get("mesh", ""))
            if theirs and ours and how not in SAME:
                found[theirs] = f"{ours} ({how})"
    return dict(sorted(found.items()))


def write_report(out: Path, report: dict[str, Any]) -> Path:
    """Write report.json whole: readable, and the same bytes for the same report."""
    text = json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return replace_file(out / NAME, lambda part: part.write_text(text, encoding="utf-8", newline="\n"))


def read_report(path: Path) -> dict[str, Any]:
    """A report that `write_report` wrote."""
    report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return report
