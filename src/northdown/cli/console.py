"""What the user sees: facts, tables, warnings, progress."""

from __future__ import annotations

import contextlib
import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import IO, Any

from northdown.cli.wording import as_typed

# Wide enough that no table is cut where nobody looks at it on a screen.
_WIDTH_OF_A_FILE = 200


def one_line(text: str) -> str:
    """Text in one line, without control characters: messages may quote a stranger's file."""
    joined = " ".join(text.split("\n"))
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)


def warn(text: str) -> None:
    """Write one line to standard error."""
    print(one_line(as_typed(text)), file=sys.stderr)


def facts(pairs: Iterable[tuple[str, str]], file: IO[str] | None = None) -> None:
    """Write labelled lines; a pair with an empty label goes on with the one before."""
    rows = list(pairs)
    width = max((len(label) for label, _ in rows), default=0)
    for label, text in rows:
        print(f"{label:<{width}}  {one_line(text)}", file=file or sys.stdout)


def table(header: Sequence[str], rows: Iterable[Sequence[str]], *, left: int = 1) -> None:
    """Write a table to standard output; the first `left` columns are aligned left, the others right."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    screen = Console(highlight=False, width=None if sys.stdout.isatty() else _WIDTH_OF_A_FILE)
    grid = Table(box=SIMPLE_HEAD, header_style="bold", show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    for k, name in enumerate(header):
        grid.add_column(name, justify="left" if k < left else "right", overflow="fold", no_wrap=k == 0)
    for row in rows:
        grid.add_row(*(Text(one_line(cell)) for cell in row))
    with screen.capture() as written:
        screen.print(grid)
    print("\n".join(line.rstrip() for line in written.get().splitlines()))


def paragraph(text: str, indent: int = 0) -> None:
    """Write running text to standard output, broken to the width of the screen, at most 100 columns."""
    import shutil
    import textwrap

    width = min(shutil.get_terminal_size().columns, 100)
    lead = " " * indent
    print(
        textwrap.fill(
            one_line(as_typed(text)), width, initial_indent=lead, subsequent_indent=lead, break_on_hyphens=False
        )
    )


def write_json(value: Any) -> None:
    """Write JSON to standard output; what is no number becomes null."""
    print(json.dumps(_finite(value), indent=2, ensure_ascii=False, allow_nan=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


@contextlib.contextmanager
def progress(names: Sequence[str], doing: str) -> Iterator[Iterator[str]]:
    """Iterate over `names`, with a bar on standard error when that is a terminal and there are several.

    As a context, so that the bar is gone and the cursor back before anything is said about an error.
    """
    if len(names) < 2 or not sys.stderr.isatty():
        yield iter(names)
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(doing, total=len(names))

        def steps() -> Iterator[str]:
            for done, name in enumerate(names):
                bar.update(task, completed=done, description=f"{doing} {name}")
                yield name

        yield steps()


@contextlib.contextmanager
def steps(total: int) -> Iterator[Callable[[str], None]]:
    """A function to call with the name of each of `total` steps: a bar on standard error, when that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress, TimeElapsedColumn

    with Progress(
        *Progress.get_default_columns(), TimeElapsedColumn(), console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task("", total=total)
        done = -1

        def tell(name: str) -> None:
            nonlocal done
            done += 1
            bar.update(task, completed=done, description=escape(one_line(name)))

        yield tell


@contextlib.contextmanager
def busy(doing: str, *, show: bool) -> Iterator[None]:
    """Say on standard error, when that is a terminal, that something lasts."""
    if not show or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status(Text(one_line(doing))):
        yield
