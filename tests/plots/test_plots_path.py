"""Figure of a path: what is drawn is where the body went."""

from __future__ import annotations

import numpy as np
import pytest

import northdown as nd
from northdown import plots
from northdown.errors import InputError
from northdown.navigation import Trajectory, navigate
from northdown.simulation import LOW_COST, measure, walk

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def found() -> Trajectory:
    return navigate(measure(walk(12.0), LOW_COST, 1, rate=100.0, frame="ENU"))


@pytest.mark.parametrize(("frame", "right", "up"), [("ENU", 0, 1), ("NED", 1, 0), ("NWU", 1, 0)])
def test_plan_is_a_map(found, frame, right, up):
    there = found.to_frame(frame)
    figure = plots.path(there)
    figure.canvas.draw()
    plan, height, speed = figure.axes
    line = plan.lines[0].get_xydata()
    assert np.array_equal(line, there.position[:, [right, up]])
    assert plan.get_aspect() == 1.0
    # east is on the right in every frame
    assert plan.xaxis_inverted() == (frame == "NWU")
    assert np.allclose(height.lines[0].get_ydata(), found.height)
    assert np.allclose(speed.lines[0].get_ydata(), np.linalg.norm(found.velocity, axis=1))
    marks = next(x for x in plan.lines if x.get_marker() == "o")
    stops = int((np.diff(np.concatenate([[False], there.still]).astype(int)) == 1).sum())
    assert len(marks.get_xdata()) == stops


def test_all_of_the_path_is_inside_and_several_fit(found):
    straight = Trajectory(found.orientation, found.position * [1.0, 0.0, 0.0] + [5.0, 0.0, 0.0], found.velocity)
    figure = plots.path([found, straight])
    figure.canvas.draw()
    plan = figure.axes[0]
    for t in (found, straight):
        for i, (low, high) in enumerate((plan.get_xlim(), plan.get_ylim())):
            assert low < t.position[:, i].min() <= t.position[:, i].max() < high
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert any(f"{found.distance(horizontal=True):.1f} m" in text for text in labels)


def test_one_place_can_be_drawn(found):
    still = Trajectory(found.orientation[:1], np.zeros((1, 3)), np.zeros((1, 3)))
    plots.path(still).canvas.draw()


def test_mistakes_are_told(found):
    with pytest.raises(InputError, match="trajectories in one frame, got ENU, NED"):
        plots.path([found, found.to_frame("NED")])
    with pytest.raises(InputError, match="trajectories to draw, got Orientation"):
        plots.path([found.orientation])  # type: ignore[list-item]
    with pytest.raises(InputError, match="with samples"):
        plots.path(found[:0])
    with pytest.raises(InputError, match="1 to 6 trajectories"):
        plots.path([])


def test_public_names():
    assert nd.navigate is navigate
    assert nd.Trajectory is Trajectory
    assert {"navigate", "Trajectory", "navigation"} <= set(nd.__all__)
