"""Experiments of a few milliseconds a case that note in a file whom they ran in: for tests of the runner.

    python -m tests.experiments.counted KIND OUT LOG JOBS BACKEND

runs `refsim reproduce` on the experiments of that kind, with nothing to judge. The log is a case's parameter, as a
worker knows nothing else.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

from refsim.experiments.registry import Experiment, Rows

CASES = 12
SLOW_S = 0.05


def note(log: str, what: str) -> None:
    """Add a line; lines of several processes do not mix."""
    with open(log, "ab", buffering=0) as file:
        file.write(f"{what} {os.getpid()}\n".encode())


def measure(name: str, k: int, log: str) -> Rows:
    """Seven rows of nothing much."""
    note(log, f"{name}/{k}")
    time.sleep(SLOW_S)
    return [{"name": name, "k": k, "row": row, "third": row / 3} for row in range(k % 4)]


def measure_badly(name: str, k: int, log: str) -> Rows:
    """The fifth case is one too many."""
    if k == 5:
        raise ZeroDivisionError("nothing\nleft")
    return measure(name, k, log)


def measure_fatally(name: str, k: int, log: str) -> Rows:
    """The fifth case ends its process, as the system does when memory runs out."""
    if k == 5 and not Path(log + ".spared").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    return measure(name, k, log)


MEASURES = {"good": measure, "bad": measure_badly, "fatal": measure_fatally}


def plot(rows: Rows) -> object:
    """A line."""
    from refsim.experiments.style import new_figure

    figure = new_figure(2.0)
    figure.add_subplot().plot([row["third"] for row in rows])
    return figure


def counted(kind: str, log: Path) -> dict[str, tuple[Experiment, ...]]:
    """Two topics; the first has the second's rows in a table of its own."""
    work = MEASURES[kind]

    def one(name: str, size: int, **changes: object) -> Experiment:
        cases = [{"name": name, "k": k, "log": str(log)} for k in range(size)]
        experiment = Experiment(name, name.title(), f"All of {name}.", lambda quick: cases, work)
        return replace(experiment, **changes)

    first = one("first", CASES, plot=plot)
    sums = one("sums", 0, needs=("first", "second"), tables=both)
    second, timed = one("second", CASES // 2), one("clock", 2, timed=True, plot=plot)
    return {"hre": (first, sums, timed), "gsr": (second,)}


def both(rows: Rows, others: dict[str, Rows]) -> dict[str, Rows]:
    """A line per experiment that is needed."""
    return {"sums": [{"name": name, "rows": len(own)} for name, own in others.items()]}


def without_ledger(conclude: Callable[..., object] | None = None) -> None:
    """Leave the ledger out: it knows nothing of these experiments."""
    from refsim import experiments

    experiments.conclude = lambda *_, **__: (SimpleNamespace(differs=[]), [])  # type: ignore[assignment]
    experiments.summary_rows = lambda _: []


def main(kind: str, out: str, log: str, jobs: str, backend: str) -> int:
    """The command's exit code."""
    # A worker does without
    from refsim import cli
    from refsim.experiments import topics

    topics.TOPICS = counted(kind, Path(log))
    without_ledger()
    return cli.main(["reproduce", "--out", out, "--jobs", jobs, "--backend", backend])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
