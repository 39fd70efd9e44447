r"""Error-state Kalman filter that calibrates its own sensors while it runs, and its smoother.

What limits the accuracy of an orientation from good inertial sensors is not their noise but what is constant and
unknown: scale and misalignment of the gyroscope, the delay of the magnetometer behind it, the field's own
disturbances. This filter has the first two as states and weighs the third.

State and its error (22)
------------------------
The nominal state is the attitude R̂ (body to navigation, NED), gyroscope bias b, velocity v, gyroscope matrix M, rest
offset e and magnetometer delay τ. The error of the attitude is a rotation vector θ in navigation axes:

.. math::

    R = \exp(\theta)\, \hat R, \qquad v = R_z(\theta_z) (\hat v + \delta v), \qquad
    x = (\theta, \delta b, \delta v, \delta M, \delta e, \delta \tau)

The velocity's error is one in axes that turn with the error of heading. Velocity near zero, alike in all horizontal
directions, says nothing about heading, and so it must not in the linear model either.

With the gyroscope's output g, the rate is ω = g − b − M g in motion and ω = g − b − e at rest: many gyroscopes
have another bias while nothing shakes them. With specific force a and gravity γ (down), and ϑ = (θ_x, θ_y, 0):

.. math::

    \dot\theta = -\hat R\, \delta b - \hat R\, \delta M\, g - \hat R w_g, \qquad
    \dot v = R a + \gamma \;\Rightarrow\; \dot{\delta v} = -[\hat R a]_\times \vartheta + w_a

Attitude and velocity are integrated at every sample. The covariance is propagated once per epoch (`epoch`), over
which only sums are needed, as in navigation axes all errors stay put:

.. math::

    \theta' = \theta - \Bigl(\sum \hat R\, \Delta t\Bigr) \delta b
              - \sum_k \Bigl(\sum \hat R\, g_k\, \Delta t\Bigr) \delta M_{\cdot k}, \qquad
    \delta v' = \delta v - \Bigl[\sum \hat R a\, \Delta t\Bigr]_\times \vartheta

(at rest e takes the part of M). Process noise, as spectral densities: θ `gyr_noise`² + `gyr_scale`² ‖ω‖²; b
`gyr_bias_walk`²; v `acc_noise`² (1 + `acc_motion` ‖Ra + γ‖²). M, e and τ take in their prior's variance once in
`calibration_time`, as sensors warm up and age.

Measurements, at the end of each epoch of length T
--------------------------------------------------
All are scalar and taken one after the other, P ← P − (P Hᵀ)(P Hᵀ)ᵀ/S.

*Velocity.* A body that does not travel has velocity zero, on average: 0 = v̂ + δv with variance
`speed_noise`² (1 + `speed_motion` A) / T, A being the mean of ‖Ra + γ‖² over the last `motion_window`. This, through
the cross-covariance of δv and θ, is what levels the attitude, and accelerations that come and go cost nothing.

*Heading.* With the field m averaged over the epoch in navigation axes, by the attitude of τ earlier,
h = mean of R̂ exp(−φ) m, where φ is the turn during the last τ:

.. math::

    0 = \operatorname{atan2}(h_y, h_x) + \Bigl(-\frac{h_x h_z}{h_h^2},\; -\frac{h_y h_z}{h_h^2},\; 1\Bigr) \theta
        + \frac{h_x \dot h_y - h_y \dot h_x}{h_h^2}\, \delta\tau, \qquad
    \dot h = \operatorname{mean}\, \hat R \exp(-\varphi)\, (m \times \omega)

so that the delay is seen in the residual heading as often as the body turns about the vertical to and fro. Variance:
`mag_noise`² / T · (1 + u)^`gate_power`, with the departure u = (Δnorm / `norm_gate`)² + (Δdip / `dip_gate`)² of the
field from its reference, the mean over the past `field_window` weighted by 1/(1 + u); the first second is not judged.
For the variance, the mean of u over the past `gate_window` counts where it is more than u: a disturbed field has norm
and dip of the reference now and then, while its heading is still wrong.
A field that is all but rejected (u > 4.6) and steady for `field_new` of motion becomes the reference.

*Rest.* Where both sensors hardly scatter for `rest_window` (before the sample in real time, around it in `smooth`)
and the mean rate is within `rest_rate` of the bias known, and the epoch's own mean within four sigmas, the mean rate
is b + e with variance `rest_noise`²/T, or what the scatter shows if that is more, and the velocity is zero; but not
where the velocity contradicts that. Where the
mean rate is within `rest_rate` of zero instead, it is b that is wrong, and its covariance is widened by the square of
what it misses by.

Acceleration that lasts
-----------------------
Where the velocity's innovation and the norm of specific force show that the body travels, the filter coasts on its
gyroscope; see `_calibrating_acceleration`. Such samples are flagged `ACC_REJECTED`. Where force shows a tilt that its
norm does not, the attitude is wrong instead, and its covariance is widened by that tilt.

Hard iron
---------
Where iron on the body explains more than `iron_share` of the variation of the field, it is taken out of the
magnetometer's samples; see `_calibrating_hard_iron`. Smaller iron widens the covariance (below).

Bias of the accelerometer
-------------------------
Where a bias of the accelerometer explains more than `acc_share` of the variation of specific force's norm, it is
taken out of the samples; see `_calibrating_acc_bias`.

Clipping
--------
Where the gyroscope is at the end of its range (`gyr_range`, or found from the data for each side of each axis), what
it seems to lack is put back, and its uncertainty counts about that axis; see `_calibrating_clip`. `run` and `smooth`
find the range from the whole recording; a live stream finds it at the first plateau of a repeated value that was
entered with a corner. `run(recording)` is ``for_recording(recording).stream().run(recording)``. Such samples are
flagged `GYRO_CLIPPED`.

Covariance
----------
The filter's own P would hold if all errors were white and all of the model. What is reported is

.. math::

    \kappa^2 P_{\theta\theta} + \operatorname{diag}(\sigma_t^2, \sigma_t^2,
    \sigma_h^2 (\max(d, 0.04) + (\psi / 0.01)^2)) + \sigma_\tau^2\, (\hat R\omega)(\hat R\omega)^T

κ (`inflation`) for errors that are correlated over time; σ_t (`tilt_sigma`) for the accelerometer's bias, and what a
bias that has been found may still be wrong by; σ_h
(`heading_sigma`) for iron on the body, which turns heading by ψ (rad) on average as far as the field shows it, with a
part d of its variance still open (see `_calibrating_iron`); σ_τ (`time_sigma`) for the delay of the gyroscope and of
its clock, which none of the sensors can see. These constants bear on nothing else. For data of which the model is
true, set κ = 1 and the three sigmas to 0.

Smoother
--------
`smooth` runs the same filter forth and the Modified Bryson–Frazier recursion back (see `_calibrating_back`), then
both once more over the epochs, and spreads the corrections evenly between epochs. The second pass weighs headings by
the field as the smoothed attitude shows it, by what follows as well as by what was before, and by what they miss the
smoothed trajectory by (see `_calibrating_weights`). The bias has `smooth_walk` of its random walk there. Velocity is
not taken in the five seconds before and after an acceleration that lasts.

Sources: error in navigation axes: J. Solà, arXiv:1711.02508 (2017), section 7; velocity held near zero for tilt: the
principle of the low-pass in an almost inertial frame of D. Laidig, T. Seel, Information Fusion 91 (2023),
doi:10.1016/j.inffus.2022.10.014, here as a measurement; smoother: G. J. Bierman, Int. J. Control 18(1) (1973),
doi:10.1080/00207177308932487. The states for matrix, delay and rest, and the weights, are this project's.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from northdown._validation import FloatArray
from northdown.checks.sensors import gyr_levels
from northdown.errors import InputError, expected
from northdown.estimators._calibrating_clip import alert, restored
from northdown.estimators._calibrating_layout import (
    ACC_VARIANCE,
    ALERT,
    ATTITUDE,
    BIAS,
    COV,
    DELAY,
    GIVEN,
    IRON_VARIANCE,
    LEVELS,
    MAG_DELAY,
    MATRIX,
    N_STATE,
    OFFSET,
    QUANTUM,
    VELOCITY,
    N,
    Terms,
)
from northdown.estimators._calibrating_learnt import LearntCalibration, begin_with, learnt
from northdown.estimators._calibrating_parameters import CalibrationParameters
from northdown.estimators._calibrating_result import DIAGONAL, START_SPEED, aligned, flagged, output
from northdown.estimators._calibrating_step import step
from northdown.estimators._stream import Stream, outputs
from northdown.frames import Frame
from northdown.kernels.holes import LONGEST_HOLE
from northdown.kernels.runner import MAX_GAP, N_RUNNER, Kernel
from northdown.orientation import Flag, Orientation
from northdown.recording import Recording

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True, kw_only=True)
class CalibratingEKF(CalibrationParameters):
    """Extended Kalman filter that finds its sensors' calibration as it goes: the most accurate estimator here.

    Notes
    -----
    `Orientation.diagnostics` has `field_departure` (u, or its mean, as the last heading was weighed; above 4.6 the
    sample is flagged `MAG_REJECTED`), `mag_delay` (τ, s), `still` (1 at rest), `acceleration`, the root of the
    mean square of linear acceleration over `motion_window`, m/s², `mag_iron`, the norm of the hard iron that has been
    found and is taken out, in the magnetometer's unit, and `acc_bias`, that of the accelerometer's bias, m/s². From
    `smooth` they are those of its first pass.
    """

    _levels: ClassVar[tuple[float, ...]] = (math.inf,) * 6

    name = "calibrating-ekf"
    smooths = True
    kernel = Kernel(
        "calibrating-ekf",
        step,
        n_params=len(Terms._fields),
        n_state=N_STATE,
        n_out=25,
        output=output,
        aligned=aligned,
        flagged=flagged,
        covariance=7,
        in_place=True,
    )
    outputs = {  # noqa: RUF012  (a constant of the class)
        "gyr_bias": slice(4, 7),
        "covariance": slice(7, 16),
        "gyr_bias_sigma": slice(16, 19),
        "field_departure": slice(19, 20),
        "mag_delay": slice(20, 21),
        "still": slice(21, 22),
        "acceleration": slice(22, 23),
        "mag_iron": slice(23, 24),
        "acc_bias": slice(24, 25),
    }

    def _parameters(self, frame: Frame) -> Sequence[float]:
        return self._terms()

    def _initial_state(self, quat: FloatArray, frame: Frame) -> Sequence[float]:
        p = self._terms()
        s = np.zeros(N_STATE)
        s[MAG_DELAY] = p.start_delay
        s[GIVEN] = -1.0
        sigma2 = np.zeros(N)
        sigma2[ATTITUDE : ATTITUDE + 3] = p.start_tilt, p.start_tilt, p.start_heading
        sigma2[BIAS : BIAS + 3] = p.start_bias
        sigma2[VELOCITY : VELOCITY + 3] = START_SPEED**2
        sigma2[MATRIX : MATRIX + 9] = p.matrix
        sigma2[OFFSET : OFFSET + 3] = p.offset
        sigma2[DELAY] = p.delay
        s[COV + np.arange(N) * DIAGONAL] = sigma2
        s[LEVELS : LEVELS + 6] = self._levels if self.gyr_range == 0.0 else self.gyr_range
        s[QUANTUM] = math.nan
        s[IRON_VARIANCE] = s[ACC_VARIANCE] = math.inf
        s[ALERT] = alert(s)
        return tuple(s[4:])

    def for_recording(self, recording: Recording) -> CalibratingEKF:
        """Copy that knows where the gyroscope of a recording clips, if `gyr_range` is not given."""
        if self.gyr_range > 0.0 or recording.gyr is None:
            return self
        levels = gyr_levels(recording.time, recording.gyr)
        if not np.isfinite(levels).any():
            return self
        this = dataclasses.replace(self)
        object.__setattr__(this, "_levels", tuple(levels.ravel().tolist()))
        return this

    def run(
        self,
        recording: Recording,
        *,
        frame: str | None = None,
        initial: Rotation | None = None,
        max_gap: float = 0.1,
        known: LearntCalibration | None = None,
    ) -> Orientation:
        """Estimate the orientation over a recording.

        Parameters
        ----------
        recording, frame, initial, max_gap
            As for `Estimator.run`.
        known : LearntCalibration, optional
            What was learnt of these sensors before; see `warm_stream`.

        Returns
        -------
        Orientation
            As from `Estimator.run`.

        Raises
        ------
        InputError
            As for `Estimator.run`.
        """
        return self._begun(recording, frame, known, initial, max_gap).run(recording)

    def smooth(
        self, recording: Recording, *, frame: str | None = None, known: LearntCalibration | None = None
    ) -> Orientation:
        """Estimate the orientation over a recording, each sample with the knowledge of all others.

        Parameters
        ----------
        recording : Recording
            As for `run`.
        frame : {"NED", "ENU", "NWU"}, optional
            Navigation frame of the result; the recording's own when not given.
        known : LearntCalibration, optional
            What was learnt of these sensors before; see `warm_stream`.

        Returns
        -------
        Orientation
            As from `run`; samples before the first of accelerometer and magnetometer have tilt and heading too.

        Raises
        ------
        InputError
            As for `run`.
        """
        return self._smoothed(self._begun(recording, frame, known), recording)[0]

    def learn(
        self,
        recording: Recording,
        *,
        frame: str | None = None,
        known: LearntCalibration | None = None,
        offline: bool = False,
        max_gap: float = 0.1,
    ) -> tuple[Orientation, LearntCalibration]:
        """Estimate the orientation over a recording, and give what has been learnt of the sensors by its end.

        Parameters
        ----------
        recording, frame, known, max_gap
            As for `run`; `max_gap` has no effect offline.
        offline : bool
            Smooth instead of running.

        Returns
        -------
        tuple of Orientation and LearntCalibration
            The estimate of `run` or `smooth`. What was learnt is the same for both but for rest, which a smoother
            sees better: at the end of a recording, past and future are all past.

        Raises
        ------
        InputError
            As for `run`.
        """
        stream = self._begun(recording, frame, known, max_gap=max_gap)
        if not offline:
            return stream.run(recording), learnt(stream)
        estimate, stream = self._smoothed(stream, recording)
        return estimate, learnt(stream)

    def _begun(
        self,
        recording: Recording,
        frame: str | None,
        known: LearntCalibration | None,
        initial: Rotation | None = None,
        max_gap: float = 0.1,
    ) -> Stream:
        """A stream for a recording, which has not taken it yet."""
        self.check_sensors(recording)
        this = self.for_recording(recording)
        frame = frame or recording.frame
        if known is None:
            return this.stream(frame=frame, initial=initial, max_gap=max_gap)
        return this.warm_stream(known, frame=frame, initial=initial, max_gap=max_gap)

    def _smoothed(self, stream: Stream, recording: Recording) -> tuple[Orientation, Stream]:
        """The estimate, and the stream at its end: another one if a long time without samples has been met."""
        from northdown.estimators import _calibrating_smoother as smoother

        whole = restored(recording, stream._work.state[N_RUNNER + LEVELS :])
        holes = np.flatnonzero(np.diff(recording.time) > max(LONGEST_HOLE, stream._work.state[MAX_GAP])) + 1
        flags, out = np.empty(len(recording), np.uint8), np.empty((len(recording), self.kernel.n_out))
        for first, end in itertools.pairwise((0, *holes.tolist(), len(recording))):
            if first > 0:
                stream = self.warm_stream(learnt(stream), frame=stream.frame)
            flags[first:end], out[first:end] = smoother.smooth(
                stream,
                whole[first:end],
                first,
                self.rest_window,
                self.rest_gyr,
                self.rest_acc,
                self.rest_rate,
                self.heading_outlier,
                self.smooth_walk,
            )
        flags[holes] |= int(Flag.LONG_STEP)
        estimate = Orientation._trusted(
            time=recording.time,
            quat=out[:, :4],
            frame=stream.frame,
            flags=flags,
            name=self.name,
            **outputs(self.outputs, out),
        )
        return estimate, stream

    def learnt(self, stream: Stream) -> LearntCalibration:
        """What a running estimate of this filter has learnt of its sensors.

        Parameters
        ----------
        stream : Stream
            Made by `stream` or `warm_stream`.

        Raises
        ------
        InputError
            When the stream is that of another estimator.
        """
        if not isinstance(stream, Stream) or not isinstance(stream.estimator, CalibratingEKF):
            raise InputError(expected(f"a stream of {self.name}", type(stream).__name__))
        return learnt(stream)

    def warm_stream(
        self,
        known: LearntCalibration,
        *,
        rate: float | None = None,
        frame: str = "NED",
        initial: Rotation | None = None,
        max_gap: float = 0.1,
    ) -> Stream:
        """Start an estimate with a calibration learnt before, with its standard deviations as the prior.

        Parameters
        ----------
        known : LearntCalibration
            From `learnt`. Raise its sigmas if the sensors may have changed since.
        rate, frame, initial, max_gap
            As for `stream`.
        """
        if not isinstance(known, LearntCalibration):
            raise InputError(expected("known as a LearntCalibration", type(known).__name__))
        stream = self.stream(rate=rate, frame=frame, initial=initial, max_gap=max_gap)
        begin_with(stream, known)
        return stream
