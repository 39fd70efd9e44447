"""The library's advice in terms of the command line: messages name arguments of Python, users here type options."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

_REPLACED: Final[tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...]] = (
    (r"units=\{'(\w+)': '?([^'{}]*)'?\}, '(\w+)' or '(\w+)'", r"--unit \1=\2, \3 or \4"),
    (r"units=\{'(\w+)': '?([^'{}]*)'?\}", r"--unit \1=\2"),
    (r"columns=\{'(\w+)': \[?([^\[\]{}]*)\]?\}", lambda m: f"--columns {m[1]}={_plain_list(m[2])}"),
    (r"columns=\{…\}", "--columns"),
    (r", or an empty list to leave it out", ", or nothing after the = to leave it out"),
    (r"rate=(\S*?)( in Hz)? \(--rate on the command line\)", r"--rate \1\2"),
    (r"rate=(\d+) \((.*?)\), or --rate on the command line", r"--rate \1 (\2)"),
    (
        r"(give|\() ?array=…, (a geometry or its TOML file )?\(?(or )?--array on the command line\)",
        r"\1 --array FILE.toml",
    ),
    (r"rate=…", "--rate"),
    (r"frame=…", "--frame"),
    (r"max_gap", "--max-gap"),
    (r", or raise max_bytes", ""),
    (r"raise max_bytes", "read it in Python with a larger max_bytes"),
    (r"(say so with|declare) mag_unit=\"arbitrary\"", "give --unit mag=a.u."),
    (r"declare reference_offset=\"(\w+)\" and align before comparing", r"give --align \1"),
    (r"Recording\.sort\(\), or --sort on the command line", "--sort"),
    (r"Recording\.between", "--start and --stop"),
    (r"remap\('([^']*)'\)", r"give --remap \1"),
    (r"northdown\.io\.read_orientation", "northdown.io.read_orientation in Python"),
)


def as_typed(message: str) -> str:
    """A message of the library with its advice as one types it here."""
    for pattern, replacement in _REPLACED:
        message = re.sub(pattern, replacement, message)
    return message


def _plain_list(names: str) -> str:
    return re.sub(r"['\s]", "", names)
