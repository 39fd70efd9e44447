"""``northdown compare``."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.cli.selection import DEFAULT_ESTIMATOR
from northdown.estimators import registry


def test_json_agrees_with_scipy(run, recording, csv):
    result = run("compare", csv, "-e", "madgwick,mahony", "--json")
    assert (result.code, result.err) == (0, "")
    value = json.loads(result.out)
    assert value["compared_with"] == "reference"
    assert value["alignment"] == "none"
    assert value["movement_only"]
    assert {e["name"] for e in value["estimators"]} == {"madgwick", "mahony"}
    for entry in value["estimators"]:
        found = nd.estimators.get(entry["name"])().run(recording)
        error = (found.rotation * recording.reference.rotation.inv())[recording.movement]
        total = np.degrees(np.sqrt(np.mean(error.magnitude() ** 2)))
        assert entry["total_rms_deg"] == pytest.approx(total, rel=1e-9)
        assert entry["samples"] == int(recording.movement.sum())
        assert 0.0 < entry["heading_rms_deg"] < total
        assert 0.0 < entry["inclination_rms_deg"] < total
        assert entry["ns_per_sample"] > 0.0
        assert entry["problem"] is None
    totals = [e["total_rms_deg"] for e in value["estimators"]]
    assert totals == sorted(totals)


def test_table_has_every_estimator(run, csv):
    result = run("compare", csv)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("walk: RMS errors to the reference over ")
    able = [name for name, estimator in registry().items() if "array" not in estimator.needs]
    assert len(able) >= 12
    for name in able:
        assert f"\n{name} " in result.out
    assert "Left out" not in result.out
    assert max(map(len, result.out.splitlines())) <= 80


def test_without_reference_it_compares_with_the_first(run, recording, tmp_path):
    path = tmp_path / "bare.csv"
    nd.write_recording(dataclasses.replace(recording, reference=None), path)
    value = json.loads(run("compare", path, "-e", "mahony", "-e", "madgwick", "--json").out)
    assert value["compared_with"] == "mahony"
    assert value["alignment"] is None
    first, second = value["estimators"]
    assert first["total_rms_deg"] == 0.0
    assert first["end_heading_deg"] == 0.0
    between = nd.Madgwick().run(recording).rotation * nd.Mahony().run(recording).rotation.inv()
    assert second["total_rms_deg"] == pytest.approx(np.degrees(np.sqrt(np.mean(between.magnitude() ** 2))), rel=1e-9)
    # the twist about the vertical of the last difference, from its quaternion
    _, _, z, w = between[-1].as_quat()
    assert second["end_heading_deg"] == pytest.approx(np.degrees(2.0 * np.arctan(z / w)), rel=1e-9)
    text = run("compare", path)
    assert f"no reference, so RMS differences from {DEFAULT_ESTIMATOR}" in text.out
    assert "end heading" in text.out
    assert max(map(len, text.out.splitlines())) <= 80


def test_left_out_for_lack_of_sensors(run, recording, tmp_path):
    path = tmp_path / "six.csv"
    nd.write_recording(dataclasses.replace(recording, mag=None), path)
    result = run("compare", path)
    assert "triad (needs mag)" in result.out
    assert "\ntriad" not in result.out
    assert "mag for triad" in run("compare", path, "-e", "mahony,triad").error
    assert json.loads(run("compare", path, "--json").out)["left_out"] == [
        f"{name} (needs mag)"
        for name, estimator in registry().items()
        if "mag" in estimator.needs and "array" not in estimator.needs
    ]


def test_aligned_table_says_so(run, recording, tmp_path):
    turned = recording.reference.turned(Rotation.from_rotvec([0.3, -1.0, 0.2]), Rotation.from_rotvec([0.0, 0.5, 1.0]))
    path = tmp_path / "glued.parquet"
    nd.write_recording(dataclasses.replace(recording, reference=turned, reference_offset="rotations"), path)
    value = json.loads(run("compare", path, "-e", "complementary,mahony", "--json").out)
    assert value["alignment"] == "rotations"
    assert max(e["total_rms_deg"] for e in value["estimators"]) < 5.0
    assert "each after aligning world and body axes, so they are lower bounds" in " ".join(
        run("compare", path).out.split()
    )


def test_one_that_fails_does_not_stop_the_others(run, csv, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise nd.InputError("too bad")

    monkeypatch.setattr(nd.Madgwick, "run", fail)
    result = run("compare", csv, "-e", "madgwick,mahony")
    assert result.code == 0
    assert result.err == "warning: madgwick: too bad\n"
    assert "\nmadgwick" in result.out
    assert "–" in result.out
    value = json.loads(run("compare", csv, "-e", "madgwick,mahony", "--json").out)
    assert [(e["name"], e["problem"]) for e in value["estimators"]] == [("mahony", None), ("madgwick", "too bad")]
    assert run("compare", csv, "-e", "madgwick").error == "error: too bad"


def test_plot(run, csv, recording, tmp_path):
    path = tmp_path / "errors.svg"
    result = run("compare", csv, "--plot", path)
    assert result.code == 0
    assert f"Written: {path}" in result.out.replace("\n", " ")
    assert b"<svg" in path.read_bytes()
    bare = tmp_path / "bare.csv"
    nd.write_recording(dataclasses.replace(recording, reference=None), bare)
    assert run("compare", bare, "--plot", tmp_path / "angles.png").code == 0


def test_offline_adds_those_that_smooth(run, csv):
    result = run("compare", csv, "-e", "vqf,mahony", "--offline", "--json")
    assert result.code == 0
    names = [e["name"] for e in json.loads(result.out)["estimators"]]
    assert sorted(names) == ["mahony", "vqf", "vqf (offline)"]


def test_clocks_aligned_on_request_only(run, recording, tmp_path):
    # the truth 30 ms early is a gyroscope 30 ms late
    reference = recording.reference
    early = dataclasses.replace(reference, time=reference.time - 0.03)
    path = tmp_path / "late.hdf5"
    nd.write_recording(dataclasses.replace(recording, reference=early), path)
    plain = json.loads(run("compare", path, "-e", "mekf", "--json").out)
    assert plain["clock_offset"] is None
    value = json.loads(run("compare", path, "-e", "mekf", "--align-clock", "--json").out)
    found = value["clock_offset"]
    assert abs(found["offset_s"] - 0.03) < 4.0 * found["sigma_s"]
    assert found["sigma_s"] < 1e-3
    before, after = (v["estimators"][0]["total_rms_deg"] for v in (plain, value))
    assert after < before
    text = " ".join(run("compare", path, "-e", "mekf", "--align-clock").out.split())
    assert f"clocks aligned (gyroscope {1e3 * found['offset_s']:.3f} ± " in text
    assert "ms behind the reference)" in text
    assert "clocks" not in run("compare", path, "-e", "mekf").out


def test_clocks_cannot_be_aligned_without_reference_or_motion(run, recording, tmp_path):
    bare = tmp_path / "bare.csv"
    nd.write_recording(dataclasses.replace(recording, reference=None), bare)
    assert "with a reference, for --align-clock" in run("compare", bare, "--align-clock").error
    still = tmp_path / "still.csv"
    nd.write_recording(nd.simulate(10.0, motion="rest", rate=50.0), still)
    assert "to find the offset of the clocks" in run("compare", still, "--align-clock").error
