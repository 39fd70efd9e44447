"""What the tests of files share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import northdown as nd
from northdown.errors import InputError, NorthdownError

Refused = Callable[..., str]


@pytest.fixture
def refused() -> Refused:
    """Call a function that must refuse with one clear line; gives the message."""

    def check(call: Callable[[], Any], *parts: str, kind: type[NorthdownError] = InputError) -> str:
        with pytest.raises(kind) as caught:
            call()
        message = str(caught.value)
        assert message.startswith("expected ")
        assert ", got " in message
        assert "\n" not in message
        assert len(message) < 700
        for part in parts:
            assert part in message
        # one error, not a chain: no traceback of the parser under it
        assert caught.value.__suppress_context__ or caught.value.__context__ is None
        return message

    return check


@pytest.fixture
def text(tmp_path: Path) -> Callable[..., Path]:
    """Write a text file and give its path."""

    def write(content: str, name: str = "log.csv", encoding: str = "utf-8") -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode(encoding))
        return path

    return write


@pytest.fixture
def full_recording() -> nd.Recording:
    """Recording with everything a file has to keep, and nothing regular about it."""
    rng = np.random.default_rng(7)
    n = 40
    time = 3.0 + np.cumsum(rng.uniform(0.005, 0.02, n))
    mag = rng.normal(0.0, 40.0, (n, 3))
    mag[::3] = np.nan
    acc = rng.normal(0.0, 10.0, (n, 3))
    acc[5] = np.nan
    seen = np.sort(rng.choice(n, 25, replace=False))
    quat = rng.normal(size=(25, 4))
    half = rng.normal(size=(25, 3, 3)) * 0.01
    reference = nd.Orientation(
        time[seen],
        quat / np.linalg.norm(quat, axis=1, keepdims=True),
        "NWU",
        covariance=half @ half.transpose(0, 2, 1),
        gyr_bias=rng.normal(size=(25, 3)),
        gyr_bias_sigma=rng.random((25, 3)),
        flags=rng.integers(0, 16, 25),
        name="truth, of a kind",
    )
    return nd.Recording(
        time,
        rng.normal(size=(n, 3)),
        acc,
        mag,
        reference,
        rng.random(n) > 0.5,
        "ENU",
        "Läufer 3",
        "arbitrary",
        "heading",
    )


def same_arrays(a: Any, b: Any) -> bool:
    """Equal to the last digit, NaN to NaN; or both absent."""
    return (a is None and b is None) or (a is not None and b is not None and np.array_equal(a, b, equal_nan=True))


@pytest.fixture(scope="session")
def assert_same_orientation() -> Callable[[nd.Orientation, nd.Orientation], None]:
    """Compare orientations to the last digit."""

    def check(a: nd.Orientation, b: nd.Orientation) -> None:
        for key in ("time", "quat", "covariance", "gyr_bias", "gyr_bias_sigma", "flags"):
            assert same_arrays(getattr(a, key), getattr(b, key)), key
        assert (a.frame, a.name) == (b.frame, b.name)

    return check


@pytest.fixture(scope="session")
def assert_same(assert_same_orientation: Callable[..., None]) -> Callable[[nd.Recording, nd.Recording], None]:
    """Compare recordings to the last digit."""

    def check(a: nd.Recording, b: nd.Recording) -> None:
        for key in ("time", "gyr", "acc", "mag", "movement"):
            assert same_arrays(getattr(a, key), getattr(b, key)), key
        for key in ("frame", "name", "mag_unit", "reference_offset"):
            assert getattr(a, key) == getattr(b, key), key
        assert (a.reference is None) == (b.reference is None)
        if a.reference is not None and b.reference is not None:
            assert_same_orientation(a.reference, b.reference)

    return check
