"""Runs experiments: measures what is not yet measured, on all processors, and writes tables and pictures.

    topic, ids ─▶ cases of all experiments ─▶ pool of workers ─▶ rows ─▶ tables, pictures, indices
                      ▲                              │
                      └── .resume: finished cases ◀──┘

All cases lie in one heap: no worker waits for an experiment to end, and what an experiment writes is written as soon as
its rows, and those it needs, are there. What is written depends neither on the number of workers nor on who is first.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

from refsim.errors import InputError
from refsim.experiments import topics
from refsim.experiments.files import (
    Journal,
    case_name,
    csv_text,
    figure_key,
    make_folder,
    new_folder,
    replace_file,
    sweep_parts,
    write_csv,
)
from refsim.experiments.fingerprint import plot_key, rows_key
from refsim.experiments.index import write_index
from refsim.experiments.outcome import Outcome
from refsim.experiments.pool import checked, pool
from refsim.experiments.registry import Experiment, Rows
from refsim.experiments.work import Drawing, Measurement, Task, explained
from refsim.progress import silent
from refsim.scene.known import check_scenes_folder

if TYPE_CHECKING:
    from refsim.progress import Advance, Progress

# Rows that hold times lie apart: no run gives them twice
TIMINGS = "timings"


def reproduce(
    topic: str | None = None,
    *,
    quick: bool = False,
    only: str | Sequence[str] | None = None,
    out: Path = Path("figures"),
    progress: Progress | None = None,
    jobs: int | None = None,
    backend: str = "joblib",
    outcome: Outcome | None = None,
) -> Iterator[Path]:
    """Make figures and tables in the folder `out`; yields each file as soon as it is written.

    Args:
        topic: its experiments; those of every topic if None.
        quick: smaller sizes.
        only: experiments by id, in the place of all.
        progress: shows how far it is.
        jobs: processes that measure at a time; 1, and that is this process, if None.
        backend: `joblib` starts them on this machine; `dask` uses the cluster of Dask's configuration, or makes one.
        outcome: is filled with what was found.

    Raises:
        InputError: at once for a topic, experiment, backend or number that does not exist, for a folder that cannot be
            written, and for a folder of meshes that is none; on the way for a case that fails, named. What is finished
            by then is kept for the next run.
    """
    asked = topics.chosen(topic, [only] if isinstance(only, str) else only)
    jobs = checked(jobs, backend)
    check_scenes_folder()
    make_folder(out)
    for folder in (out, out / TIMINGS):
        sweep_parts(folder)
    run = _Run(asked, quick, outcome or Outcome(quick, out), indices=only is None)
    return _files(run, progress or silent, jobs, backend, complete=topic is None and only is None)


def _files(run: _Run, progress: Progress, jobs: int, backend: str, complete: bool) -> Iterator[Path]:
    with progress(run.total, "") as advance:
        advance(run.count)
        yield from run.ready()
        if run.heap.waiting():
            with pool(min(jobs, run.heap.waiting()), backend) as (executor, width):
                yield from _work(run, executor, width, advance)
        # Alone: nothing else runs on the machine now
        run.add_timed()
        with pool(1, "joblib") as (executor, width):
            yield from _work(run, executor, width, advance)
    run.outcome.complete = complete


def _work(run: _Run, executor: Executor, width: int, advance: Advance) -> Iterator[Path]:
    """Have everything in the heap done; the executor does `width` tasks at a time, and finds the next ones waiting."""
    flying: dict[Future[Any], Task] = {}
    while flying or run.heap.waiting():
        while run.heap.waiting() and len(flying) < (2 * width if width > 1 else 1):
            task = run.heap.take(flying.values())
            # First come, first served: the oldest are those at work
            advance(0, doing=_doing(run, [*flying.values(), task][:width]))
            flying[executor.submit(task)] = task
        done = wait(flying, return_when=FIRST_COMPLETED).done
        for future in [future for future in flying if future in done]:
            result = _result(future, [task.full_name for task in flying.values()][:width])
            task = flying.pop(future)
            yield from run.receive(task, result)
            advance(isinstance(task, Measurement), doing=_doing(run, list(flying.values())[:width]))


def _result(future: Future[Any], at_work: list[str]) -> Any:
    try:
        return future.result()
    except InputError:
        raise
    except Exception as error:  # the pool's own: the task's are sentences
        raise InputError(
            f"a worker was lost ({type(error).__name__}) while this was worked at: {'; '.join(at_work)}. What is "
            "finished is kept: run again, with fewer jobs if memory ran out."
        ) from error


def _doing(run: _Run, tasks: list[Task]) -> str:
    names = list(dict.fromkeys(task.name for task in tasks))
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{run.rows_found:,} rows; {', '.join(names[:3])}{more}"


class _Heap:
    """What is still to do: pictures first, then cases in order, of all topics by turns.

    Experiments of one topic run the same kernels. Two workers that begin at one topic would compile each of them twice.
    """

    def __init__(self) -> None:
        self.drawings: deque[Drawing] = deque()
        self.cases: dict[str, deque[Measurement]] = {}
        self.topic_of = {experiment.id: name for name, own in topics.TOPICS.items() for experiment in own}

    def add(self, task: Task) -> None:
        """At the end of its queue."""
        if isinstance(task, Drawing):
            self.drawings.append(task)
        else:
            self.cases.setdefault(self.topic_of[task.experiment.id], deque()).append(task)

    def waiting(self) -> int:
        """How many tasks are in the heap."""
        return len(self.drawings) + sum(len(own) for own in self.cases.values())

    def take(self, flying: Iterable[Task]) -> Task:
        """The next one: a picture, or a case of the topic that the fewest workers are at."""
        if self.drawings:
            return self.drawings.popleft()
        busy = [self.topic_of[task.experiment.id] for task in flying if isinstance(task, Measurement)]
        return self.cases[min((name for name, own in self.cases.items() if own), key=busy.count)].popleft()


class _Run:
    """What is asked for, what is found, and what is written."""

    def __init__(self, asked: dict[str, list[Experiment]], quick: bool, outcome: Outcome, indices: bool) -> None:
        self.asked, self.outcome, self.heap = asked, outcome, _Heap()
        self.unwritten = [experiment for own in asked.values() for experiment in own]
        self.unindexed = [name for name, own in asked.items() if own] if indices else []
        self.written: set[str] = set()
        # Refused now rather than when all is measured
        for experiment in self.unwritten:
            new_folder(self._folder(experiment))
        known = {experiment.id: experiment for own in topics.TOPICS.values() for experiment in own}
        names = {name for e in self.unwritten for name in (e.id, *e.needs)}
        self.needed = {name: experiment for name, experiment in known.items() if name in names}
        self.cases = {name: [case_name(case) for case in e.cases(quick)] for name, e in self.needed.items()}
        self.journals = {name: Journal(outcome.out, name, rows_key(e)) for name, e in self.needed.items()}
        self.found = {name: journal.finished(self.cases[name]) for name, journal in self.journals.items()}
        for name, experiment in self.needed.items():
            new_folder(self.journals[name].folder)
            if not experiment.timed:
                self._add(experiment)

    def _add(self, experiment: Experiment) -> None:
        for case in dict.fromkeys(self.cases[experiment.id]):
            if case not in self.found[experiment.id]:
                self.heap.add(Measurement(experiment, case, self.journals[experiment.id]))

    def add_timed(self) -> None:
        """Put the cases of timed experiments in the heap."""
        for experiment in self.needed.values():
            if experiment.timed:
                self._add(experiment)

    @property
    def total(self) -> int:
        """Cases, finished or not."""
        return sum(len(set(cases)) for cases in self.cases.values())

    @property
    def count(self) -> int:
        """Cases that are finished."""
        return sum(len(cases) for cases in self.found.values())

    @property
    def rows_found(self) -> int:
        """Rows of all finished cases."""
        return sum(len(rows) for cases in self.found.values() for rows in cases.values())

    def receive(self, task: Task, result: Any) -> Iterator[Path]:
        """Take what a worker has found, and write what can be written now."""
        name = task.experiment.id
        if isinstance(task, Drawing):
            yield self._drawn(task.experiment, replace_file(self._picture(task.experiment), _writer(result)))
        else:
            rows = json.loads(result)
            if not task.journal.path(task.case).exists():
                task.journal.keep(task.case, rows)
            self.found[name][task.case] = rows
        yield from self.ready()

    def ready(self) -> Iterator[Path]:
        """Write tables of the experiments whose rows are there, have their pictures drawn, and write full indices."""
        for experiment in [e for e in self.unwritten if all(self._complete(name) for name in (e.id, *e.needs))]:
            self.unwritten.remove(experiment)
            yield from self._tables(experiment)
        for topic in [name for name in self.unindexed if all(e.id in self.written for e in self.asked[name])]:
            self.unindexed.remove(topic)
            tables = {e.id: [self._folder(e) / f"{stem}.csv" for stem in self.outcome.tables[e.id]]
                      for e in self.asked[topic]}  # fmt: skip
            yield write_index(topic, self.asked[topic], tables, self.outcome)

    def _complete(self, name: str) -> bool:
        return len(self.found[name]) == len(set(self.cases[name]))

    def _rows(self, name: str) -> Rows:
        """All rows of an experiment, in the order of its cases."""
        self.outcome.cases[name] = {case: self.found[name][case] for case in self.cases[name]}
        return [row for case in self.cases[name] for row in self.found[name][case]]

    def _folder(self, experiment: Experiment) -> Path:
        return self.outcome.out / TIMINGS if experiment.timed else self.outcome.out

    def _picture(self, experiment: Experiment) -> Path:
        return self._folder(experiment) / f"{experiment.id}.png"

    def _drawn(self, experiment: Experiment, path: Path) -> Path:
        self.written.add(experiment.id)
        self.outcome.pictures[experiment.id] = path
        return path

    def _tables(self, experiment: Experiment) -> Iterator[Path]:
        rows, others = self._rows(experiment.id), {name: self._rows(name) for name in experiment.needs}
        with explained(f"the tables of {experiment.id}"):
            tables = dict(experiment.tables_of(rows, others))
        self.outcome.tables[experiment.id] = tables
        for stem, table in tables.items():
            yield write_csv(self._folder(experiment) / f"{stem}.csv", table)
        if experiment.plot is None:
            self.written.add(experiment.id)
            return
        drawn = experiment.drawn_rows(rows, tables)
        key = plot_key(experiment, csv_text(drawn))
        if figure_key(self._picture(experiment)) == key:
            yield self._drawn(experiment, self._picture(experiment))
        else:
            self.heap.add(Drawing(experiment, drawn, key))


def _writer(content: bytes) -> Any:
    return lambda part: part.write_bytes(content)
