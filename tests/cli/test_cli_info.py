"""``northdown info``."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import northdown as nd


def test_text(run, csv):
    result = run("info", csv)
    assert (result.code, result.err) == (0, "")
    lines = result.out.splitlines()
    assert lines[0] == "Recording  walk (csv)"
    assert lines[1] == "Samples    601, 12.00 s from 0.00 s on, 50.00 Hz"
    assert [line.split() for line in lines[2:5]] == [
        ["Sensors", "gyr", "every", "sample"],
        ["acc", "every", "sample"],
        ["mag", "every", "sample"],
    ]
    assert "Reference  601 samples in NED; no alignment needed" in lines
    assert max(map(len, lines)) <= 80


def test_json_says_the_same(run, recording, csv):
    value = json.loads(run("info", csv, "--json").out)
    assert value["format"] == "csv"
    assert value["name"] == "walk"
    assert value["samples"] == 601
    assert value["duration"] == pytest.approx(12.0)  # s
    assert value["rate"] == pytest.approx(50.0)  # Hz
    assert value["sensors"] == {s: {"missing": 0.0} for s in ("gyr", "acc", "mag")}
    assert value["reference"] == {"samples": 601, "frame": "NED", "offset": "none"}
    assert [f["kind"] for f in value["findings"]] == [f.kind for f in recording.check()]


def test_missing_samples_and_findings(run, recording, tmp_path):
    mag = recording.mag.copy()
    mag[np.arange(len(mag)) % 4 > 0, 1] = np.nan  # one axis is enough
    path = tmp_path / "slow.parquet"
    nd.write_recording(dataclasses.replace(recording, mag=mag, gyr=-recording.gyr), path)
    result = run("info", path)
    assert result.code == 0  # a look at a wrong recording is no failure
    assert "mag  74.9 % missing" in result.out  # 450 of 601
    findings = result.out.split("\n\n", 1)[1]
    assert findings.startswith("error: gyr turns the other way")
    assert max(map(len, result.out.splitlines())) <= 80


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".hdf5", ".mat"])
def test_format_is_named(run, recording, tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    nd.write_recording(recording, path)
    assert json.loads(run("info", path, "--json").out)["format"] == suffix[1:]


def test_nothing_but_one_sample(run, tmp_path):
    path = tmp_path / "one.csv"
    path.write_text("time,ax,ay,az\n0,0,0,-9.8\n")
    result = run("info", path)
    assert result.code == 0
    assert json.loads(run("info", path, "--json").out)["rate"] is None  # NaN is no JSON


def test_part_of_a_recording(run, recording, csv):
    value = json.loads(run("info", csv, "--start", "2", "--stop", "4", "--json").out)
    inside = (recording.time >= 2.0) & (recording.time <= 4.0)
    assert (value["samples"], value["start"]) == (int(inside.sum()), 2.0)
