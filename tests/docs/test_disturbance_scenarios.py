"""The simulated scenarios behind the tables of docs/guides/disturbances.md are what they are called."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

EARTH = 50.0 * np.array([math.cos(math.radians(65.0)), 0.0, math.sin(math.radians(65.0))])


@pytest.fixture
def scenarios(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    return pytest.importorskip("_scenarios")


def field_n(case) -> np.ndarray:
    """The measured field, turned to NED by the truth."""
    return case.recording.reference.rotation.apply(case.recording.mag)


def test_magnet_has_the_field_asked_for(scenarios):
    place, wanted = np.array([0.3, -0.5, 0.2]), np.array([5.0, -7.0, 11.0])
    found = scenarios.magnet(wanted, place, -place).field(np.zeros(1), np.zeros((3, 1)))[:, 0]
    # closed form, so rounding only (µT)
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_magnet_is_there_for_the_whole_minute_and_then_gone(scenarios):
    case, calm = scenarios.minute(1), scenarios.calm(1)
    time = case.recording.time
    # the same motion and the same errors, so that the difference is the magnet's, but for rounding to 0.15 µT
    extra = np.linalg.norm(case.recording.mag - calm.recording.mag, axis=1)
    inside, outside = (time > 120.0) & (time < 180.0), (time < 118.0) | (time > 182.0)
    assert extra[inside].min() > 3.0
    assert extra[outside].max() < 0.5
    assert case.disturbed[inside].all()
    assert not case.disturbed[outside].any()


@pytest.mark.parametrize(
    ("name", "horizontal"), [("new field, same north", (8.0, 0.0)), ("new field, north turned", (-3.0, 12.0))]
)
def test_new_field_stays(scenarios, name, horizontal):
    case = scenarios.SCENARIOS[name](1)
    late = case.recording.time > 152.0
    # constant errors of the sensor turn with the body and average out to below 1 µT over its turns
    np.testing.assert_allclose(field_n(case)[late].mean(axis=0)[:2], EARTH[:2] + horizontal, atol=1.0)


@pytest.mark.parametrize(("banked", "sideways"), [(False, 4.0), (True, 0.0)])
def test_long_turn_feels_what_physics_demands(scenarios, banked, sideways):
    case = scenarios.long_turn(1, banked=banked, name="turn")
    time = case.recording.time
    steady = (time > 45.0) & (time < 155.0)
    force = case.recording.acc[steady].mean(axis=0)
    # a right turn pushes to the right (y); what calibration leaves is some 0.01 m/s² on each axis
    assert force[1] == pytest.approx(sideways, abs=0.05)
    assert np.linalg.norm(force) == pytest.approx(math.hypot(9.80665, 4.0), abs=0.05)
    assert case.disturbed[steady].all()


def test_town_stops_and_speeds_up(scenarios):
    case = scenarios.town(1)
    time = case.recording.time
    ahead = case.recording.acc[:, 0]
    # 12 m/s within 6 s and 5 s along a quintic, whose steepest slope is 15/8 of the mean; 0.1 m/s² of noise
    assert ahead[(time > 20.0) & (time < 26.0)].max() == pytest.approx(12.0 / 6.0 * 15.0 / 8.0, abs=0.1)
    assert ahead[(time > 34.0) & (time < 39.0)].min() == pytest.approx(-12.0 / 5.0 * 15.0 / 8.0, abs=0.1)
