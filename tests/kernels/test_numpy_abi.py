"""Arrays read in place by `Stream.update`: every kind of argument gives what arrays give, or one clear error."""

from __future__ import annotations

import copy
import pickle
import sys

import numpy as np
import pytest

from northdown.errors import InputError
from northdown.estimators import get
from northdown.kernels import numpy_abi, runner

GYR = np.array([0.01, 0.02, 0.03])
ACC = np.array([0.1, 0.2, 9.8])
MAG = np.array([20.0, 1.0, -40.0])


def read_only(v):
    v = v.copy()
    v.setflags(write=False)
    return v


KINDS = {
    "list": lambda v: v.tolist(),
    "tuple": lambda v: tuple(v),
    "read-only": read_only,
    "strided": lambda v: np.repeat(v, 4)[::4],
    "backwards": lambda v: v[::-1].copy()[::-1],
    "column": lambda v: np.column_stack([v, v])[:, 1],
    "big-endian": lambda v: v.astype(">f8"),
    "unaligned": lambda v: np.frombuffer(b"x" + v.tobytes(), np.float64, offset=1),
    "unpickled": lambda v: pickle.loads(pickle.dumps(v)),
    "subclass": lambda v: np.ma.array(v),
    "objects": lambda v: v.astype(object),
}


def follow(convert):
    stream = get("mahony")().stream(rate=100.0)
    return [stream.update(*[convert(v * (1.0 + 0.1 * i)) for v in (GYR, ACC, MAG)]) for i in range(4)]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_argument_gives_the_same_bits(kind):
    assert np.array_equal(follow(KINDS[kind]), follow(np.array))


@pytest.mark.parametrize("dtype", [np.int64, np.int32, np.uint8, np.float32, bool])
def test_other_numbers_are_converted_not_reinterpreted(dtype):
    rounded = [np.array([0, 1, 0]), np.array([1, 0, 9]), np.array([20, 1, 40])]
    streams = [get("mahony")().stream(rate=100.0) for _ in range(2)]
    given = [streams[0].update(*[v.astype(dtype) for v in rounded]) for _ in range(3)]
    plain = [streams[1].update(*[v.astype(dtype).astype(float) for v in rounded]) for _ in range(3)]
    assert np.array_equal(given, plain)


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros(2),
        np.zeros(4),
        np.zeros((1, 3)),
        np.float64(3.0),
        1.0,
        "abc",
        object(),
        {},
        [1.0, 2.0],
        np.zeros(3, "M8[s]"),
    ],
    ids=lambda v: type(v).__name__,
)
def test_what_is_no_vector_is_one_clear_error_and_changes_nothing(bad):
    stream = get("mahony")().stream(rate=100.0)
    stream.update(GYR, ACC, MAG)
    twin = copy.deepcopy(stream)
    for args in ((bad, ACC, MAG), (GYR, bad, MAG), (GYR, ACC, bad)):
        with pytest.raises(InputError, match="expected"):
            stream.update(*args)
    assert np.array_equal(stream.update(2 * GYR, ACC, MAG), twin.update(2 * GYR, ACC, MAG))


@pytest.mark.parametrize("which", range(3))
def test_infinity_is_refused_from_the_first_sample_on(which):
    stream = get("mahony")().stream(rate=100.0)
    for _ in range(3):
        samples = [GYR, ACC, MAG]
        samples[which] = np.array([1.0, -np.inf, 2.0])
        with pytest.raises(InputError, match="got infinity"):
            stream.update(*samples)
        stream.update(GYR, ACC, MAG)


@pytest.mark.parametrize("time", ["now", np.nan, np.inf, -np.inf, [1.0]])
def test_time_must_be_a_finite_number(time):
    stream = get("mahony")().stream()
    with pytest.raises(InputError, match="time"):
        stream.update(GYR, ACC, MAG, time)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_copy_goes_on_alone(duplicate):
    stream = get("mahony")().stream(rate=100.0)
    stream.update(GYR, ACC, MAG)
    other = duplicate(stream)
    expected = [stream.update(GYR * i, ACC, MAG) for i in range(3)]
    assert np.array_equal([other.update(GYR * i, ACC, MAG) for i in range(3)], expected)


def test_arguments_are_neither_kept_nor_freed():
    stream = get("mahony")().stream(rate=100.0)
    stream.update(GYR, ACC, MAG)
    before = [sys.getrefcount(v) for v in (GYR, ACC, MAG)]
    for _ in range(50):
        stream.update(GYR, ACC, MAG)
    assert [sys.getrefcount(v) for v in (GYR, ACC, MAG)] == before


def test_interpreter_with_another_layout_gets_the_same_result(monkeypatch):
    expected = follow(np.array)
    kernel = copy.copy(get("mahony").kernel)
    for name in ("_update", "update"):
        kernel.__dict__.pop(name, None)
    monkeypatch.setattr(runner, "layout_holds", lambda: False)
    monkeypatch.setattr(get("mahony"), "kernel", kernel)
    for convert in (np.array, lambda v: v.tolist(), read_only):
        # a few roundings of numbers near 1: the two are compiled apart
        assert np.allclose(follow(convert), expected, rtol=0.0, atol=4e-15)


def test_layout_is_the_one_this_numpy_has():
    assert numpy_abi.layout_holds()
