r"""When a body stands still, as on a foot that carries the weight: zero-velocity detectors.

Over windows of W samples the statistic

.. math::

    T = \frac1W \sum_k \left( \frac{\lVert f_k - g\,\bar f / \lVert \bar f \rVert \rVert^2}{\sigma_a^2}
        + \frac{\lVert \omega_k \rVert^2}{\sigma_\omega^2} \right)

is compared with a threshold γ: the generalised likelihood ratio test of 'no motion' (SHOE), with the mean direction
of the specific force for that of gravity. The angular rate energy detector keeps the second term alone. A sample is
still when T < γ in the window around it.

Source: I. Skog, P. Händel, J.-O. Nilsson, J. Rantakokko, IEEE Trans. Biomed. Eng. 57(11), 2010,
doi:10.1109/TBME.2010.2060723.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from northdown._validation import BoolArray, FloatArray, check_number
from northdown.navigation.samples import Samples, dense
from northdown.recording import Recording

# No body is still at this size (m/s², rad/s); larger values would cost running sums their digits.
_BOUND: Final = 1e4


@dataclass(frozen=True, kw_only=True)
class Detector(abc.ABC):
    """Base of the zero-velocity detectors.

    Parameters
    ----------
    threshold : float
        γ. Raising it finds more stillness, and takes slow motion for it.
    window : float
        Length of the windows, s; three samples at least. Raising it misses short stances, and takes fewer moments of
        a swing for one.
    """

    threshold: float
    window: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = check_number(field.name, getattr(self, field.name), above=0.0)
            object.__setattr__(self, field.name, value)

    @abc.abstractmethod
    def _energy(self, samples: Samples, width: int) -> FloatArray:
        """T of each window of `width` samples, (N − width + 1,)."""

    def statistic(self, recording: Recording, *, max_gap: float = 0.1) -> FloatArray:
        """T of the window around each sample, (N,); at both ends that of the nearest whole window.

        Raises
        ------
        InputError
            Without gyroscope or accelerometer, or where one of them is silent for longer than `max_gap` (s).
        """
        return self.statistic_of(dense(recording, max_gap))

    def find(self, recording: Recording, *, max_gap: float = 0.1) -> BoolArray:
        """Samples, (N,) booleans, at which T < γ; errors as for `statistic`."""
        return self.find_in(dense(recording, max_gap))

    def statistic_of(self, samples: Samples) -> FloatArray:
        """As `statistic`, of samples without missing rows."""
        n = len(samples.time)
        step = float(samples.time[-1] - samples.time[0]) / (n - 1)
        width = min(n, max(3, round(self.window / step)) if step > 0.0 else 3)
        before = (width - 1) // 2
        padded: FloatArray = np.pad(self._energy(samples, width), (before, width - 1 - before), mode="edge")
        return padded

    def find_in(self, samples: Samples) -> BoolArray:
        """As `find`, in samples without missing rows."""
        still: BoolArray = self.statistic_of(samples) < self.threshold
        return still


@dataclass(frozen=True, kw_only=True)
class Shoe(Detector):
    """Generalised likelihood ratio test on accelerometer and gyroscope (SHOE).

    Parameters
    ----------
    acc_noise : float
        σ_a, m/s². Raising it listens less to the accelerometer. Only its ratio to `gyr_noise` counts, apart from the
        scale of T.
    gyr_noise : float
        σ_ω, rad/s. Raising it listens less to the gyroscope.
    gravity : float
        g, m/s². Raising it or lowering it away from what the accelerometer shows at rest adds a constant to T.
    threshold, window
        See `Detector`.

    Notes
    -----
    With the defaults σ_a √γ is 1 m/s² and σ_ω √γ is 10 °/s: a window is still when the mean squares of specific force
    about gravity and of the rate, relative to the squares of these, do not reach 1 together.
    """

    threshold: float = 1e4
    window: float = 0.1
    acc_noise: float = 0.01
    gyr_noise: float = float(np.deg2rad(0.1))
    gravity: float = 9.80665

    def _energy(self, samples: Samples, width: int) -> FloatArray:
        force = np.clip(samples.acc, -_BOUND, _BOUND)
        total = np.column_stack([_sums(force[:, i], width) for i in range(3)])
        # Σ ‖f − g u‖² = Σ ‖f‖² − 2 g ‖Σ f‖ + W g², with the squares taken around g² so that no digits are lost
        square = _sums((force**2).sum(axis=1) - self.gravity**2, width)
        spread = square - 2.0 * self.gravity * (np.sqrt((total**2).sum(axis=1)) - width * self.gravity)
        energy = np.maximum(spread, 0.0) / self.acc_noise**2 + _turning(samples, width) / self.gyr_noise**2
        mean: FloatArray = energy / width
        return mean


@dataclass(frozen=True, kw_only=True)
class AngularRateEnergy(Detector):
    """Angular rate energy detector: the gyroscope alone.

    Parameters
    ----------
    gyr_noise : float
        σ_ω, rad/s, the unit in which the threshold is stated. Raising it lowers T.
    threshold, window
        See `Detector`; with the defaults the root mean square of the rate stays below 10 °/s.
    """

    threshold: float = 1e4
    window: float = 0.1
    gyr_noise: float = float(np.deg2rad(0.1))

    def _energy(self, samples: Samples, width: int) -> FloatArray:
        mean: FloatArray = _turning(samples, width) / (width * self.gyr_noise**2)
        return mean


def _turning(samples: Samples, width: int) -> FloatArray:
    return np.maximum(_sums((np.clip(samples.gyr, -_BOUND, _BOUND) ** 2).sum(axis=1), width), 0.0)


def _sums(value: FloatArray, width: int) -> FloatArray:
    """Sums over all windows of `width` samples."""
    total = np.concatenate([[0.0], np.cumsum(value)])
    sums: FloatArray = total[width:] - total[:-width]
    return sums
