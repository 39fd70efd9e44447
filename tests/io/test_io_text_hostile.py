"""Text that is damaged, or was never a recording: one line that says where."""

from __future__ import annotations

import pytest

from northdown.errors import FormatError
from northdown.io import read

TABLE = "t,gx,gy,gz\n0.00,0.1,0.2,0.3\n0.01,0.4,0.5,0.6\n"


def test_header_only(text, refused) -> None:
    refused(lambda: read(text("t,gx,gy,gz\n")), "a header only", kind=FormatError)
    refused(lambda: read(text("t,gx,gy,gz")), "a header only", kind=FormatError)


def test_blank_or_comments_only(text, refused) -> None:
    refused(lambda: read(text("\n\n  \n")), "no rows", kind=FormatError)
    refused(lambda: read(text("# a\n# b\n")), "no rows", kind=FormatError)


def test_prose(text, refused) -> None:
    refused(lambda: read(text("Dear diary,\ntoday I went\nfor a walk,\nand then home.\n")), "text", kind=FormatError)


def test_cut_off_last_line(text, refused) -> None:
    content = TABLE[:-6]
    refused(lambda: read(text(content)), "4 fields", "in line 3, the last", "cut off", kind=FormatError)


def test_ragged_row(text, refused) -> None:
    lines = "t,gx,gy,gz\n0,1,2,3\n1,2,3\n2,3,4,5\n3,4,5,6\n"
    refused(lambda: read(text(lines)), "4 fields", "got 3, in line 3;", kind=FormatError)
    lines = "t,gx,gy,gz\n0,1,2,3\n1,2,3,4\n2,3,4,5,6\n3,4,5,6\n"
    refused(lambda: read(text(lines)), "got 5, in line 4;", kind=FormatError)


def test_ragged_first_row(text, refused) -> None:
    lines = "t,gx,gy,gz\n0,1,2\n.1,2,3,4\n.2,3,4,5\n"
    refused(lambda: read(text(lines)), "got 3, in line 2", kind=FormatError)


def test_ragged_row_far_down(text, refused) -> None:
    rows = [f"{i / 100},1,2,3" for i in range(1000)]
    rows[700] = "7.0,1,2,3,4"
    refused(lambda: read(text("t,gx,gy,gz\n" + "\n".join(rows))), "got 5, in line 702", kind=FormatError)


@pytest.mark.parametrize("word", ["abc", "1_000", "0x10", "--1", "1.2.3", "١٢"])
def test_text_among_numbers(word: str, text, refused) -> None:
    rows = ["t;gx;gy;gz", "# remark", "0;1;2;3", "", ".1;1.5;2;3", f".2;1;{word};3", ".3;1;2;3"]
    got = f"numbers in column 'gy', got {word!r} in line 6"
    refused(lambda: read(text("\n".join(rows))), got, kind=FormatError)


def test_points_among_decimal_commas(text, refused) -> None:
    """They might be thousands: 1.250 may mean 1250."""
    rows = ["t;gx;gy;gz", "0;1,5;2,5;3", "0,1;1.250;2,5;3"]
    refused(lambda: read(text("\n".join(rows))), "column 'gx', got '1.250' in line 3", kind=FormatError)


def test_header_too_short(text, refused) -> None:
    content = "t,gx,gy,gz\n0,1,2,3,4\n.1,1,2,3,4\n"
    refused(lambda: read(text(content)), "5 column names", "4 in the header", kind=FormatError)


def test_infinity(text, refused) -> None:
    refused(lambda: read(text("t,gx,gy,gz\n0,1,2,3\n.1,1,inf,3\n")), "infinity", "at sample 1")
    refused(lambda: read(text("t,gx,gy,gz\n0,1,2,3\n.1,1,1e400,3\n")), "infinity", "at sample 1")


def test_overflow_by_units(text, refused) -> None:
    refused(lambda: read(text("t,mx,my,mz\n0,1,2,3\n.1,1,1e306,3\n"), units={"mag": "T"}), "infinity", "at sample 1")


def test_missing_time(text, refused) -> None:
    refused(lambda: read(text("t,gx,gy,gz\n0,1,2,3\n,1,2,3\n")), "finite time", "at sample 1")


def test_zero_byte(text, refused) -> None:
    content = "t,gx,gy,gz\n" + "0,1,2,3\n" * 1000 + "0,1\0,2,3\n"
    refused(lambda: read(text(content)), "zero byte in line 1002", kind=FormatError)


def test_endless_line(text, refused) -> None:
    refused(lambda: read(text("1," * 600_000)), "more than a million characters", kind=FormatError)


def test_open_quote(text, refused) -> None:
    refused(lambda: read(text('t,gx,gy,gz\n0,1,2,3\n0,"1,2,3\n0,1,2,3\n')), "quotes in pairs", kind=FormatError)


def test_wild_metadata(text) -> None:
    recording = read(text("# frame: nowhere\n# name: x\n" + TABLE))  # not northdown's: only comments
    assert (recording.frame, recording.name) == ("NED", "log")


def test_wild_metadata_of_a_northdown_file(text, refused) -> None:
    refused(lambda: read(text("# northdown: recording\n# frame: nowhere\n" + TABLE)), "frame", "'NOWHERE'")
    refused(lambda: read(text("# northdown: poem\n" + TABLE)), "a recording", "'poem'", kind=FormatError)
