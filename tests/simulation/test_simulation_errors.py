"""Each error of a sensor by itself, against what it is said to do."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from northdown import InputError
from northdown.simulation import (
    LOW_COST,
    AboutAxis,
    Dipole,
    Fixed,
    Motion,
    SensorErrors,
    Shaking,
    SplinePath,
    Still,
    TriadErrors,
    accelerometer,
    gyroscope,
    magnetometer,
    measure,
    random_motion,
    rest,
    steady,
    swing,
)
from northdown.simulation.imu_errors_lag import _FilteredNoise
from northdown.simulation.imu_errors_noise import Gaps

TURN = Motion(AboutAxis(Rotation.identity(), (1, 2, -2), steady(1.5)), Still(), 0.0, 20.0)
RATE_B = 1.5 * np.array([1, 2, -2]) / 3.0


def only(**sensors) -> SensorErrors:
    return SensorErrors(**{"gyr": None, "acc": None, "mag": None} | sensors)


def over_seeds(motion, errors, sensor, count=300) -> np.ndarray:
    return np.array([getattr(measure(motion, errors, k), sensor).mean(axis=0) for k in range(count)])


def test_white_noise_has_the_stated_density():
    recording = measure(rest(400.0), LOW_COST, 6)
    for sensor in ("gyr", "acc", "mag"):
        # a standard deviation from n = 40 000 samples is known to 1/√(2n) = 0.35 %; four of these
        noise = getattr(LOW_COST, sensor).noise * 10.0
        assert getattr(recording, sensor).std(axis=0) == pytest.approx(noise, rel=0.015)


def test_noise_of_a_mean_rate_is_that_of_its_own_interval():
    time = np.cumsum(np.tile([0.001, 0.009], 20_000))
    gyr = measure(rest(300.0), only(gyr=TriadErrors(noise=0.1)), time=time).gyr
    assert gyr[2::2].std() == pytest.approx(0.1 / math.sqrt(0.001), rel=0.02)
    assert gyr[1::2].std() == pytest.approx(0.1 / math.sqrt(0.009), rel=0.02)


def test_turn_on_bias_differs_from_seed_to_seed():
    biases = over_seeds(rest(0.05), only(acc=TriadErrors(bias=(0.1, 0.2, 0.0))), "acc") - [0.0, 0.0, -9.80665]
    # a standard deviation from 300 draws is known to 4 %; four of these
    assert biases.std(axis=0) == pytest.approx([0.1, 0.2, 0.0], rel=0.16, abs=1e-12)


def test_scale_and_misalignment():
    errors = only(gyr=TriadErrors(scale=0.02, misalignment=0.01))
    ratio = over_seeds(TURN, errors, "gyr", 200) - RATE_B
    expected = np.sqrt((0.02 * RATE_B) ** 2 + 0.01**2 * ((RATE_B**2).sum() - RATE_B**2))
    assert ratio.std(axis=0) == pytest.approx(expected, rel=0.2)  # four standard errors of 200 draws


def test_g_sensitivity():
    responses = over_seeds(rest(0.05), only(gyr=TriadErrors(g_sensitivity=0.01)), "gyr")
    assert responses.std(axis=0) == pytest.approx([0.0980665] * 3, rel=0.16)


def test_hard_and_soft_iron_are_what_was_given():
    soft = np.array([[1.1, 0.05, 0.0], [0.02, 0.9, -0.03], [0.0, 0.1, 1.0]])
    errors = only(mag=TriadErrors(matrix=soft, offset=(10.0, -20.0, 5.0)))
    plain = measure(TURN, only(mag=TriadErrors())).mag
    assert np.allclose(measure(TURN, errors).mag, plain @ soft.T + [10.0, -20.0, 5.0], atol=1e-12)


def test_saturation_and_quantisation():
    gyr = measure(TURN, only(gyr=TriadErrors(limit=0.8, resolution=0.03))).gyr
    assert np.allclose(gyr, np.round(np.clip(RATE_B, -0.8, 0.8) / 0.03) * 0.03, atol=1e-12)
    fine = measure(random_motion(20.0, 1), only(acc=TriadErrors(resolution=0.01))).acc
    exact = measure(random_motion(20.0, 1), only(acc=TriadErrors())).acc
    assert np.abs(fine - exact).max() <= 0.005 + 1e-12


def test_delay_shows_the_past():
    motion = random_motion(20.0, 2)
    late = measure(motion, only(gyr=TriadErrors(delay=0.02), acc=TriadErrors(delay=0.05), mag=TriadErrors(delay=0.1)))
    exact = measure(motion)
    for sensor, rows in (("gyr", 2), ("acc", 5), ("mag", 10)):
        assert np.allclose(getattr(late, sensor)[rows:], getattr(exact, sensor)[:-rows], atol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("frequency", [1.0, 10.0, 30.0])
def test_low_pass_filter_has_the_response_of_its_order(order, frequency):
    """Shaking of one frequency comes out with the gain and phase of the analog filter, also for a turning one."""
    bandwidth = 10.0
    s = 1j * frequency / bandwidth
    response = 1.0 / (1.0 + s) if order == 1 else 1.0 / (1.0 + math.sqrt(2.0) * s + s * s)
    w = 2.0 * np.pi * frequency
    shaken = Motion(
        AboutAxis(Rotation.identity(), (1.0, 0.0, 0.0), swing(1.0 / w, frequency)),
        Shaking((1.0 / w**2, 0.0, 0.0), frequency, 0.5 * math.pi),
        0.0,
        20.0,
    )
    filtered = TriadErrors(bandwidth=bandwidth, order=order)
    recording = measure(shaken, only(gyr=filtered, acc=filtered), rate=250.0)
    settled = recording.time > 5.0
    wave = np.exp(-1j * w * recording.time[settled])
    gyr = 2.0 * (recording.gyr[settled, 0] * wave).mean()
    acc = 2.0 * (recording.acc[settled, 0] * wave).mean()
    # the mean over a period T has the response sinc(f T) and a delay of T/2; true rate and −acceleration are cosines
    mean = np.sinc(frequency / 250.0) * np.exp(-0.5j * w / 250.0)
    # 10 ticks per period of the bandwidth: (π/10)²/6 = 1.6 % at it, more where the input is faster than that
    tolerance = 0.02 + 0.1 * (frequency > bandwidth)
    assert abs(acc / -response - 1.0) < tolerance
    assert abs(gyr / (response * mean) - 1.0) < tolerance


def test_a_wide_filter_changes_nothing():
    motion = random_motion(20.0, 3)
    wide = TriadErrors(bandwidth=900.0)
    filtered, exact = measure(motion, only(gyr=wide, acc=wide)), measure(motion)
    # a lag of 1/(2π 900 Hz) = 0.18 ms of changes of at most 10 rad/s² and 10 m/s³
    assert np.abs(filtered.gyr - exact.gyr).max() < 2e-3
    assert np.abs(filtered.acc - exact.acc).max() < 5e-3


@pytest.mark.parametrize("order", [1, 2])
def test_filtered_noise_keeps_its_density_and_loses_its_height(order):
    n, bandwidth = 0.1, 5.0
    filtered = TriadErrors(noise=n, bandwidth=bandwidth, order=order)
    recording = measure(rest(600.0), only(gyr=filtered, acc=filtered), 1)
    # equivalent width π f/2 of the first order and π f/(2√2) of the second, on both sides of zero. 600 s hold some
    # 10⁴ independent values of each axis: 0.7 %
    height = n * math.sqrt(math.pi * bandwidth / (1.0 if order == 1 else math.sqrt(2.0)))
    assert recording.acc.std(axis=0) == pytest.approx([height] * 3, rel=0.03)
    # correlation over one sample, of an exponential and of a damped oscillation
    x = 2.0 * math.pi * bandwidth / 100.0
    y = x / math.sqrt(2.0)
    expected = math.exp(-x) if order == 1 else math.exp(-y) * (math.cos(y) + math.sin(y))
    noise = recording.acc - recording.acc.mean(axis=0)
    assert (noise[1:] * noise[:-1]).mean(axis=0) / noise.var(axis=0) == pytest.approx([expected] * 3, rel=0.01)
    for value in (recording.gyr, recording.acc):
        # over 10 s the filter is of no account; 180 values have 5 % of scatter
        means = value[:60_000].reshape(60, 1000, 3).mean(axis=1)
        assert (means - means.mean(axis=0)).std() == pytest.approx(n / math.sqrt(10.0), rel=0.2)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("tick", [1e-3, 0.1, 0.6])
def test_recursion_has_the_covariance_of_filtered_white_noise(order, tick):
    """In closed form: an exponential, and a damped oscillation; from the first value on."""
    denominator = [1.0, 1.0] if order == 1 else [1.0, math.sqrt(2.0), 1.0]
    noise = _FilteredNoise(np.ones(3), denominator, tick, np.random.default_rng(1))
    response = lfilter(noise._b, noise._a, np.concatenate([[1.0], np.zeros(round(60.0 / tick))]))
    t = tick * np.array([0.0, 1.0, 2.0, 7.0])
    y = t / math.sqrt(2.0)
    expected = 0.5 * np.exp(-t) if order == 1 else np.exp(-y) * (np.cos(y) + np.sin(y)) / math.sqrt(8.0)
    found = [response[: len(response) - k] @ response[k:] for k in (0, 1, 2, 7)]
    assert found == pytest.approx(expected, rel=1e-8)
    rng = np.random.default_rng(2)
    starts = np.hstack([_FilteredNoise(np.ones(3), denominator, tick, rng).next(3) for _ in range(1000)])
    # 3000 values: 2.6 % of scatter
    assert (starts**2).mean(axis=1) == pytest.approx([expected[0]] * 3, rel=0.1)
    assert (starts[0] * starts[2]).mean() == pytest.approx(expected[2], rel=0.1)


def test_a_slower_sensor_has_nan_rows_and_values_of_its_own_times():
    motion = random_motion(20.0, 1)
    recording = measure(motion, only(gyr=TriadErrors(), mag=TriadErrors(rate=30.0, phase=0.005)), rate=100.0)
    there = ~np.isnan(recording.mag).any(axis=1)
    assert there.sum() == 600
    assert np.isnan(recording.mag[~there]).all()
    ticks = 0.005 + np.arange(600) / 30.0
    rows = recording.time[there]
    # each is in the first row after it
    assert ((rows >= ticks - 1e-7) & (rows - ticks < 0.01 + 1e-7)).all()
    assert np.allclose(recording.mag[there], measure(motion, only(mag=TriadErrors()), time=ticks).mag, atol=1e-12)
    half = measure(motion, only(mag=TriadErrors(rate=50.0)), rate=100.0).mag
    assert not np.isnan(half[::2]).any()
    assert np.isnan(half[1::2]).all()
    faster = measure(motion, only(mag=TriadErrors(rate=1000.0)), rate=100.0).mag
    assert np.allclose(faster, measure(motion, only(mag=TriadErrors()), rate=100.0).mag, atol=1e-9)


def test_noise_of_a_slower_sensor_is_that_of_its_own_rate():
    mag = measure(rest(2000.0), only(mag=TriadErrors(noise=0.1, rate=20.0)), rate=100.0).mag
    assert np.nanstd(mag, axis=0) == pytest.approx([0.1 * math.sqrt(20.0)] * 3, rel=0.02)


@pytest.mark.parametrize(("part", "length"), [(0.1, 1.0), (0.1, 8.0), (0.6, 3.0)])
def test_gaps_have_the_stated_part_and_length(part, length):
    n = 200_000
    gaps = Gaps(part, length, np.random.default_rng(1))
    missing = np.concatenate([gaps.missing(k) for k in (1, 7, 0, n - 8)])
    edges = np.flatnonzero(np.diff(missing.astype(int)))
    runs = np.diff(edges)[1 if missing[0] else 0 :: 2]
    # relative scatter of n · part/length runs of geometric lengths; five of them
    scatter = 5.0 * math.sqrt(2.0 * length / (n * part))
    assert missing.mean() == pytest.approx(part, rel=scatter)
    assert runs.mean() == pytest.approx(length, rel=scatter)
    whole = Gaps(part, length, np.random.default_rng(1)).missing(n)
    assert np.array_equal(whole, missing)


def test_dropouts_and_lost_rows():
    errors = SensorErrors(
        gyr=TriadErrors(dropout=0.05), acc=TriadErrors(dropout=0.2, dropout_length=10.0), loss=0.1, loss_length=4.0
    )
    recording = measure(random_motion(300.0, 1), errors, 2)
    n = 30_001
    assert len(recording) == pytest.approx(0.9 * n, rel=0.03)
    assert np.isnan(recording.gyr).any(axis=1).mean() == pytest.approx(0.05, rel=0.15)
    assert np.isnan(recording.acc).any(axis=1).mean() == pytest.approx(0.2, rel=0.2)
    assert not np.isnan(recording.mag).any()
    steps = np.round(np.diff(recording.time) * 100.0)
    assert steps.max() > 5
    # a sample after a gap stands for one period still
    full = measure(random_motion(300.0, 1), SensorErrors(), 2)
    there = ~np.isnan(recording.gyr).any(axis=1)
    rows = np.round(recording.time[there] * 100.0).astype(int)
    assert np.allclose(recording.gyr[there], full.gyr[rows], atol=1e-12)


def test_jitter_is_seen_by_the_stamps_and_stamp_noise_is_not():
    motion = random_motion(60.0, 1)
    shaken = measure(motion, SensorErrors(jitter=1e-3), 1)
    assert (shaken.time - np.arange(6001) / 100.0).std() == pytest.approx(1e-3, rel=0.05)
    assert np.allclose(shaken.acc, measure(motion, time=np.clip(shaken.time, 0.0, 60.0)).acc, atol=1e-9)
    wrong = measure(motion, SensorErrors(stamp_noise=1e-3), 1)
    assert np.array_equal(wrong.acc, measure(motion).acc)
    assert (wrong.time - np.arange(6001) / 100.0).std() == pytest.approx(1e-3, rel=0.05)
    assert (wrong.reference.rotation * motion.at(wrong.time).rotation.inv()).magnitude().max() < 1e-12


@given(jitter=st.floats(0.0, 1.0), stamps=st.floats(0.0, 1.0), irregular=st.booleans())
@settings(max_examples=20, deadline=None)
def test_time_never_runs_backwards(jitter, stamps, irregular):
    errors = only(gyr=TriadErrors(), acc=TriadErrors(bandwidth=20.0))
    errors = dataclasses.replace(errors, jitter=jitter, stamp_noise=stamps)
    time = np.cumsum(np.random.default_rng(0).uniform(1e-4, 0.05, 300)) if irregular else None
    recording = measure(rest(20.0), errors, 1, time=time)
    assert (np.diff(recording.time) > 0.0).all()
    assert np.isfinite(recording.acc).all()


def test_calibration_leaves_a_part_of_the_constant_errors():
    raw = TriadErrors(
        noise=0.1, bias=(1.0, 2.0, 3.0), scale=0.5, misalignment=0.2, offset=(1.0, 0.0, 0.0), matrix=2.0 * np.eye(3)
    )
    fine = SensorErrors(gyr=raw, mag=None).calibrated(0.1)
    assert fine.mag is None
    assert fine.gyr.bias == pytest.approx([0.1, 0.2, 0.3])
    assert (fine.gyr.scale, fine.gyr.misalignment) == pytest.approx((0.05, 0.02))
    assert np.allclose(fine.gyr.matrix, 1.1 * np.eye(3))
    assert fine.gyr.offset == pytest.approx([0.1, 0.0, 0.0])
    assert fine.gyr.noise == pytest.approx([0.1] * 3)


def test_dipole_field_on_axis_and_equator():
    dipole = Dipole((0.0, 0.0, 2.0), (1.0, 1.0, 1.0))
    time = np.zeros(2)
    field = dipole.field(time, np.array([[1.0, 1.0], [1.0, 1.5], [1.5, 1.0]]))
    # µ₀/4π · 2m/r³ along the axis, −µ₀/4π · m/r³ across it; at 0.5 m of 2 A m²
    assert field[:, 0] == pytest.approx([0.0, 0.0, 0.1 * 2 * 2.0 / 0.125])
    assert field[:, 1] == pytest.approx([0.0, 0.0, -0.1 * 2.0 / 0.125])


def test_dipole_field_is_the_gradient_of_its_potential():
    moment, place, h = np.array([0.3, -1.0, 0.7]), np.array([0.2, 0.4, -0.6]), 1e-4
    dipole = Dipole(moment, place)

    def potential(x):
        r = x - place
        return 0.1 * (moment @ r) / np.linalg.norm(r) ** 3

    at = np.array([1.0, -0.5, 0.3])
    gradient = [(potential(at + d) - potential(at - d)) / (2.0 * h) for d in h * np.eye(3)]
    assert dipole.field(np.zeros(1), at[:, None])[:, 0] == pytest.approx(-np.array(gradient), rel=1e-6)


def test_a_passing_magnet_disturbs_while_it_is_near():
    from scipy.interpolate import BSpline

    places = np.array([[-5.0, 0.5, 0], [-5 / 3, 0.5, 0], [5 / 3, 0.5, 0], [5, 0.5, 0]])
    line = BSpline(np.repeat([0.0, 20.0], 4), places, 3)
    magnet = Dipole((0.0, 0.0, 20.0), SplinePath(line, (0.0, 20.0)))
    turned = Motion(Fixed(Rotation.from_euler("z", 0.7)), Still(), 0.0, 20.0)
    recording = measure(turned, disturbances=[magnet])
    plain = measure(turned)
    disturbed = np.linalg.norm(recording.mag - plain.mag, axis=1)
    assert recording.time[np.argmax(disturbed)] == pytest.approx(10.0, abs=0.01)
    assert disturbed.max() == pytest.approx(0.1 * 20.0 / 0.5**3, rel=1e-3)
    assert disturbed[0] < 0.05
    moved = measure(turned, disturbances=[magnet], position=(0.2, 0.0, 0.0))
    assert not np.allclose(moved.mag, recording.mag)


def test_units_of_data_sheets():
    gyr = gyroscope(
        noise_density_deg=0.01,
        bias_stability_deg=8.0,
        rate_random_walk_deg=6.0,
        lsb_deg=0.01,
        range_deg=500.0,
    )
    deg = math.pi / 180.0
    assert gyr.noise == pytest.approx([0.01 * deg / math.sqrt(2.0)] * 3)
    assert gyr.instability == pytest.approx([8.0 * deg / 3600.0 / 0.66428] * 3, rel=1e-4)
    assert gyr.walk == pytest.approx([6.0 * deg / 3600.0 / 60.0] * 3)
    assert (gyr.limit, gyr.resolution) == pytest.approx((500.0 * deg, 0.01 * deg))
    # 1 °/√h is 1/60 °/√s
    assert gyroscope(angle_random_walk_deg=1.0).noise == pytest.approx([deg / 60.0] * 3)
    # the two figures of the ADIS16470's sheet are one
    both = gyroscope(noise_density_deg=0.008).noise / gyroscope(angle_random_walk_deg=0.34).noise
    assert both == pytest.approx(np.ones(3), rel=0.01)
    acc = accelerometer(noise_density_ug=[100.0, 100.0, 200.0], bias_mg=20.0, bias_stability_ug=10.0, range_g=4.0)
    assert acc.noise == pytest.approx(9.80665e-6 * np.array([100.0, 100.0, 200.0]) / math.sqrt(2.0))
    assert acc.bias == pytest.approx([0.196133] * 3)
    assert acc.limit == pytest.approx(39.2266)
    assert accelerometer(velocity_random_walk=0.06).noise == pytest.approx([0.001] * 3)
    # 0.2 µT rms at 100 Hz
    assert magnetometer(noise_rms_ut=0.2, rate=100.0).noise == pytest.approx([0.02] * 3)
    assert magnetometer(noise_density_ut=0.1).noise == pytest.approx([0.1 / math.sqrt(2.0)] * 3)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: TriadErrors(noise=-1.0), "one or three numbers of at least 0 for noise"),
        (lambda: TriadErrors(bias=(1.0, 2.0)), "one or three numbers"),
        (lambda: TriadErrors(bias="much"), "real numbers in bias"),
        (lambda: TriadErrors(matrix=np.eye(2)), r"matrix of shape \(3, 3\)"),
        (lambda: TriadErrors(limit=0.0), "limit above 0"),
        (lambda: TriadErrors(bandwidth=float("nan")), "bandwidth above 0"),
        (lambda: TriadErrors(order=3), "order to be 1 or 2"),
        (lambda: TriadErrors(dropout=1.0), "dropout of less than 1"),
        (lambda: TriadErrors(dropout=0.9, dropout_length=1.0), r"dropout of at most 0\.5 with runs of 1"),
        (lambda: TriadErrors(correlation=(10.0, 1.0)), "two increasing correlation times"),
        (lambda: SensorErrors(gyr=None, acc=None, mag=None), "at least one of gyr, acc and mag"),
        (lambda: SensorErrors(gyr=TriadErrors(rate=50.0)), "a gyroscope at the recording's rate"),
        (lambda: SensorErrors(acc=3), "acc as TriadErrors or None"),
        (
            lambda: measure(rest(2.0), only(acc=TriadErrors(bandwidth=5000.0))),
            "at most 1000 Hz at a rate of 100",
        ),
        (lambda: gyroscope(noise_density_deg=1.0, angle_random_walk_deg=1.0), "one of noise_density_deg and"),
        (lambda: magnetometer(noise_rms_ut=1.0), "rate of the samples with noise_rms_ut"),
        (lambda: measure(rest(2.0), disturbances=[Dipole((0, 0, 1), (0, 0, 0))]), "a dipole at least 1 mm"),
    ],
)
def test_mistakes_are_told(make, match):
    with pytest.raises(InputError, match=match):
        make()


def test_typing_errors_are_errors():
    with pytest.raises(TypeError, match="nosie"):
        gyroscope(nosie=1.0)
    with pytest.raises(TypeError, match="nosie"):
        TriadErrors(nosie=1.0)
