"""What users get wrong: each mistake gets one clear line and exit code 2, and leaves no file behind."""

from __future__ import annotations

import dataclasses
import os
import pickle

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.cli.main import main


@pytest.fixture
def write(tmp_path):
    """Write a recording with changes, and give its path."""

    def call(recording, name="bad.csv", **changes):
        path = tmp_path / name
        nd.write_recording(dataclasses.replace(recording, **changes), path)
        return path

    return call


def table(recording, path, **factors):
    """Write a table without units, the sensors multiplied by these factors, as a careless logger would."""
    columns = [recording.time[:, None]]
    columns += [getattr(recording, s) * factors.get(s, 1.0) for s in ("gyr", "acc", "mag")]
    header = "time,gx,gy,gz,ax,ay,az,mx,my,mz"
    np.savetxt(path, np.hstack(columns), delimiter=",", header=header, comments="")
    return path


def refused(run, path, *options, says, tmp_path):
    """Both commands that estimate refuse with the same line, and write nothing."""
    before = sorted(os.listdir(tmp_path))
    line = run("estimate", path, *options, "-o", tmp_path / "out.csv").error
    assert says in line
    assert run("compare", path, *options).error == line
    assert sorted(os.listdir(tmp_path)) == before


def test_unit_of_the_gyroscope(run, recording, tmp_path):
    path = table(recording, tmp_path / "a.csv", gyr=np.degrees(1.0))
    refused(run, path, says="deg/s", tmp_path=tmp_path)
    result = run("estimate", path, "--unit", "gyr=deg/s", "--unit", "mag=uT")
    assert (result.code, result.err) == (0, "")


def test_unit_of_the_accelerometer(run, recording, tmp_path):
    path = table(recording, tmp_path / "a.csv", acc=1.0 / 9.80665)
    refused(run, path, says="acc", tmp_path=tmp_path)
    result = run("estimate", path, "--unit", "acc=g", "--unit", "mag=uT")
    assert (result.code, result.err) == (0, "")


def test_sign_of_the_accelerometer_against_the_reference(run, recording, write, tmp_path):
    path = write(recording, acc=-recording.acc)
    refused(run, path, says="negate acc", tmp_path=tmp_path)


def test_sign_of_the_accelerometer_without_reference_is_a_warning(run, recording, tmp_path):
    # at rest and level, specific force that points down can also mean a body mounted upside down
    n = 1000
    still = nd.Recording(
        np.arange(n) / 100.0,
        np.random.default_rng(1).normal(0.0, 1e-3, (n, 3)),
        np.random.default_rng(2).normal((0.0, 0.0, 9.81), 0.02, (n, 3)),
        np.random.default_rng(3).normal((20.0, 0.0, 40.0), 0.2, (n, 3)),
    )
    path = tmp_path / "still.csv"
    nd.write_recording(still, path)
    result = run("estimate", path)
    assert result.code == 0
    assert result.err.count("\n") == 1
    assert result.err.startswith("warning: at rest acc reads")


def test_sign_of_the_gyroscope(run, recording, write, tmp_path):
    refused(run, write(recording, gyr=-recording.gyr), says="gyr turns the other way", tmp_path=tmp_path)


def test_force_goes_on_with_a_warning(run, recording, write):
    path = write(recording, gyr=-recording.gyr)
    result = run("estimate", path, "--force")
    assert result.code == 0
    assert "At the end" in result.out
    assert result.err.startswith("warning, forced: gyr turns the other way")


def test_shuffled_time(run, recording, tmp_path):
    order = np.random.default_rng(0).permutation(len(recording))
    shuffled = dataclasses.replace(recording, reference=None, movement=None)[order]
    path = tmp_path / "shuffled.csv"
    nd.write_recording(shuffled, path)
    refused(run, path, says="--sort", tmp_path=tmp_path)
    assert "Recording.sort" not in run("estimate", path).err
    sorted_again = run("estimate", path, "--sort", "-o", "-")
    assert sorted_again.code == 0
    straight = tmp_path / "straight.csv"
    nd.write_recording(dataclasses.replace(recording, reference=None, movement=None), straight)
    assert run("estimate", straight, "-o", "-").out == sorted_again.out


