"""K06's figures as drawn: a sample of each kind."""

from __future__ import annotations

import numpy as np
import pytest

from northdown.evaluation.kao2006 import published
from northdown.evaluation.kao2006.comparison import Comparison, Rows
from northdown.evaluation.kao2006.figures import FIGURES, panels, simulate_run
from northdown.plots import _kao2006, save

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def run():
    return simulate_run("sine", "indirect", 3)


@pytest.mark.parametrize("number", ["4.2", "4.5", "4.6", "4.9", "4.10", "4.14"])
def test_curves_are_the_panels(run, number):
    (described,) = [f for f in FIGURES if f.number == number]
    figure = _kao2006._draw(described, run)
    expected = panels(described, run)
    assert len(figure.axes) == len(expected)
    for ax, panel in zip(figure.axes, expected, strict=True):
        assert ax.get_ylabel() == panel.label
        assert len(ax.lines) == len(panel.curves)
        for line, values in zip(ax.lines, panel.curves.values(), strict=True):
            np.testing.assert_allclose(line.get_ydata(), values)
    assert figure.legends[0].get_title().get_text() == described.title


def test_comparison_draws_both_and_is_written(tmp_path):
    rows = {noise: 1.1 * np.array(row) for noise, row in published.GYRO_BASED.items()}
    free = {"direct": np.full(3, 0.2), "indirect, radius ×2": np.full(3, 0.1)}
    second = Rows(1.0, np.ones(3), rows, free, free)
    figure = _kao2006._draw_comparison(Comparison(10, second, second), "title")
    for k, ax in enumerate(figure.axes):
        ours, level, _, half_level, k06, k06_level = ax.lines
        np.testing.assert_allclose(np.divide(ours.get_ydata(), k06.get_ydata()), 1.1)
        assert [line.get_ydata()[0] for line in (level, half_level, k06_level)] == [0.2, 0.1, published.GYRO_FREE[k]]
    save(figure, tmp_path / "figure.png", dpi=50.0)
    assert (tmp_path / "figure.png").stat().st_size > 1000
