"""What a recording's check finds, on made-up motion with one fault at a time, and on real recordings."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown.checks import CHECKS, Finding, Findings, motion, sampling_step
from northdown.checks import base as checks_base
from northdown.orientation import Orientation
from northdown.recording import Recording

RATE = 100.0
UP = np.array([0.0, 0.0, 9.80665])
FIELD = np.array([0.0, 20.0, -43.0])  # ENU, µT: north of the magnetic equator, dip 65°
ORDINARY = {"time-rate"}


def make(seconds: float = 60.0, *, seed: int = 0, rest: float = 10.0, **changes: Any) -> Recording:
    """A level rest, then turns about all axes, in ENU; noise and bias as of a common sensor.

    Made by SciPy: attitude from products of rotations, gyroscope from their differences.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE)
    time = np.arange(n) / RATE
    rate = np.stack(
        [1.5 * np.sin(2 * math.pi * f * time + p) for f, p in ((0.23, 0.3), (0.31, 1.0), (0.17, 2.0))], -1
    )
    rate[time < rest] = 0.0
    steps = Rotation.from_rotvec(rate / RATE)
    attitude = [Rotation.identity()]
    for i in range(1, n):
        attitude.append(attitude[-1] * steps[i])
    body = Rotation.concatenate(attitude)
    values: dict[str, Any] = {
        "time": time,
        "gyr": rate + rng.normal([0.003, -0.002, 0.001], 0.002, (n, 3)),
        "acc": body.inv().apply(UP) + rng.normal(scale=0.02, size=(n, 3)),
        "mag": body.inv().apply(FIELD) + rng.normal(scale=0.2, size=(n, 3)),
        "frame": "ENU",
    }
    TRUTH[len(time), seed] = body
    return Recording(**(values | changes))


TRUTH: dict[tuple[int, int], Rotation] = {}


@pytest.fixture(scope="module")
def good() -> Recording:
    return make()


def changed(recording: Recording, **changes: Any) -> Recording:
    names = ("time", "gyr", "acc", "mag", "frame", "mag_unit", "reference", "reference_offset")
    return Recording(**({name: getattr(recording, name) for name in names} | changes))


def kinds(recording: Recording) -> set[str]:
    return {f.kind for f in recording.check()} - ORDINARY


def only(recording: Recording, kind: str) -> Finding:
    """The one thing found, which must be of this kind."""
    found = [f for f in recording.check() if f.kind not in ORDINARY]
    assert [f.kind for f in found] == [kind], str(Findings(found))
    return found[0]


# ---- in general ----


def test_nothing_is_found_in_a_good_recording(good: Recording) -> None:
    found = good.check()
    assert [f.kind for f in found] == ["time-rate"]
    assert str(found) == "note: rate 100 Hz (median step 10.00 ms, jitter under 0.01 ms)"
    assert str(Findings()) == "nothing found"


def test_worst_first(good: Recording) -> None:
    acc = good.acc / 9.80665
    acc[5] = 0.0
    found = changed(good, acc=acc).check()
    assert [f.severity for f in found] == ["error", "warning", "note"]
    assert isinstance(found, Findings)
    assert str(found).splitlines()[0].startswith("error: acc has a norm of 1 m/s²")


def test_each_check_is_listed_once_and_says_what_it_is() -> None:
    assert len(set(CHECKS)) == len(CHECKS) >= 13
    assert all(check.__doc__ for check in CHECKS)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 5, 9])
def test_few_samples(good: Recording, n: int) -> None:
    finding = only(good[:n], "time-few")
    assert finding.severity == ("warning" if n else "error")
    assert f"has {n} sample" in finding.message


@pytest.mark.parametrize("sensors", [["gyr"], ["acc"], ["mag"], ["acc", "mag"], ["gyr", "mag"], ["gyr", "acc"]])
def test_any_set_of_sensors(good: Recording, sensors: list[str]) -> None:
    absent = {name: None for name in ("gyr", "acc", "mag") if name not in sensors}
    assert kinds(changed(good, **absent)) == set()


def test_checking_changes_nothing(good: Recording) -> None:
    before = {name: getattr(good, name).copy() for name in ("time", "gyr", "acc", "mag")}
    changed(good, reference=Orientation.from_rotation(good.time, TRUTH[len(good), 0], "ENU")).check()
    assert all(np.array_equal(before[name], getattr(good, name)) for name in before)


# ---- time ----


def test_rate_is_measured_and_not_the_median(good: Recording) -> None:
    # 286 Hz in whole milliseconds
    n = 2000
    time = np.round(np.arange(n) / 286.0, 3)
    assert 1 / sampling_step(time) == pytest.approx(286, rel=2e-4)  # 1 ms over 7 s
    finding = only(Recording(time, good.gyr[:n]), "time-jitter")
    assert finding.severity == "warning"
    assert "rate 286" in finding.message
    assert "rounded to 1.00 ms" in finding.message


