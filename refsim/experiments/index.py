"""The index of a topic: what there is, and how to read it."""

from __future__ import annotations

from pathlib import Path

from refsim.experiments.files import replace_file
from refsim.experiments.outcome import Outcome
from refsim.experiments.registry import Experiment
from refsim.experiments.topics import INDICES, TITLES


def write_index(topic: str, wanted: list[Experiment], tables: dict[str, list[Path]], outcome: Outcome) -> Path:
    """Write the index of the topic's experiments; `tables` holds the tables of each."""
    size = " --quick" if outcome.quick else ""
    made = f"Made by `refsim reproduce {topic}{size}`" + (": smaller than the full ones." if outcome.quick else ".")
    lines = [f"# {TITLES[topic]}: figures and tables", "", made, ""]
    for experiment in wanted:
        lines += [f"## {experiment.title}", ""]
        if experiment.id in outcome.pictures:
            lines += [f"![{experiment.title}]({_link(outcome.pictures[experiment.id], outcome)})", ""]
        links = sorted(_link(path, outcome) for path in tables[experiment.id])
        files = ", ".join(f"[{link}]({link})" for link in links)
        alone = f"`refsim reproduce {topic}{size} --only {experiment.id}`"
        lines += [experiment.caption, "", f"Data: {files}. Alone: {alone}.", ""]
    text = "\n".join(lines)
    return replace_file(outcome.out / INDICES[topic], lambda part: part.write_text(text, encoding="utf-8"))


def _link(path: Path, outcome: Outcome) -> str:
    return path.relative_to(outcome.out).as_posix()
