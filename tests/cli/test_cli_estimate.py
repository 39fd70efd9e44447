"""``northdown estimate``."""

from __future__ import annotations

import dataclasses
import io
import re
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.cli.output import ORIENTATION_SUFFIXES
from northdown.cli.selection import DEFAULT_ESTIMATOR
from northdown.simulation import measure, random_motion


def numbers(text, label):
    """Numbers of the line with this label."""
    line = next(line for line in text.splitlines() if line.startswith(label))
    return [float(x) for x in re.findall(r"-?\d+\.\d+", line)]


def table(text):
    return pd.read_csv(io.StringIO(text), comment="#")


def test_summary_agrees_with_scipy(run, recording, csv):
    result = run("estimate", csv)
    assert (result.code, result.err) == (0, "")
    assert max(map(len, result.out.splitlines())) <= 80
    orientation = nd.estimators.get(DEFAULT_ESTIMATOR)().run(recording)
    found = Rotation.from_quat(orientation.quat[:, [1, 2, 3, 0]])
    yaw, pitch, roll = found[-1].as_euler("ZYX", degrees=True)
    # two digits are shown
    np.testing.assert_allclose(numbers(result.out, "At the end"), [roll, pitch, yaw], atol=0.0051)
    bias, sigma = np.rad2deg(orientation.gyr_bias[-1]), np.rad2deg(orientation.gyr_bias_sigma[-1])
    shown = numbers(result.out, "Gyro bias")
    np.testing.assert_allclose(shown, np.column_stack([bias, sigma]).ravel(), atol=0.00051)
    error = (found * recording.reference.rotation.inv())[recording.movement]
    total = np.degrees(np.sqrt(np.mean(error.magnitude() ** 2)))
    assert numbers(result.out, "RMS error")[0] == pytest.approx(total, abs=0.0051)
    assert f"over {int(recording.movement.sum())} of 601 samples, not aligned" in result.out
    assert "\nFlagged" not in result.out


def test_parameters_and_frame(run, recording, csv):
    result = run("estimate", csv, "-e", "mahony", "-p", "kp=2", "-p", "integrator=rk4", "--frame", "enu", "-o", "-")
    expected = nd.Mahony(kp=2.0, integrator="rk4").run(recording, frame="ENU")
    assert result.out.startswith("# northdown: orientation\n# frame: ENU\n")
    np.testing.assert_array_equal(table(result.out)[["qw", "qx", "qy", "qz"]], expected.quat)
    # the summary makes room for the table, and knows what was set
    assert "mahony (kp=2 rad/s, ki=0.0012 1/s², integrator=rk4)" in result.err
    assert "(body to ENU)" in result.err


def test_certainty_is_told_by_those_that_know_it(run, recording, csv):
    result = run("estimate", csv, "-e", "mekf", "--frame", "ENU", "-p", "gyr_noise=0.02")
    orientation = nd.MEKF(gyr_noise=0.02).run(recording, frame="ENU")
    cov = np.degrees(np.degrees(orientation.covariance[-1]))
    tilt, heading = np.sqrt(cov[0, 0] + cov[1, 1]), np.sqrt(cov[2, 2])
    np.testing.assert_allclose(
        numbers(result.out, "1 sigma"), [tilt, heading], atol=0.0051
    )  # as many digits as shown
    bias = np.degrees(np.stack([orientation.gyr_bias[-1], orientation.gyr_bias_sigma[-1]], axis=1))
    np.testing.assert_allclose(numbers(result.out, "Gyro bias"), bias.ravel(), atol=0.00051)
    assert "mekf (gyr_noise=0.02 rad/s/√Hz)" in result.out
    assert "mekf (defaults)" in run("estimate", csv, "-e", "mekf").out


def test_error_does_not_depend_on_the_frame(run, csv):
    lines = {
        frame: numbers(run("estimate", csv, "--frame", frame).out, "RMS error") for frame in ("NED", "ENU", "NWU")
    }
    assert lines["NED"] == lines["ENU"] == lines["NWU"]


@pytest.mark.parametrize("suffix", ORIENTATION_SUFFIXES)
def test_every_format_gives_the_same_orientation(run, recording, csv, tmp_path, suffix):
    path = tmp_path / f"out{suffix}"
    result = run("estimate", csv, "-e", "madgwick", "-o", path)
    assert (result.code, result.err) == (0, "")
    assert f"Written     {path}" in result.out
    expected = nd.Madgwick().run(recording)
    written = nd.read_orientation(path)
    assert written.frame == "NED"
    np.testing.assert_allclose(written.quat, expected.quat, atol=1e-15)  # digit for digit, but for normalisation
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_plot(run, csv, tmp_path):
    path = tmp_path / "angles.png"
    assert run("estimate", csv, "--plot", path).code == 0
    assert path.read_bytes().startswith(b"\x89PNG")
    assert [p.name for p in tmp_path.iterdir()] == ["angles.png"]


def test_flags_are_counted(run, recording, tmp_path):
    mag = recording.mag.copy()
    mag[:40] = np.nan
    path = tmp_path / "late.csv"
    nd.write_recording(nd.Recording(recording.time, recording.gyr, recording.acc, mag), path)
    assert "Flagged     heading unknown: 40 samples" in run("estimate", path).out


