"""Findings of a recording's check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from northdown._validation import FloatArray

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing found in a recording.

    Parameters
    ----------
    kind : str
        Short stable name such as ``"gyr-unit"``, for programs.
    severity : {"error", "warning", "note"}
        ``"error"``: results will be wrong; ``"warning"``: may be; ``"note"``: for information.
    message : str
        What was found and what to do, for people.
    at : int, optional
        First sample concerned.
    """

    kind: str
    severity: Severity
    message: str
    at: int | None = None


class Findings(tuple[Finding, ...]):
    """Findings, worst first."""

    __slots__ = ()

    def __str__(self) -> str:
        return "\n".join(f"{f.severity}: {f.message}" for f in self) or "nothing found"


def check_recording(
    time: FloatArray,
    gyr: FloatArray | None,
    acc: FloatArray | None,
    mag: FloatArray | None,
    *,
    frame: str,
    mag_unit: str,
) -> Findings:
    """Check the arrays of a recording; see `Recording.check`."""
    return Findings()
