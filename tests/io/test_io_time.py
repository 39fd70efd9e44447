"""Time stamps: units, dates, precision; truth by exact integer arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from northdown.io import read
from northdown.io.assemble import seconds

START = 1_700_000_000_123_456_789  # ns since 1970: beyond the 53 bits of a float64


def rows(times, header: str) -> str:
    return f"{header},gx,gy,gz\n" + "".join(f"{t},1,2,3\n" for t in times)


def test_integer_nanoseconds_keep_their_precision(text) -> None:
    steps = np.array([0, 1_000_001, 2_000_003, 3_000_007])
    recording = read(text(rows(START + steps, "timestamp [ns]")))
    np.testing.assert_array_equal(recording.time, steps / 1e9)


@pytest.mark.parametrize("parts", [1, 1000, 1_000_000, 1_000_000_000])
def test_dates_without_unit_show_it_by_their_size(parts: int, text) -> None:
    stamps = [1_700_000_000 * parts + i * max(1, parts // 100) for i in range(4)]
    expected = [(s - stamps[0]) / parts for s in stamps]
    np.testing.assert_array_equal(read(text(rows(stamps, "timestamp"))).time, expected)


def test_iso_dates(text) -> None:
    stamps = [f"2024-05-01T23:59:59.{i:09d}Z" for i in (0, 5, 10_000_001, 999_999_999)] + ["2024-05-02T00:00:00Z"]
    np.testing.assert_array_equal(read(text(rows(stamps, "time"))).time, [0, 5e-9, 0.010000001, 0.999999999, 1.0])


def test_relative_times_are_kept(text) -> None:
    np.testing.assert_array_equal(read(text(rows([7.25, 7.5], "t"))).time, [7.25, 7.5])


def test_milliseconds_are_divided_exactly(text) -> None:
    np.testing.assert_array_equal(read(text(rows(range(1000), "t (ms)"))).time, np.arange(1000) / 1000)


def test_whole_numbers_without_unit(text, refused) -> None:
    refused(lambda: read(text(rows([0, 10, 20], "time"))), "whole numbers without unit, 10 apart", "'ms'")
    np.testing.assert_array_equal(read(text(rows([0, 10, 20], "time")), units={"time": "s"}).time, [0, 10, 20])


def test_stamps_beyond_int64(text) -> None:
    time = read(text(rows([2**63 + 10**9, 2**63 + 3 * 10**9], "time (ns)"))).time
    # float64 near 2⁶³ has steps of 2048 ns
    np.testing.assert_allclose(time, [0.0, 2.0], atol=5e-6)


def test_difference_beyond_int64() -> None:
    raw = np.array([-(2**62), 2**62 + 2**61])
    assert seconds(raw, "ns")[1] == pytest.approx((2**63 + 2**61) / 1e9, rel=1e-12)


@given(
    st.lists(st.integers(-(2**40), 2**40), min_size=1, max_size=5),
    st.sampled_from([("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)]),
)
def test_correctly_rounded(steps: list[int], unit: tuple[str, int]) -> None:
    name, parts = unit
    start = 10**9 * parts
    stamps = np.array([start, *(start + s for s in steps)])
    truth = [float(Fraction(int(s) - start, parts)) for s in stamps]
    assert seconds(stamps, name).tolist() == truth
