"""Offset between the clocks: a motion in closed form whose gyroscope is stamped late by a known time."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown.datasets import broad
from northdown.errors import InputError
from northdown.estimators.gyro_integration import GyroIntegration
from northdown.evaluation import ClockOffset, attitude_error, clock_offset, match
from northdown.orientation import Orientation
from northdown.recording import Recording

LATE = 0.0037  # s
RATE, REFERENCE_RATE = 200.0, 120.0  # Hz; neither is a multiple of the other


def attitude(t: np.ndarray, seed: int = 0, size: float = 0.25) -> Rotation:
    """Three turns one after the other, each a sum of sines up to 1.5 Hz: rates of some 200 °/s."""
    rng = np.random.default_rng(seed)
    f, phase = rng.uniform(0.2, 1.5, (3, 3)), rng.uniform(0.0, 2.0 * math.pi, (3, 3))
    angles = size * np.sin(2.0 * math.pi * f[:, :, None] * t + phase[:, :, None]).sum(axis=1)
    return Rotation.from_euler("ZYX", angles.T)


def recorded(
    late: float = LATE, seed: int = 0, duration: float = 40.0, noise: float = 1.0, **motion: float
) -> Recording:
    """Mean rates from the attitude itself, stamped late; noise of 0.5 °/s and of 0.05° in the reference."""
    rng = np.random.default_rng(seed + 1000)
    time = np.arange(int(duration * RATE)) / RATE
    ends = attitude(np.append(time[0] - 1.0 / RATE, time) - late, seed, **motion)
    gyr = (ends[:-1].inv() * ends[1:]).as_rotvec() * RATE + np.radians([0.5, -1.0, 0.3])
    gyr += noise * np.radians(0.5) * rng.normal(size=gyr.shape)
    seen = np.arange(int(duration * REFERENCE_RATE)) / REFERENCE_RATE
    truth = attitude(seen, seed, **motion) * Rotation.from_rotvec(
        noise * np.radians(0.05) * rng.normal(size=(len(seen), 3))
    )
    return Recording(time=time, gyr=gyr, reference=Orientation.from_rotation(seen, truth, "NED"), name="analytic")


@pytest.mark.parametrize("late", [LATE, -LATE, 0.0, 0.213, -0.35])
def test_known_offset_is_found_with_its_sign(late: float) -> None:
    found = clock_offset(recorded(late))
    assert abs(found.offset - late) < 3.0 * found.sigma
    # 4 700 windows with errors of 0.05° / 50 ms in rates that change by some 1 000 °/s²
    assert 2e-6 < found.sigma < 1e-4
    assert 1000 < found.samples < 5000


def test_without_noise_it_is_exact() -> None:
    # What is left is that rates are means over 5 ms here and over 8 ms there; a hundredth of a sample
    assert clock_offset(recorded(noise=0.0)).offset == pytest.approx(LATE, abs=5e-5)


def test_sigma_is_the_scatter_over_seeds() -> None:
    found = [clock_offset(recorded(seed=seed, duration=15.0)) for seed in range(16)]
    normal = np.array([(f.offset - LATE) / f.sigma for f in found])
    # chi² of 16: 0.1 % to 99.9 % is 3.9 to 39.3, which is a mean square from 0.25 to 2.46
    assert 0.25 < np.mean(normal * normal) < 2.46


def test_body_axes_and_navigation_axes_of_the_reference_do_not_matter() -> None:
    plain = recorded()
    assert plain.reference is not None
    turned = plain.reference.turned(Rotation.from_rotvec([0.3, 1.0, -2.0]), Rotation.from_rotvec([2.0, -0.5, 0.4]))
    found = clock_offset(dataclasses.replace(plain, reference=turned, reference_offset="rotations"))
    # rounding only
    assert found.offset == pytest.approx(clock_offset(plain).offset, abs=1e-7)


def test_gaps_and_wild_samples_do_no_harm() -> None:
    recording = recorded()
    reference, gyr = recording.reference, recording.gyr
    assert reference is not None
    assert gyr is not None
    keep = np.ones(len(reference), bool)
    for begin in (300, 1500, 3000):
        keep[begin : begin + 200] = False
    wild = reference[keep]
    quat = wild.quat.copy()
    quat[500:520] = Rotation.random(20, rng=np.random.default_rng(1)).as_quat()
    gyr = gyr.copy()
    gyr[4000:4400] = np.nan
    holed = dataclasses.replace(recording, gyr=gyr, reference=Orientation(wild.time, quat, "NED"))
    found = clock_offset(holed)
    assert abs(found.offset - LATE) < 3.0 * found.sigma
    # two seconds of the gyroscope, and half a second and two windows beside them, are not used
    whole = clock_offset(recording).samples
    without = clock_offset(dataclasses.replace(recording, gyr=gyr)).samples
    assert 0.88 * whole < without < 0.95 * whole
    assert found.samples < 0.85 * whole
    # a gap of the clock itself
    moved = np.delete(np.arange(len(recording)), np.arange(2000, 2300))
    found = clock_offset(recording[moved])
    assert abs(found.offset - LATE) < 3.0 * found.sigma


def spinning(rate: float, duration: float = 30.0, noise: float = 1.0) -> Recording:
    """Turning about one axis all the time at the same rate."""
    t = np.arange(int(duration * 100.0)) / 100.0
    rng = np.random.default_rng(4)
    truth = Rotation.from_rotvec(np.outer(rate * t, [0.0, 0.0, 1.0]))
    gyr = np.tile([0.0, 0.0, rate], (len(t), 1)) + noise * 0.01 * rng.normal(size=(len(t), 3))
    truth = truth * Rotation.from_rotvec(noise * 1e-3 * rng.normal(size=(len(t), 3)))
    return Recording(time=t, gyr=gyr, reference=Orientation.from_rotation(t, truth, "NED"))


def test_too_little_motion_is_refused() -> None:
    with pytest.raises(InputError, match=r"expected 2 s faster than 20 °/s, .* got 0\.0 s"):
        clock_offset(spinning(0.1))
    with pytest.raises(InputError, match=r"motion that tells the offset between the clocks, got rates that leave it"):
        clock_offset(spinning(1.0))


def test_times_that_repeat_are_taken_or_refused() -> None:
    recording = recorded()
    reference = recording.reference
    assert reference is not None
    twice = reference[np.repeat(np.arange(len(reference)), 2)]
    found = clock_offset(dataclasses.replace(recording, reference=twice))
    assert abs(found.offset - LATE) < 3.0 * found.sigma
    frozen = Orientation(np.zeros(len(reference)), reference.quat, "NED")
    with pytest.raises(InputError, match="samples of different times"):
        clock_offset(dataclasses.replace(recording, reference=frozen))
    with pytest.raises(InputError, match="rates that hardly change"):
        clock_offset(spinning(1.0, noise=0.0))


def test_another_recordings_reference_is_refused() -> None:
    other = dataclasses.replace(recorded(), reference=recorded(seed=7).reference)
    with pytest.raises(InputError, match="turn alike, got rates that differ by"):
        clock_offset(other)
    with pytest.raises(InputError, match="raise limit"):
        clock_offset(recorded(0.4), limit=0.1)


def test_what_is_missing_is_said() -> None:
    recording = recorded(duration=10.0)
    with pytest.raises(InputError, match="with gyr"):
        clock_offset(dataclasses.replace(recording, gyr=None, acc=np.ones((len(recording), 3))))
    with pytest.raises(InputError, match="with a reference"):
        clock_offset(dataclasses.replace(recording, reference=None))
    with pytest.raises(InputError, match="three samples"):
        clock_offset(recording[:2])
    with pytest.raises(InputError, match="limit"):
        clock_offset(recording, limit=0.0)


@pytest.fixture(scope="module")
def late() -> tuple[Recording, Orientation]:
    """A gyroscope that is late, and its integral from the attitude that it shows at the first sample."""
    recording = recorded(noise=0.0)
    assert recording.gyr is not None
    bias = np.radians([0.5, -1.0, 0.3])
    clean = dataclasses.replace(recording, gyr=recording.gyr - bias)
    return clean, GyroIntegration().run(clean, initial=attitude(np.array([-LATE]))[0])


def test_aligned_errors_are_without_the_offset(late: tuple[Recording, Orientation]) -> None:
    recording, estimate = late
    as_recorded = attitude_error(estimate, recording)
    assert as_recorded.clock is None
    aligned = attitude_error(estimate, recording, clock="aligned")
    assert aligned.clock is not None
    assert "gyroscope 3.7" in repr(aligned)
    # late by 3.7 ms at about 200 °/s
    assert 0.3 < as_recorded.rmse().total_deg < 1.5
    # of 50 µs at 200 °/s 0.01° is left, and as much of interpolation between samples of the truth
    assert aligned.rmse().total_deg < 0.03
    assert aligned.rmse().total_deg < 0.05 * as_recorded.rmse().total_deg


def test_a_known_offset_can_be_given(late: tuple[Recording, Orientation]) -> None:
    recording, estimate = late
    known = ClockOffset(LATE, 0.0, 0)
    assert recording.reference is not None
    error = attitude_error(estimate, recording.reference, clock=known)
    # the truth in closed form, at the time that the late sample shows
    true = attitude(error.time - LATE)
    size = (estimate.rotation[error.index] * true.inv()).magnitude()
    # spherical interpolation of the truth over 8.3 ms, at up to 60 rad/s²: 60/8 · 8.3e-3² rad
    np.testing.assert_allclose(error.total, size, rtol=0.0, atol=6e-4)
    with pytest.raises(InputError, match="to align the clocks"):
        attitude_error(estimate, recording.reference, clock="aligned")
    with pytest.raises(InputError, match="clock"):
        attitude_error(estimate, recording, clock="late")  # type: ignore[arg-type]


def test_samples_that_do_not_count_as_recorded_do_not_count_aligned() -> None:
    t = np.arange(100) * 0.01
    known = np.ones(100, bool)
    known[40:45] = False
    estimate = Orientation.from_rotation(t, Rotation.from_rotvec(np.outer(t, [1.0, 2.0, 3.0])), "NED")
    truth = Orientation.from_rotation(t[known], estimate.rotation[known], "NED")
    assert np.array_equal(match(estimate, truth).index, np.flatnonzero(known))
    later = match(estimate, truth, late=0.004)
    assert np.array_equal(later.index, np.flatnonzero(known)[1:])
    # a constant rate: what is interpolated is exact
    expected = Rotation.from_rotvec(np.outer(t[later.index] - 0.004, [1.0, 2.0, 3.0]))
    assert (later.truth.rotation * expected.inv()).magnitude().max() < 1e-12


def test_words() -> None:
    assert str(ClockOffset(0.0023, 1e-5, 10)) == "gyroscope 2.300 ± 0.010 ms behind the reference"
    assert str(ClockOffset(-0.0023, 1e-5, 10)) == "gyroscope 2.300 ± 0.010 ms ahead of the reference"


def test_trials_of_one_system_agree(data_root: Path) -> None:
    """BROAD: one sensor, one optical system, never the same motion."""
    for name in ("05_undisturbed_slow_rotation_with_breaks_B", "35_disturbed_attached_magnet_4cm"):
        if not (data_root / "broad" / f"{name}.mat").is_file():
            pytest.skip(f"{name} is not at hand")
        found = clock_offset(broad(name, data_root))
        # all fourteen: 2.395 ms, scatter 0.049 ms
        assert found.offset == pytest.approx(2.395e-3, abs=3 * 0.049e-3)
        assert found.sigma < 5e-5
