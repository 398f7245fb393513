"""Plan: the script that goes through a chapter runs every block of it, and fails where a block fails.

- It finds the blocks that the built page shows, on every page.
- Blocks share one namespace and run in order; other languages and words are left alone.
- A block that raises ends the script with the page's own line; blocks after it do not run.
- It imports nothing that installing refsim does not bring.
"""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs import run_chapter

SCRIPT = Path(run_chapter.__file__)
DOCS = SCRIPT.parents[2] / "docs"
PAGE = '# A page\n\n```sh\nfalse\n```\n\n```python\nx = 20\n```\nWords\n\n```python hide alt="A dot"\n{second}\n```\n'


def go(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    page = folder / "page.md"
    page.write_text(text, encoding="utf-8")
    return subprocess.run([sys.executable, SCRIPT, page], cwd=folder, capture_output=True, text=True)


def test_every_block_runs(tmp_path: Path) -> None:
    done = go(tmp_path, PAGE.format(second="print(x + 1)\nimport os; print(os.environ['MPLBACKEND'])"))
    assert (done.returncode, done.stdout, done.stderr) == (0, "21\nAgg\npage.md: 2 blocks ran\n", "")


def test_a_block_that_raises_fails(tmp_path: Path) -> None:
    done = go(tmp_path, PAGE.format(second="print(x)\nassert x == 21") + "\n```python\nprint('after')\n```\n")
    assert (done.returncode, done.stdout) == (1, "20\n")
    assert 'page.md", line 14' in done.stderr and "AssertionError" in done.stderr


@pytest.mark.parametrize("page", sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")))
def test_blocks_are_those_of_the_built_page(monkeypatch: pytest.MonkeyPatch, page: str) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    text = (DOCS / page).read_text(encoding="utf-8")
    cells = [cell for cell in importlib.import_module("python_blocks").read(text).cells if cell["cell_type"] == "code"]
    assert [block["code"].rstrip() for block in run_chapter.FENCE.finditer(text)] == [cell["source"] for cell in cells]
    sys.modules.pop("python_blocks")


def test_it_needs_no_extras() -> None:
    nodes = [node for node in ast.walk(ast.parse(SCRIPT.read_text(encoding="utf-8")))]
    imported = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    imported |= {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
    assert imported <= sys.stdlib_module_names
