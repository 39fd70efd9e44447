"""What every estimator must do; a new file in estimators/ is tested here without being named."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re

import numpy as np
import pytest
from array_truth import scattered, with_array
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown import Flag, InputError, Recording
from northdown.cli.parameters import describe
from northdown.estimators import registry
from northdown.simulation import LOW_COST, measure, random_motion

RATE = 4000.0  # Hz
# rad. At this rate first-order integration, (ωΔt)³/12 a step, errs by under 1e-4 and Madgwick, which corrects by 2βΔt
# in every step however small the error, trembles by a few times 6e-5.
NEAR_TRUTH = 1e-3
# rad. Different machine code for one sample and for many may contract products differently.
SAME = 1e-12
# s. Methods without gyroscope start with a rate of zero and must first learn it.
LEARNING = 4.0


def angle(a: Rotation, b: Rotation) -> float:
    return float((a * b.inv()).magnitude().max())


@pytest.fixture(params=list(registry()))
def estimator(request):
    return registry()[request.param]()


@pytest.fixture(scope="module")
def recordings() -> dict[str, Recording]:
    """Noisy: low-cost sensors, magnetometer at a fifth of the rate. Exact: no errors, turning without being shifted.

    Gentle: the body stays away from pitch ±90°, for methods that fail there and say so.
    """
    made = {}
    for kind, turn in (("wild", 1.0), ("gentle", 0.15)):
        motion = random_motion(20.0, seed=3, turn=turn)
        noisy = with_array(measure(motion, LOW_COST, seed=3, rate=100.0), motion, scattered(9), noise=0.005)
        slow = np.arange(len(noisy)) % 5 != 0
        made["noisy", kind] = dataclasses.replace(noisy, mag=np.where(slow[:, None], np.nan, noisy.mag))
        motion = random_motion(10.0, seed=11, turn=turn, reach=0.0)
        made["exact", kind] = with_array(measure(motion, rate=RATE), motion, scattered(9))
    pitch = {k: np.abs(r.reference.as_euler()[:, 1]).max() for k, r in made.items()}
    assert pitch["exact", "wild"] > 1.0
    assert max(pitch["exact", "gentle"], pitch["noisy", "gentle"]) < 1.0
    return made


def without_samples(recording: Recording, index, sensor: str = "acc", axis=slice(None)) -> Recording:
    """NaN in acc and the array, in gyr and the array, or in mag."""
    holed = {}
    for name in (sensor, "array_acc") if sensor != "mag" else (sensor,):
        holed[name] = getattr(recording, name).copy()
        holed[name][index, axis] = np.nan
    return dataclasses.replace(recording, **holed)


def rows(estimator, recording: Recording) -> list[tuple]:
    """Positional arguments of `Stream.update` for each sample."""
    if "array" in estimator.uses:
        return [(channels, None, mag) for channels, mag in zip(recording.array_acc, recording.mag, strict=True)]
    return list(zip(recording.gyr, recording.acc, recording.mag, strict=True))


def settled(estimator, recording: Recording):
    """Samples from which on the result must be right."""
    return recording.time - recording.time[0] >= (LEARNING if "array" in estimator.uses else 0.0)


def kind(estimator) -> str:
    return "gentle" if estimator.singular else "wild"


@pytest.fixture
def noisy(estimator, recordings) -> Recording:
    return recordings["noisy", kind(estimator)]


@pytest.fixture
def exact(estimator, recordings) -> Recording:
    return recordings["exact", kind(estimator)]


def test_batch_is_stream(estimator, noisy):
    batch = estimator.run(noisy, frame="ENU")
    stream = estimator.for_recording(noisy).stream(frame="ENU")
    live = [stream.update(*row, time=t) for t, row in zip(noisy.time, rows(estimator, noisy), strict=True)]
    assert np.abs(np.array(live) - batch.quat).max() < SAME


def test_rate_is_as_good_as_times(estimator, noisy):
    batch = estimator.run(noisy)
    stream = estimator.for_recording(noisy).stream(rate=100.0)
    last = [stream.update(*row) for row in rows(estimator, noisy)][-1]
    assert np.abs(last - batch.quat[-1]).max() < 1e-9  # adding up periods rounds otherwise than reading times


def test_split_run_is_whole_run(estimator, noisy):
    whole = estimator.run(noisy)
    stream = estimator.for_recording(noisy).stream()
    parts = [stream.run(noisy[a:b]) for a, b in [(0, 1), (1, 1), (1, 700), (700, 701), (701, len(noisy))]]
    assert np.array_equal(np.vstack([p.quat for p in parts]), whole.quat)
    assert np.array_equal(np.concatenate([p.flags for p in parts]), whole.flags)


def test_mounting_turns_the_result(estimator, noisy):
    turn = Rotation.random(random_state=np.random.default_rng(7))
    if estimator.singular:
        turn = Rotation.from_euler("ZX", [2.0, 0.2])
    plain = estimator.run(noisy)
    turned = estimator.run(noisy.rotate_body(turn.as_matrix()))
    # Rounding, amplified by the filter's own dynamics over 2000 steps; what works on angles is the same in other axes
    # only as far as its errors are small, and so under linear acceleration if pitch is f_x / g
    bound = 1e-8 if not estimator.singular else 0.15 if "array" in estimator.uses else 0.02
    assert angle(turned.rotation * turn, plain.rotation) < bound


@pytest.mark.parametrize("frame", ["ENU", "NWU"])
def test_frame_turns_the_result(estimator, noisy, frame):
    assert angle(estimator.run(noisy, frame=frame).rotation, estimator.run(noisy).to_frame(frame).rotation) < 1e-10
    assert estimator.run(noisy, frame=frame).frame == frame


def test_truth_from_error_free_sensors(estimator, exact):
    after = settled(estimator, exact)
    assert angle(estimator.run(exact).rotation[after], exact.reference.rotation[after]) < NEAR_TRUTH


def test_irregular_steps(estimator):
    rng = np.random.default_rng(11)
    motion = random_motion(10.0, seed=11, reach=0.0, turn=0.15 if estimator.singular else 1.0)
    keep = np.cumsum(rng.integers(1, 4, 45_000))
    time = motion.times(2.0 * RATE)
    recording = with_array(measure(motion, time=time[keep[keep < len(time)]]), motion, scattered(9))
    assert np.ptp(np.diff(recording.time)) > 0.9 / RATE
    after = settled(estimator, recording)
    assert angle(estimator.run(recording).rotation[after], recording.reference.rotation[after]) < NEAR_TRUTH


def test_start_given(estimator, exact):
    blind = without_samples(without_samples(exact, slice(None)), slice(None), "mag")
    start = Rotation.from_euler("ZYX", [0.3, -0.2, 2.9])
    for frame in ("NED", "ENU"):
        result = estimator.run(blind[:1], frame=frame, initial=start)
        assert angle(result.rotation, start) < SAME
        assert not (result.flags & (255 - int(Flag.GYRO_HELD))).any()


def test_rows_of_nan(estimator, exact):
    holed = without_samples(without_samples(exact, slice(10_000, 10_300)), slice(16_000, 28_000, 2), axis=1)
    holed = without_samples(without_samples(holed, slice(12_000, 12_400), "mag"), slice(18_000, 26_000), "mag", 2)
    result = estimator.run(holed)
    assert np.isfinite(result.quat).all()
    if "gyr" in estimator.uses:
        assert angle(result.rotation, exact.reference.rotation) < NEAR_TRUTH
    elif "array" in estimator.uses:
        # an angular acceleration held for 75 ms is another one than the true
        there = settled(estimator, exact) & (exact.time > 9.0)
        assert angle(result.rotation[there], exact.reference.rotation[there]) < NEAR_TRUTH
    else:
        there = ~np.isnan(holed.acc).any(axis=1) & ~np.isnan(holed.mag).any(axis=1)
        assert angle(result.rotation[there], exact.reference.rotation[there]) < NEAR_TRUTH


def test_late_sensors_are_flagged_and_then_used(estimator, exact):
    tilt, heading = 2_000, 6_000
    holed = without_samples(without_samples(exact, slice(tilt)), slice(heading), "mag")
    result = estimator.run(holed, max_gap=1.0)
    assert np.array_equal(result.has(Flag.TILT_UNKNOWN), np.arange(len(exact)) < tilt)
    assert np.array_equal(result.has(Flag.HEADING_UNKNOWN), np.arange(len(exact)) < heading)
    after = np.append(np.zeros(heading, bool), settled(estimator, exact[heading:]))
    assert angle(result.rotation[after], exact.reference.rotation[after]) < NEAR_TRUTH
    if estimator.needs != ("acc", "mag") and "array" not in estimator.uses:
        level = result.to_frame("NED").rotation[tilt:heading].as_matrix()[:, 2]
        assert np.abs(level - exact.reference.rotation[tilt:heading].as_matrix()[:, 2]).max() < NEAR_TRUTH


def test_without_magnetometer_heading_is_flagged(estimator, exact):
    if "mag" in estimator.needs:
        with pytest.raises(InputError, match=f"for {estimator.name}, got no mag"):
            estimator.run(dataclasses.replace(exact, mag=None))
        return
    result = estimator.run(dataclasses.replace(exact, mag=None))
    assert result.has(Flag.HEADING_UNKNOWN).all()
    after = settled(estimator, exact)
    down = result.rotation[after].as_matrix()[:, 2]
    assert np.abs(down - exact.reference.rotation[after].as_matrix()[:, 2]).max() < NEAR_TRUTH


def test_missing_sensor_is_named(estimator, exact):
    for sensor in estimator.needs:
        absent = ("array", "array_acc") if sensor == "array" else (sensor,)
        recording = dataclasses.replace(exact, **dict.fromkeys(absent))
        with pytest.raises(InputError, match=f"for {estimator.name}, got no {sensor}"):
            estimator.run(recording)


def test_one_sample_and_none(estimator, exact):
    one = estimator.run(exact[:1])
    assert angle(one.rotation, exact.reference.rotation[:1]) < SAME
    assert len(estimator.run(exact[:0])) == 0


@pytest.mark.parametrize("scale", [1e-6, 1e-2, 1e4])
def test_size_of_the_field_does_not_matter(estimator, noisy, scale):
    plain = estimator.run(noisy)
    scaled = estimator.run(dataclasses.replace(noisy, mag=noisy.mag * scale, mag_unit="arbitrary"))
    assert angle(scaled.rotation, plain.rotation) < 1e-8  # rounding, as for the mounting


def test_huge_rates_stay_on_the_sphere(estimator, exact):
    part = exact[:2000]
    for rate in (50.0, 2000.0, 1e6):
        spun = dataclasses.replace(part, gyr=np.full_like(part.gyr, rate))
        if "array" in estimator.uses:  # up to 10 rad/s² for half a second; much more is refused as an overflow
            turning = 1e-5 * rate * part.array.matrix[:, 2]
            spun = dataclasses.replace(spun, array_acc=part.array_acc + turning)
        result = estimator.run(spun)
        assert np.abs(np.linalg.norm(result.quat, axis=1) - 1.0).max() < SAME


def test_unit_norm_after_ten_million_steps(estimator):
    n = 500_000
    rng = np.random.default_rng(13)
    gyr = rng.normal(0.0, 1.0, (n, 3)) + np.array([0.3, -0.2, 0.1])
    acc = rng.normal(0.0, 0.5, (n, 3)) + np.array([0.0, 0.0, -9.81])
    mag = rng.normal(0.0, 0.5, (n, 3)) + np.array([20.0, 0.0, 40.0])
    array = scattered(6)
    channels = acc @ array.direction.T + rng.normal(0.0, 0.1, (n, 6))
    stream = dataclasses.replace(estimator, **({"array": array} if "array" in estimator.uses else {})).stream()
    for k in range(20 if "gyr" in estimator.uses else 4):
        time = (np.arange(n) + k * n) * 0.01
        result = stream.run(Recording(time, gyr, acc, mag, array=array, array_acc=channels))
    # one rounding of each component at the last normalisation, however many steps went before
    assert np.abs(np.linalg.norm(result.quat, axis=1) - 1.0).max() < 1e-15


def test_gyroscope_held_through_short_gaps_only(estimator, exact):
    holed = without_samples(exact, slice(12_000, 12_200), "gyr")
    result = estimator.run(holed)
    assert np.array_equal(np.flatnonzero(result.has(Flag.GYRO_HELD)), np.arange(12_000, 12_200))
    assert np.isfinite(result.quat).all()
    if {"gyr", "array"} & set(estimator.uses):
        with pytest.raises(InputError, match=r"every 0\.01001 s, got NaN for longer, at sample 12040; cut"):
            estimator.run(holed, max_gap=0.01001)


def test_time_must_not_run_backwards(estimator, noisy):
    time = noisy.time.copy()
    time[7] = time[6]
    assert np.isfinite(estimator.run(dataclasses.replace(noisy, time=time)).quat).all()
    time[7] = time[5]
    with pytest.raises(InputError, match=r"finite time that does not run backwards, .*, at sample 7; sort"):
        estimator.run(dataclasses.replace(noisy, time=time))


def test_a_refused_update_changes_nothing(estimator, noisy):
    estimator = estimator.for_recording(noisy)
    good, spoiled = estimator.stream(rate=100.0), estimator.stream(rate=100.0)
    for k, row in enumerate(rows(estimator, noisy)[:50]):
        for bad in (
            (np.full_like(row[0], np.inf), row[1], row[2]),
            (row[0], [0.0, 1.0], row[2]),
            (row[0], row[1], "north"),
        ):
            # an infinite rate does not concern an estimator that does not use it
            if bad[0] is not row[0] and not {"gyr", "array"} & set(estimator.uses):
                continue
            with pytest.raises(InputError):
                spoiled.update(*bad)
        with pytest.raises(InputError, match="backwards"):
            spoiled.update(*row, time=-1.0 if k else -np.inf)
        a, b = good.update(*row), spoiled.update(*row)
        assert np.array_equal(a, b)


def test_update_takes_lists_and_other_types(estimator, noisy):
    estimator = estimator.for_recording(noisy)
    plain, other = estimator.stream(rate=100.0), estimator.stream(rate=100.0)
    for first, second, third in rows(estimator, noisy)[:3]:
        expected = plain.update(first, second, third)
        strided = None if second is None else np.asfortranarray(np.tile(second, (2, 1)))[1]
        given = other.update(first.tolist(), strided, tuple(third))
        assert np.array_equal(given, expected)


def test_parameters_are_described_and_checked(estimator):
    cls = type(estimator)
    described = describe(cls)
    for field in dataclasses.fields(cls):
        if field.name == "array":  # a geometry, not to be written on a command line
            with pytest.raises(InputError, match="an AccelerometerArray for array"):
                cls(array="square")
            continue
        parameter = described[field.name]
        assert parameter.text, f"{cls.__name__}.{field.name} is not described"
        if parameter.kind == "choice":
            with pytest.raises(InputError, match=f"{field.name} to be one of"):
                cls(**{field.name: "nonsense"})
        elif parameter.kind == "number":
            assert re.search(r"[Rr]aising", parameter.text), f"say what raising {field.name} does"
            for bad in (float("nan"), float("inf"), "much"):
                with pytest.raises(InputError, match=field.name):
                    cls(**{field.name: bad})
    with pytest.raises(TypeError, match="no_such_parameter"):
        cls(no_such_parameter=1.0)


def test_names_agree(estimator):
    cls = type(estimator)
    assert cls.__module__.rsplit(".", 1)[1] == estimator.name.replace("-", "_")
    assert getattr(nd, cls.__name__) is cls
    assert cls.__name__ in nd.__all__
    source = inspect.getsource(nd)
    static = [a.name for n in ast.walk(ast.parse(source)) if isinstance(n, ast.ImportFrom) for a in n.names]
    assert cls.__name__ in static, "add it to the TYPE_CHECKING block of northdown/__init__.py, for editors"
