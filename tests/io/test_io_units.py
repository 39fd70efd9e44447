"""Units: each spelling to its SI size, from the definitions of the units."""

from __future__ import annotations

import math

import pytest

from northdown.errors import InputError
from northdown.io.units import factor, is_arbitrary, is_unit, split_bracket


@pytest.mark.parametrize(
    ("quantity", "spellings", "size"),
    [
        ("gyr", ["rad/s", "rad/sec", "rad s^-1", "rad·s⁻¹", "RAD/S", "rad_s"], 1.0),
        ("gyr", ["deg/s", "°/s", "dps", "degrees/s", "deg s^-1", "deg_s"], math.pi / 180),
        ("gyr", ["mdps"], math.pi / 180_000),
        ("acc", ["m/s²", "m/s^2", "m/s2", "m/s/s", "m s^-2", "m s⁻²", "m_s2"], 1.0),
        ("acc", ["g", "G", "gn"], 9.80665),
        ("acc", ["mg", "mG"], 0.00980665),
        ("mag", ["uT", "µT", "μT", "microtesla"], 1.0),
        ("mag", ["nT"], 1e-3),
        ("mag", ["mT"], 1e3),
        ("mag", ["T", "tesla"], 1e6),
        ("mag", ["G", "gauss", "Gs"], 100.0),  # 1 G = 1e-4 T by definition of the CGS unit
        ("mag", ["mG", "mGauss"], 0.1),
        ("mag", ["a.u.", "arbitrary"], 1.0),
        ("time", ["s", "sec", "seconds"], 1.0),
        ("time", ["ms"], 1e-3),
        ("time", ["us", "µs"], 1e-6),
        ("time", ["ns"], 1e-9),
    ],
)
def test_factor(quantity: str, spellings: list[str], size: float) -> None:
    for spelling in spellings:
        assert factor(quantity, spelling) == pytest.approx(size, rel=1e-15)
        assert is_unit(quantity, spelling)


def test_no_unit_is_si_and_a_number_is_the_factor() -> None:
    assert factor("gyr", None) == 1.0
    assert factor("acc", 9.80665 / 16384) == 9.80665 / 16384


@pytest.mark.parametrize(("quantity", "unit"), [("gyr", "furlong"), ("acc", "deg/s"), ("mag", "g/s"), ("time", "")])
def test_unknown_unit(quantity: str, unit: str) -> None:
    with pytest.raises(InputError, match=f"a unit of {quantity}"):
        factor(quantity, unit)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_impossible_factor(value: float) -> None:
    with pytest.raises(InputError, match="factor"):
        factor("gyr", value)


def test_arbitrary() -> None:
    assert is_arbitrary(None)
    assert is_arbitrary("a.u.")
    assert not is_arbitrary("uT")
    assert not is_arbitrary(0.15)


@pytest.mark.parametrize(
    ("label", "parts"),
    [
        ("Gyroscope X (deg/s)", ("Gyroscope X", "deg/s")),
        ("w_x [rad s^-1]", ("w_x", "rad s^-1")),
        (" acc_x ", ("acc_x", None)),
        ("q_w []", ("q_w", None)),
        ("", ("", None)),
    ],
)
def test_split_bracket(label: str, parts: tuple[str, str | None]) -> None:
    assert split_bracket(label) == parts
