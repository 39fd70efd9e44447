"""`Recording` as a value: what it takes, its parts, remounting and resampling."""

from __future__ import annotations

import copy
import itertools
import math
import pickle
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown.errors import InputError
from northdown.frames import mounting_matrix
from northdown.orientation import Orientation
from northdown.recording import Recording

N = 100
RATE = 50.0
# Rounding of a product of a few numbers of size ten.
ROUNDING = 1e-13


def make(n: int = N, **changes: Any) -> Recording:
    rng = np.random.default_rng(4)
    time = np.arange(n) / RATE
    values: dict[str, Any] = {
        "time": time,
        "gyr": rng.normal(size=(n, 3)),
        "acc": rng.normal([0, 0, 9.81], size=(n, 3)),
        "mag": rng.normal([20, 0, -40], size=(n, 3)),
        "reference": Orientation.from_rotation(
            time, Rotation.random(n, random_state=1), "ENU", gyr_bias=rng.normal(size=(n, 3))
        ),
        "movement": time > 1.0,
        "frame": "ENU",
        "name": "made",
    }
    return Recording(**(values | changes))


def same(a: Recording, b: Recording, atol: float = 0.0) -> None:
    for name in ("time", "gyr", "acc", "mag"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=atol, rtol=0)
    for name in ("frame", "name", "mag_unit", "reference_offset"):
        assert getattr(a, name) == getattr(b, name)
    assert np.array_equal(a.movement, b.movement)
    np.testing.assert_allclose((a.reference.rotation * b.reference.rotation.inv()).magnitude(), 0, atol=atol + 1e-13)


