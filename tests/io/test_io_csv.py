"""Delimited text: separators, headers, units, time, missing samples; numbers from closed form."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest

import northdown as nd
from northdown.errors import FormatError
from northdown.io import read, write_recording
from northdown.io.text import scan

# one row per time: t, gyr (deg/s), acc (g), mag (G); chosen so that no two columns are alike
ROWS = [[0.0, 1, 2, 3, 0.1, 0.2, 0.9, 0.5, -0.25, 0.125], [0.5, 4, 5, 6, 0.2, 0.3, 0.8, 0.25, 0.5, -0.125]]
HEADER = [
    "Time (s)",
    *(f"Gyroscope {c} (deg/s)" for c in "XYZ"),
    *(f"Accelerometer {c} (g)" for c in "XYZ"),
    *(f"Magnetometer {c} (G)" for c in "XYZ"),
]


def table(separator: str, decimal: str = ".", header: list[str] | None = None) -> str:
    names = HEADER if header is None else header
    lines = [separator.join(names)] if names else []
    lines += [separator.join(str(v).replace(".", decimal) for v in row) for row in ROWS]
    return "\n".join(lines) + "\n"


def check_rows(recording: nd.Recording) -> None:
    rows = np.array(ROWS)
    # rounding of one multiplication
    np.testing.assert_allclose(recording.time, rows[:, 0], rtol=0, atol=0)
    np.testing.assert_allclose(recording.gyr, rows[:, 1:4] * math.pi / 180, rtol=1e-15)
    np.testing.assert_allclose(recording.acc, rows[:, 4:7] * 9.80665, rtol=1e-15)
    np.testing.assert_allclose(recording.mag, rows[:, 7:10] * 100.0, rtol=1e-15)
    assert recording.mag_unit == "uT"


@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(",", "."), (";", "."), ("\t", "."), (";", ","), ("\t", ","), (", ", "."), (" ; ", ",")],
)
def test_separators_and_decimal_signs(separator: str, decimal: str, text) -> None:
    check_rows(read(text(table(separator, decimal))))


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("separator", [" ", "   ", " \t "])
def test_blanks(separator: str, decimal: str, text) -> None:
    header = ["time_s", *(f"g{c}_dps" for c in "xyz"), *(f"a{c}_g" for c in "xyz"), *(f"m{c}_G" for c in "xyz")]
    check_rows(read(text(table(separator, decimal, header))))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, newline: str, text) -> None:
    content = table(",").replace("(deg/s)", "(°/s)").replace("\n", newline)
    check_rows(read(text(content, encoding=encoding)))


def test_comments_blank_lines_and_quotes(text) -> None:
    lines = table(",").splitlines()
    quoted = ",".join(f'"{name}"' for name in HEADER)
    row = ",".join(f'"{cell}"' for cell in lines[1].split(","))
    content = f"# made by hand\n// twice\n\n{quoted}\n{row}\n\n# break\n   \n{lines[2]}\n"
    check_rows(read(text(content)))


def test_preamble_is_not_a_header(text) -> None:
    check_rows(read(text(f"Logger 3000\nSerial: 17\n{table(',')}")))


def test_trailing_separators(text) -> None:
    lines = table(";").splitlines()
    check_rows(read(text("\n".join(line + ";" for line in lines))))
    check_rows(read(text("\n".join([lines[0] + ";;", *lines[1:]]))))
    check_rows(read(text("\n".join([lines[0], *(line + ";" for line in lines[1:])]))))


def test_line_of_units_below_the_names(text) -> None:
    names = "t,gx,gy,gz,ax,ay,az,mx,my,mz"
    units = "s,deg/s,deg/s,deg/s,g,g,g,[G],[G],[G]"
    check_rows(read(text(table(",", header=[names + "\n" + units]))))


def test_line_of_axes_below_the_groups(text) -> None:
    groups = "Time (s),Gyroscope,,,Accelerometer,,,Magnetometer,,"
    recording = read(
        text(table(",", header=[groups + "\n,X,Y,Z,X,Y,Z,X,Y,Z"])), units={"gyr": "dps", "acc": "g", "mag": "G"}
    )
    check_rows(recording)


@pytest.mark.parametrize("sign", ["#", "# ", "%"])
def test_header_in_a_comment(sign: str, text) -> None:
    check_rows(read(text(sign + table(","))))


def test_numpy_savetxt(tmp_path) -> None:
    path = tmp_path / "log.txt"
    np.savetxt(path, ROWS, header="t gx gy gz ax ay az mx my mz")
    check_rows(read(path, units={"gyr": "deg/s", "acc": "g", "mag": "gauss"}))


def test_numbers_only_with_columns(text) -> None:
    path = text(table(",", header=[]))
    columns = {"time": 0, "gyr": [1, 2, 3], "acc": [4, 5, 6], "mag": [7, 8, 9]}
    check_rows(read(path, columns=columns, units={"gyr": "dps", "acc": "g", "mag": "G"}))


def test_numbers_only(text, refused) -> None:
    refused(lambda: read(text(table(",", header=[]))), "a header", "columns={'gyr': [1, 2, 3]}", kind=FormatError)


def test_argument_overrides_header_units(text) -> None:
    recording = read(text(table(",")), units={"gyr": "rad/s", "acc": 2.0, "time": "ms"})
    assert recording.gyr is not None
    assert recording.acc is not None
    np.testing.assert_array_equal(recording.gyr, np.array(ROWS)[:, 1:4])
    np.testing.assert_array_equal(recording.acc, np.array(ROWS)[:, 4:7] * 2.0)
    np.testing.assert_array_equal(recording.time, [0.0, 0.0005])


def test_without_units_si_and_arbitrary_field(text) -> None:
    recording = read(text("t,gx,gy,gz,mx,my,mz\n0,1,2,3,4,5,6\n.1,1,2,3,4,5,6\n"))
    assert recording.gyr is not None
    assert recording.mag is not None
    np.testing.assert_array_equal(recording.gyr[0], [1, 2, 3])
    np.testing.assert_array_equal(recording.mag[0], [4, 5, 6])
    assert recording.mag_unit == "arbitrary"
    assert recording.acc is None


@pytest.mark.parametrize("empty", ["", "NaN", "nan", "NA", " "])
def test_empty_cells_are_no_samples(empty: str, text) -> None:
    recording = read(text(f"t,gx,gy,gz,mx,my,mz\n0,1,2,3,{empty},{empty},{empty}\n.1,1,2,3,4,5,6\n"))
    assert recording.mag is not None
    assert np.isnan(recording.mag[0]).all()
    np.testing.assert_array_equal(recording.mag[1], [4, 5, 6])


def test_repeated_field_samples_stay(text) -> None:
    recording = read(text("t,mx,my,mz\n0,4,5,6\n.1,4,5,6\n.2,4,5,7\n"))
    assert recording.mag is not None
    np.testing.assert_array_equal(recording.mag, [[4, 5, 6], [4, 5, 6], [4, 5, 7]])


def test_text_in_an_unneeded_column(text) -> None:
    recording = read(text("t,label,gx,gy,gz\n0,walk,1,2,3\n.1,run,4,5,6\n"))
    np.testing.assert_array_equal(recording.gyr, [[1, 2, 3], [4, 5, 6]])


def test_name_is_the_stem(text) -> None:
    path = text(table(","), "walk.of.today.csv")
    assert read(path).name == "walk.of.today"
    assert read(path, name="mine").name == "mine"


def test_stream(text) -> None:
    data = table(",").encode()
    recording = read(io.BytesIO(data))
    check_rows(recording)
    assert recording.name == ""
    with open(text(table(",")), "rb") as file:
        assert read(file).name == "log"


def test_rate_gives_and_replaces_time(text) -> None:
    path = text("gx,gy,gz\n1,2,3\n4,5,6\n7,8,9\n")
    np.testing.assert_array_equal(read(path, rate=256).time, [0, 1 / 256, 2 / 256])
    np.testing.assert_array_equal(read(text(table(",")), rate=10).time, [0, 0.1])


def test_packet_numbers_are_not_time(text, refused) -> None:
    path = text("Packet number,gx,gy,gz\n3,1,2,3\n5,1,2,3\n6,4,5,6\n")
    refused(lambda: read(path), "a sampling rate, got 'Packet number' only", "rate=256", "--rate")
    np.testing.assert_array_equal(read(path, rate=256).time, [0, 1 / 256, 2 / 256])


def test_no_time_at_all(text, refused) -> None:
    refused(lambda: read(text("gx,gy,gz\n1,2,3\n4,5,6\n")), "got no time", "rate=")


def test_reference_and_movement(text) -> None:
    half = math.sqrt(0.5)
    rows = ["0,1,2,3,1,0,0,0,0", f"0.1,1,2,3,{half},{half},0,0,1", "0.2,1,2,3,0,0,0,0,1", "0.3,1,2,3,,,,,0"]
    path = text("t,gx,gy,gz,ref_qw,ref_qx,ref_qy,ref_qz,movement\n" + "\n".join(rows))
    recording = read(path, frame="ENU")
    assert recording.reference is not None
    np.testing.assert_array_equal(recording.reference.time, [0.0, 0.1])  # zero and empty quaternions are left out
    np.testing.assert_allclose(recording.reference.quat[1], [half, half, 0, 0], atol=1e-16)
    assert recording.reference.frame == recording.frame == "ENU"
    np.testing.assert_array_equal(recording.movement, [False, True, True, False])


def test_unsorted_rows_with_reference(text) -> None:
    path = text("t,gx,gy,gz,qw,qx,qy,qz\n0.2,1,1,1,1,0,0,0\n0.1,2,2,2,0,1,0,0\n")
    recording = read(path)
    np.testing.assert_array_equal(recording.time, [0.2, 0.1])  # Recording.check reports it
    assert recording.reference is not None
    np.testing.assert_array_equal(recording.reference.time, [0.1, 0.2])
    np.testing.assert_array_equal(recording.reference.quat[0], [0, 1, 0, 0])


def test_repoimu_layout(text) -> None:
    content = (
        "Time (s);Vicon Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;;IMU Magnetometer;;;\n"
        ";W;X;Y;Z;X;Y;Z;X;Y;Z;X;Y;Z;\n"
        "0.01;1;0;1.6e-035;0;-0.07;0.21;9.79;0.002;-0.006;0.001;-0.33;0.19;-0.88\n"
        "0.02;0;0;0;0;-0.07;0.21;9.79;0.002;-0.006;0.001;-0.33;0.19;-0.88\n"
    )
    recording = read(text(content))
    assert recording.reference_offset == "rotations"
    assert recording.mag_unit == "arbitrary"
    assert recording.reference is not None
    assert len(recording.reference) == 1
    np.testing.assert_array_equal(recording.acc[0], [-0.07, 0.21, 9.79])
    np.testing.assert_array_equal(recording.gyr[0], [0.002, -0.006, 0.001])


def test_orientation_is_no_recording(tmp_path, refused) -> None:
    path = tmp_path / "q.csv"
    nd.write_orientation(nd.Orientation([0.0, 1.0], [[1, 0, 0, 0]] * 2, "ENU"), path)
    refused(lambda: read(path), "a recording", "read_orientation", kind=FormatError)


def test_csv_is_readable_for_people(tmp_path, full_recording) -> None:
    path = tmp_path / "x.csv"
    write_recording(full_recording, path)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[:3] == ["# northdown: recording", "# frame: ENU", "# name: Läufer 3"]
    header = next(line for line in lines if not line.startswith("#"))
    assert header.startswith("time (s),gyr_x (rad/s),gyr_y (rad/s),gyr_z (rad/s),acc_x (m/s^2)")
    assert "mag_x (a.u.)" in header


def test_reference_between_samples_does_not_fit_a_table(tmp_path, refused) -> None:
    reference = nd.Orientation([0.05], [[1, 0, 0, 0]])
    recording = nd.Recording([0.0, 0.1], np.zeros((2, 3)), reference=reference)
    path = tmp_path / "x.csv"
    refused(lambda: write_recording(recording, path), "0.050000 s", "reference.at(recording.time)")
    assert list(tmp_path.iterdir()) == []


def test_line_numbers_count_skipped_lines(text) -> None:
    from northdown.io.source import open_source

    found = scan(open_source(text("# c\nt,gx,gy,gz\n0,1,2,3\n\n#\n1,2,3,4\n\n2,3,4,5\n")))
    assert [found._line_of(i) for i in range(3)] == [3, 6, 8]
