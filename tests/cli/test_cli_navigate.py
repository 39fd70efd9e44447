"""``northdown navigate``."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import northdown as nd
from northdown.navigation import Shoe, navigate
from northdown.simulation import LOW_COST, measure, walk


@pytest.fixture(scope="module")
def foot() -> nd.Recording:
    return measure(walk(14.0), LOW_COST, 1, rate=100.0, frame="ENU", name="foot")


@pytest.fixture(scope="module")
def foot_csv(foot, tmp_path_factory):
    path = tmp_path_factory.mktemp("navigate") / "foot.csv"
    nd.write_recording(foot, path)
    return path


def test_it_is_the_library_s_trajectory(run, foot, foot_csv, tmp_path):
    result = run("navigate", foot_csv, "--out", tmp_path / "track.csv", "--plot", tmp_path / "path.png")
    assert result.code == 0
    assert result.err == ""
    truth = navigate(foot)
    table = pd.read_csv(tmp_path / "track.csv", comment="#")
    assert np.allclose(table[["east", "north", "up"]], truth.position, atol=1e-12)
    assert np.array_equal(table["still"], truth.still)
    assert f"{truth.distance(horizontal=True):.2f} m over ground" in result.out
    assert "7 times" in result.out
    assert (tmp_path / "path.png").read_bytes()[:4] == b"\x89PNG"


def test_options_reach_the_filter(run, foot, foot_csv, tmp_path):
    out = tmp_path / "track.csv"

    def place(*options: object) -> np.ndarray:
        assert run("navigate", foot_csv, "-o", out, *options).code == 0
        return pd.read_csv(out, comment="#")[["east", "north", "up"]].to_numpy()

    assert np.allclose(place("--no-zupt"), navigate(foot, zero_velocity=False).position)
    assert np.allclose(place("--forward"), navigate(foot, smooth=False).position)
    shoe = Shoe(threshold=3e3, window=0.15)
    assert np.allclose(place("--threshold", "3000", "--window", "0.15"), navigate(foot, detector=shoe).position)
    assert "not used" in run("navigate", foot_csv, "--no-zupt").out
    assert run("navigate", foot_csv, "--detector", "rate").code == 0


def test_standard_output_is_csv(foot_csv, capfdbinary):
    from northdown.cli.main import main

    assert main(["navigate", str(foot_csv), "-o", "-"]) == 0
    out, err = capfdbinary.readouterr()
    assert out.startswith(b"# frame: ENU\n# name: foot\ntime,east,north,up,")
    assert out.count(b"\n") == 1401 + 3
    assert b"over ground" in err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--threshold", "0"], "--threshold above 0"),
        (["--threshold", "much"], "a number for --threshold"),
        (["--window", "-1"], "--window above 0"),
        (["--detector", "eye"], "--detector to be one of shoe, rate"),
        (["--threshold", "1e-9"], "at which the body stands still, got none"),
        (["-o", "track.xlsx"], "--output to end in .csv, .tum, .txt"),
        (["--plot", "path.gif"], "--plot to end in"),
        (["--columns", "gyr="], "no gyr in the recording"),
    ],
)
def test_mistakes_are_one_line(run, foot_csv, options, words):
    assert words in run("navigate", foot_csv, *options).error
