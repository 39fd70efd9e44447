r"""What an array's noise becomes when it stands in for a gyroscope, in closed form.

White noise of angular acceleration of density K (rad/s²/√Hz) is, integrated once, a random walk of the rate:

========================== ================== ===================
error after a time t       array              gyroscope, noise N
========================== ================== ===================
rate, mean over t          about K √t         N/√t
angle                      K √(t³/3)          N √t
========================== ================== ===================

With a measurement of the angle of noise density R (rad/√Hz) the Kalman filter of one axis settles at

.. math::  \sigma_\theta^2 = \sqrt 2\, K^{1/2} R^{3/2},\quad \sigma_\omega^2 = \sqrt 2\, K^{3/2} R^{1/2}
           \quad\text{(array)},\qquad  \sigma_\theta^2 = N R \quad\text{(gyroscope)}

so that the array is as good as a gyroscope of noise N = √(2 K R) (steady state of the Riccati equations of a double
and a single integrator; A. Gelb, Applied Optimal Estimation, 1974, section 4.6). All of it holds for products of
rates that are corrected with the true rate; errors of the rate times the rate itself come on top in fast motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray, check_number
from northdown.arrays.analysis import ArrayAnalysis
from northdown.errors import InputError, expected


@dataclass(frozen=True, eq=False)
class ErrorBudget:
    """Errors of rate and angle about x, y and z that an array's accelerometers cause.

    Parameters
    ----------
    analysis : ArrayAnalysis
        The array; its relative noise multiplies the two below.
    noise : float
        Noise N of an accelerometer, m/s²/√Hz: a sample at rate f has N √f. Data sheets give √2 N.
    bias : float
        Standard deviation of an accelerometer's constant bias, m/s².
    """

    analysis: ArrayAnalysis
    noise: float
    bias: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.analysis, ArrayAnalysis):
            raise InputError(expected("an ArrayAnalysis", type(self.analysis).__name__, do="give analyse(array)"))
        check_number("noise", self.noise, above=0.0, unit="m/s²/√Hz")
        check_number("bias", self.bias, low=0.0, unit="m/s²")

    @property
    def rate_random_walk(self) -> FloatArray:
        """K (3,): density of angular acceleration, rad/s²/√Hz, which is the random walk of the rate, rad/s/√s."""
        found: FloatArray = self.noise * self.analysis.angular_noise
        return found

    @property
    def force_density(self) -> FloatArray:
        """Density of specific force (3,), m/s²/√Hz."""
        found: FloatArray = self.noise * self.analysis.force_noise
        return found

    def rate_error(self, time: float) -> FloatArray:
        """Standard deviation of the rate (3,), rad/s, after integrating for a time (s), from noise and bias."""
        t = check_number("time", time, low=0.0, unit="s")
        found: FloatArray = np.hypot(self.rate_random_walk * np.sqrt(t), self.bias * self.analysis.angular_noise * t)
        return found

    def angle_error(self, time: float) -> FloatArray:
        """Standard deviation of the angle (3,), rad, after integrating twice for a time (s), from noise and bias."""
        t = check_number("time", time, low=0.0, unit="s")
        found: FloatArray = np.hypot(
            self.rate_random_walk * np.sqrt(t**3 / 3.0), self.bias * self.analysis.angular_noise * t * t / 2.0
        )
        return found

    def equal_gyro_noise(self, time: float) -> FloatArray:
        """Noise N (3,) of a gyroscope, rad/s/√Hz, whose angle is as wrong after a time (s): K t/√3; without bias."""
        found: FloatArray = self.rate_random_walk * check_number("time", time, above=0.0, unit="s") / np.sqrt(3.0)
        return found

    def equal_time(self, gyro_noise: float) -> FloatArray:
        """Time (3,), s, up to which the array's angle is better than that of a gyroscope of noise N: √3 N/K."""
        noise = check_number("gyro_noise", gyro_noise, above=0.0, unit="rad/s/√Hz")
        found: FloatArray = np.sqrt(3.0) * noise / self.rate_random_walk
        return found

    def aided_angle(self, angle_noise: float) -> FloatArray:
        """Standard deviation of the angle (3,), rad, when it is measured too, with R = `angle_noise` (rad/√Hz)."""
        r = check_number("angle_noise", angle_noise, above=0.0, unit="rad/√Hz")
        found: FloatArray = np.sqrt(np.sqrt(2.0) * self.rate_random_walk**0.5 * r**1.5)
        return found

    def aided_rate(self, angle_noise: float) -> FloatArray:
        """Standard deviation of the rate (3,), rad/s, when the angle is measured with R = `angle_noise` (rad/√Hz)."""
        r = check_number("angle_noise", angle_noise, above=0.0, unit="rad/√Hz")
        found: FloatArray = np.sqrt(np.sqrt(2.0) * self.rate_random_walk**1.5 * r**0.5)
        return found

    def equal_aided_gyro_noise(self, angle_noise: float) -> FloatArray:
        """Noise N (3,) of a gyroscope, rad/s/√Hz, that is as good with the same measured angle: √(2 K R)."""
        r = check_number("angle_noise", angle_noise, above=0.0, unit="rad/√Hz")
        found: FloatArray = np.sqrt(2.0 * self.rate_random_walk * r)
        return found

    def summary(self) -> str:
        """The budget in words, after 1, 10 and 60 s."""
        k = self.rate_random_walk
        lines = [f"Random walk of the rate: x {k[0]:.3g}, y {k[1]:.3g}, z {k[2]:.3g} rad/s/√s"]
        for t in (1.0, 10.0, 60.0):
            rate, angle = np.rad2deg(self.rate_error(t).max()), np.rad2deg(self.angle_error(t).max())
            equal = np.rad2deg(self.equal_gyro_noise(t).max())
            lines.append(
                f"After {t:g} s alone, worst axis: rate {rate:.3g} °/s, angle {angle:.3g}°; as a gyroscope of "
                f"{equal:.3g} °/s/√Hz (from noise)"
            )
        return "\n".join(lines)
