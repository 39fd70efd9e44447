"""The x-IMU on a foot: a walk along a straight line over a level floor.

Its publisher gives no length. The example published with it (acceleration integrated between stances, with the drift
of each step taken off linearly; Gait-Tracking-With-x-IMU, Script.m) finds 18.73 m in 13 strides on these samples.
"""

from __future__ import annotations

import numpy as np
import pytest

import northdown as nd
from northdown.navigation import AngularRateEnergy, Trajectory

LENGTH = 18.73  # m


@pytest.fixture(scope="module")
def recording(data_root) -> nd.Recording:
    return nd.datasets.ximu(data_root)


def aside(found: Trajectory) -> np.ndarray:
    """Distance from the straight line between start and end, m."""
    along = found.position[-1, :2] / np.linalg.norm(found.position[-1, :2])
    return found.position[:, :2] @ np.array([-along[1], along[0]])


@pytest.mark.parametrize("detector", [None, AngularRateEnergy()], ids=["shoe", "rate"])
def test_straight_line(recording, detector):
    found = nd.navigate(recording, detector=detector)
    assert (np.diff(found.still.astype(int)) == 1).sum() == 13
    assert found.closure(horizontal=True) == pytest.approx(LENGTH, rel=0.02)
    assert found.distance(horizontal=True) / found.closure(horizontal=True) < 1.02  # straight
    assert np.abs(aside(found)).max() < 0.3  # m; the foot swings out sideways too
    assert abs(found.height[-1]) < 0.02 * LENGTH
    assert abs(found.height[-1]) < 3.0 * found.position_sigma[-1, 2]
    # stances stand on a floor that is level: its slope is the drift, what is left the scatter
    stances = found.still & (found.time > 8.0)
    slope = np.polyfit(found.position[stances, 0], found.height[stances], 1)
    assert np.std(found.height[stances] - np.polyval(slope, found.position[stances, 0])) < 0.02


def test_strapdown_alone_is_lost(recording):
    found = nd.navigate(recording, zero_velocity=False)
    assert found.closure() > 5.0 * LENGTH
    # and it says so
    assert (np.abs(found.position[-1]) < 3.0 * np.maximum(found.position_sigma[-1], 1.0)).all()
