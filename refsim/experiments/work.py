"""What a worker does: one case, or one picture. What goes in and comes out travels between processes.

A worker writes the rows of a finished case itself, so a case is kept whatever becomes of the process that asked for it.
"""

from __future__ import annotations

import json
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import refsim
from refsim.errors import InputError
from refsim.experiments import style
from refsim.experiments.files import Journal, figure_bytes
from refsim.experiments.fingerprint import rows_key
from refsim.experiments.registry import Experiment, Rows

PACKAGE = Path(refsim.__file__).parent
# A task takes all threads of its process; a Dask worker may call several at once
_alone = threading.Lock()


@dataclass(frozen=True)
class Measurement:
    """A case to measure; called, it gives the rows as JSON: the same text as when they are read from the journal."""

    experiment: Experiment
    case: str
    journal: Journal

    @property
    def name(self) -> str:
        """What is said of it while it runs."""
        return self.experiment.id

    @property
    def full_name(self) -> str:
        """What is said of it when it fails."""
        return f"{self.experiment.id}, case {self.case}"

    def __call__(self) -> str:
        with _alone, explained(self.full_name):
            if rows_key(self.experiment) != self.journal.key:
                raise InputError("the worker's sources or packages are not those of the process that it works for")
            rows = json.dumps(self.experiment.measure(**json.loads(self.case)))
            # On a cluster without a common folder there is none; then the rows are kept where they arrive
            if self.journal.folder.is_dir():
                self.journal.keep(self.case, json.loads(rows))
        return rows


@dataclass(frozen=True)
class Drawing:
    """A picture to draw; called, it gives the bytes of the PNG."""

    experiment: Experiment
    rows: Rows
    key: str

    @property
    def name(self) -> str:
        """What is said of it while it runs."""
        return f"{self.experiment.id} (picture)"

    full_name = name

    def __call__(self) -> bytes:
        assert self.experiment.plot is not None
        with _alone, explained(self.full_name), style.styled():
            return figure_bytes(self.experiment.plot(self.rows), self.key, self.experiment.dpi)


Task = Measurement | Drawing


@contextmanager
def explained(name: str) -> Iterator[None]:
    """Turn any error into one sentence that says what was worked at, what went wrong, and where."""
    try:
        yield
    except Exception as error:
        what = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error} ({_place(error)})"
        raise InputError(f"{name}: {' '.join(what.split())}") from error


def _place(error: BaseException) -> str:
    """The innermost line of the package that the error passed through; of whatever was called if it is elsewhere."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename != __file__]
    own = [frame for frame in frames if Path(frame.filename).is_relative_to(PACKAGE)] or frames
    return f"{Path(own[-1].filename).name}, line {own[-1].lineno}" if own else "before it began"