def test_jitter(good: Recording) -> None:
    rng = np.random.default_rng(1)
    for spread, kind in ((0.0003, "time-rate"), (0.002, "time-jitter")):
        time = good.time + rng.uniform(-spread, spread, len(good))
        # steps of two uniform deviations have √(2/3) of their half width as standard deviation
        jitter = spread * math.sqrt(2 / 3) * 1e3
        (finding,) = (f for f in changed(good, time=time).check() if f.kind.startswith("time"))
        assert finding.kind == kind
        assert float(re.search(r"jitter ([\d.]+) ms", finding.message)[1]) == pytest.approx(jitter, rel=0.1)


def test_gaps(good: Recording) -> None:
    time = good.time.copy()
    time[1000:] += 0.02  # two samples lost
    time[3000:] += 1.5
    finding = only(changed(good, time=time), "time-gap")
    assert finding.severity == "warning"
    assert finding.at == 1000
    assert "2 gaps in time (152 samples lost" in finding.message
    assert "the longest, 1.51 s, follows sample 2999 (30.01 s)" in finding.message
    # a single lost sample is worth a note
    assert (
        only(changed(good, time=np.where(good.time > 20, good.time + 0.01, good.time)), "time-gap").severity == "note"
    )


def test_a_turn_within_a_gap_is_not_held_against_the_gyroscope(good: Recording) -> None:
    keep = np.ones(len(good), bool)
    keep[2000:2300] = False
    assert kinds(good[keep]) == {"time-gap"}


def test_duplicates(good: Recording) -> None:
    time = good.time.copy()
    time[[50, 700]] = time[[49, 699]]
    found = {f.kind: f for f in changed(good, time=time).check()}
    assert found["time-duplicate"].at == 50
    assert "2 steps of time are zero" in found["time-duplicate"].message
    assert "drop the copies" in found["time-duplicate"].message
    assert "1 step of time is zero" in str(changed(good[:100], time=time[:100]).check())


def test_packets(good: Recording) -> None:
    time = np.floor(good.time * 10) / 10  # ten samples with the time of the packet
    found = {f.kind: f for f in changed(good, time=time).check()}
    assert "spread their times evenly" in found["time-duplicate"].message
    assert found["time-jitter"].message.startswith("rate 100")
    assert set(found) <= {"time-duplicate", "time-jitter"}


def test_times_in_single_precision(good: Recording) -> None:
    for n in (len(good), 400):
        time = (good.time[:n] + 1.7e9).astype(np.float32)
        finding = next(f for f in changed(good[:n], time=time).check() if f.kind == "time-duplicate")
        assert "single precision" in finding.message
    assert kinds(changed(good, time=good.time + 1.7e9)) == set()


def test_time_that_runs_backwards(good: Recording) -> None:
    time = good.time.copy()
    time[[20, 21]] = time[[21, 20]]
    finding = only(changed(good, time=time), "time-backwards")
    assert (finding.severity, finding.at) == ("error", 21)
    assert "Recording.sort()" in finding.message
    assert "1 time, by up to 10.00 ms" in finding.message
    assert kinds(changed(good, time=time).sort()) == set()


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "µs"), (1e9, "ns"), (1e3 / RATE * 10, "ms")])
def test_time_in_another_unit(good: Recording, factor: float, unit: str) -> None:
    finding = only(changed(good, time=good.time * factor + 0.25), "time-unit")
    assert finding.severity == "error"
    assert f"if time is in {unit}, divide it by" in finding.message


def test_time_as_a_count_and_in_hours(good: Recording) -> None:
    assert "that of a sample count" in only(changed(good, time=np.arange(len(good))), "time-unit").message
    assert "too short" in only(changed(good, time=good.time / 3600), "time-unit").message
    # a compass that logs once a minute has no gyroscope to be hurt by it
    assert only(changed(good, time=good.time * 6000, gyr=None), "time-unit").severity == "warning"


# ---- missing, repeated, clipped ----


def test_missing_samples(good: Recording) -> None:
    acc, mag = good.acc.copy(), good.mag.copy()
    acc[100:300] = np.nan
    mag[40:50, 1] = np.nan  # one axis is enough to be no sample
    found = {f.kind: f for f in changed(good, acc=acc, mag=mag).check()}
    assert set(found) - ORDINARY == {"acc-missing", "mag-missing"}
    assert (found["acc-missing"].severity, found["acc-missing"].at) == ("warning", 100)
    assert "no sample in 200 of 6000 rows (3.3 %), first at sample 100 (1 s)" in found["acc-missing"].message
    assert "longest time without is 2.01 s" in found["acc-missing"].message
    assert (found["mag-missing"].severity, found["mag-missing"].at) == ("note", 40)
    assert "without is 110 ms" in found["mag-missing"].message


def test_a_slow_magnetometer_with_nan_between(good: Recording) -> None:
    mag = good.mag.copy()
    mag[np.arange(len(good)) % 5 != 0] = np.nan
    finding = only(changed(good, mag=mag), "mag-missing")
    assert finding.severity == "note"
    assert "new ones come at 20 Hz on average" in finding.message


