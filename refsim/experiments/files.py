"""Files of an experiment: each is there whole or not at all, and an older one survives any failure."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from refsim.errors import InputError
from refsim.experiments import style
from refsim.experiments.registry import Case, Row, Rows

# Where finished rows wait for an interrupted run to go on. Not committed: a fresh checkout measures everything.
RESUME = ".resume"
KEY = "refsim-key"
# What a killed writer left, by the names that mkstemp gives, is swept when no writer can be at it any more
PARTS = f".*.{'?' * 8}.part"
PART_AGE_S = 3600.0


@contextmanager
def refusing(path: Path) -> Iterator[None]:
    """Turn the system's refusal to write into a sentence about `path`."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot write {str(path)!r}: {error.strerror or type(error).__name__}") from error


def new_folder(folder: Path) -> None:
    """Make `folder` unless it is there, or raise `InputError`."""
    with refusing(folder):
        folder.mkdir(parents=True, exist_ok=True)


def sweep_parts(folder: Path) -> None:
    """Remove what killed writers left. Other processes may be at it too."""
    for path in folder.glob(PARTS):
        with suppress(OSError):
            if path.stat().st_mtime < time.time() - PART_AGE_S:
                path.unlink()


def make_folder(out: Path) -> None:
    """Make `out` and its resume folder, or raise `InputError`."""
    try:
        (out / RESUME).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise InputError(f"cannot write figures to {str(out)!r}: {error.strerror or type(error).__name__}") from error


def replace_file(path: Path, write: Callable[[Path], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then put it in the place of `path`."""
    with refusing(path):
        descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        os.close(descriptor)
        try:
            write(Path(name))
            # mkstemp makes files private; a result gets the mode that any new file would have
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(name, 0o666 & ~mask)
            os.replace(name, path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    return path


def csv_text(rows: Rows) -> str:
    """Rows as CSV: a header of all columns in order of appearance, `\\n` line ends; a column a row lacks is empty."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def read_csv(path: Path) -> list[Row]:
    """The rows of a CSV, numbers as numbers."""

    def value(text: str) -> Any:
        for kind in (int, float):
            try:
                return kind(text)
            except ValueError:
                continue
        return text

    with path.open(newline="", encoding="utf-8") as file:
        return [{name: value(text) for name, text in row.items()} for row in csv.DictReader(file)]


def write_csv(path: Path, rows: Rows) -> Path:
    """Write rows to `path`."""
    text = csv_text(rows)
    return replace_file(path, lambda part: part.write_text(text, encoding="utf-8", newline="\n"))


def figure_bytes(figure: Any, key: str, dpi: int | None = None) -> bytes:
    """A matplotlib figure as a PNG that carries `key`: the same rows and code give the same bytes."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=dpi or style.DPI, metadata={"Software": "refsim", KEY: key})
    return picture.getvalue()


def figure_key(path: Path) -> str | None:
    """The key that a whole PNG carries; None without one, or if a checksum in the file says that it is damaged."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            # Opening reads the head alone, and the key is there: a file that was cut would keep it
            picture.verify()
            return picture.info.get(KEY)
    except (OSError, SyntaxError, ValueError):
        return None


def case_name(case: Case) -> str:
    """The case as text, the same in every process."""
    return json.dumps(case, sort_keys=True)


def rows_digest(rows: Rows) -> str:
    """Digest of rows, the same for those that come back from a file."""
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:32]


class Journal:
    """Rows of an experiment's finished cases: a file each, `.resume/<experiment>/<digest of the case>.json`.

    A file holds key, case, rows and their digest; rows count as long as `key`, the digest of the sources, does, and
    they are those that were written. Whoever has measured a case writes its file, whole or not at all: a process may be
    killed at any moment, and several may write at once.
    """

    def __init__(self, out: Path, experiment: str, key: str) -> None:
        self.folder, self.key = out.resolve() / RESUME / experiment, key

    def path(self, case: str) -> Path:
        """Where the rows of the case are."""
        return self.folder / f"{hashlib.sha256(case.encode()).hexdigest()[:32]}.json"

    def finished(self, cases: Iterable[str]) -> dict[str, Rows]:
        """The rows of those of the cases that are finished; files that nobody will read again are removed."""
        self._sweep()
        found = {case: self._rows(self.path(case)) for case in cases}
        return {case: rows for case, rows in found.items() if rows is not None}

    def keep(self, case: str, rows: Rows) -> None:
        """Note a finished case."""
        found = {"key": self.key, "digest": rows_digest(rows), "case": json.loads(case), "rows": rows}
        text = json.dumps(found)
        new_folder(self.folder)
        replace_file(self.path(case), lambda part: part.write_text(text, encoding="utf-8"))

    def _rows(self, path: Path) -> Rows | None:
        """The rows in the file; None if there is none, it is of other sources, or damaged."""
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            rows = found["rows"]
            own = found["key"] == self.key and self.path(case_name(found["case"])) == path
            whole = found["digest"] == rows_digest(rows)
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return rows if own and whole and isinstance(rows, list) and all(isinstance(row, dict) for row in rows) else None

    def _sweep(self) -> None:
        """Remove stale and damaged rows, and what killed writers left. Other processes may be at it too."""
        sweep_parts(self.folder)
        for path in self.folder.glob("*.json"):
            if self._rows(path) is None:
                with suppress(OSError):
                    path.unlink()
