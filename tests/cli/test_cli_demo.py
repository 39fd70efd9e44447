"""``northdown demo``."""

from __future__ import annotations

import os

import numpy as np

import northdown as nd
from northdown.estimators import registry

# what it simulates has no accelerometer array
ABLE = {name: estimator for name, estimator in registry().items() if "array" not in estimator.needs}


def test_writes_what_it_says(run, tmp_path):
    folder = tmp_path / "new" / "demo"
    result = run("demo", "--out", folder, "--duration", "8", "--seed", "2")
    assert (result.code, result.err) == (0, "")
    expected = {"recording.csv", "recording.parquet", "sensors.png", "angles.png", "errors.png"}
    expected |= {f"orientation-{name}.csv" for name in ABLE}
    assert set(os.listdir(folder)) == expected
    truth = nd.simulate(8.0, seed=2)
    for name in ("recording.csv", "recording.parquet"):
        recording = nd.read(folder / name)
        np.testing.assert_array_equal(recording.gyr, truth.gyr)
        np.testing.assert_allclose(recording.reference.quat, truth.reference.quat, atol=1e-15)  # normalised anew
    for name, estimator in ABLE.items():
        written = nd.read_orientation(folder / f"orientation-{name}.csv")
        np.testing.assert_allclose(written.quat, estimator().run(truth).quat, atol=1e-15)
        assert f"\n{name} " in result.out
    assert "What to look at" in result.out
    short = [line for line in result.out.splitlines() if str(folder) not in line]
    assert max(map(len, short)) <= 80
    # the advice at the end works
    assert run("compare", folder / "recording.csv", "-e", "mahony,madgwick").code == 0


def test_without_optional_packages_it_does_the_rest(run, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "northdown.io.writing.atomic_write", _without_parquet(nd.io.writing.atomic_write, tmp_path / "d")
    )
    monkeypatch.setattr("northdown.plots.sensors", _missing)
    monkeypatch.setattr("northdown.plots.euler", _missing)
    monkeypatch.setattr("northdown.plots.errors", _missing)
    result = run("demo", "--out", tmp_path / "d", "--duration", "5")
    assert result.code == 0
    assert result.err.count("warning: no ") == 4
    assert (tmp_path / "d" / "recording.csv").exists()


def _missing(*_: object, **__: object) -> None:
    raise nd.MissingDependencyError("pip install 'northdown[all]'")


def _without_parquet(real, folder):
    def write(path):
        if str(path).endswith(".parquet"):
            _missing()
        return real(path)

    return write


def test_folder_that_cannot_be_made(run, tmp_path):
    taken = tmp_path / "file"
    taken.touch()
    assert "--out" in run("demo", "--out", taken).error
    assert "--out" in run("demo", "--out", taken / "below").error


def test_interrupted_while_writing(run, tmp_path, monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", interrupted)
    result = run("demo", "--out", tmp_path, "--duration", "5")
    assert result.code == 130
    assert result.err == "interrupted\n"
    # what is there is complete, and nothing is under another name
    names = {"recording.csv", "recording.parquet"} | {f"orientation-{name}.csv" for name in ABLE}
    assert set(os.listdir(tmp_path)) == names