def test_missing_at_the_edges_counts(good: Recording) -> None:
    mag = good.mag.copy()
    mag[:900] = np.nan
    finding = only(changed(good, mag=mag), "mag-missing")
    assert finding.severity == "warning"
    assert "longest time without is 9 s" in finding.message


def test_missing_gyroscope(good: Recording) -> None:
    gyr = good.gyr.copy()
    gyr[500:505] = np.nan
    assert only(changed(good, gyr=gyr), "gyr-missing").severity == "note"
    gyr[2000:2020] = np.nan
    finding = only(changed(good, gyr=gyr), "gyr-missing")
    assert finding.severity == "error"
    assert "raise max_gap" in finding.message
    # every tenth sample missing does not hide what the others say
    gyr = good.gyr.copy()
    gyr[::10] = np.nan
    assert kinds(changed(good, gyr=gyr, mag=good.mag * [1, -1, 1])) == {"gyr-missing", "mag-axes"}


def test_a_sensor_without_any_sample(good: Recording) -> None:
    nothing = np.full((len(good), 3), np.nan)
    assert only(changed(good, mag=nothing), "mag-missing").severity == "warning"
    finding = only(changed(good, gyr=nothing), "gyr-missing")
    assert (finding.severity, finding.at) == ("error", 0)
    assert kinds(Recording(good.time, nothing, nothing, nothing)) == {"gyr-missing", "acc-missing", "mag-missing"}


def test_zeros_are_no_samples(good: Recording) -> None:
    acc = good.acc.copy()
    acc[70:75] = 0.0
    finding = only(changed(good, acc=acc), "acc-zero")
    assert finding.at == 70
    assert "5 rows" in finding.message
    assert "write NaN there" in finding.message


@pytest.mark.parametrize("hold", [2, 5, 3.6])
def test_a_slow_magnetometer_that_repeats(good: Recording, hold: float) -> None:
    held = (np.floor(np.arange(len(good)) / hold) * hold).astype(int)
    finding = only(changed(good, mag=good.mag[held]), "mag-rate")
    assert finding.severity == "note"
    assert float(re.search(r"at about ([\d.]+) Hz", finding.message)[1]) == pytest.approx(RATE / hold, rel=0.02)


def test_a_coarse_sensor_at_rest_is_not_a_slow_one() -> None:
    # a resolution of twice the noise: each axis repeats in half of the samples, all of them together in an eighth
    rest = make(30, rest=30)
    coarse = {"gyr": np.round(rest.gyr / 0.004) * 0.004, "acc": np.round(rest.acc / 0.04) * 0.04}
    assert (np.diff(coarse["acc"], axis=0) == 0).all(axis=1).mean() > 0.07
    assert kinds(changed(rest, **coarse)) == set()


def test_a_frozen_sensor(good: Recording) -> None:
    gyr = good.gyr.copy()
    gyr[3000:3100] = gyr[3000]
    acc = good.acc.copy()
    acc[4000:4030] = acc[4000]
    found = {f.kind: f for f in changed(good, gyr=gyr, acc=acc).check()}
    assert found["gyr-stuck"].at == 3000
    assert "does not change at all for 990 ms (1 time longer than 500 ms)" in found["gyr-stuck"].message
    assert "acc-stuck" not in found  # 0.3 s may be chance


@pytest.mark.parametrize("resolution", [1e-9, 1e-3])
def test_a_clipped_gyroscope(resolution: float) -> None:
    fast = make(30, rest=0)
    gyr = 6.0 * np.round(fast.gyr / resolution) * resolution
    gyr[:, 0] = np.clip(gyr[:, 0], -4.363, 4.363)
    finding = only(Recording(fast.time, gyr), "gyr-clipped")
    assert finding.severity == "error"
    assert "x at 4.363 rad/s (250 deg/s), x at -4.363 rad/s (-250 deg/s)" in finding.message
    hit = np.abs(gyr[:, 0]) == 4.363
    assert finding.at == int(np.argmax(hit))
    assert f"{hit.sum()} samples" in finding.message


def test_a_gyroscope_clipped_before_it_was_calibrated() -> None:
    fast = make(30, rest=0)
    raw = np.clip(6.0 * fast.gyr, -8.5, 8.5)
    mixed = raw @ np.array([[1.0, 0.002, -0.001], [0.001, 1.0, 0.001], [0.0, 0.001, 1.0]]).T + [0.01, -0.02, 0.0]
    finding = only(Recording(fast.time, mixed), "gyr-clipped")
    share = (np.abs(raw) == 8.5).any(axis=1).sum()
    found = int(re.search(r"(\d+) samples", finding.message)[1])
    assert found == pytest.approx(share, rel=0.05)  # the first and last sample of a swing are a matter of rounding


