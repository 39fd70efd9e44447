"""``northdown observability``."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import northdown as nd
from northdown.cli.selection import DEFAULT_ESTIMATOR
from northdown.evaluation import observability
from northdown.simulation import k06_sine, random_motion

MESSAGES = [
    (["--state", "matrix"], "--state to be one of quaternion, quaternion+norm, euler, tangent"),
    (["--method", "guess"], "--method to be one of direct, indirect"),
    (["--variant", "new"], "--variant to be one of"),
    (["--unknown", "bias"], "--unknown to be one of gyr_bias, field, dip, rate"),
    (["--motion", "jump"], "--motion to be one of random, rest"),
    (["--sensors", "acc w"], "sensors such as 'acc xyz, mag xy'"),
    (["--sensors", "acc, gyr"], "leave gyr out"),
    (["--sensors", "acc yz", "--method", "indirect"], "use the direct method"),
    (["--order", "-1"], "--order"),
    (["--order", "9"], "--order"),
    (["--order", "two"], "a whole number from 0 up for --order"),
    (["--points", "1"], "--points"),
    (["--points", "1000000"], "--points"),
    (["--dip", "91"], "--dip between -90 and 90"),
    (["--tolerance", "0"], "--tolerance"),
    (["--bandwidth", "0"], "--bandwidth"),
    (["--duration", "0"], "--duration"),
    (["--duration", "1e9"], "--duration"),
    (["--seed", "x"], "--seed"),
    (["--plot", "x.bmp"], "--plot"),
    (["--plot", "/nowhere/x.png"], "--plot"),
    (["--rate", "5"], "name a file first"),
    (["--force"], "name a file first"),
    (["/nowhere/walk.csv"], "/nowhere/walk.csv"),
]


@pytest.mark.parametrize(("arguments", "message"), MESSAGES)
def test_mistakes(run, arguments, message):
    assert message in run("observability", *arguments).error


def test_either_a_recording_or_a_motion(run, csv):
    for option in (["--motion", "rest"], ["--duration", "5"], ["--seed", "1"]):
        assert "either a recording, or --motion" in run("observability", csv, *option).error
    assert "--plot" in run("observability", csv, "--plot", csv).error


def test_json_agrees_with_the_library(run):
    result = run(
        "observability", "--motion", "random", "--duration", "12", "--seed", "4", "--sensors", "acc",
        "--unknown", "gyr_bias", "--state", "tangent", "--order", "2", "--points", "101", "--json",
    )  # fmt: skip
    assert (result.code, result.err) == (0, "")
    value = json.loads(result.out)
    found = observability(
        random_motion(12.0, 4),
        "acc",
        state="tangent",
        unknown="gyr_bias",
        order=2,
        times=np.linspace(0.0, 12.0, 101),
    )
    assert value["states"] == list(found.model.state_names)
    assert value["measurements"] == ["acc_x", "acc_y", "acc_z"]
    assert (value["times"], value["order"], value["observable"]) == (101, 2, False)
    assert value["largest_singular_values"] == found.singular_values.max(axis=0).tolist()
    assert sum(r["share"] for r in value["rank"]) == pytest.approx(1.0)
    assert {r["rank"] for r in value["rank"]} == set(found.rank.tolist())
    assert value["unobservable"][0] == {"text": "heading", "share": 1.0}
    assert value["overall"]["rank"] == 5
    assert value["overall"]["singular_values"] == found.overall.tolist()
    assert value["overall"]["unobservable"] == ["heading"]


def test_table_and_figure(run, tmp_path):
    figure = tmp_path / "zeros.png"
    result = run(
        "observability", "--duration", "2", "--points", "801", "--method", "indirect", "--plot", figure
    )  # fmt: skip
    assert (result.code, result.err) == (0, "")
    found = observability(k06_sine(2.0), method="indirect", times=np.linspace(0.0, 2.0, 801))
    first = next(line for line in result.out.splitlines() if line.startswith("1 of 4"))
    values = found.singular_values[:, 0]
    assert first.split()[3:] == [f"{v:.3g}" for v in (values.min(), np.median(values), values.max())]
    last = next(line for line in result.out.splitlines() if line.startswith("4 of 4"))
    assert last.split()[3:] == ["0", "0", "0"]
    for text in ("3 of 4 at all times", "length of the quaternion", "k06-sine, 801 times from 0 to 2 s", "Written"):
        assert text in result.out
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_recording(run, csv, tmp_path):
    result = run("observability", csv, "--sensors", "acc", "--unknown", "gyr_bias", "--order", "0")
    assert (result.code, result.err) == (0, "")
    assert "3 of 7 at all times" in result.out
    assert "rank 6 of 7 over all times" in result.out
    assert "the recording's reference" in result.out
    assert "--order 0 is free of that" not in result.out
    assert "--order 0 is free of that" in run("observability", csv).out


@pytest.mark.parametrize("how", ["none", "rotations"])
def test_recording_without_a_reference_to_rely_on(run, recording, tmp_path, how):
    path = tmp_path / "walk.csv"
    if how == "none":
        nd.write_recording(dataclasses.replace(recording, reference=None), path)
        more = []
    else:
        nd.write_recording(recording, path)
        more = ["--align", "rotations"]
    result = run("observability", path, "--sensors", "acc", "--state", "tangent", *more)
    assert (result.code, result.err) == (0, "")
    assert f"an estimate of {DEFAULT_ESTIMATOR}" in result.out
    assert "heading" in result.out
    assert "an estimate of mahony" in run("observability", path, "-e", "mahony", *more).out
    assert "estimator" in run("observability", path, "-e", "nothing", *more).error


def test_undefined_everywhere(run, tmp_path):
    # heading east: −tan ψ has no value; the table is left out, and a figure is refused
    from northdown.recording import Recording

    time = np.arange(100) * 0.01
    turn = nd.Orientation(time, np.tile([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (100, 1)), "NED")
    path = tmp_path / "east.csv"
    nd.write_recording(Recording(time, np.zeros((100, 3)), reference=turn), path)
    result = run("observability", path, "--method", "indirect")
    assert (result.code, result.err) == (0, "")
    assert "at 100.0 % of the times" in result.out
    assert "singular value  " not in result.out
    plotted = run("observability", path, "--method", "indirect", "--plot", tmp_path / "x.png")
    assert "defined at some time" in plotted.error
