"""Calibrations in files: read back as written, the same bytes each time, and hostile files refused."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from cal_truth import directions, field_recording, positions_recording
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from northdown.calibration import (
    Calibration,
    Evidence,
    SensorCalibration,
    TemperatureSlope,
    calibrate_accelerometer,
    calibrate_magnetometer,
    load,
    save,
)
from northdown.errors import FormatError, InputError

GOOD = 'format = "northdown calibration"\nversion = 1\n[gyr]\nunit = "rad/s"\noffset = [0.0, 0.0, 0.0]\n'
MATRIX = "matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n"


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_found_calibrations_are_read_back(tmp_path: Path, suffix: str) -> None:
    whole = calibrate_magnetometer(field_recording(directions(np.random.default_rng(1), 300))).then(
        calibrate_accelerometer(positions_recording(directions(np.random.default_rng(2), 12)))
    )
    path = tmp_path / f"cal{suffix}"
    save(whole, path)
    first = path.read_bytes()
    assert load(path) == whole
    save(load(path), path)
    assert path.read_bytes() == first
    assert [p.name for p in tmp_path.iterdir()] == [path.name]  # no draft is left


numbers = st.floats(-1e6, 1e6)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
slopes = st.builds(
    TemperatureSlope,
    st.floats(-50.0, 90.0),
    arrays(np.float64, st.tuples(st.integers(1, 5), st.just(3)), elements=numbers),
    st.floats(-60.0, 0.0),
    st.floats(0.0, 90.0),
)
evidence = st.builds(
    Evidence,
    texts,
    texts,
    texts,
    st.floats(0.0, 1e9) | st.just(np.nan),
    st.floats(0.0, 1e9),
    st.integers(0, 10**9),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0) | st.just(np.nan),
    notes=st.lists(texts, max_size=3).map(tuple),
)
parts = st.builds(
    SensorCalibration,
    st.just("mag"),
    arrays(np.float64, 3, elements=numbers),
    st.just(np.array([[1.0, 0.1, 0.0], [-0.2, 1.1, 1e-17], [0.0, 1 / 3, 0.9]])),
    arrays(np.float64, 3, elements=st.floats(0.0, 1e3)),
    unit=st.sampled_from(["uT", "arbitrary"]),
    norm=st.floats(0.0, 100.0) | st.just(np.nan),
    temperature=st.none() | slopes,
    evidence=evidence,
)


@settings(max_examples=40, deadline=None)
@given(part=parts, suffix=st.sampled_from([".toml", ".json"]))
def test_everything_that_can_be_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, part: SensorCalibration, suffix: str
) -> None:
    path = tmp_path_factory.getbasetemp() / f"any{suffix}"
    save(Calibration(mag=part), path)
    assert load(path) == Calibration(mag=part)


def test_the_file_is_plain_toml(tmp_path: Path) -> None:
    save(Calibration(gyr=SensorCalibration("gyr", [0.1, 0.2, 0.3])), tmp_path / "c.toml")
    table = tomllib.loads((tmp_path / "c.toml").read_text())
    assert table["gyr"]["offset"] == [0.1, 0.2, 0.3]
    assert table["gyr"]["unit"] == "rad/s"
    (tmp_path / "by-hand.toml").write_text(GOOD + MATRIX)
    assert load(tmp_path / "by-hand.toml") == Calibration(gyr=SensorCalibration("gyr"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "which is empty"),
        ("hello", "TOML or JSON"),
        ("[[[[[[[[", "TOML or JSON"),
        ("[" * 100_000, "TOML or JSON"),
        ("{" * 100_000, "TOML or JSON"),
        ('{"a":' * 50_000, "TOML or JSON"),
        ("x = [" * 1 + "[" * 90_000, "TOML or JSON"),
        ("a = " + "9" * 10_000, "TOML or JSON"),
        ("[1, 2, 3]\n", "TOML or JSON"),
        ('{"format": NaN}', "NaN is no number"),
        ("\x00" * 100, "TOML or JSON"),
        ("\ud800", None),
        ("time,gyr\n1,2\n", "TOML or JSON"),
        ('format = "northdown calibration"\n', "version 1"),
        ('format = "northdown calibration"\nversion = true\n', "version 1"),
        ('format = "northdown calibration"\nversion = 2\n', "update northdown"),
        ('format = "northdown calibration"\nversion = 1\n', "gyr, acc or mag"),
        ('format = "northdown calibration"\nversion = 1\ngyr = 5\n', "gyr as a table"),
        ('format = "northdown calibration"\nversion = 1\n[thermometer]\n', "'thermometer'"),
        (GOOD, "matrix in"),
        (GOOD + MATRIX + "extra = 1\n", "'extra'"),
        (GOOD + MATRIX.replace("1.0, 0.0, 0.0", "1.0, 0.0"), "3 numbers for matrix"),
        (GOOD + MATRIX.replace("1.0", "nan"), "a number below 1e30"),
        (GOOD + MATRIX.replace("1.0", "1e300"), "a number below 1e30"),
        (GOOD + MATRIX.replace("1.0", '"1"'), "a number for matrix"),
        (GOOD + MATRIX.replace("1.0", "true"), "a number for matrix"),
        (GOOD + MATRIX.replace("1.0", "2024-01-01"), "a number for matrix"),
        (GOOD + MATRIX.replace("1.0", "9" * 400), "a number below 1e30"),
        (GOOD + MATRIX.replace("1.0", "0.0"), "flattens"),
        (GOOD + MATRIX.replace("1.0", "-1.0"), "mirrors"),
        (GOOD + "matrix = [" + "[1.0, 0.0, 0.0], " * 5000 + "]\n", "3 rows for matrix"),
        (GOOD.replace("rad/s", "deg/s") + MATRIX, "unit of gyr"),
        (GOOD.replace('"rad/s"', "[]") + MATRIX, "a text of at most"),
        (GOOD.replace("rad/s", "") + MATRIX, "an empty text"),
        (GOOD + MATRIX + "[gyr.temperature]\nreference = 1.0\n", "low of the temperature"),
        (GOOD + MATRIX + "[gyr.evidence]\nnotes = 5\n", "a list of notes"),
        (GOOD + MATRIX + "[gyr.evidence]\nmodel = [1]\n", "a text of at most"),
        (GOOD + MATRIX + f'[gyr.evidence]\nmodel = "{"x" * 2000}"\n', "a text of at most"),
        (GOOD + MATRIX + "[gyr.evidence]\nsamples = inf\n", "a number below 1e30"),
    ],
)
def test_hostile_files_are_refused(tmp_path: Path, text: str, message: str | None) -> None:
    path = tmp_path / "c.toml"
    path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
    with pytest.raises(InputError, match=message) as error:
        load(path)
    assert isinstance(error.value, FormatError) == bool(text)
    assert len(str(error.value)) < 600
    assert "\n" not in str(error.value)


@settings(max_examples=60, deadline=None)
@given(
    data=st.binary(max_size=400)
    | st.builds(lambda a, b: GOOD.encode()[:a] + b, st.integers(0, 90), st.binary(max_size=40))
)
def test_random_bytes_are_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "random.toml"
    path.write_bytes(data)
    with pytest.raises(InputError):
        load(path)


def test_paths(tmp_path: Path) -> None:
    calibration = Calibration(gyr=SensorCalibration("gyr"))
    with pytest.raises(InputError, match=r"ends in \.toml or \.json"):
        save(calibration, tmp_path / "c.txt")
    with pytest.raises(InputError, match="at least one sensor"):
        save(Calibration(), tmp_path / "c.toml")
    with pytest.raises(InputError, match="folder that exists"):
        save(calibration, tmp_path / "none" / "c.toml")
    with pytest.raises(InputError, match="file that exists"):
        load(tmp_path / "none.toml")
    with pytest.raises(InputError, match="folder"):
        load(tmp_path)
    (tmp_path / "big.toml").write_bytes(b"#" * 300_000)
    with pytest.raises(InputError, match="at most"):
        load(tmp_path / "big.toml")


def test_json_is_what_the_toml_says(tmp_path: Path) -> None:
    calibration = Calibration(acc=SensorCalibration("acc", [0.1, 0.2, 0.3], norm=9.8))
    save(calibration, tmp_path / "c.toml")
    save(calibration, tmp_path / "c.json")
    assert json.loads((tmp_path / "c.json").read_text()) == tomllib.loads((tmp_path / "c.toml").read_text())
