"""K06's figures: all of them, and their curves are what they say."""

from __future__ import annotations

import numpy as np
import pytest

from northdown.errors import InputError
from northdown.evaluation.kao2006 import SIGMA, Row
from northdown.evaluation.kao2006.figures import COUNT, FIGURES, panels, simulate_run


@pytest.fixture(scope="module")
def runs():
    return {key: simulate_run(*key, 7) for key in {(f.motion, f.method) for f in FIGURES}}


def test_all_but_the_block_diagrams():
    numbers = [f.number for f in FIGURES]
    assert numbers == [f"4.{k}" for k in range(2, 59) if k != 15]
    # and 3.4 to 3.11, and 4.60
    assert len(numbers) + 8 + 1 == COUNT


# captions of K06 (its list of figures), in English
CAPTIONS = {
    "4.2": ("sine", "indirect", "in-plane accelerometers"),
    "4.5": ("sine", "indirect", "measurements"),
    "4.14": ("sine", "indirect", "Euler angle sigma"),
    "4.18": ("sine", "direct", "magnetometer"),
    "4.24": ("sine", "direct", "Euler angles"),
    "4.28": ("sine", "direct", "Euler angle sigma"),
    "4.29": ("pitch", "indirect", "quaternion"),
    "4.32": ("pitch", "direct", "Euler angles"),
    "4.33": ("rest", "indirect", "in-plane accelerometers"),
    "4.37": ("rest", "indirect", "rate"),
    "4.44": ("rest", "indirect", "quaternion sigma"),
    "4.46": ("rest", "direct", "in-plane accelerometers"),
    "4.53": ("rest", "direct", "quaternion error"),
    "4.56": ("rest", "direct", "rate sigma"),
}


@pytest.mark.parametrize("number", CAPTIONS)
def test_numbers_are_those_of_the_captions(number):
    (found,) = [f for f in FIGURES if f.number == number]
    assert found[1:] == CAPTIONS[number]


def test_every_figure_has_curves_of_finite_numbers(runs):
    for figure in FIGURES:
        run = runs[figure.motion, figure.method]
        drawn = panels(figure, run)
        assert len(drawn) in (2, 3, 4)
        for panel in drawn:
            assert panel.curves
            for name, values in panel.curves.items():
                assert values.shape == run.signals.time.shape
                lost = figure.motion == "pitch" and figure.method == "indirect" and name in ("EKF", "IKF")
                assert lost or np.isfinite(values).all()


def test_errors_are_estimates_less_truth(runs):
    run = runs["sine", "direct"]
    by_name = {f.shown: panels(f, run) for f in FIGURES if (f.motion, f.method) == ("sine", "direct")}
    for what, error in (
        ("rate", "rate error"),
        ("quaternion", "quaternion error"),
        ("Euler angles", "Euler angle error"),
    ):
        for estimate, difference in zip(by_name[what], by_name[error], strict=True):
            for name in ("EKF", "IKF"):
                expected = estimate.curves[name] - estimate.curves["truth"]
                np.testing.assert_allclose(difference.curves[name], expected, atol=1e-9)
    # measured angles scatter about the truth by what the sensors' noise makes of them, roll by 0.41°
    roll = by_name["Euler angles"][0].curves
    assert np.std(roll["measured"] - roll["truth"]) == pytest.approx(np.rad2deg(0.1 / np.sqrt(2.0) / 9.81), rel=0.1)


def test_last_sigma_is_the_tables(runs):
    (figure,) = [f for f in FIGURES if f.number == "4.58"]
    last = [p.curves["EKF"][-1] for p in panels(figure, runs["rest", "direct"])]
    # the bar of tables 4.2 to 4.13
    np.testing.assert_allclose(last, SIGMA[Row("rest", "direct", "EKF")][7:], rtol=0.3)


def test_plots_want_results():
    from northdown import plots

    with pytest.raises(InputError, match=r"results of kao2006\.reproduce"):
        next(plots.kao2006("nothing"))