def test_clipped_accelerometer_and_magnetometer(good: Recording) -> None:
    rng = np.random.default_rng(2)
    acc = good.acc + np.where(rng.random((len(good), 1)) < 0.02, 1.0, 0.0) * np.repeat(
        rng.normal(scale=30, size=(len(good) // 10, 3)), 10, axis=0
    )
    assert "acc-clipped" not in kinds(changed(good, acc=acc))
    bump = 40.0 * np.exp(-(((good.time - 40) / 1.0) ** 2))[:, None]
    acc = np.clip(good.acc + bump, -19.6, 19.6)
    found = {f.kind: f for f in changed(good, acc=acc).check()}
    assert "at 19.6 m/s²" in found["acc-clipped"].message


def test_smooth_peaks_and_a_turntable_are_not_clipping() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(6000) / RATE
    for gyr, noise in (
        (5.0 * np.sin(0.3 * time), 0.002),
        (np.round(5.0 * np.sin(0.3 * time) / 0.02) * 0.02, 0.0),  # coarse
        (np.round(5.0 * np.sin(0.3 * time) / 0.2) * 0.2, 0.0),
        (np.interp(time, [5, 6, 20, 21, 30, 31, 45, 46, 50, 51, 59], [0, 4, 4, 0, 0, 4, 4, 0, 0, 4, 4]), 0.002),
        (4.0 * np.tanh(3.5 * np.sin(6.0 * time)), 0.002),  # flat tops, but reached smoothly
    ):
        vectors = np.stack([gyr, 0.1 * np.cos(time), 0.1 * np.sin(time)], -1) + noise * rng.normal(size=(6000, 3))
        assert "gyr-clipped" not in kinds(Recording(time, vectors))


# ---- units ----


@pytest.mark.parametrize("sensors", [("acc", "mag"), ("acc",), ("mag",)])
def test_gyroscope_in_degrees(good: Recording, sensors: tuple[str, ...]) -> None:
    absent = {name: None for name in ("acc", "mag") if name not in sensors}
    finding = only(changed(good, gyr=np.rad2deg(good.gyr), **absent), "gyr-unit")
    assert finding.severity == "error"
    assert "57.3 times faster" in finding.message
    assert "π/180" in finding.message
    finding = only(changed(good, gyr=np.deg2rad(good.gyr), **absent), "gyr-unit")
    assert "57.3 times slower" in finding.message


def test_gyroscope_in_degrees_all_by_itself(good: Recording) -> None:
    finding = only(Recording(good.time, np.rad2deg(good.gyr)), "gyr-unit")
    assert "more than common sensors can" in finding.message
    assert np.linalg.norm(np.rad2deg(good.gyr[finding.at])) > 40


def test_gyroscope_in_degrees_at_rest() -> None:
    rest = make(40, rest=40)
    finding = only(changed(rest, gyr=np.rad2deg(rest.gyr)), "gyr-unit")
    assert finding.severity == "warning"  # a vibrating body would look the same
    assert "unless the body vibrates" in finding.message
    # the mean does not matter, a bias of 5 °/s is not a unit
    finding = only(changed(rest, gyr=rest.gyr + np.deg2rad([5.0, 0, 0])), "gyr-bias")
    # 0.003, −0.002, 0.001 rad/s are in it already; noise of 0.002 rad/s averages out
    assert "(5.17, -0.11" in finding.message


@pytest.mark.parametrize("bias", [0.5, 2.0, 6.0, 15.0])
def test_a_biased_gyroscope_has_the_right_unit(good: Recording, bias: float) -> None:
    found = kinds(changed(good, gyr=good.gyr + np.deg2rad(bias)))
    assert found <= {"gyr-bias"}
    assert ("gyr-bias" in found) == (bias > 1)


@pytest.mark.parametrize(
    ("factor", "kind", "words"),
    [
        (1 / 9.80665, "acc-unit", "looks like g; multiply by 9.80665"),
        (1000 / 9.80665, "acc-unit", "mg"),
        (9.80665, "acc-unit", "converted from g twice"),
        (1 / 0.3048, "acc-unit", "ft/s²"),
        (4096 / 9.80665, "acc-unit", "raw counts, 4096 per g"),
        (16384 / 9.80665, "acc-unit", "raw counts, 16384 per g"),
        (3.7, "acc-size", "find its unit"),
        (0.4, "acc-size", "gravity seems to have been removed"),
    ],
)
def test_accelerometer_in_another_unit(good: Recording, factor: float, kind: str, words: str) -> None:
    finding = only(changed(good, acc=good.acc * factor), kind)
    assert finding.severity == "error"
    assert words in finding.message


def test_an_accelerometer_without_gravity(good: Recording) -> None:
    acc = np.random.default_rng(0).normal(scale=0.05, size=(len(good), 3))
    assert "acc-size" in kinds(changed(good, acc=acc))


@pytest.mark.parametrize(
    ("factor", "kind", "words"),
    [
        (1e-2, "mag-unit", "gauss; multiply by 100"),
        (1e-3, "mag-unit", "mT; multiply by 1000"),
        (1e3, "mag-unit", "nT; divide by 1000"),
        (10, "mag-unit", "mG; multiply by 0.1"),
        (1e-6, "mag-unit", "tesla; multiply by 1e6"),
        (1 / np.linalg.norm(FIELD), "mag-unit", 'mag_unit="arbitrary"'),
        (0.1, "mag-size", "find its unit"),
    ],
)
def test_magnetometer_in_another_unit(good: Recording, factor: float, kind: str, words: str) -> None:
    finding = only(changed(good, mag=good.mag * factor), kind)
    assert finding.severity == "warning"
    assert words in finding.message
    assert kinds(changed(good, mag=good.mag * factor, mag_unit="arbitrary")) == set()


# ---- the field ----


@pytest.mark.parametrize("offset", [(12.0, -8.0, 5.0), (30.0, -20.0, 10.0), (-5.0, 70.0, 20.0)])
def test_hard_iron_is_recognised(good: Recording, offset: tuple[float, float, float]) -> None:
    found = {f.kind: f for f in changed(good, mag=good.mag + np.array(offset)).check()}
    assert set(found) - ORDINARY == {"mag-norm", "mag-dip"}  # and no exchange of axes
    message = found["mag-norm"].message
    assert found["mag-norm"].severity == "warning"
    values = [float(v) for v in re.search(r"offset of \((.*?)\)", message)[1].split(", ")]
    # 0.2 µT of noise over 2000 samples, and values to three digits
    np.testing.assert_allclose(values, offset, atol=0.1)
    assert "calibrate the magnetometer for hard iron" in message


def test_a_disturbance_is_no_offset(good: Recording) -> None:
    size = np.exp(-(((good.time - 35) / 5) ** 2))[:, None]
    disturbed = good.mag + size * TRUTH[len(good), 0].inv().apply([0.0, 0.0, -30.0])
    found = {f.kind: f for f in changed(good, mag=disturbed).check()}
    assert "does not explain it" in found["mag-norm"].message


def test_dip_that_varies_at_constant_norm(good: Recording) -> None:
    # a field that tips over and back, with the same size
    tip = Rotation.from_rotvec(np.outer(0.5 * np.sin(0.2 * good.time), [1.0, 0, 0]))
    noise = np.random.default_rng(6).normal(scale=0.2, size=(len(good), 3))
    mag = TRUTH[len(good), 0].inv().apply(tip.apply(FIELD)) + noise
    finding = only(changed(good, mag=mag), "mag-dip")
    spread = float(re.search(r"varies by ([\d.]+)°", finding.message)[1])
    # a sine's standard deviation is 1/√2 of 28.6°; averages over 2 s and a cut at full cycles take a few percent
    assert spread == pytest.approx(28.6 / math.sqrt(2), rel=0.1)


# ---- axes ----


def test_the_maps_are_half_of_the_signed_permutations() -> None:
    assert np.array_equal(motion.AXES[0], np.eye(3))
    keys = {tuple(m.ravel()) for m in motion.AXES} | {tuple((-m).ravel()) for m in motion.AXES}
    assert (len(motion.AXES), len(keys)) == (24, 48)
    assert motion.axes_name(np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])) == "y, -x, z"


