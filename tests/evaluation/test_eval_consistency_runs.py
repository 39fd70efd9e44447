"""The Kalman filters on data that are as their models suppose: their covariance must hold."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from northdown.arrays import ring
from northdown.errors import InputError
from northdown.estimators import get
from northdown.evaluation import Conditions, chi2_bounds, monte_carlo, nees

RUNS = 60
SHORT = Conditions(duration=4.0, rate=50.0)


@pytest.mark.parametrize("name", ["mekf", "quaternion-ekf"])
def test_covariance_holds(name):
    found = monte_carlo(get(name), RUNS, seed=2)
    assert found.interval[0] < 3.0 < found.interval[1], found
    assert found.consistent
    assert found.verdict.startswith("consistent")
    assert found.bounds == chi2_bounds(3, RUNS)
    # of the times 95 % should be inside; as neighbouring times agree, some 5 % more or less are chance
    assert found.inside > 0.88, found
    # independent times of a run are about 20, so that a share of 0.683 is known to 0.013: three of these
    assert np.abs(found.share[0] - 0.683).max() < 0.04
    assert np.abs(found.share[1] - 0.954).max() < 0.02
    assert found.share[2].min() > 0.99
    assert np.abs(found.rms_error / found.rms_sigma - 1.0).max() < 0.08
    low, high = chi2_bounds(1, RUNS, 0.998)
    assert (found.bias > low).all()
    assert (found.bias < high).all()
    # innovations of a right filter are independent, so that their mean is known to 0.2 %; the linearisation of the
    # start takes as much again
    assert found.anis == pytest.approx(1.0, abs=0.01)
    assert found.nis_bounds[0] < 1.0 < found.nis_bounds[1]
    inside = (found.mean_nis > found.nis_time_bounds[0]) & (found.mean_nis < found.nis_time_bounds[1])
    # 3000 independent times, so that 95 % is known to 0.4 %; the first has no measurement
    assert np.mean(inside[1:]) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("name", ["gyro-free-direct", "gyro-free-indirect", "gyro-free-mekf"])
def test_covariance_of_filters_without_gyroscope_holds(name):
    # at rest or turning slowly for the indirect one, which does not measure pitch near 90°
    conditions = Conditions(duration=8.0, rate=50.0, turn=0.15 if name == "gyro-free-indirect" else 0.6)
    found = monte_carlo(get(name), RUNS, seed=2, conditions=conditions)
    assert abs(found.factor - 1.0) < 0.03, found
    assert found.interval[0] < 3.05
    assert found.interval[1] > 2.95
    # 60 runs of some 15 independent times: as in `test_covariance_holds`
    assert np.abs(found.share[0] - 0.683).max() < 0.04
    assert np.abs(found.rms_error / found.rms_sigma - 1.0).max() < 0.08
    if name == "gyro-free-mekf":
        # one of six measurements, the redundant one, has the bias counted as as much noise again as its own
        assert 0.88 < found.anis < 0.96
    else:
        # 24 000 times of four to five measurements know it to 0.4 %
        assert found.anis == pytest.approx(1.0, abs=0.012)


def test_wrong_noise_of_an_array_is_found_out():
    sure = monte_carlo(get("gyro-free-direct"), 20, conditions=SHORT, parameters={"acc_noise": 0.0012})
    assert sure.factor > 1.3
    assert sure.anis > 2.0
    shy = monte_carlo(get("gyro-free-direct"), 20, conditions=SHORT, parameters={"acc_noise": 0.02})
    assert shy.factor < 0.8
    assert shy.anis < 0.6


def test_array_of_the_conditions_is_the_one_that_is_used():
    array = ring(8, 0.2)
    conditions = Conditions(duration=4.0, rate=50.0, array=array)
    recording, _ = conditions.draw(1, bias=False, array=True)
    assert recording.array is array
    assert conditions.configured(get("gyro-free-mekf")).array is array
    plain, _ = SHORT.draw(1, bias=False)
    beside, _ = SHORT.draw(1, bias=False, array=True)
    assert plain.array is None
    # 50 mm of K06's seven, beside sensors that do not change by it
    assert np.allclose(np.linalg.norm(beside.array.position, axis=1), 0.05)
    assert np.array_equal(beside.gyr, plain.gyr)
    assert np.array_equal(beside.mag, plain.mag)
    # four times the size, a quarter of the noise of angular acceleration: better rates, and so better angles
    small, large = (monte_carlo(get("gyro-free-direct"), 5, conditions=c) for c in (SHORT, conditions))
    assert (large.rms_sigma < small.rms_sigma).all()


def test_a_single_time_of_many_runs_is_chi_square():
    # the whole chain at one time, where runs are independent: no word of correlation is needed
    conditions = Conditions(duration=3.0, rate=50.0)
    filter_ = conditions.configured(get("mekf"))
    last = []
    for k in range(300):
        recording, start = conditions.draw(k, bias=True)
        last.append(nees(filter_.run(recording, initial=start), recording.reference).nees[-1])
    low, high = chi2_bounds(3, 300, 0.998)
    assert low < np.mean(last) < high


@pytest.mark.parametrize(
    ("name", "low", "high"),
    # as measured over 400 runs: 3.45 ± 0.07, 2.98 ± 0.06, 3.02 ± 0.06; the spread of 40 runs is three times that
    [("double-stage-ekf", 2.9, 4.0), ("euler-ukf", 2.6, 3.4), ("gyro-euler-ekf", 2.6, 3.4)],
)
def test_others_are_measured(name, low, high):
    found = monte_carlo(get(name), 40, seed=0)
    assert low < found.anees < high
    assert (found.bias is None) == (name != "double-stage-ekf")
    # 40 runs know it to 0.3 %
    assert found.anis == pytest.approx(1.0, abs=0.012)
    assert name in repr(found)


@pytest.mark.parametrize("name", ["mekf", "quaternion-ekf"])
def test_heading_that_nobody_measures_is_not_claimed(name):
    conditions = Conditions(duration=20.0, start_heading=0.2)
    filter_ = conditions.configured(get(name))
    last = []
    for k in range(40):
        recording, start = conditions.draw(k, bias=True)
        estimate = filter_.run(replace(recording, mag=None), initial=start)
        # no accelerometer or gyroscope tells the heading of the start, so its variance stays, up to rounding
        assert estimate.covariance[:, 2, 2].min() > 0.2**2 * (1.0 - 1e-4)
        last.append(nees(estimate, recording.reference).nees[-1])
    low, high = chi2_bounds(3, 40, 0.998)
    assert low < np.mean(last) < high


def test_wrong_noise_is_found_out():
    sure = monte_carlo(get("mekf"), 20, parameters={"acc_noise": 0.005, "gyr_noise": 5e-4})
    assert sure.interval[0] > 3.0
    assert sure.factor > 1.5
    assert sure.verdict.startswith("overconfident by a factor")
    shy = monte_carlo(get("mekf"), 20, parameters={"acc_noise": 0.08, "gyr_noise": 8e-3, "mag_noise": 0.8})
    # all densities four times as large, but not the start's and the bias's
    assert 0.2 < shy.factor < 0.6
    assert shy.verdict.startswith("too cautious by a factor")
    assert shy.inside < 0.2
    # the innovations show it without knowing the truth
    assert shy.anis < 0.2
    assert sure.anis > 2.0


def test_half_the_noise_makes_half_the_errors():
    # all densities and starts half as large on the same draws: errors are half as large, the NEES stays
    plain = Conditions(duration=4.0, rate=50.0, gyr_noise=4e-4, acc_noise=4e-3, mag_noise=0.04)
    half = Conditions(
        duration=4.0,
        rate=50.0,
        gyr_noise=2e-4,
        acc_noise=2e-3,
        mag_noise=0.02,
        gyr_bias_walk=5e-5,
        start_bias=0.005,
        start_tilt=0.01,
        start_heading=0.015,
    )
    a, b = (monte_carlo(get("mekf"), 5, conditions=c) for c in (plain, half))
    # to first order in the errors, of which the largest is the start's, 0.03 rad
    assert np.allclose(b.rms_error / a.rms_error, 0.5, rtol=0.03)
    assert np.allclose(b.rms_sigma / a.rms_sigma, 0.5, rtol=0.03)
    assert b.anees == pytest.approx(a.anees, rel=0.05)


def test_the_same_seed_gives_the_same_figures():
    calls = []
    first = monte_carlo(get("mekf"), 3, seed=5, conditions=SHORT, progress=calls.append)
    again = monte_carlo(get("mekf"), 3, seed=5, conditions=SHORT)
    other = monte_carlo(get("mekf"), 3, seed=6, conditions=SHORT)
    assert calls == [0, 1, 2]
    assert np.array_equal(first.mean_nees, again.mean_nees)
    assert not np.array_equal(first.mean_nees, other.mean_nees)


def test_figures_agree_with_runs_made_by_hand():
    found = monte_carlo(get("quaternion-ekf"), 4, seed=9, conditions=SHORT)
    filter_ = SHORT.configured(get("quaternion-ekf"))
    assert filter_.dip == SHORT.dip
    seeds = np.random.SeedSequence(9).generate_state(4, np.uint64)
    values, innovations = [], []
    for seed in seeds:
        recording, start = SHORT.draw(int(seed), bias=True)
        result = filter_.run(recording, initial=start)
        values.append(nees(result, recording.reference).nees)
        innovations.append(result.diagnostics["nis"].sum() / result.diagnostics["nis_dof"].sum())
    assert found.anis == pytest.approx(np.mean(innovations), rel=1e-12)
    assert np.allclose(found.mean_nees, np.mean(values, axis=0), rtol=1e-12)
    means = np.mean(values, axis=1)
    # 97.5 % point of Student's t with three degrees of freedom, from its table
    half = 3.182446 * means.std(ddof=1) / 2.0
    assert found.interval == pytest.approx((means.mean() - half, means.mean() + half), rel=1e-6)
    assert len(found.time) == 201


def test_filters_without_bias_get_data_without():
    recording, _ = SHORT.draw(1, bias=False)
    assert not recording.reference.gyr_bias.any() if recording.reference.gyr_bias is not None else True
    recording, _ = SHORT.draw(1, bias=True)
    assert recording.reference.gyr_bias.std(axis=0).min() > 0.0


def test_mistakes_are_one_line():
    for call in (
        lambda: monte_carlo(get("mahony")),
        lambda: monte_carlo("mekf"),
        lambda: monte_carlo(get("mekf")()),
        lambda: monte_carlo(get("mekf"), 1),
        lambda: monte_carlo(get("mekf"), 3, seed=-1),
        lambda: monte_carlo(get("mekf"), 3, confidence=1.0),
        lambda: monte_carlo(get("mekf"), 3, parameters={"kp": 1.0}),
        lambda: Conditions(acc_noise=0.0),
        lambda: Conditions(dip=2.0),
        lambda: Conditions(array=0.05),
        lambda: Conditions(array_noise=0.0),
        lambda: Conditions(rate=math.nan),
    ):
        with pytest.raises(InputError) as caught:
            call()
        assert str(caught.value).startswith("expected ")
        assert "\n" not in str(caught.value)
