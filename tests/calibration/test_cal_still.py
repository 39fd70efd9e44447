"""A sensor that was not turned is told so."""

from __future__ import annotations

import numpy as np
import pytest

from northdown import InputError, Recording
from northdown.calibration import calibrate_magnetometer


def test_a_still_magnetometer_is_refused_with_what_to_do():
    rng = np.random.default_rng(4)
    n = 3000
    mag = np.array([20.0, -5.0, 45.0]) + rng.normal(0.0, 0.5, (n, 3))
    with pytest.raises(InputError, match=r"turned into directions all around, got one that hardly turned"):
        calibrate_magnetometer(Recording(np.arange(n) / 100.0, mag=mag))