def test_vectors_are_brought_to_the_start_of_the_window() -> None:
    # a swing with up to 10 rad/s: half a bin of 20 ms is 0.1 rad, a sample of 5 ms 0.05 rad
    time = np.arange(4000) / 200.0
    axis = np.array([4.0, -6.0, 7.0])
    angle = np.outer(0.5 * (1.0 - np.cos(2.0 * time)), axis)
    gyr = np.vstack([np.zeros(3), np.diff(angle, axis=0)]) * 200.0
    body = Rotation.from_rotvec([0.3, 0.2, 0.1]) * Rotation.from_rotvec(angle)
    acc, mag = body.inv().apply(UP), body.inv().apply(FIELD)
    windows = motion.make_windows(checks_base.Signals(time, gyr, acc, mag, "ENU", "uT"))
    averages = motion.average(windows, 1.0)
    width = windows.angle.shape[1] * windows.per_bin
    for name, fixed in (("acc", UP), ("mag", FIELD)):
        for i, parts in enumerate(averages.vectors(name)[0]):
            expected = body[i * width].inv().apply(fixed)
            cosine = parts @ expected / np.linalg.norm(parts, axis=1) / np.linalg.norm(expected)
            # the mean over a bin shortens the turning part by (0.2 rad)²/24, which tilts the sum a little
            np.testing.assert_allclose(np.arccos(np.minimum(cosine, 1)), 0.0, atol=0.002)
        np.testing.assert_allclose(averages.disagreement(name), 0.0, atol=1e-5)


def applied(text: str, vectors: Any) -> Any:
    """Vectors replaced as a message says, 'y, -x, z'."""
    columns = []
    for part in text.split(", "):
        column = vectors[:, "xyz".index(part[-1])]
        columns.append(-column if part[0] == "-" else column)
    return np.column_stack(columns)


