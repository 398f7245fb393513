"""Docstrings as they are written, for autodoc: tables of aligned columns stay aligned.

A docstring of refsim is plain text: paragraphs, and lists of fields whose names and sentences stand in columns. The
latter become literal blocks; in the former a bar or an asterisk is itself and no markup.
"""

import re
from typing import Any

COLUMNS = re.compile(r"\S {2,}\S")
LIST = re.compile(r"- |\d+\. |\.\. |:")
# What stands in backticks is left alone; outside of them these three are themselves
MARKUP = re.compile(r"(`+).+?\1|(?P<mark>[|*_])", re.DOTALL)


def setup(app: Any) -> dict[str, bool]:
    """Sphinx calls this."""
    app.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def process(app: Any, what: str, name: str, subject: Any, options: Any, lines: list[str]) -> None:
    """Rewrites the lines of one docstring in place."""
    text = "\n".join(lines).strip("\n")
    paragraphs = re.split(r"\n\s*\n", text) if text else []
    lines[:] = [line for part in paragraphs for line in (*rewritten(part).splitlines(), "")]


def rewritten(paragraph: str) -> str:
    """A paragraph in reStructuredText: aligned or indented ones as a literal block, with plain names."""
    rows = paragraph.splitlines()
    if not LIST.match(rows[0]) and any(row.startswith(" ") or COLUMNS.search(row) for row in rows):
        return "::\n\n" + "\n".join(f"    {row}" for row in rows).replace("`", "")
    plain = MARKUP.sub(lambda found: f"\\{found['mark']}" if found["mark"] else found[0], paragraph)
    return re.sub(r"::$", ":", plain)
