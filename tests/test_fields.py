"""Gravity and the Earth's magnetic field against published values and against the potential they come from."""

from __future__ import annotations

import datetime
import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from northdown import InputError, MissingDependencyError, Orientation
from northdown.fields import MagneticField, earth_field, normal_gravity, to_true_north
from northdown.simulation import random_motion

# NIMA TR8350.2, third edition: WGS 84
GM, OMEGA, A, F = 3.986004418e14, 7.292115e-5, 6378137.0, 1.0 / 298.257223563
B = A * (1.0 - F)
E = math.sqrt(A * A - B * B)


def potential(p: float, z: float) -> float:
    """Normal potential of gravity at distance p from the axis and z above the equator, in ellipsoidal coordinates."""
    r = p * p + z * z - E * E
    u = math.sqrt(0.5 * r * (1.0 + math.sqrt(1.0 + (2.0 * E * z / r) ** 2)))
    beta = math.atan2(z * math.hypot(u, E), u * p)

    def q(u: float) -> float:
        return 0.5 * ((1.0 + 3.0 * (u / E) ** 2) * math.atan(E / u) - 3.0 * u / E)

    turning = 0.5 * OMEGA**2 * (A * A * q(u) / q(B) * (math.sin(beta) ** 2 - 1.0 / 3.0) + p * p)
    return GM / E * math.atan(E / u) + turning


def gravity_of_the_potential(latitude: float, height: float) -> float:
    n = A / math.sqrt(1.0 - F * (2.0 - F) * math.sin(latitude) ** 2)
    p, z = (n + height) * math.cos(latitude), (n * (1.0 - F) ** 2 + height) * math.sin(latitude)
    h, weights = 50.0, {-2: 1.0, -1: -8.0, 1: 8.0, 2: -1.0}
    dp = sum(w * potential(p + k * h, z) for k, w in weights.items()) / (12.0 * h)
    dz = sum(w * potential(p, z + k * h) for k, w in weights.items()) / (12.0 * h)
    return math.hypot(dp, dz)


def test_gravity_at_published_latitudes():
    # the derived constants of WGS 84 at the equator and the poles
    assert normal_gravity(0.0) == pytest.approx(9.7803253359, abs=1e-10)
    assert normal_gravity(math.pi / 2) == pytest.approx(9.8321849378, abs=1e-9)
    assert normal_gravity(-math.pi / 2) == normal_gravity(math.pi / 2)


@given(latitude=st.floats(-1.5, 1.5), height=st.floats(0.0, 20e3))
@settings(max_examples=50, deadline=None)
def test_gravity_is_the_gradient_of_the_normal_potential(latitude, height):
    # cut-off of the free-air series at 20 km 1.5e-6; rounding of the potential 1e-8/50 m and cancellation in q
    assert normal_gravity(latitude, height) == pytest.approx(gravity_of_the_potential(latitude, height), abs=2e-6)


# Test values that NOAA publishes with the models: date, km, latitude, longitude, X, Y, Z, H, F (nT), I, D (°).
PUBLISHED = [
    (2015.0, 0, 80, 0, 6636.6, -451.9, 54408.9, 6651.9, 54814.0, 83.03, -3.90),
    (2017.5, 100, 0, 120, 37584.4, 235.7, -10600.5, 37585.1, 39051.4, -15.75, 0.36),
    (2020.0, 0, 80, 0, 6570.4, -146.3, 54606.0, 6572.0, 55000.1, 83.14, -1.28),
    (2020.0, 0, 0, 120, 39624.3, 109.9, -10932.5, 39624.4, 41104.9, -15.42, 0.16),
    (2020.0, 0, -80, 240, 5940.6, 15772.1, -52480.8, 16853.8, 55120.6, -72.20, 69.36),
    (2020.0, 100, 80, 0, 6261.8, -185.5, 52429.1, 6264.5, 52802.0, 83.19, -1.70),
    (2022.5, 0, 80, 0, 6529.9, 1.1, 54713.4, 6529.9, 55101.7, 83.19, 0.01),
    (2022.5, 0, 0, 120, 39684.7, -42.2, -10809.5, 39684.7, 41130.5, -15.24, -0.06),
    (2022.5, 0, -80, 240, 6016.5, 15776.7, -52251.6, 16885.0, 54912.1, -72.09, 69.13),
    (2022.5, 100, 0, 120, 37694.0, -35.3, -10362.0, 37694.1, 39092.4, -15.37, -0.05),
]


