"""Arrays of accelerometers in files: recordings with channels and geometry, geometry as TOML, and hostile ones."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import northdown as nd
from northdown.arrays import AccelerometerArray, coplanar7, ring, triads
from northdown.errors import FormatError
from northdown.io.array_file import array_from_json, array_json

SUFFIXES = ("csv", "parquet", "h5", "mat")


def recording_with(array, n=30, seed=4):
    rng = np.random.default_rng(seed)
    values = rng.normal(0.0, 9.0, (n, len(array)))
    values[3] = np.nan
    values[5, 1] = np.nan
    mag = rng.normal(0.0, 30.0, (n, 3))
    return nd.Recording(np.arange(n) / 50.0, mag=mag, array=array, array_acc=values, name="free", frame="ENU")


@pytest.fixture
def seven():
    return recording_with(coplanar7(0.0175))


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "array", [coplanar7(0.0175), ring(8, 1 / 3), triads([[0, 0, 0.1], [0, 0.1, 0]], ["left knee", "1.5-b"])]
)
def test_written_and_read_back(suffix, array, tmp_path):
    before = recording_with(array)
    path = tmp_path / f"a.{suffix}"
    nd.write_recording(before, path)
    after = nd.read(path)
    assert np.array_equal(after.array_acc, before.array_acc, equal_nan=True)
    for name in ("position", "direction"):
        assert np.array_equal(getattr(after.array, name), getattr(array, name))
    assert (after.array.names, after.array.name) == (array.names, array.name)
    assert np.array_equal(after.mag, before.mag)
    assert (after.name, after.frame) == ("free", "ENU")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_array_alone_and_with_another_rate(suffix, seven, tmp_path):
    alone = dataclasses.replace(seven, mag=None)
    path = tmp_path / f"a.{suffix}"
    nd.write_recording(alone, path)
    after = nd.read(path, rate=25.0)
    assert after.mag is None
    assert np.array_equal(after.array_acc, alone.array_acc, equal_nan=True)
    assert after.time[1] == 0.04


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_chunks_of_a_simulation_are_the_whole(suffix, tmp_path):
    motion = nd.simulation.random_motion(3.0, seed=2)
    whole = nd.simulation.measure(motion, array=coplanar7())
    parts = nd.simulation.measure_chunks(motion, array=coplanar7(), chunk=70)
    assert nd.simulation.write_chunks(parts, tmp_path / f"b.{suffix}") == len(whole)
    after = nd.read(tmp_path / f"b.{suffix}")
    assert np.array_equal(after.array_acc, whole.array_acc)
    assert after.array.names == coplanar7().names


def table(columns: dict[str, np.ndarray]) -> str:
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{v:.6f}" for v in row) for row in rows)])


def foreign(seven, names, skip=()):
    values = {n: seven.array_acc[6:, k] for k, n in enumerate(names) if n not in skip}
    return table({"time": seven.time[6:], **values})


def test_geometry_beside_a_file_of_others(seven, text, tmp_path):
    nd.write_array(seven.array, tmp_path / "seven.toml")
    names = seven.array.names
    for labels in (names, [f"array_{n}" for n in names], [f"{n} (m/s^2)" for n in names]):
        got = nd.read(text(foreign(seven, labels)), array=tmp_path / "seven.toml")
        np.testing.assert_allclose(got.array_acc, seven.array_acc[6:], atol=1e-6)
        assert got.array.names == names
    in_g = nd.read(text(foreign(seven, [f"{n} (g)" for n in names])), array=seven.array)
    np.testing.assert_allclose(in_g.array_acc, 9.80665 * seven.array_acc[6:], atol=1e-5)
    other = nd.read(
        text(foreign(seven, list("tuvwxyz"))),
        array=seven.array,
        columns={"array": list("tuvwxyz")},
        units={"array": "mg"},
    )
    np.testing.assert_allclose(other.array_acc, 9.80665e-3 * seven.array_acc[6:], atol=1e-8)


def test_hdf5_of_others(seven, tmp_path):
    h5py = pytest.importorskip("h5py")
    for k, values in enumerate((seven.array_acc, seven.array_acc.T)):
        path = tmp_path / f"{k}.h5"
        with h5py.File(path, "w") as file:
            file["time"], file["array_acc"] = seven.time, values
        got = nd.read(path, array=seven.array)
        assert np.array_equal(got.array_acc, seven.array_acc, equal_nan=True)


def test_another_geometry_than_the_file_s_own(seven, tmp_path):
    # calibrated positions for the same channels; without a dead one the others stay
    for suffix in ("csv", "parquet"):
        nd.write_recording(seven, tmp_path / f"a.{suffix}")
        less = nd.read(tmp_path / f"a.{suffix}", array=seven.array.scaled(1.01).without(1))
        assert np.array_equal(less.array_acc, np.delete(seven.array_acc, 1, axis=1), equal_nan=True)
        assert less.array.position[0, 0] == pytest.approx(1.01 * seven.array.position[0, 0])


def test_channels_that_do_not_fit(seven, text, tmp_path, refused):
    names = [f"array_{n}" for n in seven.array.names]
    path = text(foreign(seven, names, skip=["array_A4"]))
    refused(
        lambda: nd.read(path, array=seven.array), "array_A4", "7 accelerometers", "6 named array_", "columns={'array'"
    )
    path = text(foreign(seven, names))
    refused(lambda: nd.read(path), "the geometry of the array", "7 columns array_…", "--array")
    refused(lambda: nd.read(path, array=seven.array, columns={"array": names[:3]}), "7 columns", "got 3")
    refused(lambda: nd.read(path, array=seven.array, columns={"array": ["nothing"] * 7}), "'nothing'")
    refused(lambda: nd.read(path, array=tmp_path / "none.toml"), "a file that exists")
    refused(lambda: nd.read(path, array=seven.array, units={"array": "T"}), "a unit of array")
    twice = path.read_text().replace("array_A2", "array_A1", 1)
    refused(lambda: nd.read(text(twice, "b.csv"), array=seven.array), "2 of that name")
    nd.write_recording(seven, tmp_path / "a.h5")
    refused(lambda: nd.read(tmp_path / "a.h5", array=ring(8)), "array_acc with 8 columns", kind=FormatError)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_dead_channels(suffix, seven, tmp_path, refused):
    values = seven.array_acc.copy()
    values[:, 2] = np.nan
    path = tmp_path / f"a.{suffix}"
    nd.write_recording(dataclasses.replace(seven, array_acc=values), path)
    refused(lambda: nd.read(path), "samples in every channel", "none in A3x", "leave them out")
    nothing = dataclasses.replace(seven, array_acc=np.full_like(values, np.nan))
    nd.write_recording(nothing, path)
    assert np.isnan(nd.read(path).array_acc).all()  # no sensor there is no dead channel


def test_columns_of_an_array_that_nobody_wants(seven, text):
    path = text(table({"time": seven.time, **{f"mag_{c}": seven.mag[:, i] for i, c in enumerate("xyz")},
                       **{f"array_{n}": seven.mag[:, 0] for n in seven.array.names}}))  # fmt: skip
    assert nd.read(path, columns={"array": []}).array is None


def test_damaged_geometry_in_a_recording(seven, text, tmp_path, refused):
    nd.write_recording(seven, tmp_path / "a.csv")
    content = (tmp_path / "a.csv").read_text()
    line = next(s for s in content.splitlines() if s.startswith("# array: "))
    for other, part in (
        ("# array: [1]", "the geometry of the array as JSON"),
        ("# array: {", "the geometry of the array as JSON"),
        (line.replace("0.0, 1.0]", "0.0, 1e999]"), "three finite numbers"),
        (line.replace('"A4"', '"A9"'), "a column array_A9"),
        (f"# array: {array_json(ring(8))}", "a column array_z1"),
    ):
        assert other != line
        refused(lambda o=other: nd.read(text(content.replace(line, o), "b.csv")), part)
    # without its geometry, the file is one of others: it has to be given
    bare = text(content.replace(line + "\n", ""), "c.csv")
    refused(lambda: nd.read(bare), "without it")
    assert nd.read(bare, array=seven.array).array.names == seven.array.names


# ---- geometry as TOML ----


@pytest.mark.parametrize("array", [coplanar7(0.0175), ring(6, 1 / 7), triads([[0, 0, 0]], name='a "b" \\ µ\t\x7f')])
def test_toml_gives_back_every_digit(array, tmp_path):
    path = tmp_path / "a.toml"
    nd.write_array(array, path)
    after = nd.read_array(path)
    assert np.array_equal(after.position, array.position)
    assert np.array_equal(after.direction, array.direction)
    assert (after.names, after.name) == (array.names, array.name)


def test_toml_by_hand(text):
    entry = "[[accelerometer]]\nposition_m = [0.05, 0, 1]\ndirection = [0, 3, 4]\n"
    array = nd.read_array(text(entry * 2, "own.toml"))
    assert array.names == ("a1", "a2")
    assert array.name == "own"
    assert array.direction[0].tolist() == [0.0, 0.6, 0.8]


GOOD = '[[accelerometer]]\nname = "n"\nposition_m = [0.0, 0.0, 1.0]\ndirection = [0, 0, 1]\n'


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("[[accelerometer]\n", ("an accelerometer array in TOML",)),
        ("name = 'a'\n", ("[[accelerometer]] entries", "none")),
        ("accelerometer = 3\n", ("[[accelerometer]] entries", "int")),
        ("accelerometer = [1]\n", ("accelerometer 1 as a table",)),
        (GOOD + "[other]\n", ("'other'",)),
        (GOOD + "noise = 3\n", ("accelerometer 1 ('n')", "'noise'")),
        (
            GOOD + "[[accelerometer]]\nname = 'm'\ndirection = [0, 0, 1]\n",
            ("position_m of accelerometer 2 ('m')", "none"),
        ),
        (GOOD.replace("[0, 0, 1]", "[0, 0, 0]"), ("direction of accelerometer 1 ('n') other than zero",)),
        (GOOD.replace("[0, 0, 1]", "[0, 0]"), ("three finite numbers", "direction of accelerometer 1")),
        (GOOD.replace("[0, 0, 1]", "[0, true, 1]"), ("three finite numbers",)),
        (GOOD.replace("[0, 0, 1]", "[0, nan, 1]"), ("three finite numbers",)),
        (GOOD.replace("[0, 0, 1]", f"[0, {'9' * 400}, 1]"), ("three finite numbers",)),
        (GOOD.replace("1.0", "1e9"), ("a position within",)),
        (GOOD.replace("'n'", "'n'") * 2, ("2 different names",)),
        (GOOD + GOOD.replace('name = "n"\n', ""), ("names for all accelerometers, or for none",)),
        (GOOD.replace('"n"', "[1]"), ("names that are texts",)),
        (GOOD.replace('"n"', '"\\u0007"'), ("names of letters",)),
        ("name = 5\n" + GOOD, ("a name of at most 200 characters",)),
        (GOOD * 300, ("1 to 256 accelerometers",)),
        ("a = " + "[" * 5000, ("TOML",)),
        ("#" * (1 << 18) + "\n", ("at most 0.3 MB",)),
        ("", ("a file with data",)),
    ],
)
def test_hostile_toml(content, parts, text, refused):
    refused(lambda: nd.read_array(text(content, "a.toml")), *parts)


@given(st.binary(max_size=200))
@settings(max_examples=60, deadline=None)
def test_any_bytes_are_refused_in_one_line(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("toml") / "a.toml"
    path.write_bytes(data)
    try:
        nd.read_array(path)
    except nd.InputError as problem:
        message = str(problem)
    else:
        raise AssertionError("random bytes are no array")
    assert "\n" not in message
    assert len(message) < 500


KEYS = st.sampled_from(["name", "accelerometer", "position_m", "direction", "x"])
LEAVES = st.none() | st.booleans() | st.floats() | st.text(max_size=5) | st.integers()


def nested(inner):
    return st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4)


@given(st.recursive(LEAVES, nested, max_leaves=20))
@settings(max_examples=80, deadline=None)
def test_any_json_is_an_array_or_refused(value):
    try:
        found = array_from_json(json.dumps(value), "file")
    except FormatError as problem:
        assert "\n" not in str(problem)  # noqa: PT017
    else:
        assert isinstance(found, AccelerometerArray)


def test_json_is_one_line():
    array = triads([[0, 0, 0]], name="a\nb µ")
    line = array_json(array)
    assert line.isascii()
    assert "\n" not in line
    assert array_from_json(line, "file").name == "a\nb µ"


def test_targets(seven, tmp_path, refused):
    refused(lambda: nd.write_array(seven.array, tmp_path / "a.json"), ".toml")
    refused(lambda: nd.write_array("a", tmp_path / "a.toml"), "an AccelerometerArray")
    assert not list(tmp_path.iterdir())
