"""What the calibrating filter has learnt of its sensors: to be looked at, kept, and given to the next run."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray, as_float_array, check_no_infinity, check_number
from northdown.errors import InputError, expected
from northdown.estimators import _calibrating_files as files
from northdown.estimators._calibrating_acc_bias import acc_bias_sigma, begin_with_acc_bias
from northdown.estimators._calibrating_hard_iron import begin_with_iron, iron_sigma
from northdown.estimators._calibrating_layout import (
    ACC_BIAS,
    BIAS,
    COV,
    DELAY,
    GYR_BIAS,
    GYR_MATRIX,
    MAG_DELAY,
    MAG_IRON,
    MATRIX,
    OFFSET,
    REST_OFFSET,
    N,
)
from northdown.estimators._calibrating_result import DIAGONAL
from northdown.estimators._stream import Stream
from northdown.kernels.runner import N_RUNNER

_SHAPES = {"gyr_bias": (3,), "gyr_matrix": (3, 3), "rest_offset": (3,), "mag_iron": (3,), "acc_bias": (3,)}


@dataclass(frozen=True, eq=False)
class LearntCalibration:
    """Calibration of gyroscope, magnetometer (delay, hard iron) and accelerometer (bias), with standard deviations.

    Parameters
    ----------
    gyr_bias, gyr_bias_sigma : (3,) arrays
        Bias b in motion, rad/s: the rate is g − b − M g for the gyroscope's output g.
    gyr_matrix, gyr_matrix_sigma : (3, 3) arrays
        Scale and misalignment M.
    rest_offset, rest_offset_sigma : (3,) arrays
        What the bias at rest has more, rad/s.
    mag_delay, mag_delay_sigma : float
        Delay of the magnetometer behind the gyroscope, s.
    mag_iron, mag_iron_sigma : (3,) arrays
        Hard iron that is taken out of the magnetometer's samples, in their unit (µT). None is taken out of what a run
        begins with if it is zero; with a sigma of zero it stays as it is.
    acc_bias, acc_bias_sigma : (3,) arrays
        Bias that is taken out of the accelerometer's samples, m/s². The same holds for it.

    Raises
    ------
    InputError
        On wrong shapes, on numbers that are not finite, and on negative standard deviations.
    """

    gyr_bias: FloatArray
    gyr_bias_sigma: FloatArray
    gyr_matrix: FloatArray
    gyr_matrix_sigma: FloatArray
    rest_offset: FloatArray
    rest_offset_sigma: FloatArray
    mag_delay: float
    mag_delay_sigma: float
    mag_iron: FloatArray
    mag_iron_sigma: FloatArray
    acc_bias: FloatArray
    acc_bias_sigma: FloatArray

    def __post_init__(self) -> None:
        for name, shape in _SHAPES.items():
            for key in (name, f"{name}_sigma"):
                array = as_float_array(key, getattr(self, key))
                if array.shape != shape:
                    raise InputError(expected(f"{key} of shape {shape}", f"shape {array.shape}"))
                check_no_infinity(key, array.reshape(-1))
                if np.isnan(array).any() or (key.endswith("sigma") and (array < 0.0).any()):
                    raise InputError(expected(f"{key} of finite numbers, sigmas at least 0", f"{array.ravel()}"))
                object.__setattr__(self, key, array.copy())
        delay = check_number("mag_delay", self.mag_delay, low=-0.05, high=0.05, unit="s")
        object.__setattr__(self, "mag_delay", delay)
        sigma = check_number("mag_delay_sigma", self.mag_delay_sigma, low=0.0, unit="s")
        object.__setattr__(self, "mag_delay_sigma", sigma)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write to a file; an existing one is replaced at once, or not at all.

        Parameters
        ----------
        path : str or os.PathLike
            Name that ends in ``.toml`` or ``.json``.

        Raises
        ------
        InputError
            When the name has another ending, or the system refuses to write.
        """
        files.save(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> LearntCalibration:
        """Read what `save` has written, TOML or JSON by its content.

        Raises
        ------
        FormatError
            When the content is something else, damaged, or its numbers are not what they should be.
        InputError
            When the file is missing, empty, or larger than 64 KiB.
        """
        return files.load(path)


def learnt(stream: Stream) -> LearntCalibration:
    """Read from a running estimate."""
    s = stream._work.state[N_RUNNER:]
    sigma = np.sqrt(s[COV + np.arange(N) * DIAGONAL])
    return LearntCalibration(
        gyr_bias=s[GYR_BIAS : GYR_BIAS + 3],
        gyr_bias_sigma=sigma[BIAS : BIAS + 3],
        gyr_matrix=s[GYR_MATRIX : GYR_MATRIX + 9].reshape(3, 3).T,
        gyr_matrix_sigma=sigma[MATRIX : MATRIX + 9].reshape(3, 3).T,
        rest_offset=s[REST_OFFSET : REST_OFFSET + 3],
        rest_offset_sigma=sigma[OFFSET : OFFSET + 3],
        mag_delay=float(s[MAG_DELAY]),
        mag_delay_sigma=float(sigma[DELAY]),
        mag_iron=s[MAG_IRON : MAG_IRON + 3],
        mag_iron_sigma=iron_sigma(s),
        acc_bias=s[ACC_BIAS : ACC_BIAS + 3],
        acc_bias_sigma=acc_bias_sigma(s),
    )


def begin_with(stream: Stream, known: LearntCalibration) -> None:
    """Put a calibration into a new running estimate; correlations between its parts are not kept."""
    s = stream._work.state[N_RUNNER:]
    s[GYR_BIAS : GYR_BIAS + 3] = known.gyr_bias
    s[GYR_MATRIX : GYR_MATRIX + 9] = known.gyr_matrix.T.ravel()
    s[REST_OFFSET : REST_OFFSET + 3] = known.rest_offset
    s[MAG_DELAY] = known.mag_delay
    begin_with_iron(s, known.mag_iron, known.mag_iron_sigma)
    begin_with_acc_bias(s, known.acc_bias, known.acc_bias_sigma)
    variance = {
        BIAS: known.gyr_bias_sigma,
        MATRIX: known.gyr_matrix_sigma.T.ravel(),
        OFFSET: known.rest_offset_sigma,
        DELAY: np.array([known.mag_delay_sigma]),
    }
    for first, sigma in variance.items():
        s[COV + (first + np.arange(len(sigma))) * DIAGONAL] = sigma**2
