"""Alignment on real recordings whose reference has axes of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from northdown import datasets
from northdown.estimators.mahony import Mahony
from northdown.evaluation import Alignment, align, attitude_error
from northdown.orientation import Orientation
from northdown.recording import Recording


def load(root: Path, test: int) -> Recording:
    if not (root / "repoimu" / f"TStick_Test{test:02d}_Trial1.csv").is_file():
        pytest.skip(f"test {test} is not at hand")
    return datasets.repoimu(test, root=root)


def estimate_and_alignment(root: Path, test: int) -> tuple[Recording, Orientation, Alignment]:
    recording = load(root, test)
    estimate = Mahony().run(recording)
    return recording, estimate, align(estimate, recording, "rotations")


def test_one_mounting_is_found_from_different_motions(data_root: Path) -> None:
    """The markers stayed on the stick, so tests 03, 04 and 07 must find the same rotation of the body frame."""
    found = [estimate_and_alignment(data_root, test)[2] for test in (3, 4, 7)]
    right = Rotation.concatenate([a.right for a in found])
    spread = np.rad2deg((right.mean().inv() * right).magnitude())
    # degrees; sigmas are 0.7, 0.2 and 0.6
    assert spread.max() < 1.5
    assert all(a.sigma < np.deg2rad(1.0) for a in found)


def test_error_after_alignment(data_root: Path) -> None:
    recording, estimate, found = estimate_and_alignment(data_root, 3)
    error = attitude_error(estimate, recording)
    plain = attitude_error(estimate, recording, alignment="none")
    assert error.rmse().total == pytest.approx(found.residual, abs=1e-9)
    assert np.rad2deg(found.residual) < 2.5
    assert plain.rmse().total_deg > 50.0  # the reference's heading is its own


def test_motion_about_one_axis_is_reported(data_root: Path) -> None:
    """Test 02 turns the stick about its long axis: the alignment is 5° off that of the other tests, and says so."""
    recording, _, found = estimate_and_alignment(data_root, 2)
    assert len(recording) > 8000
    assert found.findings[0].kind == "alignment-weak"
    assert found.sigma > np.deg2rad(1.0)
