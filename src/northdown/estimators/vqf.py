r"""VQF: inclination from low-passed specific force in an almost-inertial frame, with bias and disturbed field.

The gyroscope alone is integrated to an attitude `free`, whose frame drifts so slowly that it is almost inertial.
Specific force, turned to that frame, has a constant part, gravity, and accelerations whose mean vanishes for a
body that stays near a place: a low-pass filter of some seconds separates them without the lag that it would have in
body axes. Three corrections, each of its own kind, follow:

- inclination: the shortest arc that brings the low-passed specific force to point up, exactly, at each sample;
- heading: the angle between horizontal field and north, with the gain k = 1 − exp(−Δt/τ_mag);
- bias: a Kalman filter that takes the inclination's correction, in motion, or the low-passed rate, at rest.

.. math::

    q_f^+ &= q_f \otimes \exp\bigl((\omega - b)\,\Delta t\bigr) \\
    f_f &= \mathrm{LP}_{\tau_\text{acc}}\bigl(q_f \otimes f_b \otimes q_f^*\bigr), \qquad
    u = q_l \otimes \frac{f_f}{\lVert f_f \rVert} \otimes q_l^* \\
    q_l^+ &= \mathrm{arc}(u \to \text{up}) \otimes q_l \\
    \psi^+ &= \psi - k\, \mathrm{atan2}(h_\text{east}, h_\text{north}), \qquad h = q \otimes m_b \otimes q^*, \qquad
    q = q_\psi \otimes q_l \otimes q_f

At rest (rate and specific force close to their low-passed values for `rest_min_time`) the rate is the bias. A field
whose norm or dip departs from the reference is disturbed: heading then runs on the gyroscope, for
`mag_max_rejection_time` at most, and a field that stays the same for `mag_new_time`, while the body turns, becomes
the new reference.

============= ============= ===========================================================
symbol        name          meaning
============= ============= ===========================================================
q_f, q_l, q_ψ free, level,  strapdown integration, and what corrects its inclination
              turn          and its heading
b             bias          gyroscope bias, rad/s
f_b, m_b      acc, mag      specific force and field in body axes
LP            kernels/      second-order Butterworth low-pass with the time constant τ
              butterworth.py
============= ============= ===========================================================

Source: D. Laidig, T. Seel, Information Fusion 91, 2023, 187–204, doi:10.1016/j.inffus.2022.10.014, section 3.

Deviations: the paper has a constant step for each sensor; here it is the time since that sensor's last sample, and
coefficients are derived anew when it changes by more than 1e-6 of itself. The paper starts with the body's axes for
those of the frame: the first correction, as large as the tilt, then moves the bias by some 1e-5 rad/s, and the axes
in which innovations are clipped hang on how the sensor is mounted. Here the start is the attitude of the first
sample. On ordinary recordings that makes thousandths of a degree; where the gyroscope saturates, tenths. Time at rest
is counted by the gyroscope's samples, also while the accelerometer has none. A field within 0.06 degrees of the
vertical is no sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from northdown._validation import FloatArray
from northdown.estimators import _vqf_smooth
from northdown.estimators import _vqf_step as vqf
from northdown.estimators._stream import all_samples, outputs
from northdown.estimators._vqf_layout import N_PARAMS, N_STATE, steady_state
from northdown.estimators.base import Estimator, parameter
from northdown.frames import Frame
from northdown.kernels.butterworth import SAME_STEP
from northdown.kernels.runner import Kernel
from northdown.orientation import Flag, Orientation
from northdown.recording import Recording

# A mean over τ is full when its samples' steps add up to it but for rounding.
_FULL = 1.0 - 1e-9
# Standard deviation (rad/s) that a bias, known exactly at first, reaches after `bias_forgetting_time`.
_FORGOTTEN = math.radians(0.1)


@dataclass(frozen=True, kw_only=True)
class VQF(Estimator):
    """VQF, in real time by `run` and `stream`, and by `smooth` with the whole recording at hand.

    Parameters
    ----------
    tau_acc : float
        Time constant (s) of the low-pass of specific force. Raising it trusts the gyroscope more for inclination:
        for fast motion with strong accelerations.
    tau_mag : float
        Time constant (s) of the correction of heading. Raising it trusts the gyroscope more for heading: for a
        field that is often disturbed.
    motion_bias : bool
        Estimate the bias in motion.
    rest_bias : bool
        Estimate the bias at rest.
    mag_rejection : bool
        Detect a disturbed field and leave it out.
    bias_sigma_init : float
        Standard deviation of the bias at the start, rad/s. Raising it learns the bias faster at first.
    bias_forgetting_time : float
        Time (s) in which the bias becomes uncertain by 0.1 °/s. Raising it makes the bias more constant, and slower
        to follow a change of temperature.
    bias_clip : float
        Largest bias of one axis, rad/s. Raising it accepts worse gyroscopes, and slow turning as rest.
    bias_sigma_motion : float
        Standard deviation of the bias in the steady state in motion, rad/s. Raising it lets motion change the bias
        less.
    bias_vertical_forgetting : float
        Weight of the measurement that the bias about the vertical is zero, relative to that of the others. Raising it
        pulls that bias faster to zero in motion.
    bias_sigma_rest : float
        Standard deviation of the bias in the steady state at rest, rad/s. Raising it lets rest change the bias less.
    rest_min_time : float
        Time (s) for which rate and specific force must have been steady for the body to be at rest. Raising it
        mistakes slow motion for rest less often, and misses short rests.
    rest_filter_tau : float
        Time constant (s) of the low-pass filters for the detection of rest. Raising it finds slower motion, and is
        later to find rest.
    rest_gyr_threshold : float
        Departure of the rate from its low-passed value that ends rest, rad/s. Raising it finds rest more often, and
        slow motion with it.
    rest_acc_threshold : float
        The same for specific force, m/s².
        Raising it finds rest more often.
    mag_current_tau : float
        Time constant (s) of the low-pass of the field's norm and dip. Raising it is later to see a disturbance, and
        less nervous.
    mag_ref_tau : float
        Time constant (s) with which the reference follows the undisturbed field. Raising it keeps the reference
        longer.
    mag_norm_threshold : float
        Departure of the norm that is a disturbance, as a fraction of the reference. Raising it accepts more.
    mag_dip_threshold : float
        Departure of the dip that is a disturbance, rad. Raising it accepts more.
    mag_new_time : float
        Time (s) of turning after which a field that stays the same becomes the reference. Raising it believes a new
        place later.
    mag_new_first_time : float
        The same for the first reference. Raising it takes longer to trust the first field.
    mag_new_min_rate : float
        Rate above which the body counts as turning, rad/s. Raising it demands livelier motion for a new reference.
    mag_min_undisturbed_time : float
        Time (s) for which the field must be close to the reference to be used again. Raising it leaves out
        more around a disturbance.
    mag_max_rejection_time : float
        Time (s) of disturbance after which the field is used after all, at a lower gain. Raising it trusts the
        gyroscope's heading for longer.
    mag_rejection_factor : float
        By how much that gain is lower, and how much faster than it grew the time of rejection is paid back by an
        undisturbed field. Raising it follows a disturbed field more slowly.

    Notes
    -----
    The defaults are the paper's. `Flag.MAG_REJECTED` marks samples of a field found disturbed, or of one not yet
    known, that is, before the first reference; they are used nonetheless in the first seconds, and after
    `mag_max_rejection_time`. `gyr_bias_sigma` are the roots of the covariance's diagonal. Diagnostics:
    ``rest`` (1 at rest, which is found also when `rest_bias` is off) and ``bias_sigma``, the upper bound (rad/s) of
    the bias' sigma in all directions that the paper's authors give. There is no covariance of the attitude.

    A start given by `initial` is trusted: heading then changes with the usual gains only. After a start from the
    sensors the first samples weigh more, so that inclination and heading are means of what has been measured.

    References
    ----------
    D. Laidig, T. Seel, Information Fusion 91, 2023, 187–204, doi:10.1016/j.inffus.2022.10.014.
    """

    name = "vqf"
    smooths = True
    kernel = Kernel(
        "vqf",
        vqf.step,
        n_params=N_PARAMS,
        n_state=N_STATE,
        n_out=15,
        output=vqf.output,
        aligned=vqf.aligned,
        flagged=vqf.flagged,
        memoryless=True,
    )
    outputs = {  # noqa: RUF012  (a constant of the class)
        "gyr_bias": slice(4, 7),
        "gyr_bias_sigma": slice(7, 10),
        "rest": slice(10, 11),
        "bias_sigma": slice(11, 12),
    }

    tau_acc: float = parameter(3.0, unit="s", above=0.0)
    tau_mag: float = parameter(9.0, unit="s", above=0.0)
    motion_bias: bool = True
    rest_bias: bool = True
    mag_rejection: bool = True
    bias_sigma_init: float = parameter(math.radians(0.5), unit="rad/s", above=0.0)
    bias_forgetting_time: float = parameter(100.0, unit="s", above=0.0)
    bias_clip: float = parameter(math.radians(2.0), unit="rad/s", above=0.0)
    bias_sigma_motion: float = parameter(math.radians(0.1), unit="rad/s", above=0.0)
    bias_vertical_forgetting: float = parameter(1e-4, above=0.0)
    bias_sigma_rest: float = parameter(math.radians(0.03), unit="rad/s", above=0.0)
    rest_min_time: float = parameter(1.5, unit="s", low=0.0)
    rest_filter_tau: float = parameter(0.5, unit="s", above=0.0)
    rest_gyr_threshold: float = parameter(math.radians(2.0), unit="rad/s", low=0.0)
    rest_acc_threshold: float = parameter(0.5, unit="m/s²", low=0.0)
    mag_current_tau: float = parameter(0.05, unit="s", above=0.0)
    mag_ref_tau: float = parameter(20.0, unit="s", above=0.0)
    mag_norm_threshold: float = parameter(0.1, low=0.0)
    mag_dip_threshold: float = parameter(math.radians(10.0), unit="rad", low=0.0)
    mag_new_time: float = parameter(20.0, unit="s", low=0.0)
    mag_new_first_time: float = parameter(5.0, unit="s", low=0.0)
    mag_new_min_rate: float = parameter(math.radians(20.0), unit="rad/s", low=0.0)
    mag_min_undisturbed_time: float = parameter(0.5, unit="s", low=0.0)
    mag_max_rejection_time: float = parameter(60.0, unit="s", low=0.0)
    mag_rejection_factor: float = parameter(2.0, low=1.0)

    def _parameters(self, frame: Frame) -> Sequence[float]:
        half_root = math.sqrt(0.5)
        return (
            half_root / self.tau_acc,
            _FULL * self.tau_acc,
            half_root / self.rest_filter_tau,
            _FULL * self.rest_filter_tau,
            half_root / self.mag_current_tau,
            _FULL * self.mag_current_tau,
            self.tau_mag,
            self.mag_ref_tau,
            self.motion_bias,
            self.rest_bias,
            self.mag_rejection,
            self.bias_sigma_init**2,
            _FORGOTTEN**2 / self.bias_forgetting_time,
            self.bias_clip,
            self.bias_sigma_motion**2,
            1.0 / self.bias_vertical_forgetting,
            self.bias_sigma_rest**2,
            self.rest_min_time,
            self.rest_gyr_threshold**2,
            self.rest_acc_threshold**2,
            self.mag_norm_threshold,
            self.mag_dip_threshold,
            self.mag_new_time,
            self.mag_new_first_time,
            self.mag_new_min_rate**2,
            self.mag_min_undisturbed_time,
            self.mag_max_rejection_time,
            self.mag_rejection_factor,
        )

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        """As after a long rest in this attitude; `aligned` lets the filters begin anew where it is not known."""
        # before the first reference the field is used as after a long disturbance
        state = steady_state(quat, self.bias_sigma_init**2, self.mag_max_rejection_time)
        start: list[float] = state[4:].tolist()
        return start

    def smooth(self, recording: Recording, *, frame: str | None = None) -> Orientation:
        """VQF's offline variant: bias, acceleration and heading from past and future, see `Estimator.smooth`.

        Notes
        -----
        Inclination and heading come from smoothed signals, with no start that would have to be found: only where
        there is no accelerometer or magnetometer sample at all is `Flag.TILT_UNKNOWN` or `Flag.HEADING_UNKNOWN` set.
        """
        stream = self.stream(frame=frame or recording.frame)
        ahead, flags = stream._record(recording)
        if not len(recording):
            return stream.run(recording)
        time, sensors = recording.time, all_samples(self, recording)[:3]
        gyr, acc, mag = (np.ascontiguousarray(x[::-1]) for x in sensors)
        # gaps of the gyroscope that are too long have been found by the first run
        backward = self.stream(max_gap=float(np.finfo(float).max))
        back_time = _reversed(time)
        back, back_flags = backward._record(Recording(back_time, -gyr, acc, mag))
        disturbed = flags & back_flags[::-1] & np.uint8(Flag.MAG_REJECTED)
        out = np.empty((len(recording), 12))
        work = stream._work
        levelled, headed = _vqf_smooth.kernel()(
            work.params,
            work.turn,
            time,
            back_time,
            *sensors,
            ahead,
            back,
            disturbed.astype(np.bool_).view(np.uint8),
            out,
        )
        flags &= np.uint8(Flag.GYRO_HELD | Flag.LONG_STEP)
        flags |= disturbed
        flags |= np.uint8((0 if levelled else Flag.TILT_UNKNOWN) | (0 if headed else Flag.HEADING_UNKNOWN))
        return Orientation._trusted(
            time=time, quat=out[:, :4], frame=stream.frame, flags=flags, name=self.name, **outputs(self.outputs, out)
        )


def _reversed(time: FloatArray) -> FloatArray:
    """Times (s) of the rows from the last to the first; for equal steps the times themselves, with their rounding."""
    steps = np.diff(time)
    if len(steps) and np.ptp(steps) <= SAME_STEP * steps.min():
        return time
    return np.ascontiguousarray(-time[::-1])