SIGNED = [
    (axes, signs) for axes in itertools.permutations(range(3)) for signs in itertools.product((1.0, -1.0), repeat=3)
]


@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
def test_every_exchange_of_axes_is_found_and_its_repair_is_right(good: Recording, sensor: str) -> None:
    plain = getattr(good, sensor)
    for axes, signs in SIGNED:
        wrong = plain[:, axes] * signs
        recording = changed(good, **{sensor: wrong})
        found = {f.kind: f for f in recording.check() if f.kind not in (*ORDINARY, "acc-sign")}
        identity = axes == (0, 1, 2) and len(set(signs)) == 1
        if identity and (sensor != "gyr" or signs[0] > 0):
            assert not found  # the opposite vector turns alike
            continue
        assert list(found) == [f"{sensor}-axes"], (axes, signs)
        message = found[f"{sensor}-axes"].message
        texts = re.findall(r"\((-?[xyz], -?[xyz], -?[xyz])\)", message)
        texts = [text for text in texts if text != "x, y, z"]  # what is replaced
        repaired = [applied(text, wrong) for text in texts]
        assert any(np.array_equal(r, plain) for r in repaired), message
        # for a vector the opposite is as good, and said to be
        assert len(texts) == (1 if sensor == "gyr" else 2)


def test_gyroscope_that_turns_the_other_way(good: Recording) -> None:
    finding = only(changed(good, gyr=-good.gyr), "gyr-axes")
    assert "turns the other way than the accelerometer and the magnetometer" in finding.message
    assert only(changed(good, gyr=-good.gyr, mag=None), "gyr-axes").severity == "error"


def test_with_two_sensors_either_may_be_wrong(good: Recording) -> None:
    finding = only(changed(good, acc=good.acc[:, [1, 0, 2]], mag=None), "acc-axes")
    assert "replace acc (x, y, z) by (y, x, z)" in finding.message
    assert "or replace gyr" in finding.message
    gyr = re.search(r"replace gyr \(x, y, z\) by \((.*?)\)", finding.message)[1]
    assert kinds(changed(good, acc=good.acc[:, [1, 0, 2]], gyr=applied(gyr, good.gyr), mag=None)) == set()


def test_axes_and_unit_at_once(good: Recording) -> None:
    finding = only(changed(good, gyr=np.rad2deg(good.gyr)[:, [1, 0, 2]]), "gyr-unit")
    assert "its axes seem wrong too" in finding.message


def test_a_turn_about_one_axis_does_not_tell_which(good: Recording) -> None:
    time = good.time
    angle = 2.0 * np.sin(0.5 * time)
    body = Rotation.from_rotvec(np.outer(angle, [1.0, 0, 0]))
    gyr = np.outer(np.gradient(angle, time), [1.0, 0, 0])
    recording = Recording(time, gyr, body.inv().apply(UP), frame="ENU")
    assert kinds(recording) == set()
    finding = only(changed(recording, acc=recording.acc * [1, -1, 1]), "acc-axes")
    assert "as the body turned about too few axes" in finding.message


def test_sensors_that_have_nothing_to_do_with_each_other(good: Recording) -> None:
    other = make(60, seed=5, rest=0)
    shuffled = changed(good, gyr=np.roll(other.gyr, 1700, axis=0)[:, [2, 0, 1]] * 1.7)
    finding = only(shuffled, "gyr-disagrees")
    assert "no other unit or axes explain it" in finding.message


@pytest.mark.parametrize("seconds", [6, 12, 400])
def test_short_and_long_recordings(good: Recording, seconds: float) -> None:
    repeat = math.ceil(seconds / 60)
    n = round(seconds * RATE)
    part = {s: np.tile(getattr(good, s)[1500:], (2 * repeat, 1))[:n] for s in ("gyr", "acc", "mag")}
    recording = Recording(np.arange(n) / RATE, **part, frame="ENU")
    if seconds < 45:  # beyond, the copies do not join
        assert kinds(recording) == set()
        assert "mag-axes" in kinds(changed(recording, mag=recording.mag * [1, -1, 1]))
    assert "gyr-unit" in kinds(changed(recording, gyr=np.rad2deg(recording.gyr)))


def test_acceleration_is_not_mistaken_for_wrong_axes(good: Recording) -> None:
    # steps at 2 Hz with 0.5 m/s² ... 12 m/s² of amplitude, in navigation axes
    body = TRUTH[len(good), 0]
    for size in (0.5, 4.0, 12.0):
        push = size * np.column_stack([np.sin(12 * good.time), np.cos(9 * good.time), np.sin(15 * good.time)])
        assert kinds(changed(good, acc=good.acc + body.inv().apply(push))) == set()


# ---- up ----