@pytest.mark.parametrize("row", PUBLISHED, ids=lambda r: f"{r[0]}-{r[1]}km-{r[2]}-{r[3]}")
def test_magnetic_field_at_published_places(row):
    date, kilometres, latitude, longitude, x, y, z, h, f, dip, declination = row
    field = earth_field(math.radians(latitude), math.radians(longitude), 1e3 * kilometres, date=date)
    # the tables have one decimal of a nanotesla and two of a degree
    assert field.ned * 1e3 == pytest.approx([x, y, z], abs=0.06)
    assert field.magnetic_ned * 1e3 == pytest.approx([h, 0.0, z], abs=0.06)
    assert (field.horizontal * 1e3, field.intensity * 1e3) == pytest.approx((h, f), abs=0.06)
    assert np.rad2deg([field.inclination, field.declination]) == pytest.approx([dip, declination], abs=0.0051)


def test_dates():
    place = math.radians(50.0), math.radians(8.0)
    summer = earth_field(*place, date="2023-07-02")
    assert summer == earth_field(*place, date=datetime.date(2023, 7, 2))
    assert summer == earth_field(*place, date=2023.0 + 182.0 / 365.0)
    assert summer.declination > earth_field(*place, date=2021.0).declination
    # each date has the model of its own five years
    assert earth_field(*place, date="2029-12-31").intensity == pytest.approx(49.5, abs=1.0)


def test_true_heading_is_magnetic_heading_and_declination():
    truth = random_motion(10.0, 1).orientation(rate=10.0)
    for frame in ("NED", "ENU", "NWU"):
        turned = to_true_north(truth.to_frame(frame), 0.2)
        assert turned.frame == frame
        before, after = truth.as_euler(), turned.to_frame("NED").as_euler()
        assert np.abs(np.angle(np.exp(1j * (after[:, 2] - before[:, 2] - 0.2)))).max() < 1e-12
        assert np.allclose(after[:, :2], before[:, :2], atol=1e-12)


def test_compass_with_the_models_field_finds_true_north():
    field = earth_field(math.radians(60.0), math.radians(-100.0), date=2026.0)
    assert abs(field.declination) > 0.02
    level = Orientation(np.zeros(1), np.array([[1.0, 0.0, 0.0, 0.0]]))
    # a level body whose x axis points to magnetic north sees no field along y
    true = to_true_north(level, field.declination)
    seen = true.rotation.inv().apply(field.ned)[0]
    assert seen == pytest.approx(field.magnetic_ned, abs=1e-9)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: normal_gravity(2.0), "latitude between"),
        (lambda: normal_gravity(0.0, 1e6), "height between"),
        (lambda: normal_gravity("north"), "a number for latitude"),
        (lambda: earth_field(0.0, 0.0, date=2009.9), "date between 2010 and"),
        (lambda: earth_field(0.0, 0.0, date="2030-01-01"), "date between 2010 and"),
        (lambda: earth_field(0.0, 0.0, date="yesterday"), "a date such as 2026-07-01, got 'yesterday'"),
        (lambda: earth_field(0.0, 0.0, 1e7, date=2026.0), "height between"),
        (lambda: earth_field(0.0, 7.0, date=2026.0), "longitude between"),
        (lambda: to_true_north(random_motion(2.0, 1).orientation(), 20.0), "declination between"),
    ],
)
def test_mistakes_are_told(make, match):
    with pytest.raises(InputError, match=match):
        make()


def test_without_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygeomag", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'northdown\[fields\]'"):
        earth_field(0.0, 0.0, date=2026.0)


def test_a_field_is_its_three_numbers():
    field = MagneticField(0.1, math.radians(60.0), 50.0)
    assert field.horizontal == pytest.approx(25.0)
    assert np.linalg.norm(field.ned) == pytest.approx(50.0)
    assert math.atan2(field.ned[1], field.ned[0]) == pytest.approx(0.1)
