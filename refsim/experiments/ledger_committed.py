"""What was committed: `claims/committed-full.json` and `-quick.json`, written by `refsim reproduce --accept`.

    {"verdicts": {claim: [verdict, evidence]}, "rows": {experiment: {case: digest of its rows}}}

Floats count to nine digits: sums may differ in the last ones between processors. Whole numbers count to the last.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from refsim.errors import InputError
from refsim.experiments.files import replace_file
from refsim.experiments.ledger_file import FOLDER
from refsim.experiments.registry import Rows


@dataclass(frozen=True)
class Committed:
    """Verdict and evidence by claim; digests by experiment and case."""

    verdicts: dict[str, list[Any]] = field(default_factory=dict)
    rows: dict[str, dict[str, str]] = field(default_factory=dict)


def canonical(value: Any) -> Any:
    """The value with floats to nine digits, and lists in the place of tuples: what JSON gives back."""
    if isinstance(value, dict):
        return {name: canonical(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [canonical(part) for part in value]
    return float(f"{value:.9g}") if isinstance(value, float) else value


def digest(rows: Rows) -> str:
    """Sixteen hexadecimal digits of the rows."""
    text = json.dumps(canonical(rows), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def committed_path(size: str) -> Path:
    """The file for `quick` or `full` runs."""
    return FOLDER / f"committed-{size}.json"


def read_committed(size: str) -> Committed:
    """What was committed; nothing where there is no file yet."""
    path = committed_path(size)
    if not path.exists():
        return Committed()
    try:
        return Committed(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"the committed verdicts in {path.name} cannot be read: {error}") from error


def write_committed(size: str, committed: Committed) -> Path:
    """Write the file whole, a line a claim and a case."""
    lines = ['{"verdicts": {', _lines(committed.verdicts), '}, "rows": {']
    blocks = [f"{json.dumps(name)}: {{\n{_lines(own)}\n}}" for name, own in sorted(committed.rows.items())]
    text = "\n".join([*lines, ",\n".join(blocks), "}}", ""])
    return replace_file(committed_path(size), lambda part: part.write_text(text, encoding="utf-8", newline="\n"))


def _lines(entries: dict[str, Any]) -> str:
    return ",\n".join(f"{json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in sorted(entries.items()))