# ---- building ----


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gyr": None, "acc": None, "mag": None}, "at least one of gyr, acc, mag and array_acc, got none"),
        ({"gyr": np.zeros((3, N))}, "pass gyr.T"),
        ({"acc": np.zeros((N - 1, 3))}, "acc with 100 rows, one for each time, got 99 rows"),
        ({"mag": np.full((N, 3), np.inf)}, "finite numbers in mag, got infinity, at sample 0"),
        ({"gyr": "walk.csv"}, "real numbers in gyr"),
        ({"time": np.full(N, np.nan)}, "finite time"),
        ({"time": pd.date_range("2024", periods=N)}, "convert time to seconds first"),
        ({"movement": np.ones(3)}, "movement of shape"),
        ({"movement": np.full(N, 0.5)}, "booleans in movement"),
        ({"reference": Rotation.identity(N)}, "reference as an Orientation, got Rotation"),
        ({"frame": "north"}, "frame to be one of"),
        ({"mag_unit": "G"}, "mag_unit to be one of uT, arbitrary, got 'G'"),
        ({"reference_offset": None}, "reference_offset to be one of none, heading, rotations"),
    ],
    ids=str,
)
def test_bad_values(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        make(**changes)
    assert "\n" not in str(caught.value)


def test_from_a_pandas_table() -> None:
    table = pd.DataFrame(np.arange(28.0).reshape(7, 4), columns=["t", "x", "y", "z"])
    table.loc[2, "x"] = None
    recording = Recording(table["t"], acc=table[["x", "y", "z"]])
    assert recording.time.tolist() == table["t"].tolist()
    assert math.isnan(recording.acc[2, 0])
    recording.acc[0] = 0.0  # the columns of a table are read-only; the recording's arrays are its own
    assert table.loc[0, "x"] == 1.0


def test_arrays_that_fit_are_kept_and_others_copied() -> None:
    gyr = np.zeros((N, 3))
    assert make(gyr=gyr).gyr is gyr
    for other in (gyr.astype(np.float32), np.asfortranarray(gyr), gyr[::-1]):
        assert not np.shares_memory(make(gyr=other).gyr, other)


def test_integers_booleans_and_singles_are_numbers() -> None:
    recording = Recording(np.arange(3), np.zeros((3, 3), np.int16), np.ones((3, 3), np.float32))
    assert {recording.time.dtype, recording.gyr.dtype, recording.acc.dtype} == {np.dtype(np.float64)}


def test_copies() -> None:
    recording = make()
    for other in (copy.deepcopy(recording), pickle.loads(pickle.dumps(recording))):
        same(recording, other)
    with pytest.raises(AttributeError):
        recording.name = "other"  # type: ignore[misc]


def test_methods_leave_the_original_alone() -> None:
    recording = make()
    before = copy.deepcopy(recording)
    recording.sort(), recording.between(0.5, 1), recording.remap("y,-x,z"), recording.resample(30), recording.check()
    same(recording, before)


# ---- rate and duration ----


def test_rate_and_duration() -> None:
    assert make().rate == pytest.approx(RATE, rel=1e-12)
    assert make().duration == pytest.approx((N - 1) / RATE, rel=1e-12)


def test_rate_of_rounded_times() -> None:
    # 286 Hz in whole milliseconds: steps of 3 and 4 ms, so the median would say 333 or 250 Hz
    time = np.round(np.arange(2000) / 286.0, 3)
    # the ends are rounded by half a millisecond each, over 7 s
    assert make(2000, time=time, reference=None).rate == pytest.approx(286.0, rel=2e-4)


def test_rate_leaves_gaps_out() -> None:
    time = np.arange(N) / RATE
    time[40:] += 30.0
    time[80:] += 0.04
    assert make(time=time).rate == pytest.approx(RATE, rel=1e-9)


def test_rate_of_packets() -> None:
    time = np.repeat(np.arange(N // 10) / 5.0, 10)  # ten samples with one time, five times a second
    # the last packet's own time is not seen: one part in ten
    assert make(time=time).rate == pytest.approx(50.0, rel=0.11)


@pytest.mark.parametrize("time", [[], [1.0], [1.0, 1.0], [2.0, 1.0]])
def test_rate_of_nothing(time: list[float]) -> None:
    recording = Recording(time, np.zeros((len(time), 3)))
    assert math.isnan(recording.rate)
    assert "no duration" in repr(recording)


def test_repr() -> None:
    text = repr(make())
    assert text == "<Recording made: 100 samples, 2.0 s at 50.0 Hz, gyr+acc+mag, ENU, with reference>"
    assert "acc, NED>" in repr(Recording([0.0], acc=[[0, 0, 1]]))


# ---- parts ----


@pytest.mark.parametrize(
    "index",
    [
        slice(3, 30, 4),
        slice(None, None, -1),
        slice(0, 0),
        np.array([5, 5, 1, -1]),
        np.arange(N) % 3 == 0,
        pd.Series(np.arange(N) > 50),
    ],
    ids=str,
)
def test_parts(index: Any) -> None:
    recording = make()
    part = recording[index]
    for name in ("time", "gyr", "acc", "mag", "movement"):
        assert np.array_equal(getattr(part, name), getattr(recording, name)[index])
    assert part.reference is recording.reference
    assert (part.frame, part.name) == ("ENU", "made")
    assert len(part[:0].check()) == 1


@pytest.mark.parametrize("index", [3, [1, 2], (1, 2), "a", None, np.array([1.5]), np.ones(5, bool), np.array([N])])
def test_bad_parts(index: Any) -> None:
    with pytest.raises(InputError):
        make()[index]


def test_absent_sensors_stay_absent() -> None:
    part = make(acc=None, movement=None)[5:]
    assert part.acc is None
    assert part.movement is None


def test_between_takes_the_start_and_leaves_the_stop() -> None:
    recording = make()
    part = recording.between(0.5, 1.0)
    assert part.time[0] == 0.5
    assert part.time[-1] == pytest.approx(0.98)
    assert len(recording.between(-math.inf, math.inf)) == N
    assert len(recording.between(7, 8)) == 0
    assert len(recording.between(1, 1)) == 0
    halves = [recording.between(-math.inf, 0.7), recording.between(0.7, math.inf)]
    assert np.array_equal(np.concatenate([h.acc for h in halves]), recording.acc)
    for start, stop in ((1, 0), (math.nan, 1), (0, math.nan), ("a", 1), (None, 1), ([0, 1], 2)):
        with pytest.raises(InputError):
            recording.between(start, stop)


def test_sort_keeps_the_order_of_equal_times() -> None:
    time = np.random.default_rng(0).integers(0, 9, N)
    recording = make(time=time, gyr=np.tile(np.arange(N)[:, None], 3), reference=None, movement=None)
    result = recording.sort()
    order = sorted(range(N), key=lambda i: time[i])  # Python's sort keeps the order of equals
    assert result.time.tolist() == time[order].tolist()
    assert result.gyr[:, 0].tolist() == order


# ---- mounting ----


def test_remap_says_what_each_new_axis_was() -> None:
    recording = make()
    x, y, z = recording.acc.T
    assert np.array_equal(recording.remap("y,-x,z").acc, np.column_stack([y, -x, z]))
    assert np.array_equal(recording.remap("-z,x,-y").acc, np.column_stack([-z, x, -y]))


def test_remounting_turns_everything_alike() -> None:
    # the components in navigation axes do not care how the sensor is mounted
    recording = make()
    turned = recording.remap("z,x,y")
    for name in ("gyr", "acc", "mag"):
        before = recording.reference.rotation.apply(getattr(recording, name))
        after = turned.reference.rotation.apply(getattr(turned, name))
        np.testing.assert_allclose(after, before, atol=10 * ROUNDING)
    bias_before = recording.reference.rotation.apply(recording.reference.gyr_bias)
    bias_after = turned.reference.rotation.apply(turned.reference.gyr_bias)
    np.testing.assert_allclose(bias_after, bias_before, atol=ROUNDING)


def test_a_reference_on_axes_of_its_own_stays() -> None:
    recording = make(reference_offset="rotations")
    assert recording.remap("z,x,y").reference is recording.reference


def test_remap_obeys_the_laws_of_a_group() -> None:
    recording = make(10, movement=None)
    specs = ["x,y,z", "y,-x,z", "z,x,y", "-x,-y,z", "x,-z,y", "-z,-y,-x"]
    same(recording.remap("x,y,z"), recording)
    for a, b in itertools.product(specs, repeat=2):
        product = mounting_matrix(b) @ mounting_matrix(a)
        same(recording.remap(a).remap(b), recording.rotate_body(product))
    for spec in specs:
        same(recording.remap(spec).rotate_body(mounting_matrix(spec).T), recording)


def test_rotate_body_is_scipys_apply() -> None:
    turn = Rotation.random(random_state=7)
    recording = make()
    np.testing.assert_allclose(
        recording.rotate_body(turn.as_matrix()).mag, turn.apply(recording.mag), atol=10 * ROUNDING
    )


def test_missing_samples_stay_missing() -> None:
    recording = make()
    recording.mag[::3] = np.nan
    assert np.array_equal(np.isnan(recording.remap("z,x,y").mag).all(axis=1), np.isnan(recording.mag).all(axis=1))


@pytest.mark.parametrize(
    ("mat", "message"),
    [
        (np.eye(2), r"shape \(3, 3\), got shape \(2, 2\)"),
        (np.diag([1.0, 1.0, -1.0]), "mirrors space"),
        (1.1 * np.eye(3), "off orthonormal by 0.21"),
        (np.full((3, 3), np.nan), "rotation matrix"),
        ([[1, 0, 0], [0, 1]], "real numbers in mat"),
        ("y,x,z", "real numbers in mat"),
    ],
    ids=str,
)
def test_what_is_no_rotation(mat: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make().rotate_body(mat)


# ---- resampling ----


@settings(max_examples=40, deadline=None)
@given(st.floats(3.0, 400.0), st.integers(0, 1000))
def test_resampling_loses_no_rotation(rate: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.005, 0.05, N))
    gyr = rng.normal(size=(N, 3))
    result = Recording(time, gyr).resample(rate)
    np.testing.assert_allclose(np.diff(result.time), 1.0 / rate, rtol=1e-9)
    # the angle turned up to each new time, by the definition: each rate holds since the sample before
    since_start = np.vstack([np.zeros(3), np.cumsum(gyr[1:] * np.diff(time)[:, None], axis=0)])
    expected = np.column_stack([np.interp(result.time, time, since_start[:, i]) for i in range(3)])
    found = np.vstack([np.zeros(3), np.cumsum(result.gyr[1:] / rate, axis=0)])
    np.testing.assert_allclose(found, expected, atol=1e-12)  # rad; rounding of a hundred sums


def test_resampling_to_the_same_rate_changes_nothing() -> None:
    recording = make()
    recording.acc[10:13] = np.nan
    result = recording.resample(RATE)
    assert len(result) == N
    np.testing.assert_allclose(result.gyr, recording.gyr, atol=ROUNDING * RATE)
    np.testing.assert_allclose(result.mag, recording.mag, atol=10 * ROUNDING)
    # three missing rows are a gap of four periods: all that was there is there, to the edge of the gap
    assert np.array_equal(np.isnan(result.acc), np.isnan(recording.acc))
    assert np.array_equal(result.movement, recording.movement)
    assert result.reference is recording.reference


def test_resampling_interpolates_the_others_linearly() -> None:
    time = np.array([0.0, 0.1, 0.2, 0.3])
    ramp = np.outer(time, [1.0, -2.0, 3.0])
    result = Recording(time, acc=ramp, mag=ramp + 5).resample(40)
    np.testing.assert_allclose(result.acc, np.outer(result.time, [1.0, -2.0, 3.0]), atol=ROUNDING)
    np.testing.assert_allclose(result.mag, result.acc + 5, atol=ROUNDING)
    assert result.gyr is None


def test_a_slow_magnetometer_is_carried_between_its_samples() -> None:
    time = np.arange(200) / 100.0
    mag = np.outer(time, [1.0, 0, 0])
    mag[np.arange(200) % 5 != 0] = np.nan
    result = Recording(time, mag=mag).resample(100)
    last = 195
    np.testing.assert_allclose(result.mag[: last + 1, 0], time[: last + 1], atol=ROUNDING)
    assert np.isnan(result.mag[last + 1 :]).all()  # nothing is extrapolated


def test_a_long_gap_stays_missing() -> None:
    time = np.arange(200) / 100.0
    mag = np.ones((200, 3))
    mag[50:100] = np.nan
    missing = np.isnan(Recording(time, mag=mag).resample(50).mag[:, 0])
    assert np.flatnonzero(missing).tolist() == list(range(25, 50))


def test_a_sensor_with_hardly_any_sample_is_missing() -> None:
    mag = np.full((N, 3), np.nan)
    mag[50] = 1.0
    assert np.isnan(make(mag=mag).resample(20).mag).all()


@pytest.mark.parametrize(
    ("recording", "rate", "message"),
    [
        (make(), 0.0, "rate above 0 Hz, got 0"),
        (make(), math.nan, "rate above 0 Hz, got nan"),
        (make(), "fast", "a number for rate"),
        (make(), 1e300, "at most 1e.08 samples.*choose a lower rate"),
        (make()[:1], 10.0, "two samples or more, got 1"),
        (make()[:0], 10.0, "two samples or more, got 0"),
        (make()[::-1], 10.0, "time that increases, got a step of -0.02 s, at sample 1"),
        (make()[np.array([0, 1, 1, 2])], 10.0, "got a step of 0 s, at sample 2"),
        (make(gyr=np.where(np.arange(N)[:, None] == 7, np.nan, 1.0) * np.ones(3)), 10.0, "got NaN, at sample 7"),
    ],
    ids=str,
)
def test_what_cannot_be_resampled(recording: Recording, rate: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        recording.resample(rate)


def test_resampling_at_epoch_times() -> None:
    early, late = make(), make(time=np.arange(N) / RATE + 1.7e9)
    # times there have a resolution of 2.4e-7 s, over steps of 0.02 s and rates of a few rad/s
    np.testing.assert_allclose(late.resample(RATE).gyr, early.resample(RATE).gyr, atol=1e-3)
    assert len(late.resample(30.0)) == len(early.resample(30.0))


def test_an_empty_recording_has_all_its_methods() -> None:
    empty = make()[:0]
    assert (len(empty), empty.duration) == (0, 0.0)
    assert len(empty.sort()) == len(empty.remap("y,-x,z")) == len(empty.between(0, 1)) == 0
    assert [f.kind for f in empty.check()] == ["time-few"]


def test_shift_undoes_a_lag() -> None:
    """Of a field that changes linearly, interpolation is exact."""
    t = np.sort(np.random.default_rng(7).uniform(0.0, 2.0, 80))
    field = np.column_stack([3.0 * t, 5.0 - t, 0.5 * t])
    late = np.column_stack([3.0 * (t - 0.1), 5.0 - (t - 0.1), 0.5 * (t - 0.1)])
    gyr = np.ones((80, 3))
    moved = Recording(t, gyr, mag=late).shift("mag", -0.1)
    there = ~np.isnan(moved.mag).any(axis=1)
    assert moved.mag[there] == pytest.approx(field[there], abs=1e-12)
    # the last tenth of a second has no samples any more; gaps, longer than two usual steps, are left out
    assert not there[t > t[-1] - 0.1].any()
    assert there[t <= t[-1] - 0.1].mean() > 0.5
    assert np.array_equal(moved.gyr, gyr)
    assert np.array_equal(moved.time, t)


@pytest.mark.parametrize("sensor", ["acc", "mag"])
def test_shift_by_whole_samples_moves_rows(sensor: str) -> None:
    rng = np.random.default_rng(8)
    value = rng.normal(size=(50, 3))
    recording = Recording(np.arange(50) / 64.0, np.zeros((50, 3)), **{sensor: value})
    moved = getattr(recording.shift(sensor, 3.0 / 64.0), sensor)
    assert np.isnan(moved[:3]).all()
    assert moved[3:] == pytest.approx(value[:-3], abs=1e-12)
    same = getattr(recording.shift(sensor, 0.0), sensor)
    assert np.array_equal(same, value)


def test_shift_keeps_missing_samples_missing() -> None:
    """A magnetometer at a fourth of the rate has samples in the same rows as before."""
    value = np.full((80, 3), np.nan)
    value[::4] = np.arange(20)[:, None]
    moved = Recording(np.arange(80) * 0.01, np.zeros((80, 3)), mag=value).shift("mag", -0.02)
    assert np.isnan(moved.mag[np.arange(80) % 4 > 0]).all()
    assert moved.mag[:76:4, 0] == pytest.approx(np.arange(19) + 0.5, abs=1e-9)
    assert np.isnan(moved.mag[76]).all()


def test_shift_refuses_what_it_cannot_do() -> None:
    recording = Recording(np.arange(10) * 0.1, np.zeros((10, 3)))
    for attempt, match in (
        (lambda: recording.shift("mag", 0.1), "a recording with mag"),
        (lambda: recording.shift("gyr", 0.1), "sensor"),
        (lambda: make().shift("mag", math.nan), "seconds"),
        (lambda: make()[::-1].shift("mag", 0.1), "time that increases"),
    ):
        with pytest.raises(InputError, match=match):
            attempt()
