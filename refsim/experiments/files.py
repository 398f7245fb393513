"""Files of an experiment: each is there whole or not at all, and an older one survives any failure."""

from __future__ import annotations

import csv
import io
import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from refsim.errors import InputError
from refsim.experiments import style
from refsim.experiments.registry import Row, Rows

# Where finished rows wait for an interrupted run to go on. Not committed: a fresh checkout measures everything.
RESUME = ".resume"
KEY = "refsim-key"


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
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    os.close(descriptor)
    try:
        write(Path(name))
        # mkstemp makes files private; a result gets the mode that any new file would have
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)
        os.replace(name, path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise InputError(f"cannot write {str(path)!r}: {error.strerror or type(error).__name__}") from error
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


def write_figure(path: Path, figure: Any, key: str, dpi: int | None = None) -> Path:
    """Write a matplotlib figure as a PNG that carries `key`: the same rows and code give the same bytes."""
    facts = {"Software": "refsim", KEY: key}
    options = {"format": "png", "dpi": dpi or style.DPI, "metadata": facts}
    return replace_file(path, lambda part: figure.savefig(part, **options))


def figure_key(path: Path) -> str | None:
    """The key that a PNG carries; None without one."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            return picture.info.get(KEY)
    except (OSError, SyntaxError):
        return None


class Journal:
    """Rows of finished cases, kept in the resume folder until the sources or the case change."""

    def __init__(self, out: Path, experiment: str, key: str) -> None:
        self.path, self.key = out / RESUME / f"{experiment}.json", key
        self.cases: dict[str, Rows] = {}
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))
            if found["key"] == key:
                self.cases = found["cases"]
        except (OSError, ValueError, KeyError, TypeError):
            pass  # none, or damaged: measured anew

    def keep(self, case: str, rows: Rows) -> None:
        """Adds a finished case; the file is replaced as a whole."""
        self.cases[case] = rows
        text = json.dumps({"key": self.key, "cases": self.cases})
        replace_file(self.path, lambda part: part.write_text(text, encoding="utf-8"))
