"""The options with which every command reads a recording, and the reading itself."""

from __future__ import annotations

import functools
import inspect
import math
import os
import sys
from collections.abc import Callable, Iterable
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, Concatenate, Final, ParamSpec, cast, get_type_hints

import typer

from northdown.cli import console
from northdown.cli.numbers import read_number
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.recording import Recording, ReferenceOffset

P = ParamSpec("P")

NO_RECORDING: Final = ""
"""Source of a `Reading` when none was named; see `recording_optional`."""

_ALIGNMENTS = ("none", "heading", "rotations")
# A file of this size (bytes) takes long enough to read that one wonders.
_BIG = 20_000_000


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Which file to read and how: the options that all commands share; their help is their documentation."""

    source: Annotated[str, typer.Argument(metavar="REC", help="Recording to read; '-' for standard input.")]
    format: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="csv, parquet, hdf5 or mat; found from the content when not given."),
    ] = None
    rate: Annotated[
        str | None, typer.Option(metavar="HZ", help="Sampling rate, for files without a column of time.")
    ] = None
    unit: Annotated[
        list[str],
        typer.Option(
            metavar="SENSOR=UNIT", help="Unit in the file, such as gyr=deg/s, acc=g, mag=G, time=ms; repeatable."
        ),
    ] = field(default_factory=list)
    columns: Annotated[
        list[str],
        typer.Option(metavar="SENSOR=A,B,C", help="Columns by name or number, such as gyr=wx,wy,wz; repeatable."),
    ] = field(default_factory=list)
    frame: Annotated[
        str | None,
        typer.Option(metavar="NED|ENU|NWU", help="Navigation frame of the result; the file's own when not given."),
    ] = None
    calibration: Annotated[
        str | None, typer.Option(metavar="FILE", help="Correct the sensors first, with what 'calibrate' wrote.")
    ] = None
    array: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Geometry (TOML) of the array of accelerometers, where REC has none."),
    ] = None
    remap: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="New axes in terms of the old, such as y,-x,z.")
    ] = None
    align: Annotated[
        str | None,
        typer.Option(
            metavar="KIND", help="What separates the reference's axes from the sensor's: none, heading or rotations."
        ),
    ] = None
    sort: Annotated[bool, typer.Option("--sort", help="Sort the samples by time first.")] = False
    start: Annotated[
        str | None, typer.Option(metavar="S", help="Leave out what is earlier; seconds after the first sample.")
    ] = None
    stop: Annotated[
        str | None, typer.Option(metavar="S", help="Leave out what is later; seconds after the first sample.")
    ] = None

    def load(self) -> Recording:
        """Read the recording, sort it, turn its axes and cut it."""
        import northdown.io
        from northdown._validation import check_choice

        stdin = self.source == "-"
        size = 0 if stdin else _size(self.source)
        with console.busy(f"reading {self.source}", show=size > _BIG):
            recording = northdown.io.read(
                _standard_input() if stdin else self.source,
                format=self.format,
                rate=None if self.rate is None else read_number("--rate", self.rate, above=0.0, unit="Hz"),
                units=_units(self.unit) or None,
                columns=_columns(self.columns) or None,
                frame=self.frame,
                array=self.array,
            )
        if self.align is not None:
            offset = cast("ReferenceOffset", check_choice("--align", self.align, _ALIGNMENTS))
            recording = replace(recording, reference_offset=offset)
        if self.sort:
            recording = recording.sort()
        if self.calibration is not None:
            import northdown.calibration

            recording = northdown.calibration.load(self.calibration).apply(recording)
        if self.remap is not None:
            recording = recording.remap(self.remap)
        return self._cut(recording)

    def _cut(self, recording: Recording) -> Recording:
        if self.start is None and self.stop is None:
            return recording
        start = 0.0 if self.start is None else read_number("--start", self.start, low=0.0, unit="s")
        stop = math.inf if self.stop is None else read_number("--stop", self.stop, low=start, unit="s")
        first = float(recording.time.min()) if len(recording) else 0.0
        # the sample at --stop itself belongs to the part
        part = recording.between(first + start, math.nextafter(first + stop, math.inf))
        if not len(part):
            until = "the end" if self.stop is None else f"{stop:g} s"
            raise InputError(
                expected(f"samples from {start:g} s to {until}", f"none in {recording.duration:g} s of recording")
            )
        return part


def reads_recording(command: Callable[Concatenate[Reading, P], None]) -> Callable[..., None]:
    """Give a command the argument and the options of `Reading`, after its own.

    The command takes a `Reading` first; the returned function has a signature in which typer finds all of them.
    """
    hints = get_type_hints(Reading, include_extras=True)
    shared = [
        inspect.Parameter(f.name, inspect.Parameter.KEYWORD_ONLY, annotation=hints[f.name], default=_default(f))
        for f in fields(Reading)
    ]
    own = [
        p.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        for p in list(inspect.signature(command, eval_str=True).parameters.values())[1:]
    ]
    names = [f.name for f in fields(Reading)]

    @functools.wraps(command)
    def with_reading(**values: Any) -> None:
        reading = Reading(**{name: values.pop(name) for name in names})
        command(reading, **values)  # type: ignore[call-arg]

    with_reading.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
    with_reading.__annotations__ = {p.name: p.annotation for p in (*own, *shared)}
    return with_reading


def recording_optional(command: Callable[..., None]) -> Callable[..., None]:
    """Let the recording of a command be left out; its source is then `NO_RECORDING`."""

    @functools.wraps(command)
    def run(**values: Any) -> None:
        command(**values)

    signature = inspect.signature(command)
    run.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[
            p.replace(default=NO_RECORDING) if p.name == "source" else p for p in signature.parameters.values()
        ]
    )
    return run


def _default(f: Any) -> Any:
    if f.default_factory is not MISSING:
        return f.default_factory()
    return inspect.Parameter.empty if f.default is MISSING else f.default


def _size(path: str) -> int:
    try:
        return Path(path).stat().st_size
    except (OSError, ValueError):
        return 0


def _standard_input() -> BinaryIO:
    if sys.stdin is None or sys.stdin.isatty():
        raise InputError(expected("data on standard input", "a terminal", do="write: northdown … - < file"))
    return sys.stdin.buffer


def _pairs(option: str, texts: Iterable[str], known: tuple[str, ...], example: str) -> dict[str, str]:
    """Texts such as ``gyr=deg/s`` as a dict, each key once."""
    pairs: dict[str, str] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key:
            raise InputError(expected(f"{option} as {example}", repr(text)))
        if key not in known:
            raise InputError(expected(f"{', '.join(known[:-1])} or {known[-1]} in {option} {example}", repr(key)))
        if key in pairs:
            raise InputError(expected(f"one {option} for {key}", "two"))
        pairs[key] = value
    return pairs


def _units(texts: Iterable[str]) -> dict[str, str | float]:
    """Units by quantity; a number is the factor to SI."""

    def read(text: str) -> str | float:
        try:
            return float(text)
        except ValueError:
            return text

    known = ("array", "time", "gyr", "acc", "mag")
    return {key: read(unit) for key, unit in _pairs("--unit", texts, known, "gyr=deg/s").items()}


def _columns(texts: Iterable[str]) -> dict[str, list[str | int]]:
    """Columns by quantity, by name or by number from 0; none leaves the quantity out."""
    known = ("array", "time", "gyr", "acc", "mag", "reference", "movement")
    found: dict[str, list[str | int]] = {}
    for key, names in _pairs("--columns", texts, known, "gyr=a,b,c").items():
        parts = [name.strip() for name in names.split(",")] if names else []
        found[key] = [int(part) if part.isdecimal() else part for part in parts]
    return found


def same_file(a: str | os.PathLike[str], b: str | os.PathLike[str]) -> bool:
    """Whether two paths name the same existing file."""
    try:
        return os.path.samefile(a, b)
    except (OSError, ValueError):
        return False
