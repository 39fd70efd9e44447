"""``northdown calibrate``: what it prints, writes and refuses."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cal_truth import (
    HARD_IRON,
    directions,
    field_recording,
    positions_recording,
    turning_recording,
    turns_recording,
)
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.calibration import load
from northdown.cli.main import main

Run = Callable[..., tuple[int, str, str]]
RNG = np.random.default_rng


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setenv("COLUMNS", "80")

    def call(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main(["calibrate", *(str(a) for a in arguments)])
        return code, *capsys.readouterr()

    return call


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("calibrate")
    nd.write_recording(field_recording(directions(RNG(1), 600)), root / "mag.csv")
    nd.write_recording(field_recording(directions(RNG(2), 600), seed=1), root / "mag2.csv")
    nd.write_recording(positions_recording(directions(RNG(3), 12)), root / "acc.csv")
    nd.write_recording(turns_recording(directions(RNG(4), 14)), root / "gyr.csv")
    turned = Rotation.from_rotvec([0.05, 0.0, 0.02])
    nd.write_recording(turning_recording(misaligned=turned), root / "all.csv")
    ring = directions(RNG(5), 600) * [1.0, 1.0, 0.0]
    nd.write_recording(field_recording(ring / np.linalg.norm(ring, axis=1)[:, None]), root / "plane.csv")
    return root


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        ("mag", ["ellipsoid", "Hard iron", "µT", "Coverage", "100 % of all directions", "Residual"]),
        ("acc", ["offset, scale and cross-axis", "Offset", "m/s²", "12 rests in", "error of gravity's size"]),
        ("gyr", ["bias, scale and alignment", "Bias", "°/s", "14 turns", "error of gravity's direction"]),
    ],
)
def test_each_sensor(run: Run, folder: Path, tmp_path: Path, sensor: str, words: list[str]) -> None:
    cal, figure = tmp_path / "cal.toml", tmp_path / "cal.png"
    code, out, err = run(sensor, folder / f"{sensor}.csv", "-o", cal, "--plot", figure)
    assert (code, err) == (0, "")
    for word in [*words, "Condition", "±", "estimate REC --calibration"]:
        assert word in out
    # paths of any length are one word, and are left out of the count
    assert all(len(line) <= 80 for line in out.splitlines() if str(tmp_path) not in line)
    assert [part.sensor for part in load(cal).parts] == [sensor]
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_json_and_several_recordings(run: Run, folder: Path) -> None:
    code, out, _ = run("mag", folder / "mag.csv", folder / "mag2.csv", "--json", "--field", "48")
    found = json.loads(out)
    assert code == 0
    assert found["sensor"] == "mag"
    assert sorted(found["recordings"]) == ["mag", "mag2"]
    assert found["norm"] == 48.0
    assert np.abs(np.array(found["offset"]) - HARD_IRON).max() < 0.5  # µT
    assert found["steps"][0]["samples"] > 1100


def test_one_after_the_other(run: Run, folder: Path, tmp_path: Path) -> None:
    cal = tmp_path / "cal.json"
    assert run("acc", folder / "acc.csv", "-o", cal)[0] == 0
    assert run("mag", folder / "all.csv", "--turn-to", "gyr", "--calibration", cal, "-o", cal)[0] == 0
    whole = load(cal)
    assert [part.sensor for part in whole.parts] == ["acc", "mag"]
    assert whole.mag.evidence.model == "ellipsoid, then alignment by gyroscope"
    truth = Rotation.from_rotvec([0.05, 0.0, 0.02])
    u, _, v = np.linalg.svd(whole.mag.matrix)
    assert (Rotation.from_matrix(u @ v) * truth.inv()).magnitude() < 0.02  # rad


def test_what_was_found_serves_to_estimate(run: Run, folder: Path, tmp_path: Path) -> None:
    cal, raw = tmp_path / "cal.toml", nd.read(folder / "all.csv")
    nd.write_recording(dataclasses.replace(raw, mag=raw.mag + HARD_IRON), tmp_path / "iron.csv")
    assert run("acc", folder / "acc.csv", "-o", cal)[0] == 0
    # the accelerometer's calibration has nothing to correct in a recording of the field alone, and is kept
    assert run("mag", folder / "mag.csv", "--calibration", cal, "-o", tmp_path / "both.toml")[0] == 0
    assert [part.sensor for part in load(tmp_path / "both.toml").parts] == ["acc", "mag"]
    assert run("mag", tmp_path / "iron.csv", "-o", tmp_path / "mag.toml")[0] == 0
    assert main(["estimate", str(tmp_path / "iron.csv"), "--calibration", str(tmp_path / "mag.toml")]) == 0


def test_refusals_are_one_line(run: Run, folder: Path, tmp_path: Path) -> None:
    mag = folder / "mag.csv"
    for arguments, message in [
        (("mag", folder / "plane.csv"), "turn the sensor slowly about all three axes"),
        (("acc", folder / "mag.csv"), "samples of the accelerometer"),
        (("thermometer", mag), "one of mag, acc, gyr"),
        (("mag", mag, "--gravity", "9.8"), "--gravity with acc only"),
        (("acc", folder / "acc.csv", "--field", "50"), "--field with mag only"),
        (("mag", mag, "--turn-to", "north"), "--turn-to to be one of gyr, acc"),
        (("mag", mag, "--field", "much"), "a number of µT for --field"),
        (("mag", mag, "--tolerance", "2"), "--tolerance between"),
        (("mag", mag, mag), "each recording once"),
        (("mag", mag, "--remap", "y,-x,z"), "the sensor's own axes"),
        (("mag", mag, "-o", tmp_path / "cal.csv"), "--output to end in .toml, .json"),
        (("mag", mag, "-o", tmp_path / "none" / "cal.toml"), "a folder that exists"),
        (("mag", mag, "--calibration", mag), "a calibration in TOML or JSON"),
    ]:
        code, out, err = run(*arguments)
        assert (code, out) == (2, "")
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert message in err
    assert list(tmp_path.iterdir()) == []
