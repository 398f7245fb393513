"""Reads a page: Markdown in which every fenced block of Python is a cell that runs, in order, in one program.

    ```python                                     a cell
    ```python alt="A cube above a floor"          a cell whose pictures carry this text for those who cannot see them
    ```python hide                                a cell folded away until it is asked for

Nothing else marks a cell, so that a page reads the same on GitHub, in an editor and as a script.
"""

import re
from typing import Any

import nbformat

FENCE = re.compile(r"^```python(?P<info>[^\n]*)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
INFO = re.compile(r"\s*(?:(?P<hide>hide)|alt=\"(?P<alt>[^\"]+)\")(?=\s|$)")


def read(text: str) -> nbformat.NotebookNode:
    """The page as a notebook of Markdown and code cells; `source_map` holds the line where each begins."""
    cells, lines, at = [], [], 0
    for block in FENCE.finditer(text):
        _add(cells, lines, text, at, nbformat.v4.new_markdown_cell(text[at : block.start()]))
        cell = nbformat.v4.new_code_cell(block["code"].rstrip(), metadata=marks(block["info"]))
        _add(cells, lines, text, block.start(), cell)
        at = block.end()
    _add(cells, lines, text, at, nbformat.v4.new_markdown_cell(text[at:]))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    # A cell is named by its place, so that the same page is the same notebook
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    return nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel, "source_map": lines})


def marks(info: str) -> dict[str, Any]:
    """What stands behind ```` ```python ```` as the metadata of a cell."""
    found: dict[str, Any] = {}
    at = 0
    while info[at:].strip():
        mark = INFO.match(info, at)
        if mark is None:
            raise ValueError(f'a block of Python is marked {info.strip()!r}; marks are hide and alt="…"')
        if mark["hide"]:
            found["tags"] = ["hide-input"]
        else:
            found["mystnb"] = {"image": {"alt": mark["alt"]}}
        at = mark.end()
    return found


def _add(cells: list[Any], lines: list[int], text: str, start: int, cell: nbformat.NotebookNode) -> None:
    """Takes up a cell that holds anything, and the line that it begins in."""
    if cell["source"].strip():
        cells.append(cell)
        lines.append(text.count("\n", 0, start))