def test_gap_of_the_gyroscope(run, recording, write, tmp_path):
    gyr = recording.gyr.copy()
    gyr[300:330] = np.nan  # 0.6 s
    path = write(recording, gyr=gyr)
    refused(run, path, says="gyr has no sample in 30 of", tmp_path=tmp_path)
    bridged = run("estimate", path, "--max-gap", "0.7")
    assert bridged.code == 0
    assert "gyro held: 30" in bridged.out
    assert "sample 3" in run("estimate", path, "--max-gap", "0.3").err  # the estimator's own, with the place
    # what does not use the gyroscope does not mind
    assert run("estimate", path, "-e", "tilt-compass").code == 0


def test_gap_of_the_accelerometer_is_a_warning(run, recording, write):
    acc = recording.acc.copy()
    acc[300:400] = np.nan  # 2 s
    result = run("estimate", write(recording, acc=acc))
    assert result.code == 0
    assert result.err.startswith("warning: acc has no sample in 100 of")


def test_sensor_without_one_sample_is_missing(run, recording, write):
    path = write(recording, acc=np.full_like(recording.acc, np.nan))
    assert "no acc in the recording; choose gyro-integration with -e" in run("estimate", path).error
    result = run("compare", path)
    assert result.code == 0
    assert "mahony (needs acc)" in result.out
    without = write(recording, gyr=None)
    assert "choose tilt-compass or triad with -e" in run("estimate", without).error
    assert run("estimate", without, "-e", "triad").code == 0


def test_empty_file(run, tmp_path):
    path = tmp_path / "empty.csv"
    path.touch()
    refused(run, path, says="empty", tmp_path=tmp_path)


def test_folder_and_missing_file(run, tmp_path):
    refused(run, tmp_path, says="the folder", tmp_path=tmp_path)
    refused(run, tmp_path / "no.csv", says="exists", tmp_path=tmp_path)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".hdf5", ".mat"])
def test_truncated_file(run, recording, write, tmp_path, suffix):
    path = write(recording, name=f"whole{suffix}")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3 + 1])
    refused(run, path, says="expected", tmp_path=tmp_path)


@pytest.mark.parametrize("name", ["data.csv", "data.parquet", "data.mat"])
def test_pickle_in_disguise_is_not_opened(run, tmp_path, name):
    class Trap:
        def __reduce__(self):
            return (os.mkdir, (str(tmp_path / "trapped"),))

    path = tmp_path / name
    path.write_bytes(pickle.dumps(Trap()))
    refused(run, path, says="pickle", tmp_path=tmp_path)


def test_name_with_control_characters_does_not_reach_the_terminal(run, tmp_path):
    path = tmp_path / "a\x1b[31m\nred\u202e.csv"
    path.touch()
    assert "\x1b" not in run("info", path).error


def test_control_characters_in_a_file_do_not_reach_the_terminal(run, recording, tmp_path):
    path = tmp_path / "named.csv"
    name = "a\x1b[31m\nred\u202e"
    nd.write_recording(dataclasses.replace(recording, name=name), path)
    assert nd.read(path).name == name
    for command in ("info", "estimate", "compare"):
        result = run(command, path)
        assert result.code == 0
        assert "\x1b" not in result.out
        assert "\u202e" not in result.out


def test_mistakes_of_the_command_line(run, csv, tmp_path):
    cases = {
        ("-e", "nonsense"): "expected an estimator out of",
        ("-p", "kp"): "name=value",
        ("-p", "kp=-1"): "kp of at least 0 rad/s",
        ("-p", "kp=nan"): "kp of at least 0 rad/s",
        ("-p", "kp=inf"): "kp of at least 0 rad/s",
        ("-p", "kp=much"): "≥ 0 rad/s",
        ("-p", "kq=1"): "did you mean 'kp'?",
        ("-p", "integrator=euler"): "first-order | rk4 | closed-form",
        ("--frame", "XYZ"): "NED, ENU, NWU",
        ("--rate", "0"): "above 0 Hz",
        ("--rate", "nan"): "above 0 Hz",
        ("--rate", "fast"): "--rate",
        ("--format", "xml"): "csv, parquet, hdf5, mat",
        ("--unit", "gyr"): "gyr=deg/s",
        ("--unit", "gyr=furlong"): "rad/s, deg/s",
        ("--unit", "foo=g"): "time, gyr, acc or mag",
        ("--columns", "gyr=a,b"): "'a'",
        ("--columns", "bar=a"): "time, gyr, acc, mag, reference or movement",
        ("--remap", "x,y,y"): "each of x, y, z once",
        ("--remap", "-x,-y,-z"): "mirrors",
        ("--start", "100"): "samples from 100 s to the end, got none in 12 s",
        ("--start", "-1"): "--start of at least 0 s",
        ("--start", "5", "--stop", "4"): "--stop of at least 5 s",
        ("--max-gap", "-1"): "--max-gap of at least 0 s",
        ("--align", "somehow"): "none, heading, rotations",
    }
    for options, says in cases.items():
        estimator = () if "-e" in options else ("-e", "mahony")
        assert says in run("estimate", csv, *estimator, *options).error, options


