"""``northdown simulate``."""

from __future__ import annotations

import numpy as np
import pytest

import northdown as nd
from northdown.cli import simulate as command
from northdown.cli.main import main
from northdown.simulation import MOTIONS, MPU_9250, PRESETS, simulate


def test_file_is_the_library_s_recording(run, tmp_path):
    path = tmp_path / "rec.csv"
    options = ("--motion", "coning", "--preset", "mpu-9250", "--seed", 1, "--duration", 5, "--rate", 50)
    result = run("simulate", *options, "--frame", "enu", "-o", path)
    assert result.code == 0
    assert result.err == ""
    assert "simulated-coning-mpu-9250-1, 251 samples" in result.out
    assert str(path) in result.out
    read = nd.read(path)
    expected = simulate(5.0, rate=50.0, seed=1, motion="coning", sensors=MPU_9250, frame="ENU")
    for name in ("time", "gyr", "acc", "mag"):
        assert np.array_equal(getattr(read, name), getattr(expected, name), equal_nan=True)
    assert np.array_equal(read.reference.quat, expected.reference.quat)
    assert (read.name, read.frame) == ("simulated-coning-mpu-9250-1", "ENU")


def test_calibrated(run, tmp_path):
    for name, extra in (("raw", ()), ("fine", ("--calibrated",))):
        path = tmp_path / f"{name}.parquet"
        options = ("--motion", "rest", "--preset", "mpu-9250", "--duration", 2, *extra)
        assert run("simulate", *options, "-o", path).code == 0
    raw, fine = (nd.read(tmp_path / f"{name}.parquet").reference.gyr_bias[0] for name in ("raw", "fine"))
    assert fine == pytest.approx(0.02 * raw, abs=2e-4)  # the drift is not calibrated away: 10 °/h, some 5e-5 rad/s
    assert nd.read(tmp_path / "fine.parquet").name == "simulated-rest-mpu-9250-calibrated-0"


def test_standard_output_is_csv(tmp_path, capfdbinary):
    path = str(tmp_path / "a.csv")
    assert main(["simulate", "--duration", "2", "-o", path]) == 0
    capfdbinary.readouterr()
    assert main(["simulate", "--duration", "2", "-o", "-"]) == 0
    out, err = capfdbinary.readouterr()
    assert out == (tmp_path / "a.csv").read_bytes()
    assert err == b""


def test_help_lists_motions_and_presets(run):
    words = run("simulate", "--help").out.replace("-\n" + " " * 23, "-").replace(",", " ").replace(".", " ").split()
    assert set(MOTIONS) <= set(words)
    assert set(PRESETS) <= set(words)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (("--motion", "fly", "-o", "a.csv"), "--motion to be one of random"),
        (("--preset", "mpu", "-o", "a.csv"), "--preset to be one of perfect"),
        (("--duration", "0.5", "-o", "a.csv"), "--duration between 1 and"),
        (("--duration", "long", "-o", "a.csv"), "a number of s for --duration, got 'long'"),
        (("--rate", "1e9", "-o", "a.csv"), "--rate between 1 and 10000 Hz"),
        (("--seed", "-3", "-o", "a.csv"), "a whole number from 0 up for --seed"),
        (("--frame", "XYZ", "-o", "a.csv"), "frame to be one of NED, ENU, NWU"),
        (("-o", "a.tum"), "--output to end in .csv"),
        (("-o", "no/a.csv"), "a folder that exists for --output"),
        ((), "missing option '--output'"),
    ],
)
def test_mistakes_are_one_line(run, tmp_path, monkeypatch, options, match):
    monkeypatch.chdir(tmp_path)
    assert match in run("simulate", *options).error
    assert not list(tmp_path.iterdir())


def test_bar_on_a_terminal_only(run, tmp_path, monkeypatch):
    monkeypatch.setattr(command, "_MANY", 10)
    assert run("simulate", "--duration", 2, "-o", tmp_path / "a.csv").err == ""

    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with command._progress(20) as progress:
        assert progress is not None
        progress(20)
    monkeypatch.setattr("sys.stderr.isatty", lambda: False)
    with command._progress(20) as progress:
        assert progress is None
