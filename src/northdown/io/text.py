"""Delimited text: finding separator, header and rows, and reading the numbers of chosen columns.

A first pass looks at every line: it finds the separator (comma, semicolon, tab or blanks), the decimal sign, comment
lines (``#``, ``%`` or ``//``) and up to two header lines, and checks that all rows are equally long. A second pass,
by pandas, converts only the columns that are asked for.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from northdown.errors import FormatError, expected
from northdown.io.source import Source, quoted
from northdown.io.units import QUANTITIES, is_unit

if TYPE_CHECKING:
    import pandas as pd

_LINE_LIMIT: Final = 1 << 20
_HEAD_LINES: Final = 200
_COMMENT: Final = ("#", "%", "//")
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?nan|[+-]?inf", re.IGNORECASE)
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_ISO_DATE: Final = re.compile(r"\d{4}-\d\d-\d\d")

Line = tuple[int, str]


@dataclass(frozen=True)
class Text:
    """A text file whose rows have been found.

    Attributes
    ----------
    labels : tuple of str
        Header of each column; empty texts when there is none.
    comments : tuple of str
        Comment lines before the first row, without their sign.
    rows : int
        Number of rows.
    """

    source: Source
    encoding: str
    separator: str
    decimal: str
    labels: tuple[str, ...]
    comments: tuple[str, ...]
    rows: int
    _start: int
    _skipped: tuple[int, ...]
    _has_quotes: bool

    def load(self, indices: Sequence[int], time: int | None = None) -> dict[int, npt.NDArray[Any]]:
        """Read columns.

        Parameters
        ----------
        indices : sequence of int
            Columns, increasing.
        time : int, optional
            Column that may hold dates as in ISO 8601; these become nanoseconds since 1970.

        Returns
        -------
        dict
            For each index an array (N,) of int64, uint64 or float64; NaN where a cell is empty.

        Raises
        ------
        FormatError
            For text among the numbers, with line and column.
        """
        import pandas as pd

        options: dict[str, Any] = {}
        if tuple(int(part) for part in pd.__version__.split(".")[:2]) < (3, 1):
            options["float_precision"] = "round_trip"  # newer versions always read floats exactly
        with self.source.parsing("text"), self.source.open() as file:
            table = pd.read_csv(
                file,
                sep=self.separator or r"\s+",
                decimal=self.decimal,
                header=None,
                names=list(range(len(self.labels))),
                usecols=list(indices),
                index_col=False,
                skiprows=[*range(self._start - 1), *(n - 1 for n in self._skipped)],
                skipinitialspace=True,
                encoding=self.encoding,
                quoting=csv.QUOTE_MINIMAL if self._has_quotes else csv.QUOTE_NONE,
                low_memory=False,
                **options,
            )
        if len(table) != self.rows:
            raise self.source.damaged("text", f"{len(table)} rows where {self.rows} lines are")
        return {i: self._numbers(table[i], i, dates=i == time) for i in indices}

    def _numbers(self, column: pd.Series[Any], index: int, dates: bool) -> npt.NDArray[Any]:
        import pandas as pd

        if column.dtype.kind in "iuf":
            return column.to_numpy()
        if column.dtype.kind == "b":
            return column.to_numpy(dtype=np.float64)
        shown, filled = column, column.notna()
        if dates and filled.any() and _ISO_DATE.match(str(column[filled].iloc[0]).strip()):
            stamps = pd.to_datetime(column, format="ISO8601", utc=True, errors="coerce")
            if stamps.notna().all():
                return stamps.dt.as_unit("ns").astype(np.int64).to_numpy()
        if self.decimal == ",":  # a point may then stand for thousands, so it is refused
            column = column.astype(str).str.replace(".", "?", regex=False).where(filled)
            numbers = pd.to_numeric(column.str.replace(",", ".", regex=False), errors="coerce")
        else:
            numbers = pd.to_numeric(column, errors="coerce")
        bad = (numbers.isna() & filled).to_numpy()
        if bad.any():
            row = int(np.argmax(bad))
            name = quoted(self.labels[index] or index, 40)
            got = f"{quoted(shown.iloc[row], 30)} in line {self._line_of(row)}"
            raise FormatError(expected(f"numbers in column {name}", got, do="remove or repair that line"))
        return numbers.to_numpy(dtype=np.float64)

    def _line_of(self, row: int) -> int:
        line = self._start + row
        for skipped in self._skipped:
            line += skipped <= line
        return line


def scan(source: Source) -> Text:
    """Find the rows of a text file, and check that each has the same number of fields.

    Raises
    ------
    FormatError
        For a file without rows, rows of different length (with the line), a last row that is cut off, lines
        longer than 1 MiB, or bytes that are not text.
    """
    encoding = "utf-16" if source.head.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig"
    try:
        return _scan(source, encoding)
    except UnicodeError:
        if encoding == "utf-16":
            raise source.damaged("UTF-16 text", "not that encoding") from None
    return _scan(source, "latin-1")


def _scan(source: Source, encoding: str) -> Text:
    with io.TextIOWrapper(source.open(), encoding=encoding) as stream:
        lines = _lines(stream, source)
        head = list(islice(lines, _HEAD_LINES))
        content = [(n, s) for n, s in head if s.strip() and not s.startswith(_COMMENT)]
        comments = [(n, s) for n, s in head if s.startswith(_COMMENT)]
        separator, decimal = _separator([s for _, s in content])
        start, width = _first_row(content, separator, decimal, source)
        before = [s for n, s in content if n < start]
        notes = [s.strip().lstrip("#%/").strip() for n, s in comments if n < start]
        labels = _labels(before, notes, separator, width, dict(content)[start])
        rest = chain((line for line in head if line[0] >= start), lines)
        rows, skipped, has_quotes = _check_rows(rest, separator, width, source)
    return Text(source, encoding, separator, decimal, labels, tuple(notes), rows, start, tuple(skipped), has_quotes)


def _lines(stream: io.TextIOWrapper, source: Source) -> Iterator[Line]:
    """Numbered lines; each is limited, as a file may be one endless line."""
    number = 0
    while line := stream.readline(_LINE_LIMIT):
        number += 1
        if len(line) == _LINE_LIMIT:
            got = f"a line of more than a million characters in {source.label}"
            raise FormatError(expected("rows of numbers", got))
        yield number, line


def split(line: str, separator: str) -> list[str]:
    """Cut a line into fields without surrounding blanks; an empty separator means blanks."""
    if not separator:
        return line.split()
    if '"' in line:
        try:
            return [field.strip() for field in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
        except (csv.Error, StopIteration):
            pass  # a stray quote is a character like any other
    return [field.strip() for field in line.split(separator)]


def _is_number(text: str, decimal_comma: bool) -> bool:
    return bool(_NUMBER.fullmatch(text) or (decimal_comma and _DECIMAL_COMMA.fullmatch(text)))


def _separator(lines: list[str]) -> tuple[str, str]:
    """Choose the separator under which most of the fields are numbers, and the decimal sign."""
    best, choice = (0.0, 0), (",", ".")
    for separator in (";", "\t", ",", ""):
        numbers = total = commas = 0
        for line in lines[:50]:
            fields = split(line, separator)
            found = [f for f in fields if _is_number(f, separator != ",")]
            if len(fields) > 1 and found:
                numbers += len(found)
                total += sum(1 for f in fields if f)
                commas += sum("," in f for f in found)
        if total and (numbers / total, numbers) > best:
            best, choice = (numbers / total, numbers), (separator, "," if commas else ".")
    return choice


def _first_row(content: list[Line], separator: str, decimal: str, source: Source) -> tuple[int, int]:
    """Line number of the first row of numbers, and the number of fields that rows have."""
    candidates: list[tuple[int, int]] = []
    for number, line in content:
        fields = split(line, separator)
        numeric = sum(_is_number(f, decimal == ",") for f in fields)
        if len(fields) > 1 and (numeric > 1 or (numeric and numeric == sum(map(bool, fields)))):
            candidates.append((number, len(fields)))
    if not candidates:
        got = "a header only" if 0 < len(content) < 3 else "text" if content else "no rows"
        raise FormatError(expected("rows of numbers, separated by , ; tab or blanks", f"{got} in {source.label}"))
    width = Counter(w for _, w in candidates).most_common(1)[0][0]
    return candidates[0][0], width


def _labels(before: list[str], notes: list[str], separator: str, width: int, row: str) -> tuple[str, ...]:
    """Column names out of the lines before the first row; empty texts when these hold no header."""
    header = split(before[-1], separator) if before else []
    if len(header) < 2 and notes:  # as numpy.savetxt and ROS write it: the header is a comment
        noted = split(notes[-1], separator)
        header = noted if len(noted) == width else header
        before = []
    if len(header) < 2:
        return ("",) * width
    cells = len(header)
    while len(header) > width and not header[-1]:
        header.pop()
    if len(header) == width - 1 and not split(row, separator)[-1]:
        header.append("")
    if len(header) != width:
        got = f"{len(header)} in the header"
        raise FormatError(
            expected(f"{width} column names, as the rows have {width} fields", got, do="repair the header")
        )
    above = split(before[-2], separator) if len(before) > 1 else []
    if len(above) == cells:
        above = above[:width]
        bare = [c.strip("()[] ") for c in header]
        if all(not c or any(is_unit(q, c) for q in QUANTITIES) for c in bare):
            return tuple(f"{name} ({unit})" if unit else name for name, unit in zip(above, bare, strict=True))
        if len(set(header)) < len(header):
            return tuple(_grouped(above, header))
    return tuple(header)


def _grouped(above: list[str], header: list[str]) -> Iterator[str]:
    """Names such as 'Accelerometer X' from a line of groups above a line of axes."""
    group = ""
    for upper, lower in zip(above, header, strict=True):
        group = upper or group
        yield f"{group} {lower}".strip()


def _check_rows(lines: Iterator[Line], separator: str, width: int, source: Source) -> tuple[int, list[int], bool]:
    """Count rows; list the lines to be left out; say whether fields are in quotes."""
    rows, skipped, has_quotes, commas = 0, [], False, width - 1
    short: Line | None = None
    for number, line in lines:
        regular = line.count(separator) == commas if separator else len(line.split()) == width
        if regular and line[0] not in "#%/" and '"' not in line and "\0" not in line and short is None:
            rows += 1
            continue
        if not line.strip() or line.startswith(_COMMENT):
            skipped.append(number)
            continue
        if short is not None:
            raise FormatError(expected(f"{width} fields, as in other rows", short[1], do="repair that line"))
        if "\0" in line:
            raise FormatError(expected("text", f"a zero byte in line {number} of {source.label}"))
        fields = len(split(line, separator))
        if '"' in line:
            has_quotes = True
            if not separator or line.count('"') % 2:
                raise FormatError(expected("quotes in pairs", f"others in line {number}", do="repair that line"))
        rows += 1
        if fields != width:
            short = (number, f"{fields}, in line {number}")
    if short is not None:
        got = f"{short[1]}, the last"
        raise FormatError(expected(f"{width} fields, as in other rows", got, do="remove it: the file seems cut off"))
    return rows, skipped, has_quotes
