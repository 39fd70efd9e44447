"""What is drawn of long lines, wrapped angles, bands and quaternions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from northdown.frames import as_euler
from northdown.orientation import Orientation
from northdown.plots import _lines
from northdown.plots._euler import euler_sigma
from northdown.plots._quaternion import continuous

pytest.importorskip("matplotlib")


N = 3000
TIME = np.arange(N) * 0.01


def motion(frame: str = "NED", name: str = "walk") -> Orientation:
    """Turns on and on in yaw, with some roll and pitch."""
    angles = np.column_stack([0.6 * TIME, 0.5 * np.sin(TIME), 0.8 * np.sin(0.7 * TIME)])
    return Orientation.from_rotation(TIME, Rotation.from_euler("ZYX", angles), frame, name=name)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 400), st.integers(2, 40))
def test_thinning_keeps_every_peak(seed: int, n: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    time, value = np.cumsum(rng.exponential(size=n)), rng.normal(size=n)
    t, v = _lines.trace(time, value, gap=np.inf, columns=columns)
    assert set(zip(t, v, strict=True)) <= set(zip(time, value, strict=True))
    assert (np.diff(t) > 0).all()
    assert len(t) <= max(4 * columns, n if n <= 4 * columns else 0)
    for i in range(columns):
        inside = _lines.column_of(time, columns) == i
        kept = v[np.isin(t, time[inside])]
        if inside.any():
            assert (kept.min(), kept.max()) == (value[inside].min(), value[inside].max())


def test_lines_are_broken_at_gaps_and_nowhere_else() -> None:
    time = np.array([0.0, 1.0, 2.0, 6.0, 7.0, 20.0])
    value = np.arange(6.0)
    t, v = _lines.trace(time, value, gap=3.0)
    assert np.array_equal(v, [0, 1, 2, np.nan, 3, 4, np.nan, 5], equal_nan=True)
    assert np.array_equal(_lines.isolated(v), [False] * 7 + [True])
    # a missing sample alone does not break the line: the gap in time does
    _, v = _lines.trace(time, np.where(time == 1.0, np.nan, value), gap=3.0)
    assert np.array_equal(v, [0, 2, np.nan, 3, 4, np.nan, 5], equal_nan=True)
    assert len(t) == 8


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 5, 300]), st.floats(0.1, 80.0), st.sampled_from([3, 50, 1500]))
def test_wrapped_angles_have_no_vertical_strokes(seed: int, n: int, step: float, columns: int) -> None:
    """Each break is a crossing of the edge; joined there, the pieces are the continuous angle."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-180, 180) + np.cumsum(rng.uniform(-0.3, 1.0, n) * step)
    time = np.arange(n) * 1.0
    wrapped = (angle + 180.0) % 360.0 - 180.0
    t, v = _lines.trace(time, wrapped, gap=2.0, period=360.0, columns=columns)
    breaks = np.flatnonzero(np.isnan(v))
    np.testing.assert_allclose(np.abs(v[breaks - 1]), 180.0)
    np.testing.assert_allclose(v[breaks - 1], -v[breaks + 1])
    turns = np.zeros(len(v))
    turns[breaks] = np.sign(v[breaks - 1])
    joined = v + 360.0 * np.cumsum(turns)
    samples = np.isin(t, time) & np.isfinite(v)
    off = joined[samples] - angle[np.searchsorted(time, t[samples])]
    # degrees; a whole number of turns throughout, to the rounding of angles of a few thousand degrees
    np.testing.assert_allclose(off, 360.0 * np.round(off[0] / 360.0), atol=1e-8)
    assert np.nanmax(np.abs(v)) <= 180.0
    assert not _lines.isolated(v).any()


def test_a_crossing_ends_at_one_edge_and_starts_at_the_other() -> None:
    t, v = _lines.trace(np.array([0.0, 1.0]), np.array([170.0, -150.0]), gap=2.0, period=360.0)
    np.testing.assert_allclose(t, [0.0, 0.25, 0.25, 0.25, 1.0])
    np.testing.assert_allclose(v, [170.0, 180.0, np.nan, -180.0, -150.0])
    # three turns in one step of a thinned line, downwards
    t, v = _lines._wrap(np.array([0.0, 1.0]), np.array([0.0, -1080.0]), np.array([0, 0]), 360.0)
    np.testing.assert_allclose(v, [0, *[-180, np.nan, 180] * 3, 0])
    np.testing.assert_allclose(t[[1, 4, 7]], [1 / 6, 3 / 6, 5 / 6])


