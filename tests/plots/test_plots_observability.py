"""The figure of an analysis of observability: values, the zero area, the rank, and the words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from northdown import plots
from northdown.errors import InputError
from northdown.evaluation import observability
from northdown.simulation import k06_sine, pitch_sweep, random_motion, rest

pytest.importorskip("matplotlib")


def lines(ax):
    return [line for line in ax.lines if len(line.get_xdata()) > 2]


def title(figure) -> str:
    return figure.legends[0].get_title().get_text()


def test_what_is_drawn_is_what_was_found():
    found = observability(k06_sine(2.0), method="indirect", times=np.linspace(0.0, 2.0, 101))
    figure = plots.observability(found)
    figure.canvas.draw()
    values, rank = figure.axes
    assert values.get_yscale() == "log"
    drawn = lines(values)
    assert len(drawn) == 4
    for k in range(3):
        np.testing.assert_array_equal(drawn[k].get_ydata(), found.singular_values[:, k])
    # zeros lie at the floor, within the picture and the grey area
    low, high = values.get_ylim()
    zeros = drawn[3].get_ydata()
    assert (zeros > low).all()
    assert (zeros < found.limit).all()
    assert high > found.singular_values.max()
    np.testing.assert_array_equal(lines(rank)[0].get_ydata(), 3.0)
    assert rank.get_ylim()[1] > 4
    assert "-tan(yaw)" in title(figure)
    assert "unobservable: length of the quaternion" in title(figure)
    labels = [t.get_text() for t in figure.legends[0].get_texts()]
    assert labels == ["σ₁", "σ₂", "σ₃", "σ₄", "counts as zero"]


def test_many_states_and_times_without_rank():
    found = observability(
        random_motion(8.0, 1), "acc, mag", unknown=("gyr_bias", "field"), times=np.linspace(0, 8, 50)
    )
    figure = plots.observability(found)
    figure.canvas.draw()
    assert len(lines(figure.axes[0])) == 9
    labels = [t.get_text() for t in figure.legends[0].get_texts()]
    assert labels == ["σ₁ to σ₃", "σ₄", "σ₅", "σ₆", "σ₇", "σ₈", "σ₉", "counts as zero"]
    at_times = plots.observability(observability(random_motion(8.0, 1), "acc", unknown="gyr_bias"))
    assert "heading; gyroscope bias about the vertical at times" in title(at_times)


def test_lines_break_where_nothing_is_defined():
    found = observability(pitch_sweep(4.0, yaw=0.2), state="euler", times=np.linspace(0.0, 4.0, 801))
    assert not found.defined.all()
    figure = plots.observability(found)
    figure.canvas.draw()
    for ax in figure.axes:
        assert np.isnan(lines(ax)[0].get_ydata()).any()
    assert "undefined" in [t.get_text() for t in figure.legends[0].get_texts()]


def test_no_rank_at_all_and_one_time():
    for times in ([1.0], [1.0, 2.0, 3.0]):
        found = observability(rest(4.0), "acc z", state="tangent", times=times)
        assert set(found.rank) == {0}
        figure = plots.observability(found)
        figure.canvas.draw()
        assert "rotation about all axes" in title(figure)


def test_mistakes():
    with pytest.raises(InputError, match="result of observability"):
        plots.observability("k06")
    motion = pitch_sweep(10.0, yaw=0.0)
    at = 10.0 * math.asin(0.75) / (2.0 * math.pi)
    with pytest.raises(InputError, match="defined at some time"):
        plots.observability(observability(motion, state="euler", times=[at]))
