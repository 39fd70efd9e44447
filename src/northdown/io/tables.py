"""Small tables in files, TOML or JSON with the same content: written exactly, and read with suspicion."""

from __future__ import annotations

import json
import math
import tomllib
from typing import Any, NoReturn

import numpy as np

from northdown._validation import FloatArray
from northdown.errors import FormatError, expected
from northdown.io.source import quoted

Table = dict[str, Any]


def toml_value(value: Any) -> str:
    """A text, number or nested list as TOML writes it; numbers are read back exactly."""
    if isinstance(value, str):
        return '"' + "".join(_escaped(c) for c in value) + '"'
    if isinstance(value, list):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    return repr(value)


def _escaped(c: str) -> str:
    if c in '"\\':
        return "\\" + c
    if ord(c) < 32 or ord(c) == 127:
        return f"\\u{ord(c):04X}"
    return c


def parse_table(data: bytes, label: str, what: str) -> Table:
    """Content of a TOML or JSON file, told apart by its beginning; `what` names it in errors."""
    try:
        text = data.decode("utf-8-sig")
        is_json = text.lstrip()[:1] == "{"
        table = json.loads(text, parse_constant=_refuse) if is_json else tomllib.loads(text)
    # the parsers raise ValueError for what they do not understand, RecursionError for nesting
    except (ValueError, RecursionError) as error:
        why = str(error).split("\n")[0][:100]
        raise FormatError(expected(f"{what} in TOML or JSON", f"{label} ({why})", do="export it again")) from None
    if not isinstance(table, dict):
        raise FormatError(expected(f"{what} in TOML or JSON", f"a list in {label}"))
    return table


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no number")


def check_keys(what: str, table: Table, known: tuple[str, ...]) -> None:
    """Raise FormatError when a table has another key."""
    unknown = [key for key in table if key not in known]
    if unknown:
        raise FormatError(expected(f"{what} with only {', '.join(known)}", quoted(unknown[0])))


def as_table(name: str, value: Any) -> Table:
    """The value, which must be a table."""
    if not isinstance(value, dict):
        raise FormatError(expected(f"{name} as a table", type(value).__name__))
    return value


def as_number(name: str, value: Any) -> float:
    """The value, which must be a number, finite and of reasonable size."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise FormatError(expected(f"a number for {name}", quoted(value)))
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not abs(number) < 1e30:
        raise FormatError(expected(f"a number below 1e30 for {name}", f"{number:g}"))
    return number


def as_array(name: str, value: Any, columns: int, rows: int | None = None) -> FloatArray:
    """Vector of 3 numbers, or matrix with some rows of 3."""
    if not isinstance(value, list) or (rows is None and len(value) != columns):
        raise FormatError(expected(f"{columns} numbers for {name}", quoted(value)))
    if rows is None:
        return np.array([as_number(name, v) for v in value])
    if not 1 <= len(value) <= rows:
        raise FormatError(expected(f"{rows} rows for {name}", f"{len(value)}"))
    return np.array([as_array(name, row, columns) for row in value])


def as_text(name: str, value: Any) -> str:
    """The value, which must be a text, not a long one."""
    if not isinstance(value, str) or len(value) > 1000:
        raise FormatError(expected(f"a text of at most 1000 characters for {name}", quoted(value)))
    return value
