"""Every guide runs: its Python in one namespace, its command lines in this process, in a folder of its own.

Blocks are taken in their order. A block fenced as ``python`` runs; ``python skip`` is left out. Of a block fenced as
``bash`` the lines that begin with ``northdown`` run; they must end with success.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from northdown.cli.main import main

GUIDES = sorted((Path(__file__).parents[2] / "docs" / "guides").glob("*.md"))
FENCE = re.compile(r"^(?P<fence>`{3,})(?P<info>[^\n`]*)\n(?P<body>.*?)^(?P=fence)[ \t]*$", re.M | re.S)


@dataclass(frozen=True)
class Block:
    """A fenced block: what stands after the fence, its text, and the line of the guide on which that begins."""

    info: str
    body: str
    line: int


def blocks(text: str) -> list[Block]:
    return [
        Block(" ".join(m["info"].split()), m["body"], text.count("\n", 0, m.start("body")) + 1)
        for m in FENCE.finditer(text)
    ]


def command_lines(block: Block) -> list[tuple[int, list[str]]]:
    """Lines to run with their numbers; a line that ends in a backslash goes on in the next."""
    found = []
    lines = block.body.splitlines()
    k = 0
    while k < len(lines):
        start, line = k, lines[k]
        while line.endswith("\\") and k + 1 < len(lines):
            k += 1
            line = line[:-1] + lines[k]
        words = shlex.split(line, comments=True)
        if words[:1] == ["northdown"]:
            found.append((block.line + start, words[1:]))
        k += 1
    return found


def run_guide(text: str, name: str) -> int:
    """Run the blocks of a guide in the working folder; how many ran."""
    namespace: dict[str, Any] = {"__name__": "__main__"}
    count = 0
    for block in blocks(text):
        if block.info == "python":
            # empty lines before, so that an error names the line of the guide
            exec(compile("\n" * (block.line - 1) + block.body, name, "exec"), namespace)
            count += 1
        elif block.info == "bash":
            for line, words in command_lines(block):
                assert main(words) == 0, f"{name}, line {line}: northdown {shlex.join(words)}"
            count += 1
    return count


@pytest.mark.parametrize("guide", GUIDES, ids=[g.stem for g in GUIDES])
def test_guide_runs(guide, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_guide(guide.read_text(encoding="utf-8"), str(guide)) > 0


def test_there_are_guides():
    assert GUIDES


# ---- the runner itself, as a guide that is not run would pass too ----

EXAMPLE = """# Title
```python
x = 1
```
```python skip
x = 2
```
```text
x = 3
```
```bash
ls /nowhere
northdown --version  # a comment
northdown estimators \\
    mahony
```
"""


def test_runner_runs_what_it_should(capsys):
    assert run_guide(EXAMPLE + "```python\nassert x == 1\nprint('ran')\n```\n", "example") == 3
    out = capsys.readouterr().out
    assert "northdown" in out
    assert "mahony" in out
    assert out.endswith("ran\n")


def test_runner_tells_the_line_of_an_error(capsys):
    with pytest.raises(ZeroDivisionError) as problem:
        run_guide(EXAMPLE + "```python\n\ny = 1 / 0\n```\n", "example")
    assert problem.traceback[-1].lineno + 1 == EXAMPLE.count("\n") + 3
    with pytest.raises(AssertionError, match="line 2: northdown nonsense"):
        run_guide("```bash\nnorthdown nonsense\n```\n", "example")
