"""``northdown consistency``."""

from __future__ import annotations

import json

import numpy as np
import pytest

from northdown.estimators import get
from northdown.evaluation import coverage, monte_carlo


def test_recording_json_agrees_with_the_library(run, recording, csv):
    result = run("consistency", csv, "-e", "quaternion-ekf", "-p", "acc_noise=0.3", "--json")
    assert (result.code, result.err) == (0, "")
    value = json.loads(result.out)
    estimate = get("quaternion-ekf")(acc_noise=0.3).run(recording)
    found = coverage(estimate, recording)
    nis = estimate.diagnostics["nis"].sum() / estimate.diagnostics["nis_dof"].sum()
    assert value["mean_nis"] == pytest.approx(nis, rel=1e-6)
    # the file holds text of so many digits
    assert value["mean_nees"] == pytest.approx(found.mean_nees, rel=1e-6)
    assert value["samples"] == found.count == recording.movement.sum()
    for k, axis in enumerate(value["axes"]):
        assert axis["rms_error_deg"] == pytest.approx(np.degrees(found.rms_error[k]), rel=1e-6)
        assert axis["rms_sigma_deg"] == pytest.approx(np.degrees(found.rms_sigma[k]), rel=1e-6)
        assert axis["within_sigma"] == pytest.approx(found.share[:, k], abs=1e-3)
    assert [a["about"] for a in value["axes"]] == ["north", "east", "down"]


def test_recording_table(run, csv, tmp_path):
    figure = tmp_path / "errors.png"
    result = run("consistency", csv, "--frame", "ENU", "--plot", figure)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("mekf: ")
    for text in ("about east", "about north", "about up", "when right", "68.3", "Mean NEES", "Mean NIS", "Written: "):
        assert text in result.out
    assert max(map(len, result.out.split("Written")[0].splitlines())) <= 80
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_runs_json_agrees_with_the_library(run):
    result = run("consistency", "--runs", "4", "--seed", "3", "--json", "-p", "acc_noise=0.01")
    assert (result.code, result.err) == (0, "")
    value = json.loads(result.out)
    found = monte_carlo(get("mekf"), 4, 3, parameters={"acc_noise": 0.01})
    assert value["mean_nees"] == found.anees
    assert value["mean_nees_interval"] == list(found.interval)
    assert value["verdict"] == found.verdict
    assert value["mean_nis"] == found.anis
    assert (value["runs"], value["seed"], value["estimator"]) == (4, 3, "mekf")
    assert len(value["bias_mean_square"]) == 3


@pytest.mark.parametrize("name", ["mekf", "euler-ukf", "gyro-free-direct"])
def test_runs_table(run, tmp_path, name):
    figure = tmp_path / "runs.svg"
    result = run("consistency", "--runs", "3", "-e", name, "--plot", figure)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"{name}: ")
    assert "Runs       3 of 30 s, seed 0" in result.out
    assert "Mean NIS   " in result.out
    assert ("Bias" in result.out) == (name == "mekf")
    assert max(map(len, result.out.split("Written")[0].splitlines())) <= 80
    assert b"<svg" in figure.read_bytes()


def test_mistakes(run, csv, tmp_path):
    assert "either a recording, or --runs" in run("consistency", csv, "--runs", "5").error
    assert "either a recording, or --runs" in run("consistency", csv, "--seed", "5").error
    assert "name a file first" in run("consistency", "--rate", "5").error
    assert "name a file first" in run("consistency", "--force").error
    assert "with a covariance out of calibrating-ekf" in run("consistency", "-e", "madgwick").error
    assert "--runs" in run("consistency", "--runs", "1").error
    assert "--runs" in run("consistency", "--runs", "many").error
    assert "--seed" in run("consistency", "--seed", "-4").error
    assert "did you mean" in run("consistency", "-p", "acc_nois=1").error
    assert "--plot" in run("consistency", "--plot", tmp_path / "x.bmp").error


def test_recording_without_reference(run, recording, tmp_path):
    import dataclasses

    import northdown as nd

    path = tmp_path / "bare.csv"
    nd.write_recording(dataclasses.replace(recording, reference=None), path)
    assert "a recording with a reference" in run("consistency", path).error