def test_alignment_is_named(run, recording, csv, tmp_path):
    turned = recording.reference.turned(left=Rotation.from_euler("z", 40.0, degrees=True))
    path = tmp_path / "turned.csv"
    nd.write_recording(
        nd.Recording(recording.time, recording.gyr, recording.acc, recording.mag, reference=turned), path
    )
    plain, aligned = run("estimate", path).out, run("estimate", path, "--align", "heading").out
    assert numbers(plain, "RMS error")[0] > 30.0
    assert numbers(aligned, "RMS error")[0] < 5.0
    assert "after aligning heading (a lower bound)" in aligned


def test_start_and_stop_count_from_the_first_sample(run, recording, tmp_path):
    late = nd.Recording(recording.time + 1000.0, recording.gyr, recording.acc, recording.mag)
    path = tmp_path / "late.csv"
    nd.write_recording(late, path)
    times = table(run("estimate", path, "--start", "1", "--stop", "2", "-o", "-").out)["time"]
    assert times.iloc[0] == pytest.approx(1001.0)
    assert times.iloc[-1] == pytest.approx(1002.0)
    assert len(times) == 51


def test_columns_and_rate_of_a_bare_table(run, recording, tmp_path):
    path = tmp_path / "bare.csv"
    np.savetxt(path, np.hstack([recording.mag, recording.acc, np.degrees(recording.gyr)]), delimiter=";")
    options = ["--columns", "mag=0,1,2", "--columns", "acc=3,4,5", "--columns", "gyr=6,7,8"]
    options += ["--unit", "gyr=deg/s", "--rate", "50"]
    quat = table(run("estimate", path, *options, "-o", "-").out)[["qw", "qx", "qy", "qz"]]
    # 18 digits are written, degrees cost the last bit
    np.testing.assert_allclose(quat, nd.estimators.get(DEFAULT_ESTIMATOR)().run(recording).quat, atol=1e-10)
    without = run("estimate", path, *options, "--columns", "mag=")
    assert "one --columns for mag" in without.error


def test_sensor_left_out(run, recording, csv):
    result = run("estimate", csv, "--columns", "mag=", "-o", "-")
    bare = nd.Recording(recording.time, recording.gyr, recording.acc)
    np.testing.assert_array_equal(
        table(result.out)[["qw", "qx", "qy", "qz"]], nd.estimators.get(DEFAULT_ESTIMATOR)().run(bare).quat
    )


def test_standard_input(csv, recording):
    command = [sys.executable, "-m", "northdown", "estimate", "-", "-o", "-"]
    with open(csv, "rb") as stream:
        result = subprocess.run(command, stdin=stream, capture_output=True, timeout=120)
    assert result.returncode == 0
    np.testing.assert_array_equal(
        table(result.stdout.decode())[["qw", "qx", "qy", "qz"]],
        nd.estimators.get(DEFAULT_ESTIMATOR)().run(recording).quat,
    )
    assert result.stderr.decode().startswith("Recording   walk, 601 samples")


def test_what_is_taken_out_of_the_samples_is_told(run, csv, tmp_path):
    assert "taken out" not in run("estimate", csv).out
    exact = measure(random_motion(80.0, seed=1, turn=0.5, reach=0.05), rate=100.0, seed=1)
    rng = np.random.default_rng(1)
    acc = exact.acc + [0.4, -0.3, 0.3] + 0.03 * rng.normal(size=exact.acc.shape)
    mag = exact.mag + [6.0, -8.0, 5.0] + 0.3 * rng.normal(size=exact.mag.shape)
    path = tmp_path / "off.csv"
    nd.write_recording(dataclasses.replace(exact, acc=acc, mag=mag), path)
    out = run("estimate", path, "--offline").out
    assert numbers(out, "Magnetometer") == pytest.approx([11.2], abs=0.3)  # µT
    assert numbers(out, "Accelerometer") == pytest.approx([0.58], abs=0.04)  # m/s²


def test_offline_is_smoothing(run, recording, csv, tmp_path):
    out = tmp_path / "o.csv"
    result = run("estimate", csv, "-e", "vqf", "--offline", "-o", out)
    assert (result.code, result.err) == (0, "")
    assert "vqf (defaults), offline" in result.out
    found = table(out.read_text())
    expected = nd.VQF().smooth(recording)
    # the file of the recording holds text of so many digits
    np.testing.assert_allclose(found[["qw", "qx", "qy", "qz"]].to_numpy(), expected.quat, atol=1e-6)
    assert np.abs(expected.quat - nd.VQF().run(recording).quat).max() > 1e-4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-e", "mahony"), "expected an estimator that smooths for --offline, got mahony; choose "),
        (("-e", "vqf", "--max-gap", "0.5"), "expected either --offline or --max-gap, got both"),
    ],
)
def test_offline_mistakes(run, csv, arguments, message):
    result = run("estimate", csv, "--offline", *arguments)
    assert (result.code, result.out) == (2, "")
    assert message in result.err
