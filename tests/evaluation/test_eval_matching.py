"""Matching in time: which samples count, and where the truth is interpolated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown.errors import InputError
from northdown.evaluation import attitude_error, match
from northdown.orientation import Orientation
from northdown.recording import Recording

RATE = 0.8  # rad/s about a fixed axis, so that interpolation has a closed form
AXIS = np.array([1.0, 2.0, -2.0]) / 3.0


def spin(time: np.ndarray, frame: str = "NED") -> Orientation:
    return Orientation.from_rotation(time, Rotation.from_rotvec(np.outer(time * RATE, AXIS)), frame)


def recording(time: np.ndarray, movement: np.ndarray, reference: Orientation) -> Recording:
    return Recording(time, np.zeros((len(time), 3)), movement=movement, reference=reference)


TIME = np.arange(100) * 0.01


def test_same_times_are_compared_sample_by_sample() -> None:
    found = match(spin(TIME), spin(TIME))
    assert found.index.tolist() == list(range(100))


def test_unseen_samples_of_a_shared_clock_do_not_count() -> None:
    seen = np.ones(100, dtype=bool)
    seen[[0, 30, 31, 50]] = False
    found = match(spin(TIME), spin(TIME)[seen])
    assert found.index.tolist() == np.flatnonzero(seen).tolist()
    assert np.array_equal(found.truth.time, TIME[seen])


def test_part_of_a_recording_against_the_whole_truth() -> None:
    seen = np.ones(100, dtype=bool)
    seen[45] = False
    found = match(spin(TIME)[40:60], spin(TIME)[seen])
    assert found.index.tolist() == [i for i in range(20) if i != 5]


def test_times_rounded_to_microseconds_are_the_same_clock() -> None:
    time = np.arange(1000) / 286.0
    seen = np.arange(1000) % 7 != 3
    found = match(spin(np.round(time, 6)), spin(time)[seen])
    assert found.index.tolist() == np.flatnonzero(seen).tolist()


def test_other_times_are_interpolated_exactly() -> None:
    estimate = spin(np.arange(5, 90) * 0.0117 + 0.0023)
    error = attitude_error(estimate, spin(TIME))
    inside = estimate.time <= TIME[-1]
    assert len(error) == inside.sum()
    # rad; at constant rate about one axis spherical interpolation is exact
    assert error.total.max() < 1e-12


def test_no_interpolation_across_long_gaps() -> None:
    truth = spin(np.concatenate([np.arange(50) * 0.01, 0.7 + np.arange(50) * 0.01]))
    estimate = spin(np.arange(1, 110) * 0.011)
    found = match(estimate, truth)
    time = estimate.time[found.index]
    assert not ((time > 0.49) & (time < 0.7)).any()
    known = ((estimate.time <= 0.49) | (estimate.time >= 0.7)) & (estimate.time <= truth.time[-1])
    assert found.index.tolist() == np.flatnonzero(known).tolist()
    wide = match(estimate, truth, max_gap=0.3)
    assert len(wide.index) == (estimate.time <= truth.time[-1]).sum()


@pytest.mark.parametrize(("period", "kept"), [(0.02, 0.1), (0.5, 1.5)])
def test_default_gap_is_a_tenth_of_a_second_or_three_periods(period: float, kept: float) -> None:
    def with_gap(gap: float) -> Orientation:
        steps = np.full(40, period)
        steps[20] = gap
        return spin(np.cumsum(steps))

    inside = with_gap(kept).time[19] + 0.4 * kept
    estimate = spin(np.array([inside, inside + 1e-3]))
    assert len(match(estimate, with_gap(kept)).index) == 2
    with pytest.raises(InputError, match="the truth has gaps there; raise max_gap"):
        match(estimate, with_gap(kept * 1.05))


def test_frames_are_brought_to_that_of_the_estimate() -> None:
    found = match(spin(TIME).to_frame("ENU"), spin(TIME))
    assert found.truth.frame == "ENU"
    assert attitude_error(spin(TIME).to_frame("ENU"), spin(TIME)).total.max() < 1e-14


def test_movement_is_carried_to_other_times() -> None:
    movement = (TIME >= 0.2) & (TIME < 0.5)
    estimate = spin(np.arange(1, 60) * 0.017)
    found = match(estimate, recording(TIME, movement, spin(TIME)))
    time = estimate.time[found.index]
    # the nearest sample decides, so the edges move by half a period
    assert time.min() >= 0.195
    assert time.max() < 0.495
    assert len(time) == ((estimate.time >= 0.195) & (estimate.time < 0.495)).sum()


def test_movement_does_not_reach_beyond_the_recording() -> None:
    all_moving = np.ones(50, dtype=bool)
    found = match(spin(TIME), recording(TIME[:50], all_moving, spin(TIME)))
    assert found.index.tolist() == list(range(50))


def test_one_sample_is_enough() -> None:
    assert match(spin(TIME[3:4]), spin(TIME)).index.tolist() == [0]
    assert match(spin(TIME), spin(TIME[3:4])).index.tolist() == [3]


def test_mistakes_get_one_clear_line() -> None:
    truth = spin(TIME)
    with pytest.raises(InputError, match=r"overlap in time, got 5 to 5.99 s and 0 to 0.99 s; bring both"):
        match(spin(TIME + 5.0), truth)
    with pytest.raises(InputError, match="a recording with a reference, got walk without"):
        attitude_error(truth, Recording(TIME, np.zeros((100, 3)), name="walk"))
    with pytest.raises(InputError, match="at least one sample to count, got 100 samples with a known truth and 0"):
        match(truth, truth, mask=np.zeros(100, dtype=bool))
    with pytest.raises(InputError, match=r"mask of shape \(100,\), got shape \(99,\)"):
        match(truth, truth, mask=np.ones(99, dtype=bool))
    with pytest.raises(InputError, match="truth as an Orientation or a Recording, got ndarray"):
        match(truth, np.eye(3))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="an estimate with samples, got none"):
        match(truth[:0], truth)
    with pytest.raises(InputError, match="a truth with samples, got none"):
        match(truth, truth[:0])
    with pytest.raises(InputError, match="max_gap of at least 0 s"):
        match(truth, truth, max_gap=-1.0)
    shuffled = recording(TIME[::-1], np.ones(100, dtype=bool), truth)
    with pytest.raises(InputError, match="time that does not run backwards"):
        match(truth, shuffled)
