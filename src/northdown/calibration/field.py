"""The local magnetic field as a calibrated sensor sees it: its size and its dip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from northdown._validation import BoolArray, FloatArray, check_increasing, check_number
from northdown.calibration._inputs import gather
from northdown.calibration._solve import Model, robust
from northdown.errors import InputError, expected
from northdown.frames import quat_from_ned
from northdown.recording import Recording

# Length (s) over which both sensors are averaged, and the fewest of these.
_WINDOW: Final = 0.2
_FEWEST: Final = 10
# When the accelerometer is taken to point up: its size differs from gravity by less than this share, and its samples
# scatter by less within a window. The size alone would let a horizontal acceleration of 0.2 g pass.
_SIZE: Final = 0.02
_SCATTER: Final = 0.03


@dataclass(frozen=True)
class LocalField:
    """Magnetic field at a place.

    Attributes
    ----------
    norm, norm_sigma : float
        Size and its 1-σ, in the unit of the recordings (µT, or arbitrary).
    dip, dip_sigma : float
        Angle below the horizontal (rad) and its 1-σ; positive on the northern hemisphere.
    norm_spread, dip_spread : float
        Standard deviation of size and dip over the recordings: what an estimator should take for their noise.
    samples : int
        Number of windows used.
    """

    norm: float
    dip: float
    norm_sigma: float
    dip_sigma: float
    norm_spread: float
    dip_spread: float
    samples: int

    def vector(self, frame: str = "NED") -> FloatArray:
        """Field (3,) in a navigation frame whose north is magnetic north."""
        from scipy.spatial.transform import Rotation

        ned = self.norm * np.array([math.cos(self.dip), 0.0, math.sin(self.dip)])
        turned: FloatArray = Rotation.from_quat(np.roll(quat_from_ned(frame), -1)).apply(ned)
        return turned


def local_field(recording: Recording | Sequence[Recording], *, gravity: float = 9.80665) -> LocalField:
    """Estimate size and dip of the local field from calibrated recordings.

    Parameters
    ----------
    recording : Recording or sequence of these
        With `acc` and `mag`, calibrated, in one place. No gyroscope is needed.
    gravity : float
        Local gravity, m/s².

    Returns
    -------
    LocalField
        From the windows of 0.2 s in which the sensor hardly moved. The σ take the
        spread over the recordings for few independent errors, as those of an uneven field are.

    Raises
    ------
    InputError
        When there are fewer than ten such windows.
    """
    up, mag = steady_pairs(gather(recording, ("acc", "mag")), gravity)
    if len(up) < _FEWEST:
        raise InputError(
            expected(
                f"at least {_FEWEST} moments of 0.2 s in which the sensor hardly moves",
                f"{len(up)}",
                do="move it slowly, and check the unit and the calibration of acc",
            )
        )
    size = np.linalg.norm(mag, axis=1)
    dip = -np.arcsin(np.clip((up * mag).sum(axis=1) / size, -1.0, 1.0))
    norm, norm_sigma, norm_spread = _centre(size)
    middle, dip_sigma, dip_spread = _centre(dip)
    return LocalField(norm, middle, norm_sigma, dip_sigma, norm_spread, dip_spread, len(up))


def _centre(values: FloatArray) -> tuple[float, float, float]:
    """Robust mean, its σ, and the spread of the values."""
    start = float(np.median(values))

    def prepare(_: FloatArray, __: float) -> Model:
        return lambda x: (values - x[0], -np.ones((len(values), 1)))

    solution = robust(prepare, np.array([start]), floor=1e-9 * max(1.0, abs(start)), all_persistent=True)
    return float(solution.x[0]), float(solution.sigma[0]), solution.scale


def steady_pairs(recordings: Sequence[Recording], gravity: float) -> tuple[FloatArray, FloatArray]:
    """Directions up (M, 3) and fields (M, 3), averaged over windows in which the accelerometer shows gravity only."""
    gravity = check_number("gravity", gravity, low=9.0, high=10.5, unit="m/s²")
    ups, fields = [], []
    for r in recordings:
        if r.acc is None or r.mag is None or not len(r):
            continue
        check_increasing(r.time)
        window = np.floor((r.time - r.time[0]) / _WINDOW).astype(np.int64)
        _, label = np.unique(window, return_inverse=True)
        acc, scatter = _window_means(r.acc, label)
        mag, _ = _window_means(r.mag, label)
        norm = np.linalg.norm(acc, axis=1)
        good: BoolArray = (np.abs(norm / gravity - 1.0) < _SIZE) & (scatter < _SCATTER * gravity)
        good = good & (np.linalg.norm(mag, axis=1) > 0.0)
        ups.append(acc[good] / norm[good, None])
        fields.append(mag[good])
    if not ups:
        return np.empty((0, 3)), np.empty((0, 3))
    return np.concatenate(ups), np.concatenate(fields)


def _window_means(samples: FloatArray, label: np.typing.NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """Mean (W, 3) and root mean square distance from it (W,) in each window; NaN where there is no sample."""
    there = ~np.isnan(samples).any(axis=1)
    number = int(label[-1]) + 1
    count = np.bincount(label[there], minlength=number).astype(np.float64)
    count[count == 0.0] = np.nan
    mean = np.column_stack([np.bincount(label[there], samples[there, i], number) for i in range(3)]) / count[:, None]
    square = ((samples[there] - mean[label[there]]) ** 2).sum(axis=1)
    return mean, np.sqrt(np.bincount(label[there], square, number) / count)
