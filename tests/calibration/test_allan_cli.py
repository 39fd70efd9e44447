"""``northdown allan``: the table, the files it writes, JSON, and its errors; and the figure."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import northdown as nd
from northdown import plots
from northdown.calibration.noise import identify_noise
from northdown.cli.main import main

RATE, N = 100.0, 6000


def make(seed=0):
    rng = np.random.default_rng(seed)
    return nd.Recording(
        np.arange(N) / RATE,
        gyr=1.7e-3 * rng.normal(size=(N, 3)),
        acc=2e-2 * rng.normal(size=(N, 3)) + [0.0, 0.0, 9.81],
        mag=0.6 * rng.normal(size=(N, 3)) + [20.0, 0.0, -40.0],
        name="table",
    )


@pytest.fixture(scope="module")
def recording():
    return make()


@pytest.fixture(scope="module")
def csv(recording, tmp_path_factory):
    path = tmp_path_factory.mktemp("allan") / "table.csv"
    nd.write_recording(recording, path)
    return path


@pytest.fixture
def run(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")

    def call(*arguments):
        capsys.readouterr()
        code = main(["allan", *map(str, arguments)])
        out, err = capsys.readouterr()
        return code, out, err

    return call


def test_table_of_all_sensors(run, csv):
    code, out, err = run(csv)
    assert code == 0
    assert err == ""
    assert max(map(len, out.splitlines())) <= 80
    for sensor in ("gyr:", "acc:", "mag:"):
        assert sensor in out
    # 1.7e-3 rad/s at 100 Hz is 1.7e-4 rad/s/√Hz, 0.00974 °/s/√Hz or 0.584 °/√h
    row = next(line for line in out.splitlines() if "N white noise" in line)
    assert float(row.split()[4]) == pytest.approx(0.00974, rel=0.03)
    assert "as angle random walk" in out
    assert "as velocity random walk" in out
    assert "note: K random walk of x, y, z: does not show in" in out
    assert "gyr_noise = 0.0001" in out


def test_one_sensor_and_its_files(run, csv, tmp_path):
    code, out, _ = run(csv, "--sensor", "gyr", "--plot", tmp_path / "a.png", "--toml", tmp_path / "a.toml")
    assert code == 0
    assert "acc:" not in out
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    found = tomllib.loads((tmp_path / "a.toml").read_text(encoding="utf-8"))
    assert list(found) == ["gyr_noise"]
    assert found["gyr_noise"] == pytest.approx(1.7e-4, rel=0.02)
    assert "Written" in out


def test_a_figure_for_each_sensor(run, csv, tmp_path):
    assert run(csv, "--plot", tmp_path / "a.svg")[0] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a-acc.svg", "a-gyr.svg", "a-mag.svg"]


def test_json(run, csv):
    code, out, _ = run(csv, "--json", "--ramp")
    assert code == 0
    data = json.loads(out)
    assert list(data["sensors"]) == ["gyr", "acc", "mag"]
    assert data["parameters"]["acc_noise"] == pytest.approx(2e-3, rel=0.02)
    assert data["sensors"]["gyr"]["axes"]["z"]["R"]["reason"].startswith("does not show")
    assert data["failed"] == {}


def test_part_by_hand(run, csv):
    code, out, _ = run(csv, "--sensor", "acc", "--start", "10", "--stop", "40")
    assert code == 0
    assert "acc: 10.00 s to 40.00 s, 3001 samples" in out


def test_a_stuck_sensor_does_not_hide_the_others(run, recording, tmp_path):
    mag = recording.mag.copy()
    mag[:, 1] = 12.0
    nd.write_recording(replace(recording, mag=mag), tmp_path / "stuck.csv")
    code, out, err = run(tmp_path / "stuck.csv")
    assert code == 0
    assert "warning: mag is left out: expected noise in mag y, got one value" in err
    assert "mag:" not in out
    code, out, err = run(tmp_path / "stuck.csv", "--sensor", "mag")
    assert (code, out) == (2, "")
    assert "noise in mag y" in err.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sensor", "baro"], "--sensor to be one of all, gyr, acc, mag"),
        (["--plot", "a.txt"], "--plot to end in .png"),
        (["--toml", "a.json"], "--toml to end in .toml"),
        (["--toml", "nowhere/a.toml"], "folder that exists"),
        (["--start", "59"], "256 samples of gyr"),
        (["--speed"], "no such option"),
    ],
)
def test_mistakes_are_told_in_one_line(run, csv, arguments, message):
    code, out, err = run(csv, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


# ---- figure ----


def test_figure_shows_estimates_intervals_and_coefficients(recording):
    result = identify_noise(recording, "acc")
    figure = plots.allan(result)
    assert len(figure.axes) == 3
    for k, (ax, model) in enumerate(zip(figure.axes, result.axes, strict=True)):
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        assert ax.get_ylabel() == f"{'xyz'[k]} (µg)"
        points = ax.lines[0]
        np.testing.assert_allclose(points.get_xdata(), result.curve.tau)
        np.testing.assert_allclose(points.get_ydata(), result.curve.deviation[:, k] / 9.80665e-6)
        low, high = ax.get_ylim()
        assert low < points.get_ydata().min()
        assert points.get_ydata().max() < high
        words = " ".join(t.get_text() for t in ax.texts)
        assert f"N  {model.white_noise.value / 9.80665e-6:.3g} µg/√Hz" in words
        assert "K  at most" in words
    assert figure.axes[-1].get_xlabel() == "cluster time τ (s)"


def test_figure_shows_what_is_not_in_the_fit(recording):
    smooth = np.apply_along_axis(np.convolve, 0, recording.gyr, np.full(8, 1.0 / 8.0), "valid")
    result = identify_noise(nd.Recording(recording.time[: len(smooth)], gyr=smooth), "gyr", start=0.0)
    figure = plots.allan(result)
    assert "not in the fit" in [t.get_text() for t in figure.legends[0].get_texts()]
    hollow = figure.axes[0].lines[1]
    assert hollow.get_markerfacecolor() == "white"
    assert len(hollow.get_xdata()) >= 2


def test_figure_needs_a_result(recording):
    with pytest.raises(nd.InputError, match="identify_noise"):
        plots.allan(recording)