def test_the_sign_of_the_accelerometer_with_a_field(good: Recording) -> None:
    finding = only(changed(good, acc=-good.acc), "acc-sign")
    assert "at rest acc reads -9.81 m/s² on z" in str(finding.message)
    assert finding.severity == "warning"
    assert "the field points up (dip -65°)" in finding.message
    assert "negate it" in finding.message


def test_a_body_that_lies_upside_down(good: Recording) -> None:
    finding = only(good.remap("x,-y,-z"), "acc-sign")
    assert finding.severity == "note"  # the field says that the sign is right
    assert "the field points down (dip 65°)" in finding.message
    assert "remap('x,-y,-z')" in finding.message
    assert "negate" not in finding.message
    assert kinds(good.remap("x,-y,-z").remap("x,-y,-z")) == set()


def test_without_a_field_both_are_possible(good: Recording) -> None:
    finding = only(changed(good, frame="NED", mag=None), "acc-sign")
    assert finding.severity == "warning"
    assert "+9.81 m/s² on z, so the body's z axis points up, while z of NED points down" in finding.message
    assert "negate it" in finding.message
    assert "remap('x,-y,-z')" in finding.message
    assert kinds(changed(good, frame="NWU", mag=None)) == set()


def test_in_the_south_the_field_points_up(good: Recording) -> None:
    noise = np.random.default_rng(6).normal(scale=0.2, size=(len(good), 3))
    mag = TRUTH[len(good), 0].inv().apply(FIELD * [1, 1, -1]) + noise
    finding = only(changed(good, mag=mag), "acc-sign")
    assert finding.severity == "note"
    assert "right south of the magnetic equator" in finding.message
    near_equator = TRUTH[len(good), 0].inv().apply([0.0, 33.0, -2.0]) + noise
    assert kinds(changed(good, mag=near_equator)) == set()


def test_a_field_that_points_up_now_and_then_says_nothing(good: Recording) -> None:
    sign = np.where(np.random.default_rng(9).random((len(good), 1)) < 0.7, -1.0, 1.0)
    assert "acc-sign" not in kinds(changed(good, gyr=None, mag=good.mag * sign))


def test_any_other_attitude_at_rest_is_fine(good: Recording) -> None:
    for mounting in ("z,x,y", "-z,y,x", "x,-z,y"):
        assert kinds(good.remap(mounting)) == set()


def with_reference(good: Recording, **changes: Any) -> Recording:
    reference = Orientation.from_rotation(good.time, TRUTH[len(good), 0], "ENU")
    return changed(good, **({"reference": reference} | changes))


def test_the_reference_knows_which_way_is_up(good: Recording) -> None:
    assert kinds(with_reference(good)) == set()
    finding = only(with_reference(good, acc=-good.acc), "acc-reference")
    assert finding.severity == "error"
    assert "negate acc" in finding.message
    # then the resting hint has nothing to add, nor has a body that lies upside down
    assert kinds(with_reference(good).remap("x,-y,-z")) == set()
    # a heading offset does not matter, rotations of both frames forbid the comparison
    assert kinds(with_reference(good, acc=-good.acc, reference_offset="heading")) == {"acc-reference"}
    assert kinds(with_reference(good, acc=-good.acc, reference_offset="rotations")) == {"acc-sign"}


def test_a_reference_in_the_wrong_frame_or_with_other_axes(good: Recording) -> None:
    truth = TRUTH[len(good), 0]
    wrong = Orientation.from_rotation(good.time, truth, "NED")
    assert (
        "or declare the reference as ENU or NWU"
        in only(with_reference(good, reference=wrong), "acc-reference").message
    )
    turned = with_reference(good).reference.turned(right=Rotation.from_euler("x", 90, degrees=True))
    finding = only(with_reference(good, reference=turned), "acc-reference")
    assert 'reference_offset="rotations"' in finding.message


def test_a_reference_with_its_own_times(good: Recording) -> None:
    reference = with_reference(good).reference
    parts = np.flatnonzero((reference.time % 10 < 2) & (reference.time > 12))
    assert kinds(with_reference(good, reference=reference[parts])) == set()
    assert kinds(with_reference(good, reference=reference[:0])) == set()
    assert kinds(with_reference(good, reference=reference[:1])) == set()
    elsewhere = Orientation(reference.time + 1e6, reference.quat, "ENU")
    assert kinds(with_reference(good, reference=elsewhere)) == set()


# ---- anything ----

number = st.sampled_from([0.0, 1.0, -1.0, 9.81, math.nan, 1e-300, 1e300, -1e300, 5e-324, 40.0, 1e-9])


