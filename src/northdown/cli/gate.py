"""What the findings of a recording's check mean for a command: warn, or stop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from northdown.cli import console
from northdown.cli.numbers import read_number
from northdown.errors import InputError

if TYPE_CHECKING:
    from northdown.checks import Finding
    from northdown.estimators import Estimator
    from northdown.recording import Recording

Force = Annotated[bool, typer.Option("--force", help="Go on although the check of the recording found an error.")]
MaxGap = Annotated[
    str,
    typer.Option("--max-gap", metavar="S", help="Longest time for which the last rate is held while gyr has none."),
]
DEFAULT_MAX_GAP = 0.1
MAX_GAP_TEXT = f"{DEFAULT_MAX_GAP:g}"


def read_max_gap(text: str) -> float:
    """Read the option ``--max-gap``, s."""
    return read_number("--max-gap", text, low=0.0, unit="s")


def admit(recording: Recording, estimators: Sequence[type[Estimator]], *, max_gap: float, force: bool) -> None:
    """Check a recording for estimators; see `admit_sensors`."""
    used = {sensor for estimator in estimators for sensor in estimator.uses}
    admit_sensors(recording, used, max_gap=max_gap, force=force)


def admit_sensors(recording: Recording, used: set[str], *, max_gap: float, force: bool) -> None:
    """Check a recording: warnings go to standard error, an error stops unless `force`.

    What concerns only a sensor that is not used is left out.

    Raises
    ------
    InputError
        With the first error found, without `force`.
    """
    unused = {"gyr", "acc", "mag"} - used
    findings = [f for f in recording.check() if f.kind.partition("-")[0] not in unused]
    errors = [f for f in findings if f.severity == "error" and not _may_be_bridged(f, recording, max_gap)]
    if errors and not force:
        more = f" (and {len(errors) - 1} more: see northdown info)" if len(errors) > 1 else ""
        raise InputError(f"{errors[0].message}{more}; --force goes on all the same")
    for finding in findings:
        if finding.severity != "note":
            label = "warning, forced" if finding in errors else "warning"
            console.warn(f"{label}: {finding.message}")


def _may_be_bridged(finding: Finding, recording: Recording, max_gap: float) -> bool:
    """Whether the gyroscope's gaps are left to the estimator, as the user allows longer ones than the check does."""
    import numpy as np

    if finding.kind != "gyr-missing" or max_gap <= DEFAULT_MAX_GAP or recording.gyr is None:
        return False
    return not bool(np.isnan(recording.gyr).any(axis=1).all())
