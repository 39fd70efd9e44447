"""The public recordings, as a new user would first meet them."""

from __future__ import annotations

import json

import pytest


def test_broad(run, data_root):
    path = data_root / "broad" / "01_undisturbed_slow_rotation_A.mat"
    value = json.loads(run("info", path, "--json").out)
    assert (value["format"], value["frame"]) == ("mat", "ENU")
    result = run("compare", path, "-e", "mahony,madgwick", "--json")
    assert result.code == 0
    # published for this trial and these parameters: below 4° (D. Laidig et al., Data 6(7):72, 2021, fig. 8)
    assert all(e["total_rms_deg"] < 4.0 for e in json.loads(result.out)["estimators"])


def test_repoimu(run, data_root):
    path = data_root / "repoimu" / "TStick_Test02_Trial1.csv"
    result = run("estimate", path)
    assert result.code == 0
    assert "after aligning axes" in result.out
    assert max(map(len, result.out.splitlines())) <= 80
    clipped = run("estimate", data_root / "repoimu" / "TStick_Test05_Trial1.csv")
    assert "clipped" in clipped.error
    assert run("estimate", data_root / "repoimu" / "TStick_Test05_Trial1.csv", "--force").code == 0


def test_ximu_needs_a_rate(run, data_root):
    path = data_root / "ximu" / "straightLine_CalInertialAndMag.csv"
    assert "--rate" in run("info", path).error
    result = run("compare", path, "--rate", "256")
    assert result.code == 0
    assert "no reference" in result.out


def test_fusion(run, data_root):
    path = data_root / "fusion" / "sensor_data.csv"
    value = json.loads(run("info", path, "--json").out)
    assert value["rate"] == pytest.approx(100.0, abs=1.0)  # Hz, nominal; by its own times a little less
    assert run("estimate", path).code == 0