def test_a_jump_at_pitch_90_is_no_stroke() -> None:
    _, v = _lines.trace(np.arange(4.0), np.array([0.0, 1.0, 179.0, 178.0]), gap=2.0, period=360.0)
    assert np.array_equal(v, [0, 1, np.nan, 179, 178], equal_nan=True)


def test_bands_come_back_at_the_opposite_edge() -> None:
    time = np.arange(3.0)
    middle = np.array([170.0, 175.0, 178.0])
    t, low, high = _lines.band(time, middle - 20.0, middle + 20.0, gap=2.0, period=360.0)
    covered = {(float(a), float(b), float(c)) for a, b, c in zip(t, low, high, strict=True) if np.isfinite(b)}
    assert covered == {(x, m - 20, 180.0) for x, m in zip(time, middle, strict=True)} | {
        (x, -180.0, m + 20 - 360) for x, m in zip(time, middle, strict=True)
    }
    # a band of more than a turn is the whole panel, once
    _, low, high = _lines.band(time, middle - 500.0, middle + 500.0, gap=2.0, period=360.0)
    assert np.nansum(high - low) == pytest.approx(3 * 360.0)


def test_bands_do_not_join_one_turn_to_the_next() -> None:
    time = np.arange(100.0)
    middle = (330.0 + 150.0 * np.sin(0.1 * time)) % 360.0 - 180.0  # over the edge and back
    t, low, _ = _lines.band(time, middle - 10.0, middle + 10.0, gap=2.0, period=360.0)
    joined = np.isfinite(low[1:]) & np.isfinite(low[:-1])
    assert np.diff(t)[joined].max() == 1.0
    assert np.abs(np.diff(low))[joined].max() <= 15.0


def test_thinned_bands_keep_their_extremes() -> None:
    time = np.arange(10_000) * 0.01
    low, high = np.zeros(10_000), np.ones(10_000)
    low[1234], high[4321] = -5.0, 7.0
    t, a, b = _lines.band(time, low, high, gap=1.0, columns=100)
    assert len(t) <= 100
    assert (a.min(), b.max()) == (-5.0, 7.0)


def test_spans_of_a_mask() -> None:
    mask = np.array([True, True, False, False, True])
    assert _lines.spans(np.arange(5.0), mask) == [(0.0, 2.0), (4.0, 0.0)]
    assert _lines.spans(np.zeros(0), np.zeros(0, dtype=bool)) == []


@pytest.mark.parametrize("convention", ["zyx", "rfu"])
@pytest.mark.parametrize("frame", ["NED", "ENU"])
def test_sigma_of_angles_against_differences(convention: str, frame: str) -> None:
    rng = np.random.default_rng(2)
    rotation = Rotation.from_euler("ZYX", rng.uniform(-1.2, 1.2, (40, 3)))
    root = rng.normal(size=(40, 3, 3)) * 0.01
    orientation = Orientation.from_rotation(
        np.arange(40.0), rotation, frame, covariance=root @ root.transpose(0, 2, 1)
    )
    shown = orientation.to_frame("ENU") if convention == "rfu" else orientation
    assert shown.covariance is not None
    h = 1e-6
    jacobian = np.stack(
        [
            (
                as_euler(Rotation.from_rotvec(h * axis) * shown.rotation, convention)
                - as_euler(Rotation.from_rotvec(-h * axis) * shown.rotation, convention)
            )
            / (2 * h)
            for axis in np.eye(3)
        ],
        axis=-1,
    )
    expected = np.sqrt(np.einsum("nij,njk,nik->ni", jacobian, shown.covariance, jacobian))
    # central differences are good to h² and rounding / h
    np.testing.assert_allclose(euler_sigma(orientation, convention), expected, rtol=1e-6)


def test_no_covariance_no_sigma_and_bounded_at_pitch_90() -> None:
    assert np.isnan(euler_sigma(motion())).all()
    up = Orientation.from_rotation(
        [0.0], Rotation.from_euler("ZYX", [[0, np.pi / 2, 0]]), covariance=1e-4 * np.eye(3)[None]
    )
    assert np.isfinite(euler_sigma(up)).all()


def test_quaternion_signs_are_continuous_and_alike() -> None:
    rng = np.random.default_rng(3)
    smooth = motion()
    flipped = replace(smooth, quat=smooth.quat * rng.choice([-1.0, 1.0], N)[:, None])
    first = continuous(flipped)
    assert np.abs(np.diff(first, axis=0)).max() < 0.02  # 1.6 rad/s over 0.01 s is 0.008 in a component
    assert first[0, 0] >= 0.0
    seen = (np.arange(N) % 1400) < 500  # most of a turn is missed: after it the sign is free again
    part = flipped[seen]
    np.testing.assert_allclose(continuous(part, smooth.time, first), first[seen], atol=1e-12)