@settings(max_examples=80, deadline=None)
@given(
    n=st.integers(0, 60),
    repeat=st.sampled_from([1, 30]),
    step=st.sampled_from([0.0, 0.01, 1e-9, 1.0, 1e12, -0.01]),
    pool=st.lists(number, min_size=1, max_size=6),
    seed=st.integers(0, 99),
)
def test_whatever_is_recorded_is_checked(n: int, repeat: int, step: float, pool: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    sensors = {s: rng.choice(pool, (n * repeat, 3)) for s in ("gyr", "acc", "mag")}
    time = np.cumsum(np.full(n * repeat, step) * rng.choice([1.0, 1.0, 0.0, 3.0], n * repeat))
    found = Recording(time, **sensors).check()
    for f in found:
        assert "\n" not in f.message
        assert f.at is None or 0 <= f.at < max(1, n * repeat)


# ---- real recordings ----


def real(root: Path) -> dict[str, Recording]:
    """All recordings of the folder, read without the library's own readers."""
    from scipy.io import loadmat

    found = {}
    for file in sorted((root / "broad").glob("*.mat")):
        d = loadmat(file)
        quat = d["opt_quat"]
        time = np.arange(len(quat)) / d["sampling_rate"].item()
        seen = ~np.isnan(quat).any(axis=1)
        reference = Orientation(time[seen], quat[seen], "ENU")
        found[file.stem] = Recording(time, d["imu_gyr"], d["imu_acc"], d["imu_mag"], reference, frame="ENU")
    for file in sorted((root / "repoimu").glob("*.csv")):
        x = np.genfromtxt(file, delimiter=";", skip_header=2)
        x = x[~np.isnan(x[:, 0])]
        unit = {"frame": "ENU", "mag_unit": "arbitrary"}
        found[file.stem] = Recording(x[:, 0], x[:, 8:11], x[:, 5:8], x[:, 11:14], **unit)  # type: ignore[arg-type]
    x = np.genfromtxt(root / "ximu" / "straightLine_CalInertialAndMag.csv", delimiter=",", skip_header=1)[:, 1:]
    g = 9.80665
    found["ximu"] = Recording(
        np.arange(len(x)) / 256, np.deg2rad(x[:, :3]), g * x[:, 3:6], 100 * x[:, 6:], frame="NWU"
    )
    x = np.genfromtxt(root / "fusion" / "sensor_data.csv", delimiter=",", skip_header=1)
    found["fusion"] = Recording(x[:, 0], np.deg2rad(x[:, 1:4]), g * x[:, 4:7], x[:, 7:], frame="NWU")
    return found


@pytest.fixture(scope="module")
def recordings(data_root: Path) -> dict[str, Recording]:
    return real(data_root)


def test_real_recordings_have_only_the_faults_they_have(recordings: dict[str, Recording]) -> None:
    expected: dict[str, set[str]] = {
        # README of the data: this one clips; with it the integrated gyroscope is lost. 06 clips too, for a second.
        "TStick_Test05_Trial1": {"gyr-clipped", "gyr-disagrees"},
        "TStick_Test06_Trial1": {"gyr-clipped"},
        "29_disturbed_stationary_magnet_B": {"mag-rate", "mag-norm"},
        "33_disturbed_attached_magnet_2cm": {"mag-rate", "mag-norm", "mag-dip"},
        "35_disturbed_attached_magnet_4cm": {"mag-rate", "mag-norm"},
        "ximu": {"mag-rate", "mag-norm", "mag-dip"},
        "fusion": {"mag-rate", "time-gap"},
    }
    assert len(recordings) >= 9
    for name, recording in recordings.items():
        assert kinds(recording) == expected.get(name, set() if "TStick" in name else {"mag-rate"}), name


def test_the_accelerometers_of_the_references_point_up(recordings: dict[str, Recording]) -> None:
    checked = 0
    for recording in recordings.values():
        if recording.reference is not None:
            assert "acc-reference" in kinds(changed(recording, acc=-recording.acc))
            checked += 1
    assert checked


def test_real_recordings_in_wrong_units(recordings: dict[str, Recording]) -> None:
    for name, r in recordings.items():
        assert "gyr-unit" in kinds(changed(r, gyr=np.rad2deg(r.gyr))), name
        assert "time-unit" in kinds(changed(r, time=r.time * 1e3)), name
        assert "acc-unit" in kinds(Recording(r.time, acc=r.acc / 9.80665)), name
        assert "acc-unit" in kinds(Recording(r.time, acc=r.acc / 0.00980665)), name
        factors = [1.0] if r.mag_unit == "arbitrary" else [1e-2, 1e-3, 1e3, 10.0, 1e-6]
        for factor in factors:
            assert "mag-unit" in kinds(Recording(r.time, mag=r.mag * factor)), (name, factor)


def test_axes_of_real_recordings(recordings: dict[str, Recording]) -> None:
    # trials that turn about all axes, fast and slow, also with much acceleration and beside magnets
    flip = [1.0, -1.0, 1.0]
    names = [n for n in recordings if n[:2] in ("01", "03", "07", "09", "21", "29", "31", "35")]
    for name in names:
        r = recordings[name]
        for sensor in ("gyr", "acc", "mag"):
            wrong = {sensor: getattr(r, sensor) * flip}
            assert f"{sensor}-axes" in kinds(changed(r, reference=None, **wrong)), (name, sensor)
    assert names
