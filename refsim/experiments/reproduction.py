"""Runs experiments: measures what is not yet measured, writes tables and pictures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from refsim.errors import InputError
from refsim.experiments import style
from refsim.experiments.files import (
    Journal,
    csv_text,
    figure_key,
    make_folder,
    replace_file,
    write_csv,
    write_figure,
)
from refsim.experiments.fingerprint import plot_key, rows_key
from refsim.experiments.registry import Experiment, Rows
from refsim.experiments.topics import INDICES, TITLES, experiments_of

if TYPE_CHECKING:
    from refsim.progress import Advance, Progress

@contextmanager
def _silent(total: float | None, description: str) -> Iterator[Advance]:
    """Reports nothing."""
    yield lambda steps=1: None


def reproduce(
    topic: str,
    *,
    quick: bool = False,
    only: str | None = None,
    out: Path = Path("figures"),
    progress: Progress | None = None,
) -> Iterator[Path]:
    """Make the topic's figures and tables in the folder `out`; yields each file as soon as it is written.

    `quick` takes smaller sizes, `only` one experiment. Raises `InputError` at once for a topic or experiment that does
    not exist, and for a folder that cannot be written.
    """
    known = experiments_of(topic)
    if only is not None and only not in known:
        raise InputError(f"there is no figure or table {only!r} of {topic!r}; choose from {', '.join(known)}.")
    wanted = list(known.values()) if only is None else [known[only]]
    make_folder(out)
    return _files(known, wanted, quick, out, progress or _silent, topic if only is None else None)


def _files(
    known: dict[str, Experiment],
    wanted: list[Experiment],
    quick: bool,
    out: Path,
    progress: Progress,
    index: str | None,
) -> Iterator[Path]:
    measured: dict[str, Rows] = {}

    def rows_of(experiment: Experiment) -> Rows:
        if experiment.id not in measured:
            measured[experiment.id] = measure_cases(experiment, quick, out, progress)
        return measured[experiment.id]

    for experiment in wanted:
        rows = rows_of(experiment)
        others = {name: rows_of(known[name]) for name in experiment.needs}
        for stem, table in experiment.tables_of(rows, others).items():
            yield write_csv(out / f"{stem}.csv", table)
        if experiment.plot is not None:
            with progress(None, f"{experiment.id}: drawing"):
                path = draw_figure(experiment, rows, out)
            yield path
    if index is not None:
        yield write_index(index, wanted, out, quick)


def measure_cases(experiment: Experiment, quick: bool, out: Path, progress: Progress) -> Rows:
    """Rows of all cases in order; those in the journal are not measured again."""
    cases = experiment.cases(quick)
    journal = Journal(out, experiment.id, rows_key(experiment))
    rows: Rows = []
    with progress(len(cases), experiment.id) as advance:
        for case in cases:
            name = json.dumps(case, sort_keys=True)
            if name not in journal.cases:
                journal.keep(name, experiment.measure(**case))
            rows += journal.cases[name]
            advance(1)
    return rows


def draw_figure(experiment: Experiment, rows: Rows, out: Path) -> Path:
    """The picture of the rows, drawn unless it is there already."""
    assert experiment.plot is not None
    path = out / f"{experiment.id}.png"
    key = plot_key(experiment, csv_text(rows))
    if figure_key(path) == key:
        return path
    with style.styled():
        return write_figure(path, experiment.plot(rows), key, experiment.dpi)


def write_index(topic: str, wanted: list[Experiment], out: Path, quick: bool = False) -> Path:
    """The topic's index: what there is, and how to read it."""
    size = " --quick" if quick else ""
    made = f"Made by `refsim reproduce {topic}{size}`" + (": smaller than the full ones." if quick else ".")
    lines = [f"# {TITLES[topic]}: figures and tables", "", made, ""]
    for experiment in wanted:
        lines += [f"## {experiment.title}", ""]
        if experiment.plot is not None:
            lines += [f"![{experiment.title}]({experiment.id}.png)", ""]
        tables = sorted(path.name for path in out.glob(f"{experiment.id}*.csv"))
        files = ", ".join(f"[{name}]({name})" for name in tables)
        alone = f"`refsim reproduce {topic}{size} --only {experiment.id}`"
        lines += [experiment.caption, "", f"Data: {files}. Alone: {alone}.", ""]
    text = "\n".join(lines)
    return replace_file(out / INDICES[topic], lambda part: part.write_text(text, encoding="utf-8"))
