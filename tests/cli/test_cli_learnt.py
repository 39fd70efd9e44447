"""``northdown estimate --learnt`` and ``--save-learnt``."""

from __future__ import annotations

import numpy as np
import pytest

import northdown as nd
from northdown.estimators import LearntCalibration


@pytest.mark.parametrize("offline", [False, True])
def test_what_is_learnt_is_written_and_used(run, csv, tmp_path, offline):
    more = ("--offline",) if offline else ()
    path, out = tmp_path / "k.toml", tmp_path / "o.csv"
    result = run("estimate", csv, *more, "--save-learnt", path)
    assert (result.code, result.err) == (0, "")
    assert "k.toml" in result.out
    read = nd.read(csv)
    known = LearntCalibration.load(path)
    assert np.array_equal(known.gyr_bias, nd.CalibratingEKF().learn(read, offline=offline)[1].gyr_bias)
    result = run("estimate", csv, *more, "--learnt", path, "-o", out)
    assert (result.code, result.err) == (0, "")
    method = nd.CalibratingEKF().smooth if offline else nd.CalibratingEKF().run
    expected = method(read, known=known).to_pandas()
    import pandas as pd

    found = pd.read_csv(out, comment="#")
    # the file holds text of so many digits
    np.testing.assert_allclose(found["qw"], expected["qw"], atol=1e-6)
    assert np.abs(method(read).quat[:, 1] - expected["qx"]).max() > 1e-6


@pytest.mark.parametrize("option", ["--learnt", "--save-learnt"])
def test_other_estimators_do_not_learn(run, csv, tmp_path, option):
    error = run("estimate", csv, "-e", "mekf", option, tmp_path / "k.toml").error
    assert "expected calibrating-ekf for --learnt and --save-learnt, got mekf; choose -e calibrating-ekf" in error


def test_mistakes_are_one_line(run, csv, tmp_path):
    path = tmp_path / "k.toml"
    assert "k.toml" in run("estimate", csv, "--learnt", path).error
    path.write_text("format = 3\n")
    assert "expected a learnt calibration" in run("estimate", csv, "--learnt", path).error
    assert "--save-learnt to end in .toml, .json" in run("estimate", csv, "--save-learnt", tmp_path / "k.csv").error
