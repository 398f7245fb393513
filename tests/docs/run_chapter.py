"""Runs the Python blocks of a page in order, in one program: `python run_chapter.py docs/first-steps.md`.

It needs what the page's own code needs and nothing more, unlike `docs/python_blocks.py`, which Sphinx reads pages with:
so it shows that a newcomer who has installed refsim alone gets through the page. Pictures are drawn, not shown. A block
that raises ends the run with its traceback, which names the page and the line.
"""

import os
import re
import sys
from pathlib import Path
from typing import Any

FENCE = re.compile(r"^```python[^\n]*\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)


def run(page: Path) -> int:
    """How many blocks ran: all of the page."""
    text = page.read_text(encoding="utf-8")
    namespace: dict[str, Any] = {"__name__": "__main__"}
    blocks = list(FENCE.finditer(text))
    for block in blocks:
        # As many empty lines before as the page has: a traceback then shows the page's own line
        above = "\n" * text.count("\n", 0, block.start("code"))
        exec(compile(above + block["code"], str(page), "exec"), namespace)
    return len(blocks)


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "Agg"  # a machine without a screen
    (chapter,) = map(Path, sys.argv[1:])
    print(f"{chapter.name}: {run(chapter)} blocks ran")
