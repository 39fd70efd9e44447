"""Advice of the library, as one types it on the command line."""

from __future__ import annotations

import pytest

from northdown.cli.wording import as_typed


@pytest.mark.parametrize(
    ("library", "typed"),
    [
        ("give units={'gyr': …}, a unit or the factor", "give --unit gyr=…, a unit or the factor"),
        ("give units={'time': 'ms'}, 'us' or 's', or rate=… in Hz", "give --unit time=ms, us or s, or --rate in Hz"),
        ("columns={'gyr': ['wx', 'wy', 'wz']}", "--columns gyr=wx,wy,wz"),
        ("columns={'gyr': [1, 2, 3]}", "--columns gyr=1,2,3"),
        (
            "give columns={'acc': […]}, or an empty list to leave it out",
            "give --columns acc=…, or nothing after the = to leave it out",
        ),
        ("choose with columns={'mag': …}", "choose with --columns mag=…"),
        ("choose with columns={…}", "choose with --columns"),
        ("cut the recording there, or raise max_gap", "cut the recording there, or raise --max-gap"),
        ("cut it into parts, or raise max_bytes", "cut it into parts"),
        ('find its unit, or declare mag_unit="arbitrary"', "find its unit, or give --unit mag=a.u."),
        ("unless you remap('x,-y,-z')", "unless you give --remap x,-y,-z"),
        (
            "sort the recording by time (Recording.sort(), or --sort on the command line)",
            "sort it by time with --sort",
        ),
        ('or declare reference_offset="rotations" and align before comparing', "or give --align rotations"),
        ("an error without advice stays as it is", "an error without advice stays as it is"),
    ],
)
def test_as_typed(library, typed):
    if "Recording.sort" in library:
        assert as_typed(library) == "sort the recording by time (--sort)"
    else:
        assert as_typed(library) == typed


def test_no_python_is_left_in_what_users_meet(run, csv, tmp_path):
    """The messages that the library writes today, met on the command line."""
    headless = tmp_path / "headless.csv"
    headless.write_text("1,2,3\n4,5,6\n")
    counter = tmp_path / "counter.csv"
    counter.write_text("packet,ax,ay,az\n1,0,0,9.8\n2,0,0,9.8\n")
    partial = tmp_path / "partial.csv"
    partial.write_text("time,ax,ay\n0,1,2\n1,1,2\n")
    for arguments in (["info", headless], ["info", counter], ["info", partial], ["info", csv, "--unit", "gyr=x"]):
        line = run(*arguments).error
        assert "--" in line
        assert "={" not in line
        assert "on the command line" not in line
