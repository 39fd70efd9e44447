"""From recordings to noise: the still part, gaps, rates, notes, what filters take, and what is no use."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from allan_noise import make_noise
from hypothesis import given, settings
from hypothesis import strategies as st

import northdown as nd
from northdown.calibration.noise import identify_noise
from northdown.calibration.noise_parameters import noise_parameters, noise_toml, write_noise_toml

RATE = 100.0
DENSITY = {"gyr": 1.7e-4, "acc": 2e-3, "mag": 0.06}


def still(n=12_000, seed=0, **changes):
    rng = np.random.default_rng(seed)
    rows = {s: density * math.sqrt(RATE) * rng.normal(size=(n, 3)) for s, density in DENSITY.items()}
    rows["acc"] += [0.3, -0.2, 9.79]
    rows["mag"] += [20.0, 3.0, -42.0]
    return replace(nd.Recording(np.arange(n) / RATE, **rows, name="table"), **changes)


def moved(recording, first, last, turn=0.5):
    """The same recording with the sensor in the hand from one sample to another."""
    n = last - first
    gyr, acc = recording.gyr.copy(), recording.acc.copy()
    time = np.arange(n)[:, None] / RATE
    gyr[first:last] += turn * np.sin(2.0 * np.pi * time * [0.5, 0.7, 0.9])
    acc[first:last] += 2.0 * np.sin(2.0 * np.pi * time * [0.6, 0.8, 1.1])
    return replace(recording, gyr=gyr, acc=acc)


# ---- the still part ----


def test_whole_recording_when_nothing_moves():
    result = identify_noise(still(), "gyr")
    # a rest is trimmed at its ends, where motion may set in
    assert (result.start, result.stop) == pytest.approx((0.0, 119.99), abs=0.25)
    assert result.curve.rate == pytest.approx(RATE, rel=1e-12)
    for sensor, density in DENSITY.items():
        for model in identify_noise(still(), sensor).axes:
            assert (
                model.white_noise.low < density < model.white_noise.high
                or model.white_noise.value == pytest.approx(density, rel=0.02)
            )


def test_longest_still_part_is_found():
    recording = moved(moved(still(), 2000, 3000), 9000, 10_500)
    result = identify_noise(recording, "acc")
    # from 30 s to 90 s, as far as a window of half a second can tell
    assert 29.9 <= result.start <= 30.6
    assert 89.4 <= result.stop <= 90.1
    assert result.axes[2].white_noise.value == pytest.approx(DENSITY["acc"], rel=0.05)
    assert any("white noise shows in it" in note for note in result.notes)


def test_steady_turn_is_no_rest():
    recording = still()
    gyr = recording.gyr.copy()
    gyr[:, 2] += 0.5
    with pytest.raises(nd.InputError, match="longest still part"):
        identify_noise(replace(recording, gyr=gyr), "gyr")


def test_part_may_be_given():
    recording = moved(still(), 2000, 3000)
    result = identify_noise(recording, "gyr", start=40.0, stop=60.0)
    assert (result.start, result.stop) == (40.0, pytest.approx(59.99))
    restless = identify_noise(recording, "gyr", stop=60.0)
    assert any("looks still in" in note for note in restless.notes)
    assert not any("looks still in" in note for note in result.notes)


def test_clock_may_count_from_long_ago():
    result = identify_noise(still(time=1.7e9 + np.arange(12_000) / RATE), "gyr")
    assert result.curve.rate == pytest.approx(RATE, rel=1e-6)
    assert result.axes[0].white_noise.value == pytest.approx(DENSITY["gyr"], rel=0.03)


def test_magnetometer_alone():
    result = identify_noise(still(gyr=None, acc=None), "mag")
    assert result.axes[1].white_noise.value == pytest.approx(DENSITY["mag"], rel=0.03)
    assert any("rest cannot be told" in note for note in result.notes)


# ---- time ----


def test_slower_magnetometer_has_its_own_rate():
    recording = still()
    mag = recording.mag.copy()
    mag[np.arange(len(mag)) % 4 != 1] = np.nan
    result = identify_noise(replace(recording, mag=mag), "mag", start=0.0)
    assert result.curve.rate == pytest.approx(RATE / 4.0, rel=1e-9)
    assert list(result.curve.lengths) == [3000]
    # a quarter of the samples with the same spread have twice the density
    assert result.axes[0].white_noise.value == pytest.approx(2.0 * DENSITY["mag"], rel=0.05)


def test_lost_samples_split_the_record_and_leave_the_rate_alone():
    keep = np.ones(12_000, bool)
    keep[3000:3003] = keep[7000] = False
    as_rows, as_times = still(), still()[keep]
    gyr = as_rows.gyr.copy()
    gyr[~keep] = np.nan
    for recording in (replace(as_rows, gyr=gyr), as_times):
        result = identify_noise(recording, "gyr", start=0.0)
        assert list(result.curve.lengths) == [3000, 3997, 4999]
        assert result.curve.rate == pytest.approx(RATE, rel=1e-9)
        assert any(note.startswith("2 gaps") for note in result.notes)


def test_every_tenth_sample_lost_does_not_change_the_density():
    rng = np.random.default_rng(5)
    recording = still()[np.sort(rng.choice(12_000, 11_000, replace=False))]
    result = identify_noise(recording, "gyr")
    assert result.curve.rate == pytest.approx(RATE, rel=1e-3)
    assert result.axes[0].white_noise.value == pytest.approx(DENSITY["gyr"], rel=0.05)


def test_rounded_and_late_time_stamps():
    # stamps in whole milliseconds of a sensor at 300 Hz, then stamps with a delay of up to 4 ms
    n = 12_000
    true = np.arange(n) / 300.0
    rounded = identify_noise(still(time=np.round(true, 3)), "gyr")
    assert rounded.curve.rate == pytest.approx(300.0, rel=1e-3)
    late = true + np.random.default_rng(0).uniform(0.0, 0.002, n)
    result = identify_noise(still(time=late), "gyr")
    assert result.curve.rate == pytest.approx(300.0, rel=1e-2)
    assert any("time steps vary" in note for note in result.notes)


# ---- results ----


def test_result_as_json():
    result = identify_noise(still(), "gyr", start=0.0)
    data = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert data["axes"]["x"]["N"]["value"] == result.axes[0].white_noise.value
    assert data["axes"]["x"]["R"] == {
        "value": None,
        "low": 0.0,
        "high": None,
        "unit": "rad/s²",
        "reason": "not looked for",
    }
    assert data["samples"] == 12_000


@pytest.mark.parametrize(
    ("sensor", "symbol", "name", "factor"),
    [
        ("gyr", "N", "°/s/√Hz", 180.0 / math.pi),
        ("gyr", "B", "°/h", 3600.0 * 180.0 / math.pi),
        # 1 rad/s²/√Hz is a spread of 1 rad/s after 1 s, and of 60 rad/s after an hour
        ("gyr", "K", "°/h/√h", 60.0 * 3600.0 * 180.0 / math.pi),
        ("acc", "N", "µg/√Hz", 1e6 / 9.80665),
        ("acc", "B", "µg", 1e6 / 9.80665),
        ("mag", "N", "nT/√Hz", 1000.0),
    ],
)
def test_units_of_data_sheets(sensor, symbol, name, factor):
    unit = identify_noise(still(2000), sensor).units(symbol)[0]
    assert unit.name == name
    assert unit.factor == pytest.approx(factor, rel=1e-12)


def test_angle_random_walk_from_the_density():
    # 0.01 °/s/√Hz is 0.6 °/√h
    density, walk = identify_noise(still(2000), "gyr").units("N")
    assert (walk.name, walk.factor / density.factor) == ("°/√h", pytest.approx(60.0))


def test_flat_part_lies_at_0664_of_the_bias_instability():
    model = replace(identify_noise(still(2000), "gyr").axes[0], fitted=(0.0, 0.0, 1.0, 0.0, 0.0))
    np.testing.assert_allclose(model.deviation([0.1, 10.0]), 0.664, atol=5e-4)


# ---- what filters take ----


def test_parameters_of_filters():
    results = [identify_noise(still(), s) for s in ("gyr", "acc", "mag")]
    found = noise_parameters(results)
    assert list(found) == ["gyr_noise", "acc_noise", "mag_noise"]  # the walk does not show in two minutes
    for name, density in (("gyr_noise", 1.7e-4), ("acc_noise", 2e-3), ("mag_noise", 0.06)):
        assert found[name] == pytest.approx(density, rel=0.02)
    gyr = results[0].axes
    assert found["gyr_noise"] == pytest.approx(np.sqrt(np.mean([m.white_noise.value**2 for m in gyr])), rel=1e-12)
    assert noise_parameters(results[1]) == {"acc_noise": found["acc_noise"]}


def test_parameters_with_a_random_walk():
    rng = np.random.default_rng(2)
    gyr = np.column_stack([make_noise(60_000, RATE, rng, white=1e-4, random_walk=1e-4) for _ in range(3)])
    result = identify_noise(nd.Recording(np.arange(60_000) / RATE, gyr=gyr), "gyr", start=0.0)
    found = noise_parameters(result)
    assert list(found) == ["gyr_noise", "gyr_bias_walk"]
    assert found["gyr_bias_walk"] == pytest.approx(1e-4, rel=0.25)


def test_toml(tmp_path):
    results = [identify_noise(still(), s) for s in ("gyr", "acc", "mag")]
    path = tmp_path / "noise.toml"
    write_noise_toml(results, path)
    text = path.read_text(encoding="utf-8")
    assert tomllib.loads(text) == pytest.approx(noise_parameters(results), rel=1e-6)
    assert "gyr_bias_walk: random walk not determined (x, y, z); at most" in text
    assert text == noise_toml(results)
    assert [p.name for p in tmp_path.iterdir()] == ["noise.toml"]
    with pytest.raises(nd.InputError, match="folder that exists"):
        write_noise_toml(results, tmp_path / "none" / "noise.toml")


def test_unknown_magnetic_unit_is_no_parameter():
    result = identify_noise(still(mag_unit="arbitrary"), "mag")
    assert noise_parameters(result) == {}
    assert "unit of the field is unknown" in noise_toml(result)
    assert result.units("N")[0].name == "a.u./√Hz"
    assert result.axes[0].white_noise.unit == "a.u./√Hz"


def test_one_result_for_each_sensor():
    result = identify_noise(still(2000), "gyr")
    with pytest.raises(nd.InputError, match="two for gyr"):
        noise_parameters([result, result])
    with pytest.raises(nd.InputError, match="identify_noise"):
        noise_parameters([3.0])


# ---- what is no use ----


def spoiled(**rows):
    recording = still(3000)
    for sensor, change in rows.items():
        recording = replace(recording, **{sensor: change(getattr(recording, sensor).copy())})
    return recording


def stuck(values):
    values[:, 1] = 0.01
    return values


@pytest.mark.parametrize(
    ("recording", "arguments", "message"),
    [
        (lambda: "walk.csv", {}, "a Recording, got str"),
        (still, {"sensor": "baro"}, "gyr, acc, mag"),
        (lambda: still(gyr=None), {}, "gyr in the recording, got none"),
        (lambda: still(200), {}, "256 samples of gyr or more, got 200"),
        (lambda: still(0), {}, "got 0"),
        (lambda: spoiled(gyr=lambda v: v * np.nan), {}, "got 0"),
        (lambda: spoiled(gyr=stuck), {}, "noise in gyr y, got one value"),
        (lambda: spoiled(gyr=lambda v: 0.0 * v), {}, "noise in gyr x, got one value"),
        (lambda: spoiled(gyr=lambda v: np.where(np.arange(len(v)) % 2, 1e-3, -1e-3)[:, None] + 0 * v), {}, "repeats"),
        (lambda: spoiled(gyr=lambda v: 1e200 * v), {}, "at sample 0"),
        (lambda: still(3000, time=np.arange(3000)[::-1] / RATE), {}, "sort"),
        (lambda: still(3000, time=np.zeros(3000)), {}, "same time"),
        (lambda: moved(still(3000), 100, 2900), {}, "longest still part.*lie still for an hour"),
        (still, {"start": 30.0, "stop": 31.0}, "in the part given, got 100"),
        (still, {"start": 31.0, "stop": 30.0}, "start not after stop"),
        (still, {"start": math.nan}, "start"),
        (still, {"confidence": 1.0}, "confidence between 0.5 and 0.999"),
        (still, {"confidence": "high"}, "a number for confidence"),
        (
            lambda: still()[np.sort(np.random.default_rng(0).choice(12_000, 8000, replace=False))],
            {},
            "samples are lost",
        ),
    ],
)
def test_bad_input_is_told_in_one_line(recording, arguments, message):
    with pytest.raises(nd.InputError, match=message) as problem:
        identify_noise(recording(), **arguments)
    assert "\n" not in str(problem.value)


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    n=st.integers(256, 900),
    kind=st.sampled_from(["walk", "white", "coarse", "spike", "step", "ramp", "sine", "mixed scales"]),
    size=st.sampled_from([1e-12, 1e-3, 1e6]),
    holes=st.floats(0.0, 0.02),
)
def test_any_signal_gives_a_result_or_an_error_of_its_own(seed, n, kind, size, holes):
    rng = np.random.default_rng(seed)
    white, time = rng.normal(size=(n, 3)), np.arange(n) / RATE
    signal = {
        "walk": np.cumsum(white, axis=0),
        "white": white,
        "coarse": np.round(0.3 * white),
        "spike": 1e-6 * white + (np.arange(n) == n // 2)[:, None],
        "step": 1e-6 * white + (np.arange(n) > n // 2)[:, None],
        "ramp": 1e-9 * white + time[:, None],
        "sine": np.sin(7.0 * time)[:, None] * [1.0, 2.0, 3.0],
        "mixed scales": white * [1.0, 1e-9, 1e9],
    }[kind]
    gyr = size * signal
    gyr[rng.random(n) < holes] = np.nan
    try:
        result = identify_noise(nd.Recording(time, gyr=gyr), "gyr", start=0.0, ramp=bool(seed % 2))
    except nd.InputError:
        return
    assert np.isfinite(result.curve.deviation).all()
    assert (result.low <= result.curve.deviation * (1.0 + 1e-9)).all()
    for model in result.axes:
        for c in model:
            assert 0.0 <= c.low <= c.high
            assert c.value is None or c.low <= c.value * (1.0 + 1e-3)
            assert c.value is None or c.value <= c.high * (1.0 + 1e-3)


# ---- real sensors ----


def test_real_recording_at_rest(data_root):
    import scipy.io

    data = scipy.io.loadmat(data_root / "broad" / "25_disturbed_tapping_B.mat")
    rate = float(data["sampling_rate"].squeeze())
    time = np.arange(len(data["imu_gyr"])) / rate
    recording = nd.Recording(time, data["imu_gyr"], data["imu_acc"], data["imu_mag"], frame="ENU")
    rest = identify_noise(recording, "gyr")
    assert rest.start < 1.0
    assert 40.0 < rest.stop < 46.0
    found = noise_parameters([identify_noise(recording, s) for s in ("gyr", "acc", "mag")])
    # a MEMS unit of 2020: data sheets of its kind say 0.004 to 0.01 °/s/√Hz, and 70 to 500 µg/√Hz
    assert 0.004 < math.degrees(found["gyr_noise"]) < 0.01
    assert 70e-6 < found["acc_noise"] / 9.80665 < 500e-6
    assert 0.05 < found["mag_noise"] < 0.12
    # the file holds the magnetometer interpolated to the rate of the others
    mag = identify_noise(recording, "mag")
    assert all(model.shortest > 2.0 / rate for model in mag.axes)


def test_real_recordings_of_one_sensor_agree(data_root):
    import scipy.io

    found = []
    for name in ("01_undisturbed_slow_rotation_A", "07_undisturbed_fast_rotation_B", "21_undisturbed_fast_combined"):
        data = scipy.io.loadmat(data_root / "broad" / f"{name}.mat")
        time = np.arange(len(data["imu_gyr"])) / float(data["sampling_rate"].squeeze())
        result = identify_noise(nd.Recording(time, data["imu_gyr"], data["imu_acc"]), "acc")
        found.append([model.white_noise.value for model in result.axes])
    # orientations differ from one trial to the next, and with them what rounding does
    assert (np.ptp(found, axis=0) < 0.25 * np.mean(found, axis=0)).all()
