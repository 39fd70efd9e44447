"""``northdown arrays``, and arrays in the other commands."""

from __future__ import annotations

import json

import numpy as np
import pytest

import northdown as nd
from northdown.arrays import GEOMETRIES, analyse, coplanar7, ring, triads
from northdown.simulation import K06_CHAPTER_4, ArrayErrors, simulate


def test_named_ones_are_compared(run):
    result = run("arrays")
    assert (result.code, result.err) == (0, "")
    for name in (*GEOMETRIES, "ring8"):
        assert name in result.out
    line = next(s for s in result.out.splitlines() if s.startswith("ring8"))
    # √(2 + 2·(2/4) … ): of ring(8), √(2/4 + 2/4 + 1/4) in units of the radius, and the same for f
    assert line.split()[1:] == ["8", "50.0", "1.41", "1.12", "1.12", "1"]


def test_one_in_words(run, tmp_path):
    result = run(
        "arrays", "--geometry", "coplanar7", "--radius", 0.0175, "--noise-density", 100,
        "--plot", tmp_path / "a.png", "--out", tmp_path / "a.toml",
    )  # fmt: skip
    assert (result.code, result.err) == (0, "")
    for part in ("coplanar seven", "17.5 mm", "Redundancy", "A4", "not enough", "rad/s/√s", "After 10 s"):
        assert part in result.out
    # 100 µg/√Hz, one-sided, over √2, times 46.7 per metre
    k = 100e-6 * 9.80665 / np.sqrt(2) * analyse(coplanar7(0.0175)).angular_noise[0]
    assert f"x {k:.3g}," in result.out
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    again = run("arrays", tmp_path / "a.toml")
    assert again.code == 0
    assert again.out.splitlines()[1:5] == result.out.splitlines()[1:5]


def test_json(run):
    found = json.loads(run("arrays", "--geometry", "ring10", "--json", "--noise-density", 100).out)
    expected = analyse(ring(10, 0.05))
    np.testing.assert_allclose(found["inverse"], expected.inverse)
    assert found["condition"] == expected.condition
    assert [a["name"] for a in found["accelerometer"]] == list(expected.array.names)
    assert len(found["without"]) == 10
    np.testing.assert_allclose(found["rate_random_walk"], 100e-6 * 9.80665 / np.sqrt(2) * expected.angular_noise)
    six = json.loads(run("arrays", "--geometry", "cube6", "--json").out)
    assert six["rate_random_walk"] is None
    assert six["without"][0]["condition"] is None  # singular: infinity is not JSON


def test_best(run, tmp_path):
    path = tmp_path / "best.toml"
    result = run("arrays", "--best", 6, "--plane", 0.1, "--criterion", "a", "--spacing", 0.01, "--out", path)
    assert result.code == 0
    assert "A-optimal in 100 mm, 10 mm apart" in result.out
    assert len(nd.read_array(path)) == 6


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["--geometry", "nope"], ["a geometry out of coplanar6", "'nope'"]),
        (["--geometry", "ring8", "--best", 8], ["one of a file, --geometry and --best"]),
        (["--geometry", "ring8", "--radius", "wide"], ["--radius", "'wide'"]),
        (["--geometry", "ring8", "--plot", "a.gif"], ["--plot", ".png"]),
        (["--geometry", "ring8", "--out", "a.csv"], ["--out", ".toml"]),
        (["walk.csv"], ["a TOML file", "--geometry"]),
        (["none.toml"], ["a file that exists"]),
        (["--best", "five"], ["--best"]),
        (["--best", 5], ["6 to 64 accelerometers"]),
        (["--best", 8, "--criterion", "E"], ["criterion"]),
        (["--json"], ["a geometry"]),
        (["--radius", 0.1], ["a geometry"]),
        (["--geometry", "ring8", "--plane", 0.1], ["--plane with --best"]),
        (["--best", 8, "--radius", 0.1], ["--radius with --geometry"]),
        (["--geometry", "ring8", "--noise-density", 0], ["--noise-density"]),
    ],
)
def test_mistakes(run, words, parts):
    error = run("arrays", *words).error
    for part in parts:
        assert part in error


def test_singular_geometry_is_named(run, tmp_path):
    path = tmp_path / "two.toml"
    nd.write_array(triads([[0, 0, 0], [0, 0.1, 0]]), path)
    assert "no accelerometer measures angular acceleration about y" in run("arrays", path).error


# ---- simulate, info ----


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    from northdown.cli.main import main

    path = tmp_path_factory.mktemp("array") / "free.csv"
    words = ["--array", "coplanar7", "--radius", "0.0175", "--preset", "k06-chapter-4", "--motion", "k06-sine"]
    assert main(["simulate", *words, "--duration", "2", "--rate", "400", "-o", str(path)]) == 0
    return path


def test_simulated_file_is_the_library_s(simulated):
    got = nd.read(simulated)
    expected = simulate(
        2.0, rate=400.0, motion="k06-sine", sensors=K06_CHAPTER_4,
        array=coplanar7(0.0175), array_errors=ArrayErrors.of(K06_CHAPTER_4.acc),
    )  # fmt: skip
    assert np.array_equal(got.array_acc, expected.array_acc)
    assert got.array.names == expected.array.names


def test_info(run, simulated):
    out = run("info", simulated).out
    assert "array  every sample" in out
    assert "coplanar seven (K06), 7 accelerometers: A1, A2, A3x" in out
    assert "condition 1.57" in out
    found = json.loads(run("info", simulated, "--json").out)
    assert found["array"]["channels"][2] == "A3x"
    assert found["sensors"]["array_acc"] == {"missing": 0.0}


def test_geometry_beside_the_recording(run, simulated, tmp_path):
    bare = tmp_path / "bare.csv"
    bare.write_text("".join(s for s in simulated.read_text().splitlines(keepends=True) if not s.startswith("#")))
    assert "give --array FILE.toml, or --columns array=" in run("info", bare).error
    assert "array" not in run("info", bare, "--columns", "array=").out
    nd.write_array(coplanar7(0.0175), tmp_path / "seven.toml")
    assert "coplanar seven" in run("info", bare, "--array", tmp_path / "seven.toml").out
    nd.write_array(ring(8), tmp_path / "ring.toml")
    assert "a column array_z1" in run("info", bare, "--array", tmp_path / "ring.toml").error
    # two triads are no substitute, and info says so
    nd.write_array(triads([[0, 0, 0], [0, 0.1, 0]]), tmp_path / "two.toml")
    names = "array_A1,array_A2,array_A3x,array_A3y,array_A4,array_A5"
    out = run("info", bare, "--array", tmp_path / "two.toml", "--columns", f"array={names}").out
    assert "no substitute for a gyroscope" in out
    assert "angular acceleration about y" in out


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--radius", "0.1"], "--array with --radius"),
        (["--array", "nope"], "a geometry out of"),
        (["--array", "coplanar7", "--radius", "0"], "--radius"),
        (["--array", "coplanar7", "--misplacement", "-1"], "--misplacement"),
        (["--array", "none.toml"], "a file that exists"),
        (["--array", "none.toml", "--radius", "0.1"], "--radius with a named geometry"),
    ],
)
def test_mistakes_in_simulate(run, tmp_path, words, part):
    assert part in run("simulate", *words, "-o", tmp_path / "a.csv").error
    assert not list(tmp_path.iterdir())