def test_outputs_that_cannot_be_written(run, csv, tmp_path, monkeypatch):
    before = csv.read_bytes()
    (tmp_path / "folder.csv").mkdir()
    cases = {
        ("-o", tmp_path / "no" / "out.csv"): "a folder that exists for --output",
        ("-o", csv / "out.csv"): "a folder that exists for --output",
        ("-o", tmp_path / "folder.csv"): "the folder",
        ("-o", tmp_path / "out.xlsx"): "--output to end in .csv",
        ("-o", tmp_path / "out"): "without an ending",
        ("-o", csv): "the input",
        ("-o", ""): "--output",
        ("--plot", tmp_path / "no" / "out.png"): "a folder that exists for --plot",
        ("--plot", tmp_path / "out.gif"): "--plot to end in .png",
    }
    for options, says in cases.items():
        estimator = () if "-e" in options else ("-e", "mahony")
        assert says in run("estimate", csv, *estimator, *options).error, options
    # told before the work, not after it
    monkeypatch.setattr("northdown.io.read", None)
    for options, says in cases.items():
        estimator = () if "-e" in options else ("-e", "mahony")
        assert says in run("estimate", csv, *estimator, *options).error, options
    assert csv.read_bytes() == before
    assert os.listdir(tmp_path) == ["folder.csv"]


def test_failure_while_writing_leaves_nothing(run, csv, tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "replace", refuse)
    assert "permission denied" in run("estimate", csv, "-o", tmp_path / "out.csv").error
    assert os.listdir(tmp_path) == []


def test_what_was_there_stays_until_the_new_is_complete(run, csv, tmp_path, monkeypatch):
    target = tmp_path / "out.csv"
    target.write_text("old")

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("pandas.DataFrame.to_csv", interrupted)
        result = run("estimate", csv, "-o", target)
    assert (result.code, result.out, result.err) == (130, "", "interrupted\n")
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.csv"]
    assert run("estimate", csv, "-o", target).code == 0
    assert target.read_text().startswith("# northdown: orientation")


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.one_of(st.binary(max_size=300), st.text("0123456789.,;\t\n -+eEnaif#gyrxaccmtime()", max_size=300)))
def test_any_content_gives_a_result_or_one_line(content, tmp_path, capsys):
    path = tmp_path / "any.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    code = main(["estimate", str(path)])
    out, err = capsys.readouterr()
    assert code in (0, 2)
    if code == 2:
        assert out == ""
        assert err.count("\n") == 1
        assert err.startswith("error: ")


def test_remap_turns_sensor_and_truth_alike(run, recording, csv):
    """A remounted sensor differs from the truth of the remounted body by as much as before."""
    before, after = run("estimate", csv), run("estimate", csv, "--remap", "y,-x,z")
    pick = [next(line for line in r.out.splitlines() if line.startswith("RMS error")) for r in (before, after)]
    assert pick[0] == pick[1]
    # new axes x' = y, y' = −x: the body frame is turned by +90° about z
    quarter = Rotation.from_euler("z", 90.0, degrees=True)
    end = [float(r.out.split("yaw ")[1].split("°")[0]) for r in (before, after)]
    matrix = recording.remap("y,-x,z").acc[0] - quarter.inv().apply(recording.acc[0])
    assert np.abs(matrix).max() < 1e-12  # m/s², rounding
    assert end[0] != end[1]
