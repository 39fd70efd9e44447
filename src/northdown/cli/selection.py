"""Which estimators run on a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from northdown.errors import InputError, expected

if TYPE_CHECKING:
    from northdown.estimators import Estimator
    from northdown.recording import Recording

DEFAULT_ESTIMATOR = "calibrating-ekf"


def missing_sensors(estimator: type[Estimator], recording: Recording) -> list[str]:
    """Sensors that the estimator needs and of which the recording has not one sample."""
    import numpy as np

    values = {s: recording.array_acc if s == "array" else getattr(recording, s) for s in estimator.needs}
    return [s for s, value in values.items() if value is None or np.isnan(value).any(axis=1).all()]


def check_sensors(estimator: type[Estimator], recording: Recording) -> None:
    """Raise, with the names of the estimators that would run, when a needed sensor is not there."""
    from northdown.estimators import registry

    missing = missing_sensors(estimator, recording)
    if missing:
        able = [name for name, other in registry().items() if not missing_sensors(other, recording)]
        raise InputError(
            expected(
                f"{' and '.join(estimator.needs)} for {estimator.name}",
                f"no {' and no '.join(missing)} in the recording",
                do=f"choose {' or '.join(able)} with -e" if able else None,
            )
        )


def check_smooths(estimator: type[Estimator]) -> None:
    """Raise, with the names of those that can, when the estimator cannot use the whole recording."""
    from northdown.estimators import registry

    if not estimator.smooths:
        able = [name for name, other in registry().items() if other.smooths]
        raise InputError(
            expected(
                "an estimator that smooths for --offline", estimator.name, do=f"choose {' or '.join(able)} with -e"
            )
        )


def named(texts: Sequence[str]) -> list[type[Estimator]]:
    """Estimators from names separated by commas, each once, in the order given."""
    from northdown.estimators import get

    names = [name.strip() for text in texts for name in text.split(",")]
    return [get(name) for name in dict.fromkeys(names) if name]


def all_for(recording: Recording) -> tuple[list[type[Estimator]], list[str]]:
    """Every estimator for which the sensors suffice, the default first, and why each of the others was left out.

    Those for accelerometer arrays go without saying where there is none.
    """
    from northdown.estimators import registry

    able, left_out = [], []
    for name, estimator in sorted(registry().items(), key=lambda item: item[0] != DEFAULT_ESTIMATOR):
        missing = missing_sensors(estimator, recording)
        if "array" in missing:
            continue
        if missing:
            left_out.append(f"{name} (needs {' and '.join(missing)})")
        else:
            able.append(estimator)
    return able, left_out
