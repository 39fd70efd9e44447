"""The parameters of an estimator: listed from its class, and read from ``-p name=value``."""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import math
import types
import typing
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, Literal

from northdown.arrays import AccelerometerArray
from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.estimators import Estimator

_SWITCH = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One parameter of an estimator.

    Parameters
    ----------
    name : str
        As on the command line.
    kind : {"number", "whole number", "switch", "choice"}
        What may be given.
    default : float, bool, str or None
        Value when not given.
    unit : str
        Unit, empty for a pure number.
    low, high : float
        Smallest and largest value of a number.
    above : float, optional
        Value that a number must exceed.
    choices : tuple of str
        What can be chosen.
    optional : bool
        Whether ``none`` may be given.
    text : str
        What the docstring says of it.
    """

    name: str
    kind: Literal["number", "whole number", "switch", "choice"]
    default: Any
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    above: float | None = None
    choices: tuple[str, ...] = ()
    optional: bool = False
    text: str = ""

    @property
    def range(self) -> str:
        """Valid values in words."""
        return f"{self._range}, or none" if self.optional else self._range

    @property
    def _range(self) -> str:
        if self.kind == "choice":
            return " | ".join(self.choices)
        if self.kind == "switch":
            return "true | false"
        if self.above is not None:
            return f"> {self.above:g}" + (f", ≤ {self.high:g}" if math.isfinite(self.high) else "")
        if math.isfinite(self.low) and math.isfinite(self.high):
            return f"{self.low:g} to {self.high:g}"
        if math.isfinite(self.low):
            return f"≥ {self.low:g}"
        return f"≤ {self.high:g}" if math.isfinite(self.high) else "any"

    def read(self, text: str) -> Any:
        """Value from what was typed; the range of numbers is left to the estimator's own check."""
        if self.optional and text.lower() == "none":
            return None
        if self.kind == "choice":
            if text in self.choices:
                return text
        elif self.kind == "switch":
            if text.lower() in _SWITCH:
                return _SWITCH[text.lower()]
        else:
            try:
                return int(text) if self.kind == "whole number" else float(text)
            except ValueError:
                pass
        valid = f"{self.range}{' ' + self.unit if self.unit else ''}"
        raise InputError(expected(f"a {self.kind} for {self.name} ({valid})", repr(text)))

    def show(self, value: Any) -> str:
        """A value as text, with its unit."""
        if value is None:
            return "none"
        if self.kind not in ("number", "whole number"):
            return str(value).lower() if self.kind == "switch" else str(value)
        return f"{value:g}{' ' + self.unit if self.unit else ''}"


def describe(estimator: type[Estimator]) -> dict[str, Parameter]:
    """The parameters of an estimator by name, in the order of its definition."""
    hints = typing.get_type_hints(estimator)
    texts: dict[str, str] = {}
    for cls in reversed(estimator.__mro__):  # a parameter may be explained where it is inherited from
        texts |= parameter_texts(inspect.cleandoc(cls.__doc__ or ""))
    found: dict[str, Parameter] = {}
    for f in dataclasses.fields(estimator):
        hint, metadata = hints[f.name], dict(f.metadata)
        if types.NoneType in typing.get_args(hint):
            metadata["optional"] = True
            hint = next(a for a in typing.get_args(hint) if a is not types.NoneType)
        if isinstance(hint, type) and issubclass(hint, AccelerometerArray):  # not to be written as a text
            continue
        kind: Literal["number", "whole number", "switch", "choice"] = "number"
        if typing.get_origin(hint) is Literal:
            kind = "choice"
            metadata["choices"] = typing.get_args(hint)
        elif hint is bool:
            kind = "switch"
        elif hint is int:
            kind = "whole number"
        found[f.name] = Parameter(f.name, kind, f.default, text=texts.get(f.name, ""), **metadata)
    return found


def read_assignments(estimator: type[Estimator], assignments: Iterable[str]) -> dict[str, Any]:
    """Values of parameters from texts such as ``kp=0.5``.

    Raises
    ------
    InputError
        For an unknown name, a text of the wrong kind, or a name given twice.
    """
    known = describe(estimator)
    values: dict[str, Any] = {}
    for assignment in assignments:
        name, equals, text = (part.strip() for part in assignment.partition("="))
        if not equals or not name:
            raise InputError(expected("a parameter as name=value", repr(assignment), do="write -p kp=0.5"))
        if name not in known:
            raise InputError(_unknown(estimator.name, name, list(known)))
        if name in values:
            raise InputError(expected(f"{name} once", "two values for it", do=f"give one -p {name}=…"))
        values[name] = known[name].read(text)
    return values


def _unknown(estimator: str, name: str, known: list[str]) -> str:
    if not known:
        return expected(f"no parameter for {estimator}, which has none", repr(name))
    close = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.5)
    hint = f"did you mean {close[0]!r}?" if close else None
    return expected(f"a parameter of {estimator} out of {', '.join(known)}", repr(name), do=hint)


def summary(estimator: type[Estimator]) -> str:
    """First sentence or line of the estimator's docstring."""
    lines = (inspect.getdoc(estimator) or "").split("\n\n")[0].splitlines()
    return " ".join(line.strip() for line in lines)


def parameter_texts(docstring: str) -> dict[str, str]:
    """What the section 'Parameters' of a numpydoc docstring says of each name."""
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in _section(docstring.splitlines(), "Parameters"):
        if line and not line[0].isspace():
            names = [n.strip() for n in line.partition(":")[0].split(",")]
            texts |= dict.fromkeys(names, "")
        else:
            for name in names:
                texts[name] = f"{texts[name]} {line.strip()}".strip()
    return {name: text.replace("`", "") for name, text in texts.items()}


def _section(lines: list[str], title: str) -> Iterator[str]:
    """Lines of one section: after its underlined title, up to the next underlined title."""
    inside = False
    for k, line in enumerate(lines):
        underline = lines[k + 1].strip() if k + 1 < len(lines) else ""
        is_title = len(underline) > 2 and not underline.strip("-")
        if is_title:
            inside = line.strip() == title
        elif inside and not (len(line.strip()) > 2 and not line.strip("- ")):
            yield line
