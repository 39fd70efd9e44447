"""`PrintedTable`: a table for readers, the same on a screen, in Markdown and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class PrintedTable:
    """A table whose cells are text.

    Parameters
    ----------
    key : str
        For the name of its file.
    title : str
        Heading.
    header : tuple of str
        Names of the columns.
    rows : sequence of tuples of str
        As long as the header.
    notes : sequence of str
        To stand below.
    left : int
        How many columns, from the first, hold words.
    """

    key: str
    title: str
    header: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    notes: Sequence[str] = ()
    left: int = 1

    def markdown(self) -> str:
        """Heading, table and notes in Markdown."""
        lines = [f"## {self.title}", "", _row(self.header)]
        lines.append(_row(["---" if k < self.left else "---:" for k in range(len(self.header))]))
        lines += [_row(row) for row in self.rows]
        for note in self.notes:
            lines += ["", note]
        return "\n".join(lines) + "\n"

    def csv(self) -> str:
        """Header and rows as CSV, without the notes."""
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(self.rows)
        return text.getvalue()


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
