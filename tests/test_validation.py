"""Checks of arguments: what is taken, what is refused, and in which words."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from northdown import _validation as v
from northdown.errors import InputError, NorthdownError, expected

VALUES = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


def read_only() -> Any:
    array = np.array(VALUES)
    array.flags.writeable = False
    return array


def unaligned() -> Any:
    return np.frombuffer(b"\0" + np.array(VALUES).tobytes(), dtype=np.float64, offset=1).reshape(2, 3)


@pytest.mark.parametrize(
    "value",
    [
        VALUES,
        tuple(map(tuple, VALUES)),
        np.array(VALUES, np.float32),
        np.array(VALUES, np.float16),
        np.array(VALUES, np.longdouble),
        np.array(VALUES, np.int8),
        np.array(VALUES, np.uint64),
        np.array(VALUES, ">f8"),
        np.asfortranarray(VALUES),
        np.repeat(np.array(VALUES), 2, axis=0)[::2],
        np.array(VALUES)[::-1][::-1],
        np.array(VALUES, object),
        [[Decimal(1), Fraction(2), 3], [np.float32(4), np.int64(5), np.bool_(True) + 5.0]],
        np.ma.masked_array(VALUES),
        pd.DataFrame(VALUES),
        pd.DataFrame(VALUES).astype("Float64"),
        pd.DataFrame(VALUES).to_numpy(),
        read_only(),
        unaligned(),
    ],
    ids=lambda value: type(value).__name__,
)
def test_numbers_of_any_kind_become_an_array_the_kernels_take(value: Any) -> None:
    array = v.as_float_array("gyr", value)
    assert array.dtype == np.float64
    assert array.dtype.isnative
    # numba's compiled signatures take nothing else
    assert array.flags.c_contiguous
    assert array.flags.aligned
    assert array.flags.writeable
    assert array.tolist() == VALUES


def test_a_good_array_is_not_copied() -> None:
    array = np.array(VALUES)
    assert v.as_float_array("gyr", array) is array


def test_shape_is_kept() -> None:
    assert v.as_float_array("x", 3).shape == ()
    assert v.as_float_array("x", [[[1]]]).shape == (1, 1, 1)
    assert v.as_float_array("x", np.zeros((0, 3), object)).shape == (0, 3)
    assert v.as_float_array("x", np.array([[[None]]], object)).shape == (1, 1, 1)


@pytest.mark.parametrize(
    "value",
    [
        [None, 2.0],
        np.array([None, 2.0], object),
        pd.Series([pd.NA, 2.0], dtype="Float64"),
        pd.Series([None, 2], dtype="Int64"),
        np.ma.masked_array([1.0, 2.0], mask=[True, False]),
        np.ma.masked_array([1, 2], mask=[True, False]),
        pd.array([None, 2.0]),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_missing_becomes_nan(value: Any) -> None:
    first, second = v.as_float_array("acc", value)
    assert math.isnan(first)
    assert second == 2.0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("text", "got str; convert gyr first"),
        (["1", "2"], "got list; see that all rows"),
        ([1, "2"], "got list; see that all rows"),
        ([[1, 2], [3]], "got list; see that all rows"),
        (np.array(["1", 2], object), "got object"),
        (np.array([{}, 2], object), "got object"),
        (np.array([1j]), "got complex128"),
        ({"x": 1}, "got dict"),
        (np.array(["2024-01-01"], "M8[s]"), "convert gyr to seconds first"),
        (np.array([1], "m8[s]"), "convert gyr to seconds first"),
        (pd.Series(pd.date_range("2024", periods=2, tz="UTC")), "convert gyr to seconds first"),
        (np.zeros(2, [("x", float)]), "convert gyr first"),
        (10**400, "real numbers in gyr"),
        ([10**400], "real numbers in gyr"),
    ],
    ids=str,
)
def test_what_is_no_number_is_one_clear_error(value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        v.as_float_array("gyr", value)
    assert "\n" not in str(caught.value)
    assert caught.value.__cause__ is None


def test_vectors() -> None:
    assert v.check_vectors("gyr", VALUES, 2).shape == (2, 3)
    assert v.check_vectors("gyr", np.full((4, 3), np.nan)).shape == (4, 3)
    for value, message in (
        (np.zeros((3, 9)), r"got shape \(3, 9\); pass gyr.T"),
        (np.zeros(3), r"got shape \(3,\); give gyr as"),
        (np.zeros((2, 4)), r"give gyr as \(N, 3\)"),
        (np.zeros((2, 3, 1)), "give gyr as"),
        (5.0, r"shape \(\)"),
    ):
        with pytest.raises(InputError, match=message):
            v.check_vectors("gyr", value)
    with pytest.raises(InputError, match="gyr with 3 rows, one for each time, got 2 rows"):
        v.check_vectors("gyr", VALUES, 3)
    bad = np.zeros((5, 3))
    bad[3, 1] = -np.inf
    with pytest.raises(InputError, match="finite numbers in gyr, got infinity, at sample 3"):
        v.check_vectors("gyr", bad)
    with pytest.raises(InputError, match="infinity, at sample 0"):
        v.check_vectors("gyr", np.full((1, 3), np.longdouble("1e400")))


def test_time() -> None:
    assert v.check_time([0, 1, 2]).tolist() == [0.0, 1.0, 2.0]
    assert v.check_time([3, 1]).tolist() == [3.0, 1.0]  # the order is a finding, not an error
    for value, message in (
        ([0, math.nan], "finite time, got nan, at sample 1; remove"),
        ([0, 1, -math.inf], "finite time, got -inf, at sample 2"),
        ([None], "got nan, at sample 0"),
        (5.0, r"time of shape \(N,\), got shape \(\)"),
        ([[1.0]], r"got shape \(1, 1\)"),
    ):
        with pytest.raises(InputError, match=message):
            v.check_time(value)


def test_increasing() -> None:
    v.check_increasing(np.array([]))
    v.check_increasing(np.array([0.0, 0.0, 1.0]))
    with pytest.raises(InputError, match=r"got 1\.0* s after 2\.0* s, at sample 2; sort"):
        v.check_increasing(np.array([0.0, 2.0, 1.0, 0.5]))


@pytest.mark.parametrize(
    "value", [[True, False], [1, 0], np.array([[1.0], [0.0]]), np.array([[1, 0]]), np.array([1, 0], np.uint8)]
)
def test_masks(value: Any) -> None:
    mask = v.check_mask("movement", value, 2)
    assert mask.dtype == np.bool_
    assert mask.tolist() == [True, False]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([True], r"movement of shape \(2,\), got shape \(1,\)"),
        (np.zeros((2, 2), bool), r"got shape \(2, 2\)"),
        ([2, 0], "booleans in movement"),
        ([math.nan, 0.0], "booleans in movement"),
        (["a", "b"], "booleans in movement"),
        ([None, True], "booleans in movement"),
        ([[1], [1, 0]], r"movement of shape \(2,\), got list"),
    ],
    ids=str,
)
def test_bad_masks(value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        v.check_mask("movement", value, 2)


def test_indices() -> None:
    assert v.check_index(slice(1, None, 2), 5) == slice(1, None, 2)
    x = np.arange(5)
    for index, picked in (
        (np.array([0, 4, -5]), [0, 4, 0]),
        (x > 2, [3, 4]),
        (pd.Series(x > 2), [3, 4]),
        (np.array([]), []),
        (np.array([1], np.uint8), [1]),
    ):
        assert x[v.check_index(index, 5)].tolist() == picked
    for bad, message in (
        (3, "got 3$"),
        (np.int64(3), r"int64 of shape \(\)"),
        ([1, 2], r"got \[1, 2\]"),
        (np.array([1.0]), "float64"),
        (np.zeros((5, 1), bool), r"bool of shape \(5, 1\)"),
        (np.array([5]), "indices of 5 samples, got 5"),
        (np.array([0, -6]), "got -6"),
        (np.array([True]), r"the mask of shape \(5,\)"),
        ("a", "'a'"),
        (None, "None"),
    ):
        with pytest.raises(InputError, match=message):
            v.check_index(bad, 5)


def test_numbers() -> None:
    assert v.check_number("kp", np.float32(0.5)) == 0.5
    assert isinstance(v.check_number("kp", 1), float)
    for value, limits, message in (
        (-1, {"low": 0.0}, "expected kp of at least 0, got -1"),
        (2, {"low": 0.0, "high": 1.0}, "kp between 0 and 1, got 2"),
        (0, {"above": 0.0, "unit": "Hz"}, "kp above 0 Hz, got 0"),
        (math.nan, {}, "expected kp, got nan"),
        (math.inf, {}, "got inf"),
        ("1", {}, "a number for kp, got '1'"),
        (b"1", {}, "a number for kp"),
        (None, {}, "a number for kp, got None"),
        ([1, 2], {}, "a number for kp"),
        (1j, {}, "a number for kp"),
        (10**400, {}, "a number for kp, got one beyond"),
        (10**5000, {}, "a number for kp, got one beyond"),
    ):
        with pytest.raises(InputError, match=message):
            v.check_number("kp", value, **limits)


@pytest.mark.parametrize("value", ["c", "", None, 3, ["a"], np.array(["a", "b"]), b"a"], ids=repr)
def test_choices(value: Any) -> None:
    assert v.check_choice("mode", "a", ("a", "b")) == "a"
    with pytest.raises(InputError, match="expected mode to be one of a, b"):
        v.check_choice("mode", value, ("a", "b"))


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3) | st.complex_numbers(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=2), inner, max_size=2),
    max_leaves=8,
)


@settings(max_examples=150, deadline=None)
@given(anything)
def test_whatever_comes_is_an_array_or_our_error(value: Any) -> None:
    for check in (v.check_time, lambda x: v.check_vectors("gyr", x), lambda x: v.check_mask("movement", x, 2)):
        try:
            outcome = check(value)
        except NorthdownError as error:
            outcome = str(error)
        assert isinstance(outcome, np.ndarray) or "\n" not in outcome


def test_the_standard_sentence() -> None:
    assert expected("a", "b") == "expected a, got b"
    assert expected("a", "b", at=0, do="turn it off") == "expected a, got b, at sample 0; turn it off"
