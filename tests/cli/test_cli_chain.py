"""From a sensor as delivered to a calibrated result: four commands, each with what the one before wrote."""

from __future__ import annotations

import json

import pytest


@pytest.mark.parametrize("estimator", ["mahony", "mekf"])
def test_calibration_makes_the_error_at_least_three_times_smaller(run, tmp_path, estimator):
    turning, walk, calibration = (str(tmp_path / name) for name in ("turning.csv", "walk.csv", "mag.toml"))
    sensor = ("--preset", "mpu-9250", "--seed", "3")  # the same seed is the same unit, with the same errors
    assert run("simulate", *sensor, "--motion", "tumbling", "--duration", "120", "-o", turning).code == 0
    assert run("simulate", *sensor, "--duration", "60", "-o", walk).code == 0
    assert run("calibrate", "mag", turning, "-o", calibration).code == 0
    errors = []
    for options in ((), ("--calibration", calibration)):
        found = json.loads(run("compare", walk, "-e", estimator, "--force", "--json", *options).out)
        errors.append(found["estimators"][0]["total_rms_deg"])
    assert errors[1] < errors[0] / 3.0
