"""Recordings written part by part are those written at once."""

from __future__ import annotations

import io

import numpy as np
import pytest

import northdown as nd
from northdown import InputError
from northdown.simulation import SensorErrors, measure_chunks, random_motion, simulate, simulate_to_file, write_chunks
from northdown.simulation.writing import SUFFIXES, join


def fields(recording):
    reference = recording.reference
    return [
        recording.time,
        recording.gyr,
        recording.acc,
        recording.mag,
        recording.movement,
        reference.time,
        reference.quat,
        reference.gyr_bias,
    ]


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".h5", ".mat"])
def test_file_holds_what_simulate_returns(tmp_path, suffix):
    path = tmp_path / f"walk{suffix}"
    told = []
    # above 65536 samples, so that there are two parts
    options = {"rate": 2200.0, "seed": 3, "frame": "ENU", "sensors": "j14"}
    count = simulate_to_file(path, 30.0, progress=told.append, **options)
    assert told == [65536, count]
    whole, read = simulate(30.0, **options), nd.read(path)
    assert len(read) == count == 66_001
    for a, b in zip(fields(whole), fields(read), strict=True):
        assert np.array_equal(a, b, equal_nan=True)
    assert (read.name, read.frame, read.reference.frame) == (whole.name, "ENU", "ENU")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_stream_gets_the_csv_of_the_file(tmp_path):
    stream = io.BytesIO()
    simulate_to_file(stream, 2.0)
    simulate_to_file(tmp_path / "a.csv", 2.0)
    assert stream.getvalue() == (tmp_path / "a.csv").read_bytes()
    assert not stream.closed


def test_join_is_the_whole():
    parts = list(measure_chunks(random_motion(5.0, 1), SensorErrors(mag=None), chunk=100))
    whole = join(parts)
    assert len(whole) == 501
    assert whole.mag is None
    assert np.array_equal(whole.reference.time, whole.time)


def test_what_fails_half_way_leaves_nothing(tmp_path):
    def chunks():
        yield simulate(2.0)
        raise RuntimeError("half way")

    for suffix in SUFFIXES:
        with pytest.raises(RuntimeError, match="half way"):
            write_chunks(chunks(), tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())


def test_mistakes_are_told(tmp_path):
    with pytest.raises(InputError, match=r"a name that ends in one of \.csv"):
        simulate_to_file(tmp_path / "a.tum", 2.0)
    with pytest.raises(InputError, match="at least one sample to write, got none"):
        write_chunks([], tmp_path / "a.csv")
    with pytest.raises(InputError, match="folder that exists"):
        simulate_to_file(tmp_path / "no" / "a.csv", 2.0)
    with pytest.raises(InputError, match="at least one part"):
        join([])
    assert not list(tmp_path.iterdir())
