"""`Trajectory` as a value, its table, and its files."""

from __future__ import annotations

import os

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import northdown as nd
from northdown.errors import InputError
from northdown.navigation import Trajectory, write_trajectory

N = 50


def trajectory(frame: str = "NED", **fields: object) -> Trajectory:
    rng = np.random.default_rng(1)
    time = np.arange(N) / 10
    root = rng.normal(size=(2, N, 3, 3))
    covariances = root @ np.swapaxes(root, -1, -2)
    values = {
        "position": rng.normal(size=(N, 3)),
        "velocity": rng.normal(size=(N, 3)),
        "position_covariance": covariances[0],
        "velocity_covariance": covariances[1],
        "acc_bias": rng.normal(size=(N, 3)),
        "still": np.arange(N) < 7,
        "name": "foot",
    } | fields
    return Trajectory(nd.Orientation.from_rotation(time, Rotation.random(N, rng=rng), frame), **values)  # type: ignore[arg-type]


def test_length_and_closure():
    turn = np.linspace(0.0, 2.0 * np.pi, N)
    ring = np.column_stack([3.0 * np.cos(turn), 3.0 * np.sin(turn), 0.5 * turn])
    found = trajectory(position=ring)
    assert found.closure(horizontal=True) == pytest.approx(0.0, abs=1e-12)
    assert found.closure() == pytest.approx(np.pi)
    # a polygon of 49 sides
    assert found.distance(horizontal=True) == pytest.approx(49 * 6.0 * np.sin(np.pi / 49))
    assert found.distance() == pytest.approx(np.hypot(49 * 6.0 * np.sin(np.pi / 49), np.pi))
    assert found.height[-1] == -found.position[-1, 2]
    assert found[:0].distance() == found[:0].closure() == 0.0


@pytest.mark.parametrize("frame", ["ENU", "NWU"])
def test_frames_there_and_back(frame):
    start = trajectory()
    other = start.to_frame(frame)
    back = other.to_frame("NED")
    for key in ("position", "velocity", "position_covariance", "velocity_covariance"):
        assert np.allclose(getattr(back, key), getattr(start, key), atol=1e-12)
    names, others = nd.navigation.trajectory.AXES["NED"], nd.navigation.trajectory.AXES[frame]
    assert np.allclose(other.position[:, others.index("north")], start.position[:, 0])
    assert np.allclose(other.position_sigma[:, others.index("north")], start.position_sigma[:, names.index("north")])
    assert np.allclose(other.height, start.height)
    assert np.allclose(other.acc_bias, start.acc_bias)
    assert start.to_frame("ned") is start


def test_part():
    part = trajectory()[5:9]
    assert len(part) == 4
    assert part.still.tolist() == [True, True, False, False]
    assert part.position_covariance.shape == (4, 3, 3)


def test_table_says_what_it_holds():
    start = trajectory("ENU")
    table = start.to_pandas()
    assert table.columns[:7].tolist() == ["time", "east", "north", "up", "v_east", "v_north", "v_up"]
    assert table.attrs == {"frame": "ENU", "name": "foot"}
    assert np.array_equal(table["up"], start.height)
    assert np.allclose(table["sigma_v_east"] ** 2, start.velocity_covariance[:, 0, 0])
    bare = trajectory(position_covariance=None, velocity_covariance=None, acc_bias=None, still=None).to_pandas()
    assert not [c for c in bare if c.startswith(("sigma", "acc", "still"))]


def test_csv_and_tum(tmp_path):
    start = trajectory("NWU")
    write_trajectory(start, tmp_path / "a.csv")
    text = (tmp_path / "a.csv").read_text()
    assert text.startswith("# frame: NWU\n# name: foot\ntime,north,west,up")
    table = pd.read_csv(tmp_path / "a.csv", comment="#")
    assert np.array_equal(table[["north", "west", "up"]], start.position)
    write_trajectory(start, tmp_path / "a.tum")
    rows = np.loadtxt(tmp_path / "a.tum")
    assert np.allclose(rows[:, 1:4], start.position, rtol=1e-8)
    assert ((Rotation.from_quat(rows[:, 4:]) * start.orientation.rotation.inv()).magnitude() < 1e-7).all()
    # as the package itself reads that format
    assert np.allclose(nd.read_orientation(tmp_path / "a.tum", frame="NWU").quat, start.orientation.quat, atol=1e-7)
    assert sorted(os.listdir(tmp_path)) == ["a.csv", "a.tum"]


def test_mistakes_are_told(tmp_path):
    with pytest.raises(InputError, match="position with 50 rows"):
        trajectory(position=np.zeros((3, 3)))
    with pytest.raises(InputError, match=r"velocity_covariance of shape \(50, 3, 3\)"):
        trajectory(velocity_covariance=np.zeros((50, 3)))
    with pytest.raises(InputError, match="still of shape"):
        trajectory(still=[True])
    with pytest.raises(InputError, match="orientation as an Orientation"):
        Trajectory(None, np.zeros((1, 3)), np.zeros((1, 3)))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"\.csv, \.tum"):
        write_trajectory(trajectory(), tmp_path / "a.xlsx")
    with pytest.raises(InputError, match="at least one sample"):
        write_trajectory(trajectory()[:0], tmp_path / "a.csv")
    with pytest.raises(InputError, match="a Trajectory"):
        write_trajectory(trajectory().orientation, tmp_path / "a.csv")  # type: ignore[arg-type]
    assert not os.listdir(tmp_path)
