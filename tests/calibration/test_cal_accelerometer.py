"""Accelerometer from positions of rest: truth recovered, σ honest, what few positions allow, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from cal_truth import ACC_MATRIX, ACC_OFFSET, GRAVITY, chi2_bounds, directions, positions_recording
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from northdown.calibration import calibrate_accelerometer
from northdown.calibration.accelerometer import count_positions
from northdown.errors import InputError
from northdown.recording import Recording

RNG = np.random.default_rng
FACES = np.vstack([np.eye(3), -np.eye(3)])
EDGES = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1], [-1, 1, 0], [1, 0, -1], [0, -1, 1]]) / np.sqrt(2.0)


def test_offset_scale_and_cross_axis_are_recovered() -> None:
    part = calibrate_accelerometer(positions_recording(np.vstack([FACES, EDGES]))).acc
    assert part.evidence.model == "offset, scale and cross-axis"
    assert part.evidence.samples == 12
    assert np.abs(part.offset - ACC_OFFSET).max() < 0.01  # m/s²; the means' noise is 0.002
    assert np.abs(part.matrix - ACC_MATRIX).max() < 1e-3
    assert part.evidence.before > 0.1
    assert part.evidence.after < 0.005
    assert part.norm == GRAVITY


def test_sigma_is_honest() -> None:
    seeds = 50
    errors = []
    for seed in range(seeds):
        part = calibrate_accelerometer(positions_recording(directions(RNG(seed), 20), seed=seed, rate=50.0)).acc
        assert part.evidence.model == "offset, scale and cross-axis"
        upper = np.triu_indices(3)
        matrix = ((part.matrix - ACC_MATRIX) / part.matrix_sigma)[upper]
        errors.append(np.concatenate([(part.offset - ACC_OFFSET) / part.offset_sigma, matrix]))
    low, high = chi2_bounds(9 * seeds)
    assert low < np.mean(np.square(errors)) < high


def test_six_faces_give_offset_and_scale_and_say_so() -> None:
    part = calibrate_accelerometer(positions_recording(FACES)).acc
    assert part.evidence.model == "offset and scale"
    off_diagonal = part.matrix - np.diag(np.diag(part.matrix))
    assert not off_diagonal.any()
    # cross-axis sensitivity of 0.4 % moves what a face shows by its square only
    assert np.abs(part.offset - ACC_OFFSET).max() < 0.01  # m/s²
    assert np.abs(np.diag(part.matrix) - np.diag(ACC_MATRIX)).max() < 1e-3
    notes = " ".join(part.evidence.notes)
    assert "6 positions are too few for offset, scale and cross-axis, 9 are needed" in notes
    assert "nothing checks the result" in notes


@pytest.mark.parametrize(
    ("up", "message"),
    [
        (FACES[:1], "1 positions are too few for offset"),
        (np.repeat(FACES[:1], 12, axis=0), "1 positions are too few"),
        (FACES[:3], "uncertain to"),
        (FACES[:5], "uncertain to"),
        (FACES[[0, 1, 3, 4]], "do not fix offset"),
        (np.column_stack([np.cos(np.arange(12)), np.sin(np.arange(12)), np.zeros(12)]), "do not fix offset"),
    ],
    ids=["one", "one, twelve times", "three", "five", "four in a plane", "twelve in a plane"],
)
def test_positions_that_do_not_suffice_are_refused(up: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        calibrate_accelerometer(positions_recording(up))
    assert "nine or more positions" in str(error.value)


def test_without_rest_it_is_refused() -> None:
    rng = RNG(1)
    shaken = Recording(np.arange(3000) / 100.0, gyr=rng.normal(size=(3000, 3)), acc=rng.normal(0.0, 8.0, (3000, 3)))
    with pytest.raises(InputError, match="rests of the sensor, got none of 1 s in 30 s"):
        calibrate_accelerometer(shaken)


def test_a_wrong_unit_is_told() -> None:
    recording = positions_recording(FACES)
    with pytest.raises(InputError, match="check the unit of acc"):
        calibrate_accelerometer(Recording(recording.time, gyr=recording.gyr, acc=recording.acc / 9.81))


def test_local_gravity_scales_the_result() -> None:
    recording = positions_recording(np.vstack([FACES, EDGES]))
    standard, local = calibrate_accelerometer(recording).acc, calibrate_accelerometer(recording, gravity=9.78).acc
    assert local.matrix == pytest.approx(standard.matrix * 9.78 / GRAVITY, abs=1e-7)
    assert local.offset == pytest.approx(standard.offset, abs=1e-6)
    with pytest.raises(InputError, match=r"gravity between 9 and 10\.5"):
        calibrate_accelerometer(recording, gravity=1.0)


def test_rotating_the_axes_turns_the_result() -> None:
    """What the symmetric form is chosen for."""
    recording = positions_recording(np.vstack([FACES, EDGES]))
    turn = Rotation.from_rotvec([0.3, 1.1, -0.5]).as_matrix()
    plain, turned = calibrate_accelerometer(recording).acc, calibrate_accelerometer(recording.rotate_body(turn)).acc
    assert turned.offset == pytest.approx(turn @ plain.offset, abs=1e-7)  # m/s²
    assert turned.matrix == pytest.approx(turn @ plain.matrix @ turn.T, abs=1e-8)


def test_one_bad_rest_is_left_out() -> None:
    up = directions(RNG(3), 20)
    recording = positions_recording(up)
    acc = np.array(recording.acc)
    acc[800:1100] *= 1.03  # the third rest, in a lift
    part = calibrate_accelerometer(Recording(recording.time, gyr=recording.gyr, acc=acc)).acc
    assert np.abs(part.offset - ACC_OFFSET).max() < 0.01  # m/s²
    assert any("1 rests were left out" in note for note in part.evidence.notes)


def test_noise_that_the_rests_do_not_show_enlarges_the_sigma() -> None:
    """Positions that differ by more than their noise, as on a table that shakes the calibration's own model."""
    up = directions(RNG(4), 24)
    plain = calibrate_accelerometer(positions_recording(up)).acc
    spoilt = positions_recording(up)
    acc = np.array(spoilt.acc)
    for k, size in enumerate(RNG(5).normal(1.0, 2e-3, 24)):
        acc[400 * k : 400 * k + 300] *= size
    part = calibrate_accelerometer(Recording(spoilt.time, gyr=spoilt.gyr, acc=acc)).acc
    assert part.offset_sigma.min() > 3.0 * plain.offset_sigma.max()
    assert np.abs((part.offset - ACC_OFFSET) / part.offset_sigma).max() < 4.0
    assert any("σ were enlarged" in note for note in part.evidence.notes)


def test_positions_are_counted_by_their_angle() -> None:
    assert count_positions(np.vstack([FACES, 9.0 * FACES])) == 6
    close = Rotation.from_rotvec([[0.0, 0.0, np.deg2rad(a)] for a in (0.0, 14.0, 16.0)]).apply([1.0, 0.0, 0.0])
    assert count_positions(close) == 2


@settings(max_examples=25, deadline=None)
@given(arrays(np.float64, st.tuples(st.integers(0, 60), st.just(3)), elements=st.floats(-1e9, 1e9) | st.just(np.nan)))
def test_hostile_arrays_are_refused_or_calibrated(acc: np.ndarray) -> None:
    try:
        part = calibrate_accelerometer(Recording(np.arange(len(acc)) * 0.1, acc=acc)).acc
    except InputError:
        return
    assert np.isfinite(part.offset).all()
